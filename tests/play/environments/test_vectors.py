"""The batched environment does what as many single ones do, step for step and in every mode of autoreset. The batched
environment over time does what as many single ones do, to the bit, in every mode of autoreset. The adapter to
Stable-Baselines3 says what the environment under it says.
"""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium import error
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from stable_baselines3.common.vec_env import VecMonitor

import scenegen
from scenegen.curriculum import Curriculum, MotionTable, MotionVector, TableTopVector, VectorCurriculum
from scenegen.play.environments.sb3 import SB3Vector
from scenegen.play.strategies import strategy

SPECS = {
    "plain": "leftOf(mug, plate)",
    "heading": "angle(knife, NORTH, 0.2) & leftOf(knife, plate)",
    "two": "near: closeTo(mug, plate, 0.2)\nside: leftOf(mug, plate)",
    "require": "object mug = box(0.1, 0.1, 0.1)\nobject plate = box(0.1, 0.1, 0.1)\nrequire noOverlap()\n"
    "task: leftOf(mug, plate)",
}
COUNT, LIMIT = 5, 6


def same(one, other, path="info"):
    """Both hold the same, to the last bits of sine and cosine."""
    if isinstance(one, dict):
        assert set(one) == set(other), path
        for key in one:
            same(one[key], other[key], f"{path}.{key}")
    elif isinstance(one, np.ndarray) and one.dtype == object:
        assert [value is None for value in one] == [value is None for value in other], path
        for a, b in zip(one, other, strict=True):
            if a is not None:
                same(a, b, path)
    else:
        assert np.asarray(one).dtype == np.asarray(other).dtype, path
        np.testing.assert_allclose(
            one, other, atol=1e-6 if np.asarray(one).dtype == np.float32 else 1e-12, err_msg=path
        )


@pytest.mark.long
@pytest.mark.parametrize("mode", list(AutoresetMode), ids=lambda mode: mode.value)
@pytest.mark.parametrize(
    "name, moves", [("plain", "grid"), ("heading", "continuous"), ("two", "grid"), ("require", "grid")]
)
def test_it_is_as_single_ones(name, moves, mode):
    settings = {"spec": SPECS[name], "moves": moves, "reward": "dense", "step": 0.15, "phi": (-0.3, -0.01)}
    many = gymnasium.make_vec(
        "scenegen/TableTop-v0", num_envs=COUNT, max_episode_steps=LIMIT, autoreset_mode=mode, **settings
    )
    assert isinstance(many.unwrapped, TableTopVector)
    single = SyncVectorEnv(
        [lambda: gymnasium.make("scenegen/TableTop-v0", max_episode_steps=LIMIT, **settings)] * COUNT,
        autoreset_mode=mode,
    )
    assert many.single_action_space == single.single_action_space
    assert many.observation_space == single.observation_space
    same(many.reset(seed=3)[1], single.reset(seed=3)[1])
    many.action_space.seed(0)
    ended = np.zeros(3, dtype=int)
    for _ in range(36):
        actions = many.action_space.sample()
        ours, theirs = many.step(actions), single.step(actions)
        same(dict(enumerate(ours)), dict(enumerate(theirs)))
        over = ours[2] | ours[3]
        ended += [over.sum(), ours[2].sum(), ours[3].sum()]
        if mode is AutoresetMode.DISABLED and over.any():
            ours = many.reset(options={"reset_mask": over.copy()})
            theirs = single.reset(options={"reset_mask": over.copy()})
            same(dict(enumerate(ours)), dict(enumerate(theirs)))
            assert ours[1]["_phi"].tolist() == over.tolist()
    assert (ended > 2).all()  # by success or off the table, and by the limit


def test_make_vec_uses_it_and_single_ones_on_request():
    assert isinstance(gymnasium.make_vec("scenegen/TableTop-v0", 2, spec=SPECS["plain"]).unwrapped, TableTopVector)
    envs = gymnasium.make_vec("scenegen/TableTop-v0", 2, vectorization_mode="sync", spec=SPECS["plain"])
    assert isinstance(envs, SyncVectorEnv)


def test_in_other_processes():
    envs = gymnasium.make_vec("scenegen/TableTop-v0", 2, vectorization_mode="async", spec=SPECS["plain"])
    here = gymnasium.make_vec("scenegen/TableTop-v0", 2, spec=SPECS["plain"])
    try:
        same(envs.reset(seed=0, options={"phi": (-0.2, -0.1)})[0], here.reset(seed=0, options={"phi": (-0.2, -0.1)})[0])
        for _ in range(3):
            same(envs.step(np.array([1, 1]))[0], here.step(np.array([1, 1]))[0])
    finally:
        envs.close()


def test_options_are_for_all_tables():
    envs = TableTopVector(4, SPECS["plain"])
    _, infos = envs.reset(seed=0, options={"phi": (-0.2, -0.1)})
    assert ((infos["phi"]["task"] >= -0.2) & (infos["phi"]["task"] <= -0.1)).all()
    assert infos["task"]["task"].tolist() == [[-0.2, -0.1]] * 4
    assert len(set(infos["phi"]["task"].tolist())) == 4


def test_what_was_handed_out_stays_as_it_is():
    envs = TableTopVector(3, SPECS["plain"], autoreset_mode="SameStep")
    seen, infos = envs.reset(seed=0)
    kept, phi = seen.copy(), infos["phi"]["task"].copy()
    for _ in range(30):
        envs.step([1, 1, 1])
    np.testing.assert_array_equal(seen, kept)
    np.testing.assert_array_equal(infos["phi"]["task"], phi)


NAME = "scenegen.curriculum:scenegen/Motion-v0"
TABLES = 5
CARRY = """object mug, plate at (0.5, 0.5)
time 4 steps
require speed(mug) <= 20 cm/s
require noOverlap()
task: (eventually closeTo(mug, plate, 25 cm)) & (finally farFrom(mug, plate, 35 cm))
calm: always farFrom(mug, plate, 10 cm)
"""
ALL = """object mug, knife
time [0, 2.5 s] every 0.5 s
moves all
require speed(mug) <= 40 cm/s & speed(knife) <= 20 cm/s & spin(knife) <= 60 deg/s
task: (next rightOf(mug, knife)) & (!facing(knife, mug) until[0, 1 s] closeTo(mug, knife, 30 cm))
"""
PAIR = """object mug, cup
time 5 steps
moves one
require speed(mug) <= 15 cm/s & speed(cup) <= 25 cm/s & spin(cup) <= 90 deg/s
require farFrom(mug, cup, 15 cm)
order: (closeTo(mug, (0.8, 0.5), 30 cm)) until_with[1, 4] (angle(cup, NORTH, 60 deg) | still(mug))
"""
STUCK = """object mug, plate at (0.5, 0.5)
time 5 steps
require speed(mug) <= 20 cm/s & displacement(mug) >= 4 cm
require farFrom(mug, plate, 20 cm)
task: finally closeTo(mug, plate, 25 cm)
"""
MOTIONS = {"carry": CARRY, "all": ALL, "pair": PAIR, "stuck": STUCK}


def source(text: str, count: int = 40) -> Any:
    return scenegen.sample_motions(scenegen.parse(text), None, count, seed=2, spread="base")


def same_motion_vector(one: Any, other: Any, path: str = "info") -> None:
    """Both hold the same, to the bit."""
    if isinstance(one, dict):
        assert set(one) == set(other), path
        for key in one:
            same_motion_vector(one[key], other[key], f"{path}.{key}")
    elif isinstance(one, np.ndarray) and one.dtype == object:
        assert [value is None for value in one] == [value is None for value in other], path
        for a, b in zip(one, other, strict=True):
            if a is not None:
                same_motion_vector(a, b, path)
    else:
        assert np.asarray(one).dtype == np.asarray(other).dtype, path
        np.testing.assert_array_equal(one, other, err_msg=path)


@pytest.mark.long
@pytest.mark.parametrize("mode", list(AutoresetMode), ids=lambda mode: mode.value)
@pytest.mark.parametrize(
    ("name", "moves", "reward", "limit"),
    [
        ("carry", "grid", "gain", None),
        ("carry", "continuous", "final", 3),
        ("all", "continuous", "gain", None),
        ("all", "grid", "final", None),
        ("pair", "continuous", "gain", 4),
        ("stuck", "grid", "gain", None),
    ],
)
def test_it_is_as_single_ones_motion_vector(
    name: str, moves: str, reward: str, limit: int | None, mode: AutoresetMode
) -> None:
    settings = {
        "spec": MOTIONS[name], "moves": moves, "reward": reward,
        "source": source(MOTIONS[name]), "phi": (None, None),
    }  # fmt: skip
    more = {} if limit is None else {"max_episode_steps": limit}
    many = gymnasium.make_vec(NAME, num_envs=TABLES, autoreset_mode=mode, **more, **settings)
    assert isinstance(many.unwrapped, MotionVector)
    single = SyncVectorEnv([lambda: gymnasium.make(NAME, **more, **settings)] * TABLES, autoreset_mode=mode)
    assert many.single_action_space == single.single_action_space
    assert many.observation_space == single.observation_space
    same_motion_vector(dict(enumerate(many.reset(seed=3))), dict(enumerate(single.reset(seed=3))))
    many.action_space.seed(0)
    ended, moments, flags = 0, set(), dict.fromkeys(("blocked", "violated", "is_success"), 0)
    for _ in range(40):
        actions = many.action_space.sample()
        ours, theirs = many.step(actions), single.step(actions)
        same_motion_vector(dict(enumerate(ours)), dict(enumerate(theirs)))
        for number in range(TABLES):
            same_motion_vector(many.unwrapped.motion(number), single.envs[number].unwrapped.motion)
        over = ours[2] | ours[3]
        ended += int(over.sum())
        moments.add(tuple(ours[4]["moment"].tolist()))
        for flag in flags:
            last = ours[4]["final_info"] if "final_info" in ours[4] else ours[4]
            flags[flag] += int(last[flag].sum())
        if mode is AutoresetMode.DISABLED and over.any():
            ours = many.reset(options={"reset_mask": over.copy()})
            theirs = single.reset(options={"reset_mask": over.copy()})
            same_motion_vector(dict(enumerate(ours)), dict(enumerate(theirs)))
    assert ended > TABLES and len(moments) >= 3
    if name == "stuck":
        assert flags["blocked"] and flags["violated"]
    if name in ("all", "stuck"):
        assert any(len(set(one)) > 1 for one in moments), "no motion has ended before the others"


def test_options_and_given_scenes() -> None:
    motions = source(CARRY)
    many = MotionVector(3, CARRY, source=motions)
    single = SyncVectorEnv([lambda: MotionTable(CARRY, source=motions)] * 3)
    for options in (
        {"phi": {"task": (-0.5, 0.0)}},
        {"phi": (5.0, 6.0), "nearest": True},
        {"scene": {"mug": (0.3, 0.4, 0.0)}},
    ):
        same_motion_vector(dict(enumerate(many.reset(seed=[4, 9, 1], options=options))),
             dict(enumerate(single.reset(seed=[4, 9, 1], options=options))))  # fmt: skip
    kept = many.reset(seed=1)[0].copy()
    with pytest.raises(error.InvalidBound, match="no-start-in-file"):
        many.reset(options={"phi": (5.0, 6.0)})
    with pytest.raises(error.Error, match="unknown-choice"):
        many.reset(options={"fi": (5.0, 6.0)})
    same_motion_vector(many.episodes.seen(), kept)


def test_what_is_refused() -> None:
    with pytest.raises(error.Error, match="not-over-time"):
        MotionVector(2, "leftOf(mug, plate)")
    with pytest.raises(error.Error, match="unknown-choice"):
        MotionVector(2, CARRY, autoreset_mode="Sometimes")
    for wrong in (0, -1, 2.5, "two"):
        with pytest.raises(error.Error):
            MotionVector(wrong, CARRY)  # type: ignore[arg-type]
    many = MotionVector(2, CARRY, source=source(CARRY, 4), phi=(None, None), autoreset_mode="Disabled")
    with pytest.raises(error.ResetNeeded):
        many.step([0, 0])
    with pytest.raises(error.Error, match="wrong-value"):
        many.reset(seed="one")  # type: ignore[arg-type]
    many.reset(seed=0)
    for actions in ([0], [0, 9], [0.5, 0.5], None):
        with pytest.raises(error.InvalidAction):
            many.step(actions)
    with pytest.raises(error.ResetNeeded):
        for _ in range(5):
            many.step([0, 0])


def test_what_was_returned_stays_as_it_is() -> None:
    many = MotionVector(3, CARRY, source=source(CARRY), phi=(None, None), autoreset_mode="SameStep")
    seen, infos = many.reset(seed=0)
    kept, task, start = seen.copy(), infos["task"]["task"].copy(), infos["start"]["task"].copy()
    for _ in range(12):
        many.step([1, 2, 0])
    np.testing.assert_array_equal(seen, kept)
    np.testing.assert_array_equal(infos["task"]["task"], task)
    np.testing.assert_array_equal(infos["start"]["task"], start)


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_a_curriculum_hears_the_same_of_many_as_of_one(mode: str) -> None:
    settings = {"spec": CARRY, "source": source(CARRY), "phi": (None, None)}
    many = MotionVector(1, autoreset_mode=mode, **settings)
    one = MotionTable(**settings)
    ours, theirs = ([] for _ in range(2))
    lessons = [strategy("self_paced", one.space, np.random.default_rng(0)) for _ in range(2)]
    many, one = VectorCurriculum(many, lessons[0]), Curriculum(one, lessons[1])
    many.reset(seed=1)
    one.reset(seed=1)
    actions = np.random.default_rng(5)
    for _ in range(12):
        over = False
        while not over:
            action = int(actions.integers(5))
            seen, _, over, _, info = one.step(action)
            found, _, ended, _, infos = many.step([action])
            assert bool(ended[0]) == over
            if mode == "NextStep":
                same_motion_vector(found[0], seen)
        last = infos["final_info"] if mode == "SameStep" else infos
        ours.append(last["outcome"][0])
        theirs.append(info["outcome"])
        one.reset()
        if mode == "NextStep":
            many.step([0])
    assert ours == theirs and len({outcome["phi"][0] for outcome in ours}) > 3


@pytest.mark.long
def test_stable_baselines() -> None:
    pytest.importorskip("stable_baselines3")
    from scenegen.curriculum import SB3Vector

    many = MotionVector(4, CARRY, source=source(CARRY), phi=(None, None), autoreset_mode="SameStep")
    tables = SB3Vector(many)
    tables.seed(3)
    tables.reset()
    ends = 0
    for _ in range(8):
        _, _, over, infos = tables.step(np.zeros(4, dtype=int))
        for number in np.flatnonzero(over):
            assert infos[number]["terminal_observation"].shape == tables.observation_space.shape
            assert infos[number]["moment"] <= 4 and set(infos[number]["start"]) == {"task", "calm"}
            ends += 1
    assert ends >= 8


SPEC = "object mug, plate\ntask: closeTo(mug, plate, 0.1)"
TABLES, STEPS = 6, 8


def make(mode="SameStep", **settings):
    return TableTopVector(TABLES, SPEC, moves="continuous", max_episode_steps=STEPS, autoreset_mode=mode, **settings)


def test_it_steps_as_what_is_under_it():
    plain, adapted = make(), SB3Vector(make())
    adapted.seed(3)
    seen, _ = plain.reset(seed=[3 + k for k in range(TABLES)])
    assert (adapted.reset() == seen).all()
    rng, ends = np.random.default_rng(0), {"truncated": 0, "success": 0, "off": 0}
    for _ in range(60):
        actions = rng.uniform(-1.0, 1.0, (TABLES, 4)).astype(np.float32)
        seen, reward, terminated, truncated, infos = plain.step(actions)
        seen_too, reward_too, over, told = adapted.step(actions)
        assert (seen_too == seen).all() and (reward_too == reward).all() and (over == (terminated | truncated)).all()
        for k in range(TABLES):
            if not over[k]:
                assert told[k] == {}
                continue
            last = infos["final_info"]
            assert (told[k]["terminal_observation"] == infos["final_obs"][k]).all()
            assert told[k]["TimeLimit.truncated"] == (truncated[k] and not terminated[k])
            assert told[k]["is_success"] == last["is_success"][k] and told[k]["off_table"] == last["off_table"][k]
            assert told[k]["phi"] == {"task": last["phi"]["task"][k]} and (told[k]["phi"]["task"] >= 0) == (
                reward[k] > 0
            )
            ends["truncated"] += told[k]["TimeLimit.truncated"]
            ends["success"] += bool(told[k]["is_success"])
            ends["off"] += bool(told[k]["off_table"])
    assert min(ends.values()) > 0, f"an episode of each kind has to end for this to show anything: {ends}"


def test_seeds_are_for_one_reset():
    one, two = SB3Vector(make()), SB3Vector(make())
    one.seed(5)
    two.seed(5)
    assert (one.reset() == two.reset()).all()
    first = one.reset()
    assert (first == two.reset()).all()
    one.seed(5)
    assert not (one.reset() == first).all()
    assert set(one.reset_infos[0]) == {"phi", "is_success", "off_table", "blocked", "task"}


def test_sb3s_own_monitor_counts_episodes():
    env = VecMonitor(SB3Vector(make()))
    env.reset()
    episodes = []
    for _ in range(2 * STEPS):
        _, _, _, infos = env.step(np.zeros((TABLES, 4), dtype=np.float32))
        episodes += [info["episode"] for info in infos if "episode" in info]
    assert (
        len(episodes) == 2 * TABLES
        and {one["l"] for one in episodes} == {STEPS}
        and {one["r"] for one in episodes} == {0}
    )


def test_what_is_said_of_all_tables_at_once():
    env = SB3Vector(make())
    assert env.get_attr("num_envs") == [TABLES] * TABLES and env.get_attr("views", [0, 2]) == [env.env.views] * 2
    assert env.env_is_wrapped(VecMonitor) == [False] * TABLES and env.render_mode is None
    env.set_attr("anything", 3)
    assert env.get_attr("anything", 1) == [3]
    with pytest.raises(
        error.Error, match="`anything` is set for single tables, which is not possible: they are one environment"
    ):
        env.set_attr("anything", 3, indices=[1])
    with pytest.raises(error.Error, match="single tables"):
        env.env_method("render")
    env.set_options({"phi": (-0.2, -0.1)})
    with pytest.raises(error.Error, match="options are given to single tables"):
        env.reset()
    env.close()


@pytest.mark.parametrize("mode", ["NextStep", "Disabled"])
def test_other_modes_are_refused(mode):
    with pytest.raises(error.Error, match='autoreset_mode="SameStep"'):
        SB3Vector(make(mode))
