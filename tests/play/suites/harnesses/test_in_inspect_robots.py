"""A suite in Inspect Robots itself: its registry, its compatibility checks, its rollouts."""

import numpy as np
import pytest

from scenegen.errors import DataError, ScenegenError
from scenegen.play.suites.harnesses.results import read_results
from scenegen.play.suites.report import report_suite
from scenegen.play.suites.suite import Suite

from . import worlds

pytestmark = pytest.mark.harnesses

WORLD = f"{worlds.__name__}:Forgetful"


@pytest.fixture(scope="module")
def robots():
    return pytest.importorskip("inspect_robots", reason="needs Inspect Robots: make test-harnesses installs it")


@pytest.fixture
def stopping(robots):
    """A policy that stops at random moments, in every second episode after it has pushed to the middle."""
    from inspect_robots.policy import PolicyBase, PolicyInfo
    from inspect_robots.spaces import Box
    from inspect_robots.types import Action, ActionChunk

    class Stopping(PolicyBase):
        info = PolicyInfo("stopping", Box((3,)))

        def __init__(self):
            self.rng, self.scenes = np.random.default_rng(3), []

        def reset(self, scene):
            self.scenes.append(scene)

        def act(self, observation):
            push = self.rng.uniform(-1.0, 1.0, 2)
            if len(self.scenes) % 2:
                push = -30.0 * observation.state["objects"][:2]
            return ActionChunk([Action(np.array([*push, float(self.rng.random() < 0.1)]))])

    return Stopping()


def test_scenes_are_starts_and_logs_are_outcomes(robots, stopping, small, tmp_path):
    """By entry points; poses are those of the suite bit for bit."""
    from inspect_robots.registry import resolve

    suite = Suite.load(small)
    task = resolve("task", "scenegen", suite=str(small), steps=20)
    for start, scene in zip(suite, task.scenes, strict=True):
        assert np.array(scene.metadata["poses"]).tobytes() == start.poses.tobytes()
        assert (scene.id, scene.instruction) == (f"{start.number:04d}", start.task.instruction)
        assert (scene.metadata["band"], scene.metadata["phi"]) == (start.band, start.phi)
    embodiment = resolve("embodiment", "scenegen", suite=str(small), world=WORLD, steps=20)
    for _ in range(2):
        worlds.begun.clear()
        (log,) = robots.eval(task, stopping, embodiment, log_dir=str(tmp_path))
        assert worlds.begun == [(start.number, start.poses.tobytes()) for start in suite]
    assert log.status == "success"

    file = max(tmp_path.glob("*.json"), key=lambda path: path.stat().st_mtime_ns)
    read = read_results(file, suite)
    scores = {scene.scene_metadata["start"]: scene.reduced for scene in log.samples}
    assert {one.episode: (one.success, one.steps) for one in read.episodes} == {
        number: (one["success_at_end"] == 1.0, one["episode_length"]) for number, one in scores.items()
    }
    assert 0 < sum(one.success for one in read.episodes) < 6
    assert (read.header.world, read.header.policy, read.header.steps) == (WORLD, "stopping", 20)
    assert "small" in report_suite(small, [file], tmp_path / "report.md").read_text()


def test_the_program(robots, small, tmp_path, monkeypatch, stopping):
    """`inspect-robots run` finds task and embodiment by name, and gives them what its options say."""
    from inspect_robots import registry
    from inspect_robots.cli import main

    registry.registered("policy")
    monkeypatch.setitem(registry._FACTORIES["policy"], "stopping", lambda: stopping)
    worlds.begun.clear()
    task = ["--task", "scenegen", "-T", f"suite={small}", "-T", "steps=5", "-T", "reverse=true"]
    world = ["--embodiment", "scenegen", "-E", f"suite={small}", "-E", f"world={WORLD}", "-E", "reverse=true"]
    assert main(["run", *task, *world, "--policy", "stopping", "--log-dir", str(tmp_path)]) == 0
    back = Suite.load(small, reverse=True)
    assert worlds.begun[1:] == [(start.number, start.poses.tobytes()) for start in back]


def test_reversed_tasks_and_bad_input(robots, stopping, small, tmp_path):
    from scenegen.play.suites.harnesses.inspect_robots import WorldEmbodiment, suite_task

    back = WorldEmbodiment(str(small), WORLD, reverse=True)
    worlds.begun.clear()
    robots.eval(suite_task(str(small), reverse=True), stopping, back, log_dir=str(tmp_path))
    assert worlds.begun == [(start.number, start.poses.tobytes()) for start in Suite.load(small, reverse=True)]
    with pytest.raises(DataError, match="start of the suite"):
        back.reset(suite_task(str(small)).scenes[0])
    with pytest.raises(DataError):
        suite_task(str(small / "nothing"))
    for world, how in (("broken", "no display"), ("blind", "action_space")):
        with pytest.raises(ScenegenError, match=how):
            WorldEmbodiment(str(small), f"{worlds.__name__}:{world}")
