"""What stands where: at all sizes of the window everything can be reached, and nothing lies over what is looked at."""

from __future__ import annotations

import io

import pytest

from ..test_looks import faults
from .conftest import download

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
