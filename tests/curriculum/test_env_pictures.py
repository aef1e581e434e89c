"""render() draws the scene as it is, with a process that stays."""

import gymnasium
import numpy as np
import pytest

from scenegen.curriculum import MotionTable, TableTop, TableTopVector

MOTION = "scenegen.curriculum:scenegen/Motion-v0"
LEFT = "leftOf(mug, plate)"
SCENE = {"mug": (0.3, 0.5, 0.0), "plate": (0.6, 0.5, 0.0)}


@pytest.mark.long
def test_pictures_follow_the_scene():
    env = TableTop(LEFT, render_mode="rgb_array", view="top", size=(96, 64), step=0.3)
    env.reset(options={"scene": SCENE})
    first = env.render()
    assert first.shape == (64, 96, 3) and first.dtype == np.uint8 and len(np.unique(first.reshape(-1, 3), axis=0)) > 20
    process = env.easel._live._pool
    np.testing.assert_array_equal(env.render(), first)
    env.reset(options={"scene": {**SCENE, "mug": (0.8, 0.5, 0.0)}})
    moved = env.render()
    changed = np.flatnonzero((moved != first).any(axis=2).any(axis=0))
    assert changed.min() < 48 < changed.max()  # the mug left the left half, and is in the right one
    assert env.easel._live._pool is process
    env.close()
    assert env.easel._live is None
    env.close()


def test_no_mode_no_picture():
    env = TableTop(LEFT)
    env.reset(options={"scene": SCENE})
    assert env.render() is None


@pytest.mark.long
def test_pictures_of_many_tables():
    envs = TableTopVector(2, LEFT, render_mode="rgb_array", size=(48, 32))
    envs.reset(options={"scene": SCENE})
    one, other = envs.render()
    np.testing.assert_array_equal(one, other)
    envs.step([0, 1])
    one, other = envs.render()
    assert (one != other).any()
    envs.close()


@pytest.mark.long
def test_pictures_follow_a_motion():
    spec = """object mug, plate at (0.75, 0.5)
time [0, 2 s] every 0.5 s
require speed(mug) <= 40 cm/s
task: finally leftOf(mug, plate)"""
    env = gymnasium.make(MOTION, spec=spec, render_mode="rgb_array", view="top", size=(96, 64))
    assert env.metadata["render_fps"] == 2.0
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.unwrapped.render()
    env.reset(options={"scene": {"mug": (0.1, 0.5, 0.0)}})
    pictures = [env.render()]
    for action in (1, 0, 1):  # x +, wait, x +
        env.step(action)
        pictures.append(env.render())
    first, moved, waited, again = pictures
    assert first.shape == (64, 96, 3)
    np.testing.assert_array_equal(moved, waited)
    for one, other in ((first, moved), (moved, again)):
        changed = np.flatnonzero((one != other).any(axis=2).any(axis=0))
        assert len(changed) > 0 and changed.max() < 60  # the plate stays where it is
    env.close()
    env.close()
    MotionTable(spec).close()
    assert MotionTable(spec).render() is None
