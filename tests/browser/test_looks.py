"""How the page looks, what it weighs for those who do not see it, and pictures of it to look at."""

from __future__ import annotations

from pathlib import Path

import pytest

from .conftest import ROOT, SHOTS

pytestmark = pytest.mark.browser

AXE = ROOT / "page" / "node_modules" / "axe-core" / "axe.min.js"
SIZES = {"desk": (1280, 800), "phone": (390, 844)}


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("size", SIZES)
def test_pictures_and_no_serious_fault(serve, tab, size, theme):
    width, height = SIZES[size]
    one = tab(serve("breakfast").link, viewport={"width": width, "height": height}, color_scheme=theme)
    one.ready()
    one.until("$.rested", patience=240.0)
    SHOTS.mkdir(parents=True, exist_ok=True)
    phone = size == "phone"

    def shot(name: str) -> None:
        one.until("!document.querySelector('.grid button[data-scene]:not(.drawn)') && !$.explaining")
        one.page.wait_for_timeout(400)  # colours fade
        one.page.screenshot(path=str(SHOTS / f"{size}_{theme}_{name}.png"))
        serious = faults(one)
        assert not serious, f"{name}: {serious}"

    shot("scenes")
    if phone:
        one.page.click(".panes button:has-text('Spec')")
        shot("spec")
        one.page.click(".panes button:has-text('Request')")
    for panel in ("request", "why", "where", "motion"):
        one.page.click(f"#tab-{panel}")
        shot(panel)
    if phone:
        one.page.click(".panes button:has-text('Scenes')")
    one.page.click(".segment button:has-text('Top')")
    one.page.evaluate("document.querySelector('svg.top').focus()")
    one.page.keyboard.press("s")
    shot("top")
    one.page.click("button:has-text('Download')")
    shot("menu")
    one.page.keyboard.press("Escape")
    one.page.click("button[aria-label=keys]")
    shot("keys")


def faults(tab) -> list[str]:
    if not AXE.exists():
        return []
    # the page's own policy forbids to add a script from a text: the test adds it by the debugger
    tab.page.evaluate(Path(AXE).read_text(encoding="utf-8"))
    rules = "{'target-size': {enabled: true}}"
    found = tab.page.evaluate(f"axe.run(document, {{resultTypes: ['violations'], rules: {rules}}})")
    return [
        f"{one['id']}: {one['nodes'][0]['html'][:200]} ({len(one['nodes'])})"
        for one in found["violations"]
        if one["impact"] in ("serious", "critical")
    ]
