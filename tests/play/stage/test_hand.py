"""The world `hand:`: what a person is asked, what the outcomes record, and what reports and fits make of it."""

import io
import json

import numpy as np
import pytest

from scenegen.errors import RequestError, ScenegenError
from scenegen.learn.success.files import OutcomesHeader
from scenegen.play.fit import outcomes_of
from scenegen.play.stage import hand
from scenegen.play.suites.loading import check_name, load_named
from scenegen.play.suites.outcomes import EpisodeOutcome, SceneThatStood, SuiteOutcomes, dump_line, read_outcomes
from scenegen.play.suites.report import band_that_stood, report_suite
from scenegen.play.suites.run import Player


def world_of(stage, keys, source=""):
    return hand.HandWorld(stage, str(source), io.StringIO(keys), io.StringIO())


def test_without_pictures_it_shows_a_card_and_asks(stage, suite):
    world = world_of(stage, "\nmaybe\ny\n")
    _, info = world.reset(seed=1, options={"start": suite[7]})
    assert info == {"success": None}
    assert world.step(None)[2:] == (True, False, {"success": True})
    said = world.screen.getvalue()
    assert "red: L15" in said and said.count("did it succeed?") == 2
    with pytest.raises(ScenegenError, match="nobody is at the terminal"):
        world.step(None)


def test_a_picture_is_looked_at_until_it_is_right(stage, suite, tmp_path, monkeypatch):
    start = suite[7]
    stored = start.task.scenes.poses[start.row]
    wrong = stored + (0.0, -0.1, 0.0) * np.array([[1.0], [0.0]])
    solved = stored.copy()
    solved[0, :2] = stored[1, :2] + (0.06, 0.0)
    looks = iter([None, wrong, stored, solved])
    monkeypatch.setattr(hand.HandWorld, "_look", lambda self: next(looks))
    world = world_of(stage, "\n\nm\n\np\n", tmp_path)
    _, info = world.reset(seed=1, options={"start": start})
    assert info["scene"]["phi"] == pytest.approx(start.phi["goal"]) and list(info["scene"]["poses"]) == ["red", "blue"]
    assert world.step(None)[-1] == {"success": True} and "phi 0.01" in world.screen.getvalue()


def test_only_new_pictures_are_looked_at(stage, suite, tmp_path):
    (tmp_path / "old.jpg").write_bytes(b"of the last episode")
    world = world_of(stage, "\n", tmp_path)
    with pytest.raises(ScenegenError):
        world.reset(seed=1, options={"start": suite[7]})
    assert f"no new picture is in {tmp_path}" in world.screen.getvalue()
    (tmp_path / "new.jpg").write_bytes(b"no picture")
    assert world._look() is None and "new.jpg is no picture" in world.screen.getvalue()
    assert world._look() is None and world.screen.getvalue().count("no new picture is in") == 2


def test_a_camera_is_looked_at(stage, suite, tmp_path, monkeypatch):
    cv2 = pytest.importorskip("cv2")
    monkeypatch.chdir(tmp_path)
    cv2.imwrite("0000.png", np.full((400, 600, 3), 120, np.uint8))
    world = world_of(stage, "\n", "%04d.png")
    with pytest.raises(ScenegenError):
        world.reset(seed=1, options={"start": suite[7]})
    said = world.screen.getvalue()
    assert "Enter when all stand there: " in said and "camera %04d.png shows no tag of the mat" in said


def test_the_end_of_a_terminal_fails_no_episode(stage, suite, monkeypatch):
    monkeypatch.setattr(hand, "make_hand", lambda folder, task, suite: world_of(stage, "\n"))
    with pytest.raises(ScenegenError, match="goes on with the outcomes"):
        Player(suite.folder, False, "hand:", "hand:mine", False, 10)(7)


def test_a_folder_that_is_missing_and_a_name_that_is_cut_short(stage, tmp_path):
    with pytest.raises(FileNotFoundError, match="make it first"):
        hand.make_hand(str(tmp_path / "none"), None, None)
    with pytest.raises(RequestError, match="`hand:`"):
        check_name("world", "hand")


def test_a_player_records_the_scene_that_was_set(stage, suite, monkeypatch):
    check_name("world", "hand:photos")
    check_name("policy", "hand:mine")
    stored = suite[7].task.scenes.poses[suite[7].row] + (0.002, 0.0, 0.0)
    monkeypatch.setattr(hand.HandWorld, "_look", lambda self: stored)
    monkeypatch.setattr(hand, "make_hand", lambda folder, task, suite: world_of(stage, "\nt\nn\n", folder))
    played = Player(suite.folder, False, "hand:photos", "hand:mine", False, 10)(7)
    assert played.success is False and played.error is None and played.steps == 1
    assert played.scene.poses["red"] == tuple(stored[0])
    assert json.loads(dump_line(played))["scene"]["poses"]["red"] == list(stored[0])
    assert load_named("policy", "hand:mine")({}, "go") is None


def test_old_lines_have_no_scene():
    one = EpisodeOutcome(episode=0, task="a", band="b", success=True, steps=1)
    assert b"scene" not in dump_line(one)


@pytest.fixture
def outcomes(suite, tmp_path):
    """An episode that stood as it should, one that was harder, and one in no band."""
    header = OutcomesHeader(
        suite=suite.name, digest=suite.digest, world="hand:", policy="hand:mine", episodes=len(suite)
    )
    episodes = []
    for number, phi in ((5, suite[5].phi["goal"]), (6, suite[5].task.bands[4].phi[0] + 0.001), (7, 0.5)):
        start = suite[number]
        poses = {name: (0.1 * k, 0.05, 1.0) for k, name in enumerate(start.objects)}
        scene = SceneThatStood(poses=poses, phi=phi)
        episodes.append(
            EpisodeOutcome(episode=number, task=start.task.name, band=start.band, success=True, steps=1, scene=scene)
        )
    return SuiteOutcomes(header, tuple(episodes))


def test_a_report_counts_bands_that_stood_there(suite, outcomes, tmp_path):
    assert [band_that_stood(one, suite) for one in outcomes.episodes] == ["level1", "level5", ""]
    path = tmp_path / "o.jsonl"
    path.write_bytes(b"".join(map(dump_line, [outcomes.header, *outcomes.episodes])))
    assert read_outcomes(path, suite).episodes == outcomes.episodes
    text = report_suite("tabletop", [path], tmp_path / "r.md").read_text()
    assert "| level5 | 100.0 %" in text and "| level2 | - |" in text and "33.3 % in the band that was asked for" in text


def test_a_fit_reads_the_scene_that_stood_there(suite, outcomes):
    task = suite[5].task
    ended = {one.episode: [one.success] for one in outcomes.episodes}
    stood = {(one.episode, 0): one.scene for one in outcomes.episodes[1:]}
    found = outcomes_of(suite, task, ended, stood)
    features = [one.name for one in found.features]
    x = found.values[features.index("x of blue")]
    assert x[1] == x[2] == pytest.approx(0.1) and x[0] == task.scenes.poses[suite[5].row, 1, 0]
    phi = found.values[0]
    assert phi[0] == pytest.approx(suite[5].phi["goal"]) and phi[1] == phi[2]
