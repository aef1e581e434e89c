"""The batched environment does what as many single ones do, step for step and in every mode of autoreset; the adapter
to Stable-Baselines3 says what the environment under it says."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest
from gymnasium import error
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from stable_baselines3.common.vec_env import VecMonitor

from scenegen.curriculum import TableTopVector
from scenegen.play.environments.sb3 import SB3Vector

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
