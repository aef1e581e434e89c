"""A suite in Inspect Robots itself: its registry, its compatibility checks, its rollouts."""

import numpy as np
import pytest

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


def test_scenes_are_starts_by_entry_points(robots, stopping, small, tmp_path):
    from inspect_robots.registry import resolve

    worlds.BEGUN.clear()
    task = resolve("task", "scenegen", suite=str(small), steps=20)
    embodiment = resolve("embodiment", "scenegen", suite=str(small), world=WORLD, steps=20)
    worlds.BEGUN.clear()
    (log,) = robots.eval(task, stopping, embodiment, log_dir=str(tmp_path))
    suite = Suite.load(small)
    import json
    print(json.dumps(log.to_dict(), indent=1)[:6000])
    print(list(tmp_path.iterdir()))
    assert worlds.BEGUN == [(start.number, start.poses.tobytes()) for start in suite]
    for start, scene in zip(suite, task.scenes, strict=True):
        assert np.array(scene.metadata["poses"]).tobytes() == start.poses.tobytes()
        assert (scene.instruction, scene.metadata["band"]) == (start.task.instruction, start.band)
