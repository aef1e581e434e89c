"""No key and no text is lost: keys that leave the editor, tabs, restarts, files that change on the disk. Commands and
names are those of the text that is open.
"""

from __future__ import annotations

import os
import random
import shlex
import signal
import socket
import stat
import subprocess
import sys
import time

import pytest

import scenegen

from .test_writing import content, write_more

pytestmark = pytest.mark.browser

TEXT = "object mug, plate\ntask: leftOf(mug, plate)\n"
SAVED = "document.querySelector('.file-name').innerText.indexOf('•') < 0"


def two(tmp_path):
    (tmp_path / "two.spec").write_text(TEXT)
    return "two.spec"


def at_end(one) -> None:
    one.page.click(".cm-content")
    one.page.keyboard.press("Control+End")


def focused(one) -> str:
    return one.page.evaluate("document.activeElement.closest('.editor') ? 'editor' : document.activeElement.tagName")


# keys


@pytest.mark.parametrize("keys", [["Escape"], ["Escape", "Tab"], ["Tab"], ["Shift+Tab"], ["Escape"] * 3, ["Control+s"]])
def test_no_key_takes_letters_away_from_the_editor(serve, tab, tmp_path, keys):
    one = tab(serve(two(tmp_path)).link)
    one.ready()
    before, theme = one.state("$.request"), one.page.evaluate("document.documentElement.dataset.theme")
    at_end(one)
    for key in keys:
        one.page.keyboard.press(key)
    one.page.keyboard.type("next: inside(mug, plate)", delay=20)
    assert content(one) == TEXT + "next: inside(mug, plate)"
    assert one.state("$.request.seed") == before["seed"]
    assert one.page.evaluate("document.documentElement.dataset.theme") == theme


def test_escape_closes_a_hover_text_and_stays_in_the_editor(serve, tab, tmp_path):
    one = tab(serve(two(tmp_path)).link)
    one.ready()
    at_end(one)
    one.page.hover(".cm-line >> text=leftOf")
    one.page.wait_for_selector(".cm-hover")
    assert one.page.evaluate("document.documentElement.scrollHeight <= innerHeight")
    one.page.keyboard.press("Escape")
    one.page.wait_for_selector(".cm-hover", state="detached")
    one.page.keyboard.type("next: inside(mug, plate)", delay=20)
    assert content(one) == TEXT + "next: inside(mug, plate)"


def test_f6_leaves_the_editor_for_the_keys_of_the_page_and_comes_back(serve, tab, tmp_path):
    one = tab(serve(two(tmp_path)).link)
    one.ready()
    at_end(one)
    one.page.keyboard.press("F6")
    assert focused(one) == "CANVAS"
    one.page.keyboard.press("n")
    one.until("$.request.seed === 1")
    one.page.keyboard.press("F6")
    one.page.keyboard.type("n")
    assert content(one) == TEXT + "n" and one.state("$.request.seed") == 1


def test_letters_go_on_in_an_editor_that_lost_the_focus_by_no_ones_wish(serve, tab, tmp_path):
    one = tab(serve(two(tmp_path)).link)
    one.ready()
    at_end(one)
    one.page.evaluate("document.activeElement.blur()")
    one.page.keyboard.type("# then", delay=20)
    assert content(one) == TEXT + "# then" and one.state("$.request.seed") == 0


TYPED = [
    "object plate, fork\n\nrequire noOverlap()\ntask: leftOf(fork, plate) & closeTo(fork, plate, 20 cm)\n",
    "object mug\nobject plate\nnext: inside(mug, plate)\ntask: rightOf(mug, plate)\n",
    "region mat = rect(0.2, 0.2, 0.6, 0.6)\nobject jar\ntask: jar.x >= 0.3 & jar.y <= 0.5\n",
    "object block[3] = box(5 cm, 5 cm, 5 cm), lid\nt: forall i in 1..3: closeTo(block[i], lid, 12 cm)\n",
    "def near(a, b) = closeTo(a, b, 9 cm)\nobject tea, pot\nx: near(tea, pot) | abs(dist(tea, pot) - 0.3) <= 1 cm\n",
    "const FAR = 25 cm\nobject a, b\n# note: e n t j h k\ntask: dist(a, b) >= FAR\n",
]
IDLE = [
    "Escape",
    "Tab",
    "Shift+Tab",
    "Control+s",
    "ArrowLeft ArrowRight",
    "Home End",
    "F6 F6",
    "Alt",
    "Control+z Control+y",
]


@pytest.mark.parametrize("number", range(int(os.environ.get("TYPED", "6"))))  # half a minute each; up to 20
def test_texts_typed_at_the_pace_of_a_person_with_every_key_of_the_page(serve, tab, tmp_path, number):
    """Keys that leave a text as it is are pressed among its letters: they leave it as it is."""
    chance = random.Random(number)
    text = TYPED[number % len(TYPED)]
    one = tab(serve(two(tmp_path)).link)
    one.ready()
    one.write("")
    keys, done = one.page.keyboard, ""
    for letter in text:
        keys.press("Enter") if letter == "\n" else keys.type(letter)
        done += letter
        one.page.wait_for_timeout(
            chance.choice([80, 110, 150, 200]) if chance.random() < 0.96 else chance.uniform(400, 1600)
        )
        if letter in " ,\n(" and chance.random() < 0.3:  # not in the midst of a word, which Tab may take
            within = done.count("(") > done.count(")")
            behind = ("Home End", "Control+z Control+y")  # the bracket that is there already
            for key in chance.choice([one for one in IDLE if not (within and one in behind)]).split():
                keys.press(key)
                one.page.wait_for_timeout(chance.choice([60, 150]))
    wanted = "\n".join(line.rstrip() for line in text.split("\n"))
    assert "\n".join(line.rstrip() for line in content(one).split("\n")) == wanted
    assert one.state("$.request.seed") == 0 and one.state("$.request.fix") == {}


FIELDS = [
    (["Enter", "mug, plate)"], "task: leftOf(mug, plate)"),
    (["Enter", "mug,plate)"], "task: leftOf(mug, plate)"),
    (["Enter", "mug", "Tab", "plate", "Tab", " & x"], "task: leftOf(mug, plate) & x"),
    (["Enter", "mug", "Tab", "plate", "Tab", "Tab", "Tab", "|"], "task: leftOf(mug, plate)|"),
    (["Enter", "mug)"], "task: leftOf(mug)"),
    (["Enter", "(mug, plate)"], "task: leftOf(mug, plate)"),
    (["Enter", "mug, ", "Escape", "plate) & y"], "task: leftOf(mug, plate) & y"),
    (["Enter", "block[1], block[i + 1])"], "task: leftOf(block[1], block[i + 1])"),
    (["Enter", "mug, plate, 2 cm)"], "task: leftOf(mug, plate, 2 cm)"),
]


@pytest.mark.parametrize("keys", range(len(FIELDS)))
def test_fields_of_a_relation_take_what_everybody_types(served, tab, keys):
    pressed, wanted = FIELDS[keys]
    one = tab(served.link)
    one.ready()
    one.write("object mug, plate\n")
    one.page.keyboard.type("task: lef", delay=60)
    one.page.wait_for_selector(
        ".cm-tooltip-autocomplete:not(.cm-tooltip-autocomplete-disabled) li[aria-selected=true]:has-text('leftOf')"
    )
    one.page.wait_for_timeout(400)
    for key in pressed:
        if key in ("Enter", "Tab", "Escape"):
            one.page.wait_for_timeout(100)
            one.page.keyboard.press(key)
        else:
            one.page.keyboard.type(key, delay=90)
    assert content(one) == "object mug, plate\n" + wanted


def test_a_call_within_a_call_has_its_own_fields(served, tab):
    one = tab(served.link)
    one.ready()
    one.write("object mug, plate\n")
    popup = ".cm-tooltip-autocomplete:not(.cm-tooltip-autocomplete-disabled) li[aria-selected=true]"
    one.page.keyboard.type("task: abs", delay=60)
    one.page.wait_for_selector(f"{popup}:has-text('abs')")
    one.page.wait_for_timeout(300)
    one.page.keyboard.press("Tab")
    one.page.keyboard.type("dis", delay=60)
    one.page.wait_for_selector(f"{popup}:has-text('dist')")
    one.page.wait_for_timeout(300)
    one.page.keyboard.press("Enter")
    one.page.keyboard.type("mug, plate) - 0.3) <= 1 cm", delay=90)
    assert content(one) == "object mug, plate\ntask: abs(dist(mug, plate) - 0.3) <= 1 cm"


# menus and focus


@pytest.mark.parametrize("width", [1280, 820, 500])
def test_the_menu_of_files_works_by_keyboard(serve, tab, tmp_path, width):
    one = tab(serve(two(tmp_path)).link, viewport={"width": width, "height": 800})
    one.ready()
    for key in ("s", "o"):
        one.page.keyboard.press(key)
    one.page.wait_for_selector("button[data-shipped=sort_3]")
    before = one.state("$.poses")
    for key in ("ArrowDown", "ArrowDown", "ArrowUp", "End"):
        one.page.keyboard.press(key)
    assert one.page.evaluate("document.activeElement.closest('.menu') && document.activeElement.offsetParent !== null")
    assert one.state("$.poses") == before
    one.page.keyboard.press("Escape")
    one.page.wait_for_selector(".menu", state="detached")
    one.page.wait_for_timeout(60)
    assert focused(one) != "BODY"


def test_the_focus_is_never_lost(serve, tab, tmp_path):
    one = tab(serve(two(tmp_path)).link)
    one.ready()

    def kept() -> None:
        one.page.wait_for_timeout(80)
        assert focused(one) != "BODY"

    for key in ("o", "k", "?", "y"):
        one.page.keyboard.press(key)
        one.page.wait_for_selector(".menu, [role=dialog], dialog[open]")
        one.page.wait_for_timeout(60)
        one.page.keyboard.press("Escape")
        kept()
    one.page.keyboard.press("?")
    one.page.click(".offers button:has-text('tour')")
    one.page.wait_for_selector(".tour")
    one.page.keyboard.press("Escape")
    kept()
    one.page.click(".phi.ask")
    one.page.wait_for_selector(".about")
    one.page.keyboard.press("Escape")
    one.page.wait_for_selector(".about", state="detached")
    kept()
    one.page.focus("[role=tab][aria-selected=true]")
    one.page.keyboard.press("ArrowRight")
    assert one.page.inner_text("[role=tab][aria-selected=true]") == "Why" and focused(one) == "BUTTON"


def test_a_move_that_was_taken_back_is_done_again(serve, tab, tmp_path):
    one = tab(serve(two(tmp_path)).link)
    one.ready()
    one.page.keyboard.press("s")
    before = one.state("$.poses")
    one.page.keyboard.press("ArrowRight")
    after = one.state("$.poses")
    assert after != before
    one.page.keyboard.press("Control+z")
    assert one.state("$.poses") == before
    one.page.keyboard.press("Control+Shift+z")
    assert one.state("$.poses") == after
    one.page.keyboard.press("Control+z")
    assert one.state("$.poses") == before


# tabs, restarts, the disk


def test_a_new_tab_shows_what_is_saved(serve, tab, tmp_path, browser):
    server = serve(two(tmp_path))
    one = tab(server.link)
    one.ready()
    write_more(one, "# saved")
    one.page.keyboard.press("Control+s")
    one.until(SAVED)
    one.page.close()
    new = tab(server.link)
    assert new.page.evaluate("JSON.parse(document.getElementById('data').textContent).text") == TEXT + "# saved"
    write_more(new, "# more")
    new.page.wait_for_timeout(4000)
    assert content(new) == TEXT + "# saved# more" and not new.page.query_selector(".conflict")


def test_what_is_loaded_from_another_file_has_its_own_history(serve, tab, tmp_path):
    third = "object fork, knife\ntask: leftOf(fork, knife)\n"
    (tmp_path / "third.spec").write_text(third)
    one = tab(serve(two(tmp_path)).link)
    one.ready()
    one.page.click("button.file-name")
    one.page.click("button[data-shipped=chess_corner]")
    one.until("$.spec && $.spec.objects.length === 6")
    write_more(one, "# mine")
    mine = content(one)
    one.page.keyboard.press("Control+s")
    one.page.fill(".menu.save input", "third")
    one.page.keyboard.press("Enter")
    one.page.click(".conflict button:has-text('Load')")
    assert content(one) == third
    for _ in range(3):
        one.page.keyboard.press("Control+z")
    one.page.keyboard.press("Control+s")
    one.page.wait_for_timeout(500)
    assert content(one) == third == (tmp_path / "third.spec").read_text()
    one.page.click("button.file-name")
    one.page.click("[data-waiting=chess_corner]")
    one.until("$.spec && $.spec.objects.length === 6")
    assert content(one) == mine
    one.faults.clear()  # the browser reports the refusal to save, too


def test_each_tab_has_its_own_draft(serve, tab, tmp_path, browser):
    server = serve(two(tmp_path))
    context = browser.new_context(viewport={"width": 1280, "height": 800})
    one, other = tab(server.link, context), tab(server.link, context)
    one.ready()
    other.ready()
    write_more(one, "# of one")
    write_more(other, "# of the other")
    other.page.wait_for_timeout(900)
    one.page.bring_to_front()
    write_more(one, "!")
    one.page.keyboard.press("Control+s")
    one.until(SAVED)
    one.page.wait_for_timeout(900)
    other.page.close()  # without a word
    new = tab(server.link, context)
    new.page.wait_for_selector(".restored")
    assert content(new) == TEXT + "# of the other"
    assert (tmp_path / "two.spec").read_text() == TEXT + "# of one!"
    for each in (one, new):
        each.faults.clear()
    context.close()


def test_the_draft_of_an_open_tab_stays_there(serve, tab, tmp_path):
    server = serve(two(tmp_path))
    one = tab(server.link)
    one.ready()
    write_more(one, "# of one")
    one.page.wait_for_timeout(900)
    new = tab(server.link)
    new.ready()
    assert content(new) == TEXT and not new.page.query_selector(".restored")
    write_more(new, "# new")
    new.page.wait_for_timeout(900)
    new.page.close()
    one.page.close()
    found = set()
    for _ in range(2):  # one after the other, as a person opens them
        again = tab(server.link)
        again.ready()
        again.page.wait_for_timeout(300)
        found.add(content(again))
    assert found == {TEXT + "# of one", TEXT + "# new"}


def test_a_restarted_server_goes_on_under_the_same_link(serve, tab, tmp_path):
    first = serve(two(tmp_path))
    one = tab(first.link)
    one.ready()
    write_more(one, "# before")
    first.end()
    one.page.wait_for_selector(".lost", timeout=20_000)
    write_more(one, " # and after")
    with one.page.expect_download() as wanted:
        one.page.click(".lost button:has-text('Download')")
    wanted.value.save_as(tmp_path / "taken.txt")
    assert (tmp_path / "taken.txt").read_text() == TEXT + "# before # and after"
    second = serve("two.spec")
    assert second.link == first.link
    one.page.wait_for_selector(".lost", state="detached", timeout=20_000)
    one.page.keyboard.press("Control+s")
    one.until(SAVED)
    assert (tmp_path / "two.spec").read_text() == TEXT + "# before # and after"
    links = list((tmp_path / ".state/scenegen/links").iterdir())
    assert [stat.S_IMODE(each.stat().st_mode) for each in links] == [0o600]
    one.faults.clear()  # requests that nobody answered


def test_another_program_on_the_port_learns_nothing_and_is_told_apart(serve, tab, tmp_path):
    first = serve(two(tmp_path))
    port = int(first.link.split(":")[2].split("/")[0])
    one = tab(first.link)
    one.ready()
    first.end()
    heard = tmp_path / "heard"
    program = (
        "import http.server, sys\n"
        "class Answer(http.server.BaseHTTPRequestHandler):\n"
        "    def do_GET(self):\n"
        "        open(sys.argv[2], 'a').write(self.path + str(self.headers))\n"
        "        self.send_response(200); self.end_headers(); self.wfile.write(b'0' * 64)\n"
        "    do_PUT = do_GET\n"
        "http.server.HTTPServer(('127.0.0.1', int(sys.argv[1])), Answer).serve_forever()\n"
    )
    thief = subprocess.Popen([sys.executable, "-c", program, str(port), str(heard)], stderr=subprocess.DEVNULL)
    try:
        one.page.wait_for_selector(".lost:has-text('Another server')", timeout=20_000)
        write_more(one, "# mine")
        one.page.keyboard.press("Control+s")
        one.page.wait_for_timeout(1500)
        assert first.link.split("token=")[1] not in heard.read_text()
        assert serve("two.spec").link != first.link  # and the token is not used again
    finally:
        thief.terminate()
        thief.wait(10)
        one.faults.clear()


@pytest.mark.parametrize("unsaved", [False, True])
def test_a_file_that_is_gone_is_written_again(serve, tab, tmp_path, unsaved):
    one = tab(serve(two(tmp_path)).link)
    one.ready()
    at_end(one)
    if unsaved:
        one.page.keyboard.type("# mine")
    (tmp_path / "two.spec").rename(tmp_path / "away.spec")
    if not unsaved:
        one.until(f"!({SAVED})", 20)  # it is noticed
    one.page.keyboard.press("Control+s")
    one.until(SAVED)
    assert (tmp_path / "two.spec").read_text() == TEXT + ("# mine" if unsaved else "")
    one.faults.clear()


def test_examples_are_as_they_ship_and_what_was_made_of_them_waits(serve, tab):
    one = tab(serve().link)
    one.page.wait_for_selector("dialog[open]")
    one.page.click("[data-example=sort_3]")
    one.until("$.spec && $.spec.objects.length === 3")
    fresh = content(one)
    for number in ("1", "2"):
        write_more(one, f"# mine {number}")
        one.page.keyboard.press("F6")
        one.page.keyboard.press("y")
        one.page.click("[data-example=sort_3]")
        one.until("!document.querySelector('.cm-content').innerText.includes('# mine')")
        assert content(one) == fresh
    one.page.click("button.file-name")
    one.page.click("[data-waiting=sort_3-2]")
    one.until("document.querySelector('.cm-content').innerText.includes('# mine 2')")
    one.page.click("button.file-name")
    one.page.click("[data-waiting=sort_3]")
    one.until("document.querySelector('.cm-content').innerText.includes('# mine 1')")


def test_two_saves_and_two_files_come_in_their_order(serve, tab, tmp_path):
    (tmp_path / "slow.spec").write_text("object slow, mug\ntask: leftOf(slow, mug)\n")
    (tmp_path / "fast.spec").write_text("object fast, mug\ntask: leftOf(fast, mug)\n")
    one = tab(serve(two(tmp_path)).link)
    one.ready()

    def late(route) -> None:
        time.sleep(0.7 if route.request.method == "PUT" or "slow" in route.request.url else 0)
        route.continue_()

    one.page.route("**/api/file*", late)
    at_end(one)
    for letter in "ab":
        one.page.keyboard.type(f"# {letter}")
        one.page.keyboard.press("Control+s")
    one.until(SAVED)
    assert (tmp_path / "two.spec").read_text() == TEXT + "# a# b" and not one.page.query_selector(".conflict")
    for name in ("slow", "fast"):
        one.page.click("button.file-name")
        one.page.click(f".menu button:has-text('{name}.spec')")
    one.page.wait_for_timeout(2500)
    assert content(one).startswith("object fast") and "fast.spec" in one.page.inner_text(".file-name")
    one.page.unroute_all(behavior="ignoreErrors")


# commands


@pytest.mark.parametrize("what", ["sort_3", "k.json", "pairs.jsonl", "new", "below/two.spec"])
def test_the_command_runs_once_the_page_says_nothing_against_it(serve, tab, tmp_path, what):
    scenegen.sample(scenegen.parse(TEXT), n=3).save(tmp_path / "k.json")
    scenegen.pairs(scenegen.parse(TEXT), {"task": (0.0, None)}, n=2).save(tmp_path / "pairs.jsonl")
    (tmp_path / "below").mkdir()
    (tmp_path / "below" / "two.spec").write_text(TEXT)
    one = tab(serve(*([] if what == "new" else [what])).link)
    if what == "new":
        one.page.click("dialog button:has-text('new spec')")
    one.ready()
    one.page.click("button:has-text('Download')")
    note = one.page.query_selector(".menu .note")
    assert bool(note) == (what not in ("sort_3", "below/two.spec"))
    if note:
        assert "save the spec first (as " in note.inner_text()
        one.page.keyboard.press("Escape")
        one.page.keyboard.press("Control+s")
        one.page.keyboard.press("Enter")
        one.until("document.querySelector('.file-name').innerText.includes('.spec')")
        one.page.click("button:has-text('Download')")
        assert not one.page.query_selector(".menu .note")
    words = shlex.split(one.page.inner_text(".command"))
    done = subprocess.run([sys.executable, "-m", *words], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_the_name_that_a_text_is_saved_under_is_shown(serve, tab, tmp_path):
    one = tab(serve("sort_3").link)
    one.ready()
    one.page.click(".cm-content")
    one.page.keyboard.press("Control+s")
    one.page.fill(".menu.save input", "x.txt")
    assert one.page.inner_text(".menu.save .strong") == "Save as x.spec"
    one.page.keyboard.press("Enter")
    one.until("document.querySelector('.file-name').innerText.startsWith('x.spec')")
    one.page.wait_for_timeout(60)
    assert (tmp_path / "x.spec").is_file() and not (tmp_path / "x.txt.spec").exists() and focused(one) == "editor"


# what is said while somebody types


def test_mistakes_are_told_once_somebody_rests(serve, tab, tmp_path):
    one = tab(serve(two(tmp_path)).link)
    one.ready()
    at_end(one)
    one.page.evaluate(
        """() => {
          window.jumps = 0;
          const what = ".problems, .problems li, .behind-note";
          new MutationObserver((all) => {
            for (const { addedNodes } of all) for (const node of addedNodes) window.jumps += node.matches?.(what) ?? 0;
          }).observe(document.body, { childList: true, subtree: true });
        }"""
    )
    one.page.keyboard.type("near: closeTo(mug, plate, 20 cm) & dist(mug, plate) >= 5 cm", delay=140)
    one.until("$.spec && $.spec.labels.length === 2")
    assert one.page.evaluate("window.jumps") == 0
    one.page.keyboard.type(" & leftof(mug, plate)")
    one.page.wait_for_selector(".problems li")
    assert "`" not in one.page.inner_text(".problems")


def test_requirements_that_are_added_stand_together_in_their_order(serve, tab, tmp_path):
    one = tab(serve(two(tmp_path)).link)
    one.ready()
    one.write(
        "object mug, plate, fork\n\ntime [0, 2 s] every 0.5 s\nrequire speed(plate) <= 20 cm/s\n\n"
        "task: finally leftOf(mug, plate) & leftOf(fork, plate)\n"
    )
    for name in ("mug", "fork"):
        one.page.click(f".problems .mend:has-text('speed({name})')")
    lines = content(one).split("\n")
    assert [line.split(")")[0] for line in lines[3:6]] == [f"require speed({name}" for name in ("plate", "mug", "fork")]


def test_a_server_that_is_asleep_is_told(serve, tab, tmp_path):
    server = serve(two(tmp_path))
    one = tab(server.link)
    one.ready()
    os.kill(server.process.pid, signal.SIGSTOP)
    try:
        at_end(one)
        one.page.keyboard.type("near: closeTo(mug, plate, 20 cm) & dist(mug, plate) >= 5 cm", delay=60)
        one.page.wait_for_selector(".stage.behind", timeout=5000)
        assert "does not answer" in one.page.inner_text(".status")
        one.page.wait_for_timeout(3000)
    finally:
        os.kill(server.process.pid, signal.SIGCONT)
    one.until("$.spec && $.spec.labels.length === 2 && $.result && $.result.phi.near && !$.busy && !$.preview")
    assert not one.state("$.refusal") and not one.page.query_selector(".stage.behind")


def test_the_script_is_sent_small_and_kept(serve):
    server = serve("sort_3")
    host, port = server.link.split("/")[2].split(":")

    def get(*more: str) -> tuple[bytes, int]:
        with socket.create_connection((host, int(port))) as line:
            lines = [
                "GET /static/page.js HTTP/1.1",
                f"Host: {host}:{port}",
                "Accept-Encoding: gzip",
                "Connection: close",
            ]
            line.sendall("\r\n".join([*lines, *more, "", ""]).encode())
            data = b"".join(iter(lambda: line.recv(65536), b""))
        head, _, body = data.partition(b"\r\n\r\n")
        return head.lower(), len(body)

    head, size = get()
    assert b"content-encoding: gzip" in head and b"cache-control: no-cache" in head and size < 450_000
    tag = next(line.split(b": ")[1].decode() for line in head.split(b"\r\n") if line.startswith(b"etag"))
    head, size = get(f"If-None-Match: {tag}")
    assert b" 304 " in head.split(b"\r\n")[0] and size == 0
