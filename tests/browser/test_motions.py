"""Motions on the page, in Chromium: they play, stop, are changed by hand, and taken away as files."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

import scenegen

from .conftest import ROOT, SHOTS

pytestmark = pytest.mark.browser

TEXT = """# The mug is carried to the plate.
object mug, plate, knife
time [0, 6 s] every 0.5 s
moves one
require forall a in objects: speed(a) <= 30 cm/s
require noOverlap()
task: (initially farFrom(mug, plate, 40 cm)) & (finally closeTo(mug, plate, 22 cm))
apart: always farFrom(knife, mug, 10 cm)
"""
AXE = ROOT / "page" / "node_modules" / "axe-core" / "axe.min.js"


@pytest.fixture
def served(serve, tmp_path):
    (tmp_path / "carry.spec").write_text(TEXT)
    return serve("carry.spec")


def ready(tab) -> None:
    tab.until("$.result && $.result.motions && !$.busy && $.report && $.report.signals")


def test_a_motion_plays_and_stops(served, tab):
    one = tab(served.link)
    ready(one)
    assert one.state("$.result.motions.length") == 16 and one.state("$.result.motions[0].length") == 13
    slider = one.page.get_by_role("slider", name="moment")
    assert slider.input_value() == "0"
    one.page.select_option("select[aria-label=speed]", index=0)  # the slowest: half a minute
    one.page.keyboard.press("Escape")
    one.page.locator(".stage canvas").focus()
    one.page.keyboard.press("Space")
    one.until("document.querySelector('.timeline input').value > 2")
    one.page.keyboard.press("Space")
    at = int(slider.input_value())
    assert 2 < at <= 12 and one.state(f"JSON.stringify($.poses) === JSON.stringify($.result.motions[0][{at}])")
    for key, moment in (("Home", 0), ("ArrowRight", 1), ("ArrowRight", 2), ("ArrowLeft", 1), ("End", 12)):
        one.page.keyboard.press(key)
        assert int(slider.input_value()) == moment
    one.page.select_option("select[aria-label=speed]", index=3)
    one.page.get_by_role("button", name="play").click()
    one.until("+document.querySelector('.timeline input').value < 12")
    one.until("document.querySelector('.play').ariaLabel === 'play'")
    assert slider.input_value() == "12"
    slider.focus()
    one.page.keyboard.press("ArrowLeft")
    assert slider.input_value() == "11" and one.page.locator(".timeline .time b").inner_text() == "5.5 s"


def test_the_moment_that_decides_is_shown_and_said(served, tab):
    one = tab(served.link)
    ready(one)
    one.page.keyboard.press("2")
    decides = one.state("$.report.decides.task")
    one.page.keyboard.press("End" if decides["moment"] == 0 else "Home")
    one.page.click(".decided")
    assert one.page.get_by_role("slider", name="moment").input_value() == str(decides["moment"])
    assert decides["text"].split(",")[0] in one.page.inner_text(".decider")
    one.page.keyboard.press("v")
    assert one.page.locator("svg.top .mark").count() > 0 and one.page.locator("svg.top .trail").count() > 0
    one.page.click("button:has-text('from ')")
    row = one.page.locator(".tree .row .value").first
    one.until(f"document.querySelector('.tree .row .value').innerText !== '' && {decides['moment']} >= 0")
    shown = float(row.inner_text().replace("\N{MINUS SIGN}", "-"))
    line = one.state("$.spec.trees.task.line")
    assert shown == pytest.approx(one.state(f"$.report.over[{line}][{decides['moment']}]"), abs=6e-4)


def test_a_pose_that_is_changed_by_hand_changes_phi_as_eval_computes_it(served, tab, tmp_path):
    one = tab(served.link)
    ready(one)
    one.page.keyboard.press("End")
    one.page.keyboard.press("s")
    for _ in range(6):
        one.page.keyboard.press("Shift+ArrowLeft")
    one.until("!$.explaining && $.report && $.report.require[0] < 0")
    assert "changed by hand" in one.page.inner_text(".phis")
    phi = one.state("$.report.phi")
    assert one.state("JSON.stringify($.poses) !== JSON.stringify($.result.motions[0][12])")
    one.page.click("button:has-text('Download')")
    with one.page.expect_download() as wanted:
        one.page.click("button[data-format=jsonl]")
    wanted.value.save_as(tmp_path / "moved.jsonl")
    found = scenegen.read_motions(tmp_path / "moved.jsonl")
    assert len(found) == 16 and {name: [values[0]] for name, values in found.phi.items()} == phi
    command = [sys.executable, "-m", "scenegen", "eval", "carry.spec", "moved.jsonl", "--motion", "1", "--json"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    rows = json.loads(done.stdout)["motions"][0]["phi"]
    assert {name: [row["phi"]] for name, row in rows.items() if name != "require"} == phi
    one.page.keyboard.press("z")
    one.until("JSON.stringify($.poses) === JSON.stringify($.result.motions[0][12])")


def test_what_motions_do_not_have_is_not_offered(served, tab):
    one = tab(served.link)
    ready(one)
    assert [button.inner_text() for button in one.page.locator(".panel [role=tab]").all()] == [
        "Request",
        "Why",
        "Where",
    ]
    assert one.page.locator("label:has-text('method') option").all_inner_texts() == ["auto", "rejection", "splitting"]
    one.page.keyboard.press("k")
    assert one.page.locator("button[data-format=mjcf]").count() == 0
    assert "scenegen export" in one.page.inner_text(".hint-line")
    one.page.keyboard.press("Escape")
    one.write("object mug, plate\ntask: leftOf(mug, plate)\n")
    one.until("$.result && !$.busy && !$.result.motions && $.spec && !$.spec.time")
    assert one.page.locator(".timeline").count() == 0
    one.write("object mug, plate\ntime 3 steps\ntask: eventually leftOf(mug, plate)\n")
    one.page.wait_for_selector(".trouble:has-text('nothing says how far')")
    bound = "require forall a in objects: speed(a) <= 20 cm/s\n"
    one.write(f"object mug, plate\ntime 3 steps\n{bound}task: eventually leftOf(mug, plate)\n")
    one.until("$.result && !$.busy && $.result.motions && $.result.motions[0].length === 4")


def test_a_held_object_stays_all_the_time(served, tab):
    one = tab(served.link)
    ready(one)
    one.page.keyboard.press("s")
    one.page.keyboard.press("h")
    held = one.state("$.request.fix.mug")
    one.page.keyboard.press("Enter")
    same = "JSON.stringify(poses[0]) === JSON.stringify($.request.fix.mug)"
    one.until(f"!$.busy && $.result.motions.every((one) => one.every((poses) => {same}))")
    assert one.state("$.request.fix.mug") == held


def test_a_file_of_motions_and_a_page_without_a_server(serve, tab, tmp_path):
    spec = scenegen.parse(TEXT)
    motions = scenegen.sample_motions(spec, {"task": (0.0, None)}, n=5)
    motions.save(tmp_path / "motions.jsonl")
    one = tab(serve("motions.jsonl").link)
    ready(one)
    assert one.state("$.result.motions") == motions.poses.tolist()
    command = [sys.executable, "-m", "scenegen", "view", "motions.jsonl", "--export", "page.html"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    two = tab((tmp_path / "page.html").as_uri())
    two.until("$.result && $.report && $.report.signals")
    two.page.keyboard.press("Space")
    two.until("+document.querySelector('.timeline input').value === 12")
    two.page.keyboard.press("]")
    two.until("document.querySelector('.grid [aria-selected=true]').dataset.scene === '1'")
    two.page.keyboard.press("2")
    assert two.page.locator(".segment.small button").nth(1).is_disabled()


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("size", [(1280, 800), (390, 844)])
def test_it_looks_well_and_can_be_used_by_all(served, tab, scheme, size):
    if not AXE.is_file():
        pytest.skip("axe-core is not installed: npm ci in page/")
    width, height = size
    one = tab(served.link, viewport={"width": width, "height": height}, color_scheme=scheme)
    ready(one)
    one.page.wait_for_selector(".grid button.drawn")
    SHOTS.mkdir(parents=True, exist_ok=True)
    one.page.screenshot(path=SHOTS / f"motion_{scheme}_{width}.png")
    one.page.evaluate(AXE.read_text())
    for key in ("1", "2", "3"):
        one.page.keyboard.press(key)
        if width < 500:
            one.page.click("nav.panes button:nth-child(2)")
        found = one.page.evaluate("axe.run(document, {resultTypes: ['violations']})")
        faults = [(fault["id"], [node["html"][:160] for node in fault["nodes"]][:3]) for fault in found["violations"]]
        assert not faults
    assert one.page.evaluate("document.documentElement.scrollWidth") <= width


def test_rare_motions_are_shown_while_they_are_found(serve, tab, tmp_path):
    text = "object mug, plate\ntime [0, 15 s] every 0.5 s\nrequire forall a in objects: speed(a) <= 20 cm/s\n"
    text += "task: (initially leftOf(mug, plate)) & (finally rightOf(mug, plate)) & (always closeTo(mug, plate, 30 cm))"
    text += " & (always still(plate))\n"
    (tmp_path / "round.spec").write_text(text)
    one = tab(serve("round.spec").link)
    said = "document.querySelector('.first')?.innerText ?? ''"
    one.until(f"$.busy === 'sample' && $.poses.length === 2 && /come nearest|of 16 motions found/.test({said})", 20)
    assert one.page.evaluate("window.table.objects.children.every((one) => one.visible)")
