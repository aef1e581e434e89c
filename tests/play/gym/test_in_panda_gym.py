"""The example of docs/layouts.md in panda-gym's own environment."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from scenegen.cli.app import run
from scenegen.gym import SceneResets, phi_space
from scenegen.play.strategies import strategy
from tests.play.layouts.recipes import example

pytestmark = pytest.mark.long
RESETS, STEPS = 50, 10
ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(scope="module")
def page():
    pytest.importorskip("panda_gym", reason="panda-gym is not installed (pip install 'scenegen-dsl[robots]')")
    return example("panda_gym")


def get(env, name):
    body = {"cube": "object"}.get(name, name)
    return [
        *env.sim.get_base_position(body),
        *env.sim.physics_client.getBasePositionAndOrientation(env.sim._bodies_idx[body])[1],
    ]


def started(page, phi):
    calls = {"put": page["put"], "observe": lambda env: env._get_obs(), "get": get}
    return SceneResets(page["env"].env, page["spec"], phi, quaternion="xyzw", origins="middle", **calls)


def test_fifty_resets(page):
    env = started(page, (-0.1, 0.05))
    starts, off, moved, agreed = {}, [], [], 0
    for seed in range(RESETS):
        seen, info = env.reset(seed=seed)
        promised = info["phi"]["task"]
        cube, target = seen["achieved_goal"], seen["desired_goal"]
        starts[seed] = cube.tobytes() + target.tobytes()
        off.append(max(abs(0.05 - math.dist(cube, target) - promised), abs(env.phi_now()["task"] - promised)))
        agreed += bool(env.unwrapped.task.is_success(cube, target)) == (promised >= 0)
        for _ in range(STEPS):
            seen, *_ = env.step(np.zeros(3, dtype=np.float32))
        moved.append(1e3 * math.dist(seen["achieved_goal"], cube))
    print(f"phi off by at most {max(off):.1e}; moved {max(moved):.3f} mm in {STEPS} steps")
    assert len(set(starts.values())) > 0.9 * RESETS and agreed == RESETS  # two seeds may choose one of the 4,096
    assert max(off) < 1e-6 and max(moved) < 0.1
    seen, _ = env.reset(seed=7)
    assert seen["achieved_goal"].tobytes() + seen["desired_goal"].tobytes() == starts[7]


def test_a_strategy_hears_of_episodes(page):
    lessons = strategy("self_paced", phi_space(page["spec"]), np.random.default_rng(0))
    env = started(page, lessons)
    for _ in range(3):
        env.reset()
        over = False
        while not over:
            _, _, terminated, truncated, info = env.step(np.zeros(3, dtype=np.float32))
            over = terminated or truncated
        assert info["outcome"]["success"] == info["is_success"] and info["outcome"]["steps"] <= 50
    assert lessons.state() != strategy("self_paced", phi_space(page["spec"]), np.random.default_rng(0)).state()


WORLD = """
import gymnasium, panda_gym
from scenegen.cli.app import run
from scenegen.gym import SceneResets
from tests.play.layouts.recipes import example

put = example("panda_gym")["put"]

def make(task):
    calls = {"put": put, "observe": lambda env: env._get_obs()}
    return SceneResets(gymnasium.make("PandaPush-v3"), task.spec, quaternion="xyzw", origins="middle", **calls)

def act(observation, instruction):
    return [0.0, 0.0, 0.0]
"""


def test_a_suite_runs_in_it(page, tmp_path):
    """Every start is missed, as it promises, by a policy that does nothing."""
    (tmp_path / "push.spec").write_text(page["spec"].source)
    (tmp_path / "world.py").write_text(f"import sys\nsys.path.insert(0, {str(ROOT)!r})\n{WORLD}")
    words = f"new {tmp_path}/push.spec --bands 2 -n 2 --out {tmp_path}/mine"
    assert run(["suite", *words.split()]) == 0
    words = f"run {tmp_path}/mine --world {tmp_path}/world.py:make --policy {tmp_path}/world.py:act --steps 5"
    assert run(["suite", *words.split(), "--out", str(tmp_path / "none.jsonl")]) == 0
    lines = [json.loads(line) for line in (tmp_path / "none.jsonl").read_text().splitlines()][1:]
    assert [(line["success"], line["steps"], line["error"]) for line in lines] == [(False, 5, None)] * 4
