"""Beside the table: a run with a terminal, breaks in it, and the page of the docs from printing to the report."""

import json
import re
import shlex
import time
from pathlib import Path

import numpy as np
import pytest

from scenegen.play.stage.stage import TableStage
from scenegen.play.suites.outcomes import read_outcomes
from scenegen.play.suites.report import band_that_stood
from scenegen.play.suites.suite import Suite
from tests.play.stage.terminal import Terminal

pytestmark = pytest.mark.long
PAGE = Path(__file__).parents[3] / "docs" / "stage.md"
SHORTER = {"-n 25": "-n 2", "--live 0": "--live table.avi"}
CTRL_C, CTRL_D = "\x03", "\x04"


def episodes_of(path):
    return [json.loads(line) for line in path.read_text().splitlines()[1:]]


def run(folder, *more):
    words = "suite run tabletop --world hand: --policy hand:mine --episodes 3:6 --out o.jsonl"
    return Terminal([*words.split(), *more], folder)


@pytest.mark.parametrize("key", [CTRL_C, CTRL_D], ids=["ctrl-c", "ctrl-d"])
@pytest.mark.parametrize("question", ["stand there: ", "[n]o: "])
def test_a_break_loses_and_repeats_nothing(tmp_path, key, question):
    first = run(tmp_path)
    assert first.wait_for("stand there: ")
    first.type("\n")
    assert first.wait_for("[n]o: ")
    first.type("y\n")
    assert first.wait_for("stand there: ")
    if question == "[n]o: ":
        first.type("\n")
        assert first.wait_for(question)
    first.type(key)
    assert first.end() == (130 if key == CTRL_C else 1)
    assert "--resume goes on" in first.said and "Traceback" not in first.said
    assert [one["episode"] for one in episodes_of(tmp_path / "o.jsonl")] == [3]
    again = run(tmp_path, "--resume")
    while again.wait_for("stand there: "):
        again.type("\n")
        assert again.wait_for("[n]o: ")
        again.type("n\n")
    assert again.end() == 0
    assert [int(one) for one in re.findall(r"episode (\d+): ", first.said + again.said)] == [3, 4, 4, 5]
    found = episodes_of(tmp_path / "o.jsonl")
    assert [(one["episode"], one["success"], one["error"]) for one in found] == [
        (3, True, None), (4, False, None), (5, False, None),
    ]  # fmt: skip


def test_an_answer_is_taken_back(tmp_path):
    first = run(tmp_path)
    while first.wait_for("stand there: "):
        first.type("\n")
        assert first.wait_for("[n]o: ")
        first.type("n\n")
    assert first.end() == 0
    lines = (tmp_path / "o.jsonl").read_text().splitlines()
    (tmp_path / "o.jsonl").write_text("\n".join([*lines[:2], lines[3], ""]))
    again = run(tmp_path, "--resume")
    assert again.wait_for("episode 4: ") and again.wait_for("stand there: ")
    again.type("\n")
    assert again.wait_for("[n]o: ")
    again.type("y\n")
    assert again.end() == 0
    assert [one["success"] for one in episodes_of(tmp_path / "o.jsonl")] == [False, True, False]


class Person:
    """Sets starts with hands that are 7 mm and 5 degrees off, photographs them, and answers."""

    def __init__(self, folder):
        from experiments.stage.photographs import mat_raster

        self.folder, self.suite = folder, Suite.load(folder / "hand")
        self.stage, self.rng = TableStage.from_suite(self.suite), np.random.default_rng(5)
        self.raster, self.stood = mat_raster(self.stage), {}

    def photograph(self, number, path, poses=None):
        """Writes a picture; returns where things stand in it."""
        import cv2

        from experiments.stage.photographs import draw_shot, render_photograph

        start = self.suite[number]
        if poses is None:
            poses = start.task.scenes.poses[start.row]
            poses = poses + self.rng.normal(0.0, (0.007, 0.007, np.radians(5.0)), poses.shape).clip(-0.014, 0.014)
        shot = draw_shot(self.rng, self.stage, 0.9)
        picture = render_photograph(self.stage, start, poses, shot, self.rng, raster=self.raster)
        cv2.imwrite(str(path), picture)
        return poses

    def play(self, words):
        """A run, of which every second episode succeeds; one start is far off at first."""
        (self.folder / "photos").mkdir()
        terminal = Terminal(words, self.folder)
        while terminal.wait_for("in photos: "):
            number = int(re.findall(r"episode (\d+): ", terminal.said)[-1])
            path = self.folder / "photos" / f"{len(self.stood)}.png"
            if not self.stood:
                terminal.type("\n")
                assert terminal.wait_for("no new picture is in photos") and terminal.wait_for("in photos: ")
                start = self.suite[number]
                far = start.task.scenes.poses[start.row] + (0.0, -0.1, 0.0) * np.array([[1.0], [0.0]])
                self.photograph(number, path.with_stem("far"), far)
                terminal.type("\n")
                assert terminal.wait_for("[t]ake: ") and "move " in terminal.said
                terminal.type("m\n")
                assert terminal.wait_for("in photos: ")
            time.sleep(0.01)
            self.stood[number] = self.photograph(number, path)
            terminal.type("\n")
            if terminal.wait_for("[p]hi of a new picture: ", "[t]ake: ") == "[t]ake: ":
                terminal.type("t\n")
                assert terminal.wait_for("[p]hi of a new picture: ")
            terminal.type("y\n" if number % 2 else "n\n")
        assert terminal.end() == 0, terminal.said
        assert (self.folder / "photos" / "overlay.png").exists()


def test_the_page_from_printing_to_the_report(tmp_path, warm):
    pytest.importorskip("cv2")
    pytest.importorskip("fpdf")
    pytest.importorskip("pybullet")
    import cv2

    text = PAGE.read_text()
    (tmp_path / "beside.spec").write_text(re.search(r"```spec file=beside.spec\n(.*?)```", text, re.DOTALL)[1])
    lines = re.search(r"```text\n(scenegen suite new.*?)```", text, re.DOTALL)[1].splitlines()
    assert len(lines) == 9 and all(line.startswith("scenegen ") for line in lines)
    person = None
    for line in lines:
        for long, short in SHORTER.items():
            line = line.replace(long, short)
        words = shlex.split(line.partition("#")[0])[1:]
        if words[:2] == ["suite", "run"]:
            person.play(words)
            continue
        done = warm.run(["-m", "scenegen", *words], tmp_path)
        assert done.returncode == 0, f"{line}\n{done.stdout}{done.stderr}"
        if words[:2] == ["suite", "new"]:
            person = Person(tmp_path)
            person.photograph(3, tmp_path / "table.jpg")
            frame = cv2.imread(str(tmp_path / "table.jpg"))
            video = cv2.VideoWriter(str(tmp_path / "table.avi"), cv2.VideoWriter_fourcc(*"MJPG"), 5, frame.shape[1::-1])
            for one in (0 * frame, frame):
                video.write(one)
            video.release()
    assert not {"mat.pdf", "sheets.pdf", "order.csv", "where.png", "mine.jsonl", "report.html"} - {
        one.name for one in tmp_path.iterdir()
    }
    found = read_outcomes(tmp_path / "mine.jsonl", person.suite)
    assert [one.episode for one in found.episodes] == [0, 1, 2, 3]
    for one in found.episodes:
        assert one.success == bool(one.episode % 2) and one.error is None
        poses = np.array([one.scene.poses[name] for name in person.suite[one.episode].objects])
        assert np.abs(poses - person.stood[one.episode])[:, :2].max() < 0.003
        assert band_that_stood(one, person.suite) == one.band, "such starts forgive"
    assert "in the band that was asked for" in (tmp_path / "report.html").read_text()


def test_what_the_page_says_of_its_photograph(tmp_path, warm):
    cv2 = pytest.importorskip("cv2")
    from experiments.stage.pictures import photograph_of_page

    said = re.search(r"```text\n\$ (scenegen stage check.*?)\n(.*?)```", PAGE.read_text(), re.DOTALL)
    cv2.imwrite(str(tmp_path / "table.png"), photograph_of_page()[0][..., ::-1])
    done = warm.run(["-m", *shlex.split(said[1])], tmp_path)
    assert done.returncode == 1 and done.stdout == said[2], done.stdout
