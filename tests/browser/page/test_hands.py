"""Objects that are moved by hand: their phi is that of `scenegen eval`."""

from __future__ import annotations

import json

import pytest

import scenegen

from .conftest import download, drag, scenegen_eval, settled

pytestmark = pytest.mark.browser


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
