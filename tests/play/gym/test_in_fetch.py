"""The example of docs/layouts.md in gymnasium-robotics' FetchPush: 100 resets, with and without a place kept for the
gripper."""

import math

import numpy as np
import pytest

import scenegen
from scenegen.gym import SceneResets, keep_clear
from tests.play.layouts.recipes import example

pytestmark = [pytest.mark.fetch, pytest.mark.filterwarnings("ignore:.*")]
RESETS, STEPS = 100, 10


@pytest.fixture(scope="module")
def page():
    pytest.importorskip("gymnasium_robotics", reason="needs gymnasium-robotics: make test-fetch installs it")
    return example("gymnasium_robotics")


def get(env, name):
    if name == "target":
        return [*env.goal, 1.0, 0.0, 0.0, 0.0]
    return env._utils.get_joint_qpos(env.model, env.data, "object0:joint")


def measured(page, spec):
    """(RESETS,) each: how far phi is off at reset, and how far, in mm, the block moves while the hand is at rest."""
    height = page["height"]
    env = SceneResets(
        page["fetch"], spec, (-0.15, 0.05), put=page["put"], observe=lambda env: env._get_obs(), get=get,
        quaternion="wxyz", origin=(0, 0, height - 0.025), origins="middle",
    )  # fmt: skip
    starts, off, moved = {}, [], []
    for seed in [*range(RESETS), 0, 1]:
        seen, info = env.reset(seed=seed)
        promised = info["phi"]["task"]
        block, goal = seen["achieved_goal"], seen["desired_goal"]
        off.append(max(abs(0.05 - math.dist(block, goal) - promised), abs(env.phi_now()["task"] - promised)))
        assert bool(env.unwrapped._is_success(block, goal)) == (promised > 0)
        assert starts.setdefault(seed, seen["observation"].tobytes()) == seen["observation"].tobytes()
        for _ in range(STEPS):
            seen, *_ = env.step(np.zeros(4))
        moved.append(1e3 * math.dist(seen["achieved_goal"], block))
    assert len(set(starts.values())) > 0.9 * RESETS  # two seeds may choose one of the 4,096
    return np.array(off), np.array(moved)


def test_a_hundred_resets(page):
    hand = page["hand"]
    off, moved = measured(page, page["spec"])
    print(f"without: phi off by at most {off.max():.1e}; thrown {(moved > 1).sum()}, moved {moved.max():.2f} mm")
    assert off.max() < 1e-6 and moved.max() > 10  # what the place for the hand is for
    off, moved = measured(page, keep_clear(page["spec"], hand[0], hand[1], 0.05))
    print(f"with: phi off by at most {off.max():.1e}; thrown {(moved > 1).sum()}, moved {moved.max():.2f} mm")
    assert off.max() < 1e-6 and moved.max() < 0.2


@pytest.mark.parametrize(
    ("name", "shape", "half", "most"),
    [
        ("FetchPickAndPlace-v4", "box(5 cm, 5 cm, 5 cm)", 0.025, 0.2),
        ("FetchSlide-v4", "cylinder(2.5 cm, 4 cm)", 0.02, 3.0),  # its puck slides by itself
    ],
)
def test_other_tasks(page, name, shape, half, most):
    env = page["gymnasium"].make(name)
    env.reset()
    (x, y, _), height = env.unwrapped.initial_gripper_xpos, env.unwrapped.height_offset
    spec = scenegen.parse(f"""
        workspace [{x - 0.1:.3f}, {x + 0.1:.3f}] x [{y - 0.1:.3f}, {y + 0.1:.3f}]
        object block = {shape}
        task: x(block) >= {x:.3f}
    """)
    env = SceneResets(
        env, keep_clear(spec, x, y, 0.05), put=page["put"], observe=lambda env: env._get_obs(), get=get,
        quaternion="wxyz", origin=(0, 0, height - half), origins="middle",
    )  # fmt: skip
    moved = []
    for seed in range(RESETS // 2):
        seen, info = env.reset(seed=seed)
        assert abs(env.phi_now()["task"] - info["phi"]["task"]) < 1e-6
        block = seen["achieved_goal"]
        for _ in range(STEPS):
            seen, *_ = env.step(np.zeros(4))
        moved.append(1e3 * math.dist(seen["achieved_goal"], block))
    print(f"{name}: moved {max(moved):.2f} mm")
    assert max(moved) < most
