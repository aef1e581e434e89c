"""`scenegen/Motion-v0`: rewards sum up to phi, the spec bounds steps, seeds decide, bad requests are refused."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium import error
from gymnasium.utils.env_checker import check_env

import scenegen
from scenegen.curriculum import Curriculum, MotionTable
from scenegen.play.strategies import strategy
from scenegen.sampling.motions.bounds import step_bounds

NAME = "scenegen.curriculum:scenegen/Motion-v0"
CARRY = """object mug, plate at (0.5, 0.5)
time 4 steps
require speed(mug) <= 20 cm/s
require noOverlap()
task: (eventually closeTo(mug, plate, 25 cm)) & (finally farFrom(mug, plate, 35 cm))
calm: always farFrom(mug, plate, 10 cm)
"""
ALL = """object mug, knife
time [0, 2 s] every 0.5 s
moves all
require speed(mug) <= 40 cm/s & speed(knife) <= 20 cm/s & spin(knife) <= 60 deg/s
task: (next rightOf(mug, knife)) & (!facing(knife, mug) until[0, 1 s] closeTo(mug, knife, 30 cm))
"""


def start(env: MotionTable, rng: np.random.Generator, fixed: tuple[int, ...] = ()) -> np.ndarray:
    """A first scene that the spec allows, without sampling motions."""
    while True:
        poses = rng.random((len(env.scenes.objects), 3)) * [1.0, 1.0, 2.0 * math.pi]
        for index in fixed:
            poses[index] = env.scenes.definition.fixed[index]
        try:
            env.reset(options={"scene": poses})
        except error.Error:
            continue
        return poses


def episode(env: MotionTable) -> tuple[float, dict[str, Any]]:
    total, over, info = 0.0, False, {}
    while not over:
        seen, reward, over, late, info = env.step(env.action_space.sample())
        assert seen in env.observation_space and not late
        total += reward
    return total, info


@pytest.mark.parametrize("moves", ["grid", "continuous"])
@pytest.mark.parametrize("reward", ["gain", "final"])
@pytest.mark.parametrize(("text", "fixed"), [(CARRY, (1,)), (ALL, ())])
def test_rewards_sum_up_to_phi(text: str, fixed: tuple[int, ...], reward: str, moves: str) -> None:
    env = MotionTable(text, moves=moves, reward=reward)
    env.action_space.seed(7)
    rng, phi = np.random.default_rng(3), env.scenes.trace_robustness()
    radius, turn = step_bounds(env.scenes.over_time)
    early = 0
    for _ in range(6):
        first = start(env, rng, fixed)
        total, info = episode(env)
        motion = env.motion
        assert np.array_equal(motion[0], first) and info["moment"] == len(motion) - 1
        left = env.scenes.horizon.moments - len(motion)
        early += left > 0
        whole = np.concatenate([motion, np.repeat(motion[-1:], left, axis=0)])  # an early end: nothing to come matters
        found = phi(torch.tensor(whole[None]))[0].tolist()
        lowest = min(found)
        assert not info["violated"] and phi.required(torch.tensor(whole[None])).item() >= 0.0
        assert total == pytest.approx(lowest, abs=1e-12)
        assert min(info["phi"].values()) == pytest.approx(lowest, abs=1e-12)
        assert info["is_success"] == (lowest >= 0.0)
        steps = np.diff(motion, axis=0)
        assert (np.hypot(steps[..., 0], steps[..., 1]) <= radius).all()
        if env.scenes.moves == "one":
            assert ((steps != 0.0).any(axis=2).sum(axis=1) <= 1).all()
        assert (np.abs(np.remainder(steps[..., 2] + math.pi, 2 * math.pi) - math.pi) <= np.minimum(turn, 9.0)).all()


def test_bounds_of_phi_only_narrow() -> None:
    env = MotionTable(CARRY, goal="task")
    env.action_space.seed(1)
    start(env, np.random.default_rng(0), (1,))
    low, high, over = -math.inf, math.inf, False
    while not over:
        _, _, over, _, info = env.step(env.action_space.sample())
        assert low - 1e-12 <= info["phi"]["task"] <= info["phi_high"]["task"] <= high + 1e-12
        low, high = info["phi"]["task"], info["phi_high"]["task"]
    assert low == high


def test_memory_is_seen() -> None:
    """Two ways to the same scene at the same time: one has visited the place, the other has not."""
    text = """object mug
    time 4 steps
    require speed(mug) <= 20 cm/s
    task: (eventually closeTo(mug, (0.3, 0.5), 5 cm)) & (eventually closeTo(mug, (0.9, 0.5), 5 cm))"""
    env = MotionTable(text)
    seen = []
    for actions in ((2, 1), (3, 4)):  # there and back along x, along y
        env.reset(options={"scene": {"mug": (0.5, 0.5, 0.0)}})
        for action in actions:
            last = env.step(action)[0]
        seen.append(dict(zip(env.names, last.tolist(), strict=True)))
    one, other = seen
    assert one["mug.x"] == pytest.approx(other["mug.x"]) and one["time left"] == other["time left"] == 0.5
    assert any(one[name] > other[name] + 0.05 for name in env.names if name.endswith("least"))


def test_what_the_requirement_forbids_is_not_done() -> None:
    text = """object mug, plate at (0.5, 0.5)
    time 3 steps
    require speed(mug) <= 20 cm/s
    require farFrom(mug, plate, 20 cm)
    task: finally closeTo(mug, plate, 25 cm)"""
    env = MotionTable(text)
    env.reset(options={"scene": {"mug": (0.29, 0.5, 0.0)}})
    _, _, _, _, info = env.step(list(env.moves.names).index("mug x +"))
    assert info["blocked"] and np.array_equal(env.motion[0], env.motion[1]) and not info["violated"]
    env = MotionTable(text.replace("require farFrom", "require displacement(mug) >= 1 cm\n    require farFrom"))
    env.reset(options={"scene": {"mug": (0.29, 0.5, 0.0)}})
    _, _, over, _, info = env.step(0)
    assert over and info["violated"] and not info["is_success"]


def test_an_episode_goes_on_while_the_requirement_needs_steps() -> None:
    """phi is known at once, but what is required is not yet done."""
    text = """object mug
    time 3 steps
    require speed(mug) <= 20 cm/s
    require {}
    task: initially leftOf(mug, (0.5, 0.5))"""
    lengths = []
    for required in ("true", "displacement(mug) >= 1 cm"):
        env = MotionTable(text.format(required))
        env.reset(options={"scene": {"mug": (0.4, 0.5, 0.0)}})
        over = False
        while not over:
            _, _, over, _, info = env.step(1)
        assert info["is_success"]
        lengths.append(info["moment"])
    assert lengths == [1, 3]


def test_gymnasium_and_seeds() -> None:
    env = gymnasium.make(NAME, spec=CARRY, goal="task").unwrapped
    check_env(env, skip_render_check=True)
    first, info = env.reset(seed=5, options={"phi": (0.0, 0.05)})
    assert info["task"]["task"].tolist() == [0.0, 0.05] and info["phi_high"]["task"] >= 0.0
    others = [env.reset(options={"phi": (0.0, 0.05)})[0] for _ in range(3)]
    assert np.array_equal(first, env.reset(seed=5, options={"phi": (0.0, 0.05)})[0])
    again = [env.reset(options={"phi": (0.0, 0.05)})[0] for _ in range(3)]
    assert np.array_equal(others, again) and len(np.unique([first, *others], axis=0)) == 4


def test_several_one_after_another_are_the_same_as_single_ones() -> None:
    motions = scenegen.sample_motions(scenegen.parse(CARRY), {"task": (-0.3, 0.02)}, 40, seed=2)
    settings = {"spec": CARRY, "source": motions, "phi": (None, None)}
    many = gymnasium.make_vec(NAME, 2, vectorization_mode="sync", **settings)
    single = [MotionTable(**settings) for _ in range(2)]
    seen, infos = many.reset(seed=3)
    alone = [env.reset(seed=3 + k) for k, env in enumerate(single)]
    for action in (1, 4, 0):
        assert np.array_equal(seen, [found[0] for found in alone])
        assert infos["phi"]["task"].tolist() == [found[-1]["phi"]["task"] for found in alone]
        seen, reward, _, _, infos = many.step([action, action])
        alone = [env.step(action) for env in single]
        assert reward.tolist() == [found[1] for found in alone]
    many.close()


def test_starts_of_a_file(tmp_path: Path) -> None:
    spec = scenegen.parse(CARRY)
    motions = scenegen.sample_motions(spec, {"task": (0.0, None), "calm": (0.0, None)}, 3, seed=2)
    env = MotionTable(spec, source=motions.save(tmp_path / "motions.jsonl"))
    met = []
    env.reset(seed=0)
    for _ in range(3):
        met.append(env.motion[0])
        env.reset()
    assert np.array_equal(np.sort(np.array(met), axis=0), np.sort(motions.poses[:, 0], axis=0))
    with pytest.raises(error.InvalidBound, match="no-start-in-file"):
        env.reset(options={"phi": {"task": (-0.2, -0.1)}})
    with pytest.raises(error.Error, match="motions-of-another-spec"):
        MotionTable(CARRY.replace("4 steps", "3 steps"), source=motions)


@pytest.mark.parametrize("name", ["self_paced", "alp_gmm"])
def test_strategies_choose_phi_of_motions(name: str) -> None:
    spec = scenegen.parse(CARRY)
    motions = scenegen.sample_motions(spec, {"task": (-0.3, 0.02)}, 40, seed=2)
    env = gymnasium.make(NAME, spec=spec, source=motions, phi=(None, None))
    env.action_space.seed(0)
    space = env.unwrapped.space
    lowest, highest = min(motions.phi["task"]), max(motions.phi["task"])
    assert (space.low[0], space.high[0]) == pytest.approx((lowest, highest), abs=1e-12)
    lessons = strategy(name, space, np.random.default_rng(0))
    env = Curriculum(env, lessons)
    env.reset(seed=1)
    for _ in range(12):
        over = False
        while not over:
            _, _, over, _, info = env.step(env.action_space.sample())
        outcome = info["outcome"]
        assert tuple(outcome["phi"]) == tuple(info["start"].values())
        assert env.unwrapped.motion[0].tolist() in motions.poses[:, 0].tolist()
        env.reset()


def test_a_curriculum_needs_motions() -> None:
    with pytest.raises(error.Error, match="missing-argument"):
        _ = MotionTable(CARRY).space


BAD_SETTINGS = [
    ({"spec": "leftOf(mug, plate)"}, "not-over-time"),
    ({"spec": "object mug\ntime 3 steps\ntask: finally leftOf(mug, (0.5, 0.5))"}, "no-bound-on-steps"),
    (
        {"spec": "object mug\ntime 3 steps\nrequire speed(mug) <= 0 m/s\ntask: finally leftOf(mug, (0.4, 0.5))"},
        "nothing-to-move",
    ),
    ({"goal": "order"}, "unknown-label"),
    ({"goal": []}, "wrong-value"),
    ({"share": 0.0}, "out-of-range"),
    ({"share": "half"}, "wrong-value"),
    ({"share": math.nan}, "out-of-range"),
    ({"moves": "fly"}, "unknown-choice"),
    ({"reward": "dense"}, "unknown-choice"),
    ({"phi": (math.nan, 1.0)}, "range-not-a-pair"),
    ({"phi": {"order": (0.0, 1.0)}}, "unknown-label"),
    ({"source": 3}, "wrong-value"),
    ({"source": "nowhere.jsonl"}, "cannot-read"),
    ({"render_mode": "human"}, "unknown-choice"),
    ({"render_mode": "rgb_array", "view": "tap"}, "unknown-choice"),
    ({"render_mode": "rgb_array", "size": (4, 4)}, "out-of-range"),
]


@pytest.mark.parametrize(("settings", "code"), BAD_SETTINGS)
def test_bad_settings_are_refused(settings: dict[str, Any], code: str) -> None:
    with pytest.raises(error.Error) as found:
        MotionTable(**{"spec": CARRY, **settings})
    assert found.value.diagnostic.code == code  # type: ignore[attr-defined]


BAD_OPTIONS = [
    ({"phi": (3.0, 4.0)}, "beyond-bounds"),
    ({"start": 1}, "unknown-choice"),
    ({"nearest": True}, "wrong-value"),
    ({"scene": {"mug": (9.0, 0.5, 0.0)}}, "not-a-first-scene"),
    ({"scene": {"mug": (0.5, 0.5, 0.0)}}, "not-a-first-scene"),
    ({"scene": {"cup": (0.5, 0.5, 0.0)}}, "unknown-object"),
    ({"scene": np.zeros((4, 3))}, "wrong-value"),
    ({"scene": np.full((2, 3), math.nan)}, "wrong-value"),
    ({"scene": 3}, "wrong-value"),
]


@pytest.mark.parametrize(("options", "code"), BAD_OPTIONS)
def test_bad_options_are_refused(options: dict[str, Any], code: str) -> None:
    with pytest.raises(error.Error) as found:
        MotionTable(CARRY).reset(seed=0, options=options)
    assert found.value.diagnostic.code == code  # type: ignore[attr-defined]


def test_bad_actions_and_times_are_refused() -> None:
    env = MotionTable(CARRY)
    with pytest.raises(error.ResetNeeded):
        env.step(0)
    start(env, np.random.default_rng(0), (1,))
    for action in (5, -1, 0.5, None):
        with pytest.raises(error.InvalidAction):
            env.step(action)
    episode(env)
    with pytest.raises(error.ResetNeeded):
        env.step(0)
    with pytest.raises(error.Error, match="scenegen/Motion-v0"):
        gymnasium.make("scenegen.curriculum:scenegen/TableTop-v0", spec=CARRY)
