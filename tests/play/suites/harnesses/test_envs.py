"""The environments of a suite in Gymnasium, as LeRobot gets them: which start begins when, whatever was before."""

import numpy as np
import pytest

from scenegen.errors import DataError, RequestError, ScenegenError
from scenegen.errors.worlds import NOT_A_SUITE, WORLD_FAILS
from scenegen.play.suites.harnesses.groups import group_name
from scenegen.play.suites.harnesses.lerobot import make_suite_envs
from scenegen.play.suites.run import Player
from scenegen.play.suites.suite import Suite

from . import worlds

WORLD = f"{worlds.__name__}:Forgetful"


def envs_of(folder, n=3, world=WORLD, **given):
    found = make_suite_envs(folder, world, n, **given)
    group = group_name(Suite.load(folder, reverse=given.get("reverse", False)))
    assert list(found) == [group] and list(found[group]) == [0]
    return found[group][0]


def poses_of(observation):
    return [row.tobytes() for row in observation["environment_state"]]


@pytest.fixture
def poses(small):
    """The bytes of the poses of each start."""
    return [start.poses.tobytes() for start in Suite.load(small)]


def test_an_observation_has_the_names_of_lerobot(small):
    envs = envs_of(small, 2)
    observation, info = envs.reset()
    assert {name: part.shape for name, part in observation.items() if name != "pixels"} == {
        "agent_pos": (2, 7),
        "environment_state": (2, 14),
    }
    assert observation["pixels"]["eye"].shape == (2, 8, 8, 3) and observation["pixels"]["eye"].dtype == np.uint8
    start = Suite.load(small)[1]
    assert (info["start"][1], info["band"][1], info["phi"][1]) == (1, start.band, start.phi["goal"])
    assert envs.call("task") == ("beside",) * 2 and envs.call("task_description") == (start.task.instruction,) * 2
    assert (envs.envs[0].render() == observation["pixels"]["eye"][0]).all()
    assert envs.observation_space.contains(observation)


@pytest.mark.parametrize("asynchronous", [False, pytest.param(True, marks=pytest.mark.long)])
@pytest.mark.parametrize("n", [1, 2, 3, 4])
def test_resets_begin_starts_in_order_whatever_ended_between(small, poses, n, asynchronous):
    """As LeRobot's loop does it: environments that are done are stepped on, and begin other starts by themselves."""
    envs = envs_of(small, n, use_async_envs=asynchronous)
    for batch in range(5):
        observation, info = envs.reset(seed=[1000 + batch * n + k for k in range(n)])
        wanted = [(batch * n + k) % 6 for k in range(n)]
        assert info["start"].tolist() == wanted and poses_of(observation) == [poses[i] for i in wanted]
        actions = [worlds.stops(batch * n + k) for k in range(n)]
        for _ in range(20):
            envs.step(np.array([next(one) for one in actions]))
    for seed in (1000, 1000, 5000, 999):  # other evaluations
        assert envs.reset(seed=seed)[1]["start"][0] == 0
    envs.close()


@pytest.mark.parametrize("n", [1, 2, 3])
def test_automatic_resets_skip_and_repeat_no_start(small, poses, n):
    """A loop that resets once: episode j of environment k has start k + j n."""
    envs = envs_of(small, n)
    observation, info = envs.reset()
    begun = [[(info["start"][k], poses_of(observation)[k])] for k in range(n)]
    actions = [worlds.stops(k) for k in range(n)]
    for _ in range(150):
        observation, _, terminated, truncated, info = envs.step(np.array([next(one) for one in actions]))
        for k in np.flatnonzero(terminated | truncated):
            begun[k].append((info["start"][k], poses_of(observation)[k]))
            assert info["final_info"]["start"][k] == begun[k][-2][0]
    for k, found in enumerate(begun):
        assert len(found) > 6 and found == [(i % 6, poses[i % 6]) for i in range(k, k + n * len(found), n)]


@pytest.mark.parametrize("seed", range(4))
def test_any_order_of_calls(small, poses, seed):
    """Several vector environments in one process, and episodes of `suite run` between: resets in order, by number, with
    seeds and masks, and steps until whatever moment; what begins is always the start that `info` names."""
    rng, suite = np.random.default_rng(seed), Suite.load(small)
    vectors = [envs_of(small, n) for n in (1, 3, 2)]
    player = Player(small, False, WORLD, f"{worlds.__name__}:still", False, 5)
    for envs in vectors:
        envs.reset()
    for _ in range(150):
        envs = vectors[rng.integers(3)]
        how = rng.integers(7)
        begun = np.ones(envs.num_envs, dtype=bool)
        if how == 0:
            observation, info = envs.reset(seed=int(rng.integers(5)))
        elif how == 1:
            observation, info = envs.reset(options={"start": int(rng.integers(6))})
        elif how == 2:
            observation, info = envs.reset()
        elif how == 3:
            begun[rng.integers(envs.num_envs)] = rng.random() < 0.5
            begun[0] |= not begun.any()
            observation, info = envs.reset(options={"reset_mask": begun.copy()})
        elif how == 4:
            worlds.begun.clear()
            number = int(rng.integers(6))
            assert player(number).episode == number and worlds.begun == [(number, poses[number])]
            continue
        else:
            stops = rng.random((envs.num_envs, 1)) < 0.3
            actions = np.hstack([rng.uniform(-1.0, 1.0, (envs.num_envs, 2)), stops]).astype(np.float32)
            observation, _, terminated, truncated, info = envs.step(actions)
            begun = terminated | truncated
        for k in np.flatnonzero(begun):
            assert poses_of(observation)[k] == poses[info["start"][k]], how
    assert [start.poses.tobytes() for start in suite] == poses


def test_a_start_that_is_asked_for(small, poses):
    envs = envs_of(small, 2)
    for first in (4, 0, 4, 2):
        observation, info = envs.reset(options={"start": first})
        assert info["start"].tolist() == [first, first + 1] and poses_of(observation) == poses[first : first + 2]
    assert envs.reset()[1]["start"].tolist() == [4, 5]
    mask = np.array([False, True])
    assert envs.reset(options={"reset_mask": mask})[1]["start"][1] == 1
    for wrong in (6, -1, 1.5):
        with pytest.raises(RequestError):
            envs.reset(options={"start": wrong})


def test_success_and_the_last_step_end_an_episode(small):
    envs = envs_of(small, 1, steps=4)
    assert envs.call("_max_episode_steps") == (4,)
    envs.reset()
    still = np.zeros((1, 3), dtype=np.float32)
    ends = [envs.step(still)[3][0] for _ in range(4)]
    assert ends == [False, False, False, True]
    start = Suite.load(small)[0]
    envs = envs_of(small, 1)
    envs.reset(options={"start": 0})
    for _ in range(100):
        place = envs.envs[0]._episodes.env.poses[0, :2]
        _, _, terminated, _, info = envs.step(np.array([[*(-place / np.abs(place).max()), 0.0]], dtype=np.float32))
        if terminated[0]:
            break
    assert info["final_info"]["is_success"].tolist() == [True] and start.phi["goal"] < 0.0


def test_reversed_tasks_and_one_task(small):
    back = Suite.load(small, reverse=True)
    envs = envs_of(small, 1, reverse=True)
    assert poses_of(envs.reset()[0]) == [back[0].poses.tobytes()]
    assert envs_of(small, 1, cfg=type("Config", (), {"task": "beside"})) is not None
    with pytest.raises(RequestError, match="task"):
        envs_of(small, 1, cfg=type("Config", (), {"task": "besides"}))


@pytest.mark.parametrize("world, how", [("broken", "no display"), ("blind", "action"), ("nobody", "nobody")])
def test_a_world_that_is_none(small, world, how):
    with pytest.raises(ScenegenError, match=how) as caught:
        envs_of(small, 1, f"{worlds.__name__}:{world}")
    assert caught.value.diagnostics[0].kind is WORLD_FAILS


def test_a_folder_that_is_no_suite(tmp_path):
    with pytest.raises(DataError) as caught:
        make_suite_envs(tmp_path, WORLD)
    assert caught.value.diagnostics[0].kind is not NOT_A_SUITE  # the file is missing


def test_no_environments(small):
    with pytest.raises(RequestError, match="n_envs"):
        envs_of(small, 0)
