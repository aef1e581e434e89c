"""Asking for scenes: ranges of phi, numbers of things, and what is impossible. What is taken away from the page and
brought to it: files, commands, links, pages without a server.
"""

from __future__ import annotations

import json
import shlex
import subprocess
import sys
import zipfile

import pytest

import scenegen

from .conftest import TEXT, download, drag, scenegen_eval, settled

pytestmark = pytest.mark.browser


def test_a_moved_handle_shows_known_scenes_at_once(served, tab):
    one = tab(served.link)
    one.ready()
    found = one.page.evaluate(
        """() => {
          const chip = [...document.querySelectorAll(".chip")].find((one) => one.textContent === "barely satisfied");
          chip.click();
          const { request, result, preview } = window.scenegen;
          return [request.phi.task, result.phi.task ?? [], preview];
        }"""
    )
    assert found[2] and all(found[0][0] <= phi <= found[0][1] for phi in found[1])
    one.ready()
    assert len(one.state("$.result.poses")) == 16


def test_scenes_that_stay_in_range_stay_on_the_screen(served, tab):
    """A wider range keeps what is shown, pictures included, until the wanted scenes are there."""
    one = tab(served.link)
    one.ready()
    one.until("!document.querySelector('.grid button[data-scene]:not(.drawn)')")
    kept = one.page.evaluate(
        """async () => {
          const before = window.scenegen.result.poses, explained = window.scenegen.report;
          document.querySelector("[role=slider]").dispatchEvent(
            new KeyboardEvent("keydown", { key: "ArrowLeft", bubbles: true }));
          const { result, preview, report } = window.scenegen;
          await new Promise(requestAnimationFrame);
          await new Promise(requestAnimationFrame);
          const drawn = document.querySelectorAll(".grid button.drawn").length;
          return [preview, result.poses.every((one, k) => one === before[k]), drawn, report === explained];
        }"""
    )
    assert kept == [True, True, 16, True]
    one.ready()


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


def test_what_is_impossible_says_what_clashes(served, tab):
    one = tab(served.link)
    one.ready()
    one.write("object mug, plate\ntask: leftOf(mug, plate) & x(mug) >= x(plate) + 10 cm\n")
    one.page.wait_for_selector(".problems li")
    assert "clash" in one.page.inner_text(".problems")
    one.page.wait_for_selector(".trouble")
    assert "task" in one.page.inner_text(".trouble")


def test_a_clash_is_told_once_and_ends_the_search(served, tab):
    one = tab(served.link)
    one.ready()
    same = "document.querySelector('.trouble b')?.innerText === document.querySelector('.problems b')?.innerText"
    # without a proof, the search can be ended; it took 16 s, and then said to use fewer objects
    jars = "object jar[3], lid\nrequire noOverlap()\ntask: forall i in 1..3: closeTo(jar[i], lid, 12 cm)\n"
    one.write(jars)
    one.page.click(".trouble button:has-text('Stop')")
    one.until(f"!$.busy && !document.querySelector('.working') && {same}")
    assert "can hardly be satisfied" in one.page.inner_text(".trouble")
    # with a proof, it ends at once
    one.write("object pot, lid\nrequire noOverlap()\ntask: closeTo(pot, lid, 12 cm)\n")
    one.until(f"!$.busy && document.querySelector('.trouble')?.innerText.includes('can never') && {same}")
    # nobody asks for it to be satisfied: what clashes is no matter
    for field, value in (("from", "-0.2"), ("to", "-0.02")):
        one.page.fill(f"input[aria-label='{field}, task']", value)
        one.page.keyboard.press("Enter")
    one.until("$.request.phi.task[1] === -0.02 && $.result && !$.busy && !$.preview && $.result.poses.length === 16")
    assert not one.page.query_selector(".trouble")


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


def test_thousands_of_objects_are_drawn_together(serve, tab, tmp_path):
    (tmp_path / "many.spec").write_text(
        "object block[2000] = box(1 cm, 1 cm, 1 cm)\ntask: leftOf(block[1], block[2])\n"
    )
    one = tab(serve("many.spec").link)
    one.until("$.result && $.poses.length === 2000 && window.table.frames")
    assert one.state("$.request.n") == 10 and one.state("$.refusal") is None
    assert one.page.evaluate("window.table.renderer.info.render.calls") < 40
    place = one.page.evaluate("window.table.where('block[7]')")
    one.page.mouse.click(place["x"], place["y"])
    one.page.wait_for_selector(".chosen-thing b")
    assert one.page.inner_text(".chosen-thing b").startswith("block[")


def test_rare_specs_say_how_rare_they_are(serve, tab, tmp_path):
    """`range` cannot tell how rare some phi are that lie between others of which it can."""
    apart = "closeTo(block[i], block[i + 1], 9 cm) & abs(y(block[i]) - y(block[i + 1])) <= 1 cm"
    text = "object block[7] = box(5 cm, 5 cm, 5 cm)\nrequire noOverlap()\n"
    text += f"row: forall i in 1..6: leftOf(block[i], block[i + 1]) & {apart}\n"
    (tmp_path / "row.spec").write_text(text)
    (found,) = scenegen.rarity(scenegen.parse(text)).labels
    assert None in [level.above for level in found.curve[1:-1]]
    (exact,) = [level.above.log10 for level in found.curve if level.phi == 0.0]
    one = tab(serve("row.spec").link)
    one.until("$.rarity.row")
    assert one.page.inner_text(".label-box .rare") == f"1 in 10^{-exact:.0f}"
    heights = one.page.evaluate(
        "document.querySelector('.handles .curve').getAttribute('d').slice(1)"
        ".split('L').map((one) => +one.split(' ')[1])"
    )
    top = heights.index(min(heights))
    assert heights[top:-1] == sorted(heights[top:-1])  # no gap: ever rarer to the right of the most frequent phi
    one.page.fill("input[aria-label='from, row']", "-0.02")  # between two of which nothing is known
    one.page.keyboard.press("Enter")
    one.until("$.request.phi.row[0] === -0.02")
    assert one.page.inner_text(".label-box .rare").startswith("1 in 10^")
    one.page.click(".chip:has-text('barely satisfied')")
    one.until("$.request.phi.row[1] !== null")
    assert one.page.inner_text(".label-box .rare").startswith("1 in 10^")


def test_fields_say_what_they_do_not_take(served, tab):
    one = tab(served.link)
    one.ready()
    for value in ("abc", "0,02", "2 miles"):
        one.page.fill("input[aria-label='from, task']", value)
        one.page.keyboard.press("Enter")
        one.page.wait_for_selector(f".wrong:has-text('{value} is no number here')")
        assert one.state("$.request.phi.task") == [0, None]
        assert one.page.get_attribute("input[aria-label='from, task']", "aria-invalid") == "true"
    one.page.fill("input[aria-label='from, task']", "2 cm")
    one.page.keyboard.press("Enter")
    one.until("$.request.phi.task[0] === 0.02")
    assert not one.page.query_selector(".wrong")
    assert one.page.query_selector(".fields .caption")  # evenly over phi, with an open end
    one.page.fill("input[aria-label='to, task']", "10 mm")
    one.page.keyboard.press("Enter")
    one.page.wait_for_selector(".wrong:has-text('from is larger than to')")
    one.page.fill("input[aria-label='to, task']", "40 mm")
    one.page.keyboard.press("Enter")
    one.until("$.request.phi.task[1] === 0.04")
    assert not one.page.query_selector(".fields .caption")


def test_scenes_that_arrive_leave_what_is_being_typed(served, tab):
    one = tab(served.link)
    one.ready()
    for typed, now in (("0.0", [0, None]), ("0.02", [0.02, None])):
        one.page.fill("input[aria-label='from, task']", typed)
        one.page.evaluate("document.querySelector('.joined button').click()")  # new scenes; the field keeps the focus
        one.until("$.busy")
        one.ready()
        assert one.page.input_value("input[aria-label='from, task']") == typed
        one.page.keyboard.press("Enter")
        one.until(f"JSON.stringify($.request.phi.task) === '{json.dumps(now, separators=(',', ':'))}'")


def test_dialogs_keep_the_keyboard_and_give_it_back(served, tab):
    one = tab(served.link)
    one.ready()
    one.page.focus("button[aria-label=keys]")
    one.page.keyboard.press("Enter")
    one.page.wait_for_selector("[role=dialog]")
    inside = "document.activeElement === document.body || !!document.activeElement.closest('[role=dialog]')"
    for _ in range(4):
        one.page.keyboard.press("Tab")
        assert one.page.evaluate(inside)
    one.page.keyboard.press("Escape")
    one.until("document.activeElement.getAttribute('aria-label') === 'keys'")
    one.page.click(".phi.ask")
    assert "at 0 or more the formula is satisfied" in one.page.inner_text(".about")


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
    one.page.click(".chip:has-text('barely satisfied')")
    one.ready()
    one.page.click("button:has-text('Download')")
    words = shlex.split(one.page.inner_text("code.command"))
    assert words[0] == "scenegen"
    subprocess.run([sys.executable, "-m", *words], cwd=tmp_path, check=True, capture_output=True)
    assert scenegen.read_scenes(tmp_path / "scenes.json").poses.tolist() == one.state("$.result.poses")


def test_a_link_reopens_the_same_state(served, tab):
    one = tab(served.link)
    one.ready()
    one.page.keyboard.press("Escape")
    for _ in range(6):  # further than a first look has scenes
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
    assert two.page.evaluate("window.scenegen.link()") == link
    assert two.state("$.report.phi") == one.state("$.report.phi")


def test_scenes_are_opened_as_they_are(serve, tab, tmp_path):
    found = scenegen.sample(scenegen.parse(TEXT), {"task": (0, 0.1)}, 6, seed=4)
    found.save(tmp_path / "six.json")
    one = tab(serve("six.json").link)
    one.ready()
    assert one.state("$.result.poses") == found.poses.tolist()
    assert one.state("$.request.phi.task") == [0, 0.1]


def test_scenes_of_drawn_numbers_are_opened_apart(serve, tab, tmp_path):
    spec = scenegen.parse("object block[1..2], mug\ntask: leftOf(block[1], mug)\n")
    found = scenegen.sample(spec, n=6, seed=4)
    found.save(tmp_path / "six.json")
    one = tab(serve("six.json").link)
    one.ready()
    assert one.state("$.request.phi.task") == [None, None]
    for number in (2, 1, 2):
        one.page.select_option("[data-count=block]", str(number))
        one.until(f"$.spec.numbers[0].now === {number} && $.result && !$.busy && $.poses.length === {number + 1}")
        mine = found.counts["block"] == number
        assert one.state("$.result.poses") == found.poses[mine][:, found.present[mine][0]].tolist()


def test_a_page_without_a_server(tab, tmp_path):
    (tmp_path / "two.spec").write_text(TEXT)
    command = [sys.executable, "-m", "scenegen", "view", "two.spec", "--export", "page.html", "-n", "40"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    one = tab((tmp_path / "page.html").as_uri())
    one.until("$.result && $.report && $.report.decides")
    assert one.page.locator(".grid button[data-scene]").count() == 40
    one.page.click(".chip:text-is('satisfied')")
    one.until("document.querySelectorAll('.grid button[data-scene]').length < 40")
    shown = one.page.eval_on_selector_all(
        ".grid button[data-scene] span", "all => all.map(one => JSON.parse(one.dataset.phi).task)"
    )
    assert 0 < len(shown) < 40 and all(phi >= 0 for phi in shown)


def exported(folder, text: str) -> str:
    (folder / "two.spec").write_text(text)
    command = [sys.executable, "-m", "scenegen", "view", "two.spec", "--export", "page.html", "-n", "12"]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    return (folder / "page.html").as_uri()


def test_a_page_without_a_server_gives_its_scenes_back(tab, tmp_path):
    text = (
        "region board[2] = rect(0, 0.6, 1, 1) at 30 cm, 60 cm\nobject can on any of board, mug\n"
        "require noCollision()\ntask: z(can) >= 10 cm & leftOf(can, mug)\n"
    )
    one = tab(exported(tmp_path, text))
    one.until("$.result && $.report && $.report.decides")
    phi, poses, on = one.state("$.result.phi.task"), one.state("$.result.poses"), one.state("$.result.on")
    back = scenegen.read_scenes(path := download(one, "json", tmp_path))
    assert (back.poses.tolist(), back.phi["task"].tolist(), back.on.astype(int).tolist()) == (poses, phi, on)
    assert [each["task"] for each in scenegen_eval(tmp_path / "two.spec", path)] == phi
    drag(one, "mug", 40, -25)
    moved = one.state("$.poses")
    assert moved != poses[0] and "no server" in one.page.inner_text(".phi.moved")
    assert one.page.inner_text(".phi[data-label=task] b") == "?" and not one.page.query_selector(".decider")
    one.page.click(".grid button[data-scene='1']")
    one.until("$.report.decides")
    one.page.click(".grid button[data-scene='0']")
    assert one.state("$.poses") == moved
    path = download(one, "json", tmp_path)
    back = scenegen.read_scenes(path, spec=scenegen.parse(text))
    assert back.poses.tolist() == [moved, *poses[1:]] and back.on.astype(int).tolist() == on
    assert [each["task"] for each in scenegen_eval(tmp_path / "two.spec", path)][1:] == phi[1:]
    assert download(one, "spec", tmp_path).read_text() == text
    one.page.keyboard.press("Control+z")
    one.until("$.report.decides")
    assert one.state("$.poses") == poses[0] and not one.page.query_selector(".phi.moved")


def test_a_page_without_a_server_gives_its_motions_back(tab, tmp_path):
    text = "object mug, plate\ntime 4 steps\nrequire forall a in objects: speed(a) <= 20 cm/s\n"
    one = tab(exported(tmp_path, text + "task: eventually leftOf(mug, plate)\n"))
    one.until("$.result && $.report && $.report.decides")
    back = scenegen.read_motions(download(one, "json", tmp_path))
    assert back.poses.tolist() == one.state("$.result.motions")
    assert back.phi["task"].tolist() == one.state("$.result.phi.task")
