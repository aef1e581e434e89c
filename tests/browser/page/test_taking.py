"""What is taken away from the page and brought to it: files, commands, links, pages without a server."""

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
