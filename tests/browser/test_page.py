"""The page of `scenegen view` as people use it, in Chromium."""

from __future__ import annotations

import json
import shlex
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

import scenegen

pytestmark = pytest.mark.browser

TEXT = "object mug, plate, fork\nrequire noOverlap()\ntask: leftOf(mug, plate) & closeTo(mug, plate, 35 cm)\n"


def scenegen_eval(spec: Path, scenes: Path) -> list[dict[str, float]]:
    command = [sys.executable, "-m", "scenegen", "eval", str(spec), str(scenes), "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return [one["phi"] for one in json.loads(done.stdout)["scenes"]]


def download(tab, format_: str, into: Path) -> Path:
    tab.page.click("button:has-text('Download')")
    with tab.page.expect_download() as wanted:
        tab.page.click(f"button[data-format={format_}]")
    path = into / wanted.value.suggested_filename
    wanted.value.save_as(path)
    return path


@pytest.fixture
def served(serve, tmp_path):
    (tmp_path / "two.spec").write_text(TEXT)
    return serve("two.spec")


def drag(tab, name: str, dx: float, dy: float) -> None:
    place = tab.page.evaluate(f"window.table.where({name!r})")
    tab.page.mouse.move(place["x"], place["y"])
    tab.page.mouse.down()
    for step in range(1, 9):
        tab.page.mouse.move(place["x"] + dx * step / 8, place["y"] + dy * step / 8)
    tab.page.mouse.up()


def settled(tab) -> None:
    """Until phi on the page is that of the poses on the page."""
    tab.until("!$.explaining && $.report && $.report.decides")


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
    assert one.page.locator(".grid button[data-scene].drawn").first.is_visible()


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
    one.page.wait_for_selector(".explained:has-text('Mended')")
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


def test_a_moved_handle_shows_known_scenes_at_once(served, tab):
    one = tab(served.link)
    one.ready()
    found = one.page.evaluate(
        """() => {
          const chip = [...document.querySelectorAll(".chip")].find((one) => one.textContent === "just solved");
          chip.click();
          const { request, result, preview } = window.scenegen;
          return [request.phi.task, result.phi.task ?? [], preview];
        }"""
    )
    assert found[2] and all(found[0][0] <= phi <= found[0][1] for phi in found[1])
    one.ready()
    assert len(one.state("$.result.poses")) == 16


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


def test_every_shown_phi_lies_between_the_handles(served, tab):
    one = tab(served.link)
    one.ready()
    low = one.page.locator("[role=slider][aria-label='lowest phi of task']")
    high = one.page.locator("[role=slider][aria-label='highest phi of task']")
    box = high.bounding_box()
    one.page.mouse.move(box["x"] + box["width"] / 2, box["y"] + 20)
    one.page.mouse.down()
    one.page.mouse.move(box["x"] - 60, box["y"] + 20, steps=5)
    one.page.mouse.up()
    low.focus()
    for _ in range(3):
        one.page.keyboard.press("ArrowRight")
    one.ready()
    lowest, highest = one.state("$.request.phi.task")
    assert lowest > 0 and highest is not None
    shown = one.page.eval_on_selector_all(
        ".grid button[data-scene] span", "all => all.map(one => JSON.parse(one.dataset.phi).task)"
    )
    assert len(shown) == 16 and all(lowest <= phi <= highest for phi in shown)


def test_no_answer_to_an_older_request_is_shown_as_the_newest(served, tab):
    one = tab(served.link)
    one.ready()
    low = one.page.locator("[role=slider][aria-label='lowest phi of task']")
    low.focus()
    one.page.evaluate(
        """() => {
            window.late = 0;
            const look = () => {
                const now = window.scenegen, [low, high] = now.request.phi.task;
                const fits = (phi) => (low === null || phi >= low) && (high === null || phi <= high);
                if (!now.busy && !now.preview && !(now.result.phi.task ?? []).every(fits)) window.late++;
                setTimeout(look, 1);
            };
            look();
        }"""
    )
    for k in range(24):
        one.page.keyboard.press("ArrowRight")
        one.page.wait_for_timeout(52 + 4 * k)  # as long as the page waits, and an answer takes, and longer
    one.ready()
    assert one.page.evaluate("window.late") == 0


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
    one.page.click("button:has-text('Hold')")
    one.page.click("button:has-text('Sample the rest')")
    one.ready()
    poses = one.state("$.result.poses")
    assert all(scene[1] == held for scene in poses) and len({str(scene[0]) for scene in poses}) > 10


def test_each_format_can_be_downloaded_and_evaluated(served, tab, tmp_path):
    one = tab(served.link)
    one.ready()
    phi = one.state("$.result.phi.task")
    for format_ in ("json", "jsonl", "parquet"):
        path = download(one, format_, tmp_path)
        assert [found["task"] for found in scenegen_eval(tmp_path / "two.spec", path)] == phi
    mujoco = pytest.importorskip("mujoco")
    path = download(one, "mjcf", tmp_path)
    zipfile.ZipFile(path).extractall(tmp_path / "unpacked")
    worlds = sorted((tmp_path / "unpacked").rglob("scene_*.xml"))
    assert len(worlds) == 16 and mujoco.MjModel.from_xml_path(str(worlds[0])).nbody > 3
    assert len(zipfile.ZipFile(download(one, "sdf", tmp_path)).namelist()) > 16
    assert download(one, "png", tmp_path).read_bytes()[:4] == b"\x89PNG"


def test_the_command_makes_the_same_scenes(served, tab, tmp_path):
    one = tab(served.link)
    one.ready()
    one.page.click(".chip:has-text('just solved')")
    one.ready()
    one.page.click("button:has-text('Download')")
    words = shlex.split(one.page.inner_text("code.command"))
    assert words[0] == "scenegen"
    subprocess.run([sys.executable, "-m", *words], cwd=tmp_path, check=True, capture_output=True)
    assert scenegen.read_scenes(tmp_path / "scenes.json").poses.tolist() == one.state("$.result.poses")


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


def test_a_link_reopens_the_same_state(served, tab):
    one = tab(served.link)
    one.ready()
    one.page.keyboard.press("Escape")
    one.page.keyboard.press("]")
    one.page.keyboard.press("s")
    for _ in range(3):
        one.page.keyboard.press("ArrowUp")
    settled(one)
    link = one.page.evaluate("window.scenegen.link()")
    two = tab(link)
    two.ready()
    two.until(f"JSON.stringify($.poses) === {json.dumps(json.dumps(one.state('$.poses'), separators=(',', ':')))}")
    settled(two)
    assert two.state("$.report.phi") == one.state("$.report.phi")


def test_shipped_specs_open_from_the_menu(served, tab):
    one = tab(served.link)
    one.ready()
    one.page.click("button.file-name")
    one.page.click("button[data-shipped=chess_corner]")
    one.until("$.spec && $.spec.objects.length === 6 && $.result && !$.busy && $.result.poses[0].length === 6")
    assert "chess_corner" in one.page.inner_text(".file-name")


def test_what_is_impossible_says_what_clashes(served, tab):
    one = tab(served.link)
    one.ready()
    one.write("object mug, plate\ntask: leftOf(mug, plate) & x(mug) >= x(plate) + 10 cm\n")
    one.page.wait_for_selector(".problems li")
    assert "clash" in one.page.inner_text(".problems")
    one.page.wait_for_selector(".trouble")
    assert "task" in one.page.inner_text(".trouble")


def test_scenes_are_opened_as_they_are(serve, tab, tmp_path):
    found = scenegen.sample(scenegen.parse(TEXT), {"task": (0, 0.1)}, 6, seed=4)
    found.save(tmp_path / "six.json")
    one = tab(serve("six.json").link)
    one.ready()
    assert one.state("$.result.poses") == found.poses.tolist()
    assert one.state("$.request.phi.task") == [0, 0.1]


def test_a_page_without_a_server(tab, tmp_path):
    (tmp_path / "two.spec").write_text(TEXT)
    command = [sys.executable, "-m", "scenegen", "view", "two.spec", "--export", "page.html", "-n", "40"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    one = tab((tmp_path / "page.html").as_uri())
    one.until("$.result && $.report && $.report.decides")
    assert one.page.locator(".grid button[data-scene]").count() == 40
    one.page.click(".chip:has-text('solved') >> nth=1")
    one.until("document.querySelectorAll('.grid button[data-scene]').length < 40")
    shown = one.page.eval_on_selector_all(
        ".grid button[data-scene] span", "all => all.map(one => JSON.parse(one.dataset.phi).task)"
    )
    assert 0 < len(shown) < 40 and all(phi >= 0 for phi in shown)


def test_numbers_of_things_are_chosen_and_a_mistake_says_that_scenes_are_older(serve, tab, tmp_path):
    one = tab(serve("breakfast").link)
    one.ready()
    one.write("object block[2..4] = box(5 cm, 5 cm, 5 cm)\nobject mug\ntask: leftOf(block[1], mug)\n")
    one.until("$.result && $.poses.length === 5 && !$.busy")
    one.page.select_option("[data-count=block]", "3")
    one.until("$.result && $.poses.length === 4 && !$.busy")
    one.page.click("button:has-text('Download')")
    assert "--count block=3" in one.page.inner_text(".command")
    one.page.keyboard.press("Escape")
    scenes = json.loads(download(one, "json", tmp_path).read_text())["scenes"]
    assert len(scenes) == 16 and all(len(each["poses"]) == 4 for each in scenes)
    one.page.keyboard.press("Escape")
    one.write("object mug\ntask: leftOf(mug")
    one.until("$.wrong")
    assert one.page.inner_text(".behind-note").startswith("the spec has a mistake")
    one.write("object mug, plate\ntask: leftOf(mug, plate)\n")
    one.until("!$.wrong && $.result && $.poses.length === 2")
    assert not one.page.query_selector(".behind-note")
