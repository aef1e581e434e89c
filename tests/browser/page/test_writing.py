"""Writing specs on the page: mistakes, the editor's help, keys, and what survives. The text on the page: what is typed
is what is there, and none of it is lost.
"""

from __future__ import annotations

import pytest

pytestmark = pytest.mark.browser


def test_a_mistake_is_shown_and_mended(served, tab):
    one = tab(served.link)
    one.ready()
    one.write("object mug, plate\ntask: leftof(mug, plate)\n")
    one.page.wait_for_selector(".cm-lintRange-error")
    assert "did you mean leftOf?" in one.page.inner_text(".problems")
    one.page.hover(".cm-lintRange-error")
    one.page.wait_for_selector(".cm-tooltip-lint")
    one.write("object mug, plate\ntask: leftOf(mug, plate)\n")
    one.page.wait_for_selector(".problems", state="detached")
    one.until("$.result && !$.busy && $.result.poses[0].length === 2")
    one.page.wait_for_selector(".grid button[data-scene].drawn")


def test_the_editor_completes_hovers_and_formats(served, tab):
    one = tab(served.link)
    one.ready()
    one.write("object mug,plate\ntask: leftO")
    one.page.keyboard.press("Control+ ")
    one.page.click(".cm-tooltip-autocomplete li:has-text('leftOf')")
    one.page.keyboard.type("(mug, plate)")
    one.until("$.spec && $.spec.objects.length === 2")
    one.page.click("button:has-text('Format')")
    one.until("document.querySelector('.cm-content').innerText.startsWith('object mug, plate')")
    one.page.hover(".cm-line >> text=leftOf")
    one.page.wait_for_selector(".cm-hover")
    assert "leftOf(" in one.page.inner_text(".cm-hover")


def test_codes_are_explained_and_other_files_are_read(served, tab, tmp_path):
    (tmp_path / "own.spec").write_text("def near(a, b) = closeTo(a, b, 9 cm)\n")
    one = tab(served.link)
    one.ready()
    one.write('import "own.spec"\nobject mug, plate\ntask: near(mug, plate) & leftof(mug, plate)')
    one.page.hover(".problems .diagnostic-code")
    one.page.wait_for_selector(".explained:has-text('Corrected')")
    one.page.hover(".cm-content")
    one.page.wait_for_selector(".explained", state="detached")
    one.page.click(".problems .diagnostic-code")
    one.page.wait_for_selector(".explained")
    one.page.keyboard.press("Escape")
    one.page.wait_for_selector(".explained", state="detached")
    one.page.click(".cm-line >> text=near")
    one.page.keyboard.press("F12")
    one.page.wait_for_selector(".reader")
    assert "def near(a, b)" in one.page.inner_text(".reader .cm-content")
    one.page.keyboard.type("x")
    assert "def near(a, b)" in one.page.inner_text(".reader .cm-content")
    one.page.keyboard.press("Escape")
    one.page.wait_for_selector(".reader", state="detached")


def test_the_keyboard_alone_is_enough(served, tab):
    one = tab(served.link)
    one.ready()
    keys = one.page.keyboard
    keys.press("e")
    keys.press("Control+a")
    keys.insert_text("object mug, plate\ntask: rightOf(mug, plate)\n")
    one.until("$.spec && $.spec.labels.length === 1 && $.result && $.result.poses[0].length === 2 && !$.busy")
    keys.press("Control+s")
    one.until("document.querySelector('.file-name').innerText.indexOf('•') < 0")
    assert "rightOf" in (served.folder / "two.spec").read_text()
    keys.press("F6")
    keys.press("s")
    before = one.state("$.poses[0]")
    keys.press("ArrowRight")
    keys.press(".")
    after = one.state("$.poses[0]")
    assert after[0] == pytest.approx(min(before[0] + 0.01, 1.0)) and after[2] != before[2]
    keys.press("h")
    assert one.state("$.request.fix.mug")
    keys.press("n")
    one.until("$.request.seed === 1 && !$.busy && $.result.sampler.seed === 1")
    keys.press("v")
    one.page.wait_for_selector("svg.top")
    for key in ("2", "3", "4", "1", "g", "l", "t", "]", "["):
        keys.press(key)
    keys.press("?")
    one.page.wait_for_selector("[role=dialog]")
    keys.press("Escape")
    keys.press("o")
    one.page.wait_for_selector("button[data-shipped=sort_3]")
    keys.press("Escape")


def test_text_undo_and_state_survive_a_reload(served, tab):
    one = tab(served.link)
    one.ready()
    one.write("object mug, plate\ntask: rightOf(mug, plate)\n")
    one.until("$.spec && $.spec.objects.length === 2 && !$.busy && $.result")
    one.page.keyboard.press("F6")
    one.page.keyboard.press("n")
    one.page.keyboard.press("v")
    one.until("$.request.seed === 1 && !$.busy")
    one.page.reload()
    one.until("$.result && !$.busy")
    assert "rightOf" in one.page.inner_text(".cm-content")
    assert one.state("$.request.seed") == 1 and one.page.is_visible("svg.top")
    one.page.click(".cm-content")
    one.page.keyboard.press("Control+z")
    one.until("$.spec && $.spec.objects.length === 3")
    assert "fork" in one.page.inner_text(".cm-content")


def test_two_tabs_do_not_disturb_each_other(served, tab, browser):
    context = browser.new_context(viewport={"width": 1280, "height": 800})
    one, two = tab(served.link, context), tab(served.link, context)
    one.ready()
    two.ready()
    one.write("object a, b\ntask: leftOf(a, b)\n")
    two.write("object a, b, c\ntask: leftOf(a, b) & leftOf(b, c)\n")
    one.until("$.spec && $.spec.objects.length === 2 && !$.busy && $.result && $.result.poses[0].length === 2")
    two.until("$.spec && $.result && !$.busy && $.result.poses[0].length === 3 && $.spec.objects[0].name === 'a'")
    context.close()


def test_shipped_specs_open_from_the_menu(served, tab):
    one = tab(served.link)
    one.ready()
    one.page.click("button.file-name")
    one.page.click("button[data-shipped=chess_corner]")
    one.until("$.spec && $.spec.objects.length === 6 && $.result && !$.busy && $.result.poses[0].length === 6")
    assert "chess_corner" in one.page.inner_text(".file-name")


TYPED = """object plate, fork, knife, mug
region mat = rect(0.2, 0.2, 0.6, 0.6)
object b, c
const FAR = 25 cm
require noOverlap()
task: leftOf(fork, plate) & closeTo(knife, plate, FAR)
other: facing(mug, NORTH, 20 deg) | mug.x >= 0.3
"""


def content(one) -> str:
    return one.page.evaluate("[...document.querySelectorAll('.cm-line')].map((one) => one.textContent).join('\\n')")


@pytest.mark.parametrize("pause", [60, 150])
def test_what_is_typed_is_what_appears(served, tab, pause):
    one = tab(served.link)
    one.ready()
    one.write("")
    one.page.keyboard.type(TYPED, delay=pause)
    assert content(one) == TYPED


def test_keys_take_words_that_were_meant(served, tab):
    one = tab(served.link)
    one.ready()
    one.write("")
    for start, keys in (("task: rightO", ["Enter"]), ("object mu", ["Tab"]), ("object ", ["Control+ ", "Enter"])):
        one.write("\n")
        one.page.keyboard.press("Backspace")
        one.page.keyboard.type(start, delay=40)
        if keys[0] != "Control+ ":
            one.page.wait_for_selector(
                ".cm-tooltip-autocomplete:not(.cm-tooltip-autocomplete-disabled) [aria-selected]"
            )
            one.page.wait_for_timeout(500)
        for key in keys:
            one.page.keyboard.press(key)
            one.page.wait_for_timeout(600)
        assert content(one).startswith(start) and "\n" not in content(one) and content(one) != start


def test_escape_closes_the_list_of_words_and_stays_in_the_editor(served, tab):
    one = tab(served.link)
    one.ready()
    before, theme = one.state("$.request"), one.page.evaluate("document.documentElement.dataset.theme")
    one.write("object mug, plate\n")
    one.page.keyboard.type("task: lef", delay=60)
    one.page.wait_for_selector(".cm-tooltip-autocomplete")
    one.page.keyboard.press("Escape")
    one.page.wait_for_selector(".cm-tooltip-autocomplete", state="detached")
    one.page.keyboard.type("tOf(mug, plate)xnjh", delay=30)
    assert content(one).endswith("task: leftOf(mug, plate)xnjh")
    assert one.page.evaluate("document.documentElement.dataset.theme") == theme
    assert one.state("$.request.seed") == before["seed"] and one.state("$.request.fix") == {}
    one.page.keyboard.press("Escape")
    one.page.keyboard.press("Escape")
    one.page.keyboard.type("nt")
    assert content(one).endswith("xnjhnt")
    one.page.keyboard.press("F6")
    assert one.page.evaluate("document.activeElement.closest('.stage') !== null")


def test_each_file_has_its_own_history(serve, tab, tmp_path):
    kitchen, cutlery = (
        "object mug, plate\ntask: leftOf(mug, plate)\n",
        "object fork, knife\ntask: leftOf(fork, knife)\n",
    )
    (tmp_path / "kitchen.spec").write_text(kitchen)
    (tmp_path / "cutlery.spec").write_text(cutlery)
    one = tab(serve("kitchen.spec").link)
    one.ready()
    one.page.click(".cm-content")
    one.page.keyboard.press("Control+End")
    one.page.keyboard.type("# mine")

    def open_(name: str) -> None:
        one.page.click("button.file-name")
        one.page.click(f".menu button:has-text('{name}.spec')")
        one.until(f"document.querySelector('.file-name').innerText.startsWith('{name}')")
        one.page.click(".cm-content")

    open_("cutlery")
    for _ in range(3):
        one.page.keyboard.press("Control+z")
    one.page.keyboard.press("Control+s")
    assert content(one) == cutlery and (tmp_path / "cutlery.spec").read_text() == cutlery
    open_("kitchen")  # what was not saved is there, and its history
    assert content(one) == kitchen + "# mine" and (tmp_path / "kitchen.spec").read_text() == kitchen
    one.page.keyboard.press("Control+z")
    assert content(one) == kitchen
    one.until("$.result && !$.busy && $.spec.objects[0].name === 'mug'")


def test_what_is_written_in_a_tab_of_a_link_survives_a_reload(served, tab):
    one = tab(served.link)
    one.ready()
    two = tab(one.page.evaluate("window.scenegen.link()"))
    two.ready()
    two.page.click(".cm-content")
    two.page.keyboard.press("Control+End")
    two.page.keyboard.type("# mine")
    two.until("!$.busy")
    two.page.reload()
    two.ready()
    assert content(two).endswith("# mine")


def test_another_file_begins_without_the_request_of_the_one_before(serve, tab, tmp_path):
    one = tab(serve().link)
    one.page.wait_for_selector("dialog[open]")
    one.page.keyboard.press("Escape")  # the examples
    one.ready()
    one.page.fill("input[aria-label^='from, ']", "0.6")
    one.page.keyboard.press("Enter")
    one.until("Object.values($.request.phi)[0][0] === 0.6")
    one.page.click("button.file-name")
    one.page.click("button[data-shipped=packing_tray]")
    one.page.wait_for_selector("button.file-name:has-text('packing_tray')")
    one.until("$.spec && $.spec.objects.some((each) => each.name === 'large')")
    one.ready()
    assert set(map(tuple, one.state("Object.values($.request.phi)"))) == {(0, None)}
    assert one.state("$.refusal") is None and one.state("$.request.fix") == {}


def write_more(one, more: str) -> None:
    one.page.click(".cm-content")
    one.page.keyboard.press("Control+End")
    one.page.keyboard.type(more)


def test_text_that_is_not_saved_is_asked_about_and_kept(serve, tab, tmp_path):
    text = "object mug, plate\ntask: leftOf(mug, plate)\n"
    (tmp_path / "two.spec").write_text(text)
    first = serve("two.spec")
    one = tab(first.link)
    one.ready()
    asked: list[str] = []
    one.page.on("dialog", lambda one: (asked.append(one.type), one.accept()))
    one.page.goto("about:blank")
    assert asked == []  # nothing is lost
    one.page.goto(first.link)
    write_more(one, "# mine")
    one.page.wait_for_timeout(600)
    one.page.goto("about:blank")
    assert asked == ["beforeunload"]
    one.page.close()
    first.end()
    two = tab(serve("two.spec").link)  # another port, another tab
    two.ready()
    assert content(two) == text + "# mine" and (tmp_path / "two.spec").read_text() == text
    two.page.click(".restored button")
    two.page.wait_for_selector(".restored", state="detached")
    assert content(two) == text
    two.page.wait_for_timeout(600)
    three = tab(serve("two.spec").link)
    three.ready()
    assert content(three) == text
    write_more(three, "# saved")
    three.page.keyboard.press("Control+s")
    three.until("document.querySelector('.file-name').innerText.indexOf('•') < 0")
    three.page.wait_for_timeout(600)
    four = tab(serve("two.spec").link)
    four.ready()
    assert content(four) == text + "# saved" and not four.page.query_selector(".restored")
    token = "new URLSearchParams(location.search).get('token')"
    kept = four.page.evaluate(f"fetch('/api/draft?name=two.spec&token=' + {token}).then((one) => one.json())")
    assert kept is None


def test_what_is_written_in_an_example_is_kept_too(serve, tab):
    one = tab(serve().link)
    one.page.wait_for_selector("dialog[open]")
    one.page.keyboard.press("Escape")  # the examples
    one.ready()
    write_more(one, "# mine")
    one.page.click("button.file-name")
    one.page.click("button[data-shipped=chess_corner]")
    one.until("$.spec && $.spec.objects.length === 6")
    write_more(one, "# chess")
    one.page.wait_for_timeout(600)
    two = tab(serve().link)
    two.page.keyboard.press("Escape")
    two.ready()
    assert content(two).endswith("# mine")
    two.page.click("button.file-name")
    two.page.click("button[data-shipped=chess_corner]")
    two.until("$.spec && $.spec.objects.length === 6")
    assert not content(two).endswith("# chess")  # an example is as it ships; what was made of it is offered
    two.page.click(".restored button")
    assert content(two).endswith("# chess")


def test_after_a_refusal_no_picture_of_another_spec_stays(serve, tab, tmp_path):
    (tmp_path / "two.spec").write_text("object mug, plate\ntask: leftOf(mug, plate)\n")
    one = tab(serve("two.spec").link)
    one.ready()
    one.page.wait_for_selector(".tags .good")
    one.write("object bowl, fork\ntask: leftOf(bowl, fork) & x(bowl) >= x(fork) + 10 cm\n")
    one.page.wait_for_selector(".trouble")
    one.until("!$.busy && $.refusal")
    one.page.wait_for_timeout(300)
    assert one.page.locator(".tags span:not(.axis)").count() == 0
    drawn = one.page.evaluate("window.table.objects.children.map((one) => [one.name, one.visible])")
    assert drawn == [["bowl", False], ["fork", False]]
    before = one.page.evaluate("window.table.frames")
    one.page.wait_for_timeout(200)
    assert one.page.evaluate("window.table.frames") == before > 0
    # of the same objects, older scenes stay, and the page says what they are
    one.write("object bowl, fork\ntask: leftOf(bowl, fork)\n")
    one.ready()
    one.write("object bowl, fork\ntask: leftOf(bowl, fork) & x(bowl) >= x(fork) + 10 cm\n")
    one.page.wait_for_selector(".trouble")
    one.page.wait_for_selector(".stage.behind .trouble .quiet >> text=these scenes are of the text before")
    assert one.page.query_selector(".grid.behind")


def test_what_another_program_writes_is_noticed(serve, tab, tmp_path):
    file = tmp_path / "two.spec"
    text = "object mug, plate\ntask: leftOf(mug, plate)\n"
    file.write_text(text)
    one = tab(serve("two.spec").link)
    one.ready()
    file.write_text(text + "# theirs\n")
    one.until("document.querySelector('.cm-content').innerText.includes('# theirs')", 20)
    write_more(one, "# mine")
    file.write_text(text + "# theirs again\n")
    one.page.wait_for_selector(".conflict", timeout=20_000)
    one.page.click(".conflict button:has-text('Look')")
    one.page.wait_for_selector(".reader")
    assert "# theirs again" in one.page.inner_text(".reader .cm-content")
    one.page.keyboard.press("Escape")
    one.page.click(".conflict button:has-text('Load')")
    assert content(one) == text + "# theirs again\n"
    one.page.click(".cm-content")
    one.page.keyboard.press("Control+z")
    assert content(one).endswith("# theirs\n# mine")
    file.write_text(text + "# once more\n")
    one.page.keyboard.press("Control+s")
    one.page.click(".conflict button:has-text('Save mine')")
    one.until("document.querySelector('.file-name').innerText.indexOf('•') < 0")
    assert file.read_text().endswith("# theirs\n# mine")
    one.faults.clear()  # the browser reports the refusal to save, too


def test_relations_come_with_their_arguments_and_mistakes_with_their_mends(served, tab):
    one = tab(served.link)
    one.ready()
    one.write("object mug, plate\n")
    one.page.keyboard.type("task: lef", delay=60)
    popup = ".cm-tooltip-autocomplete:not(.cm-tooltip-autocomplete-disabled)"
    one.page.wait_for_selector(f"{popup} li[aria-selected=true]:has-text('leftOf')")
    one.page.wait_for_timeout(400)
    one.page.keyboard.press("Enter")
    one.until("document.querySelector('.cm-content').innerText.includes('leftOf(a, b)')")
    one.page.keyboard.type("mug", delay=60)
    one.page.keyboard.press("Tab")
    one.page.keyboard.type("plate", delay=60)
    one.page.keyboard.press("Escape")
    assert content(one) == "object mug, plate\ntask: leftOf(mug, plate)"
    one.write("object mug, plate\ntask: leftof(mug, plate)\n")
    one.page.click(".problems .mend:has-text('leftOf')")
    assert content(one) == "object mug, plate\ntask: leftOf(mug, plate)\n"
    one.write(
        "object mug, plate\ntime [0, 2 s] every 0.5 s\nrequire speed(plate) <= 20 cm/s\n"
        "task: finally leftOf(mug, plate)\n"
    )
    one.page.wait_for_selector(".cm-lintRange-warning")
    one.page.click(".problems .mend:has-text('speed(mug)')")
    one.until("$.spec && $.spec.time && $.problems.length === 0 && $.result && !$.busy")


def test_news_of_a_text_that_was_refused_go_with_it(served, tab):
    one = tab(served.link)
    one.ready()
    status = ".status"
    one.write("# " + "x" * 2_000_000)  # more than a message may have
    one.page.wait_for_selector(f"{status}:has-text('at most 256 kB')")
    one.write("object mug, plate\ntask: leftOf(mug, plate)\n")
    one.page.wait_for_selector(f"{status}:has-text('16 scenes')")
    assert not one.page.query_selector(".trouble")


def test_the_thirteenth_page_says_why_it_gets_no_answer(served, tab, browser):
    context = browser.new_context()
    first = tab(served.link, context)
    first.ready()
    more = first.page.evaluate(
        """async () => {
          window.sockets = [];
          for (let k = 0; k < 11; k++) {
            const token = new URLSearchParams(location.search).get('token');
            const one = new WebSocket(`ws://${location.host}/api/socket?token=${token}`);
            await new Promise((then) => (one.onopen = then));
            window.sockets.push(one);
          }
          return window.sockets.length;
        }"""
    )
    assert more == 11
    last = tab(served.link, context)
    last.page.wait_for_selector(".status:has-text('allows no more open pages')")
    first.page.evaluate("window.sockets.pop().close()")
    last.until("$.result && !$.busy")
    last.faults.clear()  # the browser reports the refused connection, too
    context.close()
