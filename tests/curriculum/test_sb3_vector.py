"""The adapter to Stable-Baselines3 says what the environment under it says."""

import numpy as np
import pytest
from gymnasium import error
from stable_baselines3.common.vec_env import VecMonitor

from scenegen.learn.curriculum.sb3 import SB3Vector
from scenegen.learn.curriculum.tabletop import TableTopVector

SPEC = "object mug, plate\ntask: closeTo(mug, plate, 0.1)"
TABLES, LIMIT = 6, 8


def make(mode="SameStep", **settings):
    return TableTopVector(TABLES, SPEC, moves="continuous", max_episode_steps=LIMIT, autoreset_mode=mode, **settings)


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
    for _ in range(2 * LIMIT):
        _, _, _, infos = env.step(np.zeros((TABLES, 4), dtype=np.float32))
        episodes += [info["episode"] for info in infos if "episode" in info]
    assert (
        len(episodes) == 2 * TABLES
        and {one["l"] for one in episodes} == {LIMIT}
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
