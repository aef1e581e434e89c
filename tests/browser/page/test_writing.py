"""Writing specs on the page: mistakes, the editor's help, keys, and what survives."""

from __future__ import annotations

import pytest

pytestmark = pytest.mark.browser


def test_a_mistake_is_shown_and_mended(served, tab):
    one = tab(served.link)
    one.ready()
    one.write("object mug, plate\ntask: leftof(mug, plate)\n")
    one.page.wait_for_selector(".cm-lintRange-error")
    assert "did you mean `leftOf`?" in one.page.inner_text(".problems")
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
    keys.press("Escape")
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
    one.page.keyboard.press("Escape")
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
