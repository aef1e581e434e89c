"""What stands where: at all sizes of the window everything can be reached, and nothing lies over what is looked at.
The first screen: examples with pictures, and the tour. Objects that are moved by hand: their phi is that of
`scenegen eval`.
"""

from __future__ import annotations

import io
import json

import pytest

import scenegen

from ..test_looks import faults
from .conftest import download, drag, scenegen_eval, settled

pytestmark = pytest.mark.browser


SHELF = "object shelfunit at (0.5, 0.8, SOUTH)\nobject can on shelfunit.shelf[3], mug\ntask: leftOf(mug, can)\n"
OVER = ".over > *, .tools > *"
COVERED = """(boxes) => window.scenegen.spec.objects.map((one) => [one.name, window.table.where(one.name)]).filter(
    ([, { x, y }]) => [...document.querySelectorAll(boxes)].some((one) => {
        const { left, right, top, bottom } = one.getBoundingClientRect();
        return x > left && x < right && y > top && y < bottom;
    })).map(([name]) => name)"""


def test_nothing_lies_over_the_objects(serve, tab, tmp_path):
    (tmp_path / "shelf.spec").write_text(SHELF)
    one = tab(serve("shelf.spec").link)
    one.ready()
    one.page.keyboard.press("Escape")
    one.page.keyboard.press("s")
    one.page.keyboard.press("s")  # the can, at the top
    one.page.wait_for_selector(".chosen-thing:has-text('can')")
    for width, height in ((1280, 800), (820, 700), (640, 400)):
        one.page.set_viewport_size({"width": width, "height": height})
        for _ in range(2):
            one.page.wait_for_timeout(300)
            assert one.page.evaluate(COVERED, OVER) == [], (width, height)
            one.page.keyboard.press("g")


@pytest.mark.parametrize("width", [820, 390])
def test_narrow_pages_have_all_buttons_and_plots_as_large_as_their_text(served, tab, width):
    one = tab(served.link, viewport={"width": width, "height": 800})
    one.ready()
    one.page.click(".panes button:has-text('Request')")
    assert one.page.evaluate("document.querySelector('.handles').getBoundingClientRect().width") <= 420
    one.page.click("button.file-name")
    for name in ("Save", "Format", "Grid" if width > 560 else "Many small scenes"):
        assert one.page.locator(f".bar button:text-is('{name}'):visible").count() == 1, name
    one.page.keyboard.press("Escape")
    assert one.page.evaluate("document.documentElement.scrollWidth") <= width


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_find_panel_fits_and_can_be_read(served, tab, scheme):
    one = tab(served.link, color_scheme=scheme)
    one.ready()
    one.page.click(".cm-content")
    one.page.keyboard.press("Control+f")
    one.page.wait_for_selector(".cm-search input[name=search]")
    inside = """() => { const right = document.querySelector(".editor").getBoundingClientRect().right;
        return [...document.querySelectorAll(".cm-search :is(input, button, label)")].every((one) => {
            const box = one.getBoundingClientRect();
            return box.right <= right && one.scrollWidth <= one.clientWidth + 2 && box.width < 300; }) }"""
    assert one.page.evaluate(inside)
    assert faults(one) == []


def test_pictures_hold_what_is_on_the_screen(serve, tab, tmp_path):
    """A label with its number in 3D; in the top view everything below the edges of the letters, too."""
    image = pytest.importorskip("PIL.Image")
    one = tab(serve("tidy_desk").link)
    one.ready()
    one.page.keyboard.press("Escape")
    one.page.wait_for_selector(".tags .good")
    for colour in ((11, 122, 92), (253, 252, 249)):  # of the label, of the table's paper
        picture = image.open(io.BytesIO(download(one, "png", tmp_path).read_bytes())).convert("RGB")
        counts = {found: count for count, found in picture.getcolors(1 << 24)}
        assert counts.get(colour, 0) > 500 and len(counts) > 30
        one.page.click(".segment button:has-text('Top')")
        one.page.wait_for_selector("svg.top")


def test_a_page_of_nothing_begins_with_the_examples(serve, tab):
    one = tab(serve().link)
    one.page.wait_for_selector("[data-example=tidy_desk] img")
    broken = "[...document.querySelectorAll('.card img')].filter((one) => one.complete && !one.naturalWidth).length"
    assert one.page.evaluate(broken) == 0
    one.page.screenshot(path="build/screenshots/welcome.png")
    one.page.click("[data-example=tidy_desk]")
    one.until("$.spec && $.spec.objects.length > 4 && !document.querySelector('dialog')")
    one.ready()
    one.page.keyboard.press("Escape")
    one.page.keyboard.press("y")
    one.page.wait_for_selector("dialog[open]")
    one.page.keyboard.press("t")  # no shortcut of the page below
    assert one.page.evaluate("document.documentElement.dataset.theme") != "dark"
    one.page.keyboard.press("Escape")
    one.until("!document.querySelector('dialog')")
    assert "phone" in one.page.inner_text(".cm-content")


def test_a_page_of_a_spec_does_not(served, tab):
    one = tab(served.link)
    one.ready()
    assert one.page.query_selector("dialog") is None


def test_the_tour_goes_from_the_text_to_the_download(serve, tab):
    one = tab(serve().link)
    one.page.click("text=Take the tour")
    seen = []
    while one.page.query_selector(".tour"):
        seen.append(one.page.inner_text(".tour h2"))
        one.page.wait_for_timeout(150)
        ring = one.page.locator(".ring").bounding_box()
        assert ring["width"] > 200 and ring["height"] > 30
        one.page.click(".tour .strong")
    assert [title[0] for title in seen] == list("12345")
    one.page.keyboard.press("?")
    one.page.click(".offers >> text=Take the tour")
    one.page.wait_for_selector(".tour")
    one.page.keyboard.press("Escape")
    one.until("!document.querySelector('.tour')")


def test_things_stand_at_the_heights_of_the_spec(serve, tab, tmp_path):
    text = "object shelfunit at (0.5, 0.8, SOUTH)\nobject can on shelfunit.shelf[2]\ntask: x(can) >= 0.4\n"
    (tmp_path / "shelf.spec").write_text(text)
    one = tab(serve("shelf.spec").link)
    one.ready()
    heights = {one.state("$.report.bases[0][1]"), *one.state("$.result.bases.map((one) => one[1])")}
    assert heights == {scenegen.parse(text).checked.heights[1]}
    one.page.keyboard.press("Escape")
    one.page.keyboard.press("s")
    one.page.keyboard.press("s")
    one.page.keyboard.press("ArrowRight")
    settled(one)
    assert {one.state("$.report.bases[0][1]")} == heights


def test_a_moved_object_keeps_its_surface_until_another_is_chosen(serve, tab, tmp_path):
    text = (
        "region board[2] = rect(0, 0.6, 1, 1) at 30 cm, 60 cm\nobject can on any of board, mug\n"
        "require noCollision()\ntask: z(can) >= 10 cm & leftOf(can, mug)\n"
    )
    (tmp_path / "boards.spec").write_text(text)
    one = tab(serve("boards.spec").link)
    one.ready()
    (on,) = one.state("$.on")
    assert one.page.evaluate("window.table.boards.children.map((one) => Math.round(1000 * one.position.z))") == [
        290,
        590,
    ]
    one.page.keyboard.press("Escape")
    for key in ("s", "ArrowRight"):
        one.page.keyboard.press(key)
    settled(one)
    assert one.state("$.on") == [on] and one.state("$.bases[0]") == {1: 0.3, 2: 0.6}[on]
    one.page.keyboard.press("u")
    one.until(f"$.on[0] === {3 - on} && $.bases[0] === {[0.6, 0.3][on - 1]}")
    settled(one)
    assert one.page.input_value(".standing select") == str(3 - on)
    path = download(one, "json", tmp_path)
    back = scenegen.read_scenes(path)
    assert back.on[0].tolist() == [3 - on] and back.poses[0].tolist() == one.state("$.poses")
    assert scenegen_eval(tmp_path / "boards.spec", path)[0]["task"] == one.state("$.report.phi.task[0]")


def test_a_dragged_object_has_the_phi_of_eval(served, tab, tmp_path):
    one = tab(served.link)
    one.ready()
    drag(one, "mug", 40, -25)
    settled(one)
    moved = one.state("$.poses")
    assert moved != one.state("$.result.poses[0]")
    shown = float(one.page.get_attribute(".phi[data-label=task]", "data-phi"))
    path = download(one, "json", tmp_path)
    assert scenegen.read_scenes(path).poses[0].tolist() == moved
    assert scenegen_eval(tmp_path / "two.spec", path)[0]["task"] == shown
    one.page.keyboard.press("4")
    one.page.wait_for_selector(".motion svg path.path")
    one.page.click(".motion button:has-text('Play')")
    one.page.wait_for_timeout(300)


def test_a_held_object_stays_while_the_rest_is_sampled(served, tab):
    one = tab(served.link)
    one.ready()
    drag(one, "plate", -20, -10)
    settled(one)
    held = one.state("$.poses[1]")
    one.page.click("button:has-text('Keep in place')")
    one.page.click("button:has-text('Sample the others')")
    one.ready()
    poses = one.state("$.result.poses")
    assert all(scene[1] == held for scene in poses) and len({str(scene[0]) for scene in poses}) > 10


def test_moved_scenes_stay_as_they_were_left_and_moves_are_taken_back(served, tab, tmp_path):
    one = tab(served.link)
    one.ready()
    one.until("!document.querySelector('.grid button[data-scene]:not(.drawn)')")
    sampled = one.state("$.result.poses[0]")
    drag(one, "mug", 40, -25)
    settled(one)
    moved, phi = one.state("$.poses"), one.state("$.report.phi.task[0]")
    small = ".grid button[data-scene='0'] span"
    one.until(f'JSON.parse(document.querySelector("{small}").dataset.phi).task === {phi}')
    one.page.click(".grid button[data-scene='1']")
    one.until("$.poses[0][0] === $.result.poses[1][0][0]")
    drag(one, "plate", 30, 0)
    settled(one)
    one.page.click(".grid button[data-scene='0']")
    settled(one)
    assert one.state("$.poses") == moved and one.state("$.report.phi.task[0]") == phi
    path = download(one, "json", tmp_path)
    back = scenegen.read_scenes(path)
    assert back.poses[0].tolist() == moved and back.poses[1].tolist() != one.state("$.result.poses[1]")
    assert scenegen_eval(tmp_path / "two.spec", path)[0]["task"] == phi
    drag(one, "fork", 0, -20)
    settled(one)
    one.page.keyboard.press("Control+z")
    one.until(f"JSON.stringify($.poses) === {json.dumps(json.dumps(moved, separators=(',', ':')))}")
    one.page.keyboard.press("Control+z")  # the plate of the other scene
    one.until("JSON.stringify($.poses) === JSON.stringify($.result.poses[1])")
    one.page.keyboard.press("Control+z")
    one.until("JSON.stringify($.poses) === JSON.stringify($.result.poses[0])")
    assert one.state("$.poses") == sampled and not one.page.query_selector(".phi.moved")
