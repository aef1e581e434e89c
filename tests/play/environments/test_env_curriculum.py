"""A curriculum inside reset: who is asked, who hears what, and a real run of Stable-Baselines3."""

import gymnasium
import numpy as np
import pytest
from gymnasium import error
from gymnasium.vector import SyncVectorEnv
from stable_baselines3 import DQN, PPO
from stable_baselines3.common.logger import KVWriter, Logger
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv

from scenegen.curriculum import (
    Curriculum,
    CurriculumCallback,
    Outcome,
    PhiBox,
    SB3Vector,
    TableTopVector,
    VectorCurriculum,
)

LEFT = "leftOf(mug, plate)"


class Ladder:
    """Narrow tasks in turn, from easy to hard; remembers what it hears."""

    def __init__(self, count=5):
        self.tasks = [PhiBox((-0.1 * k - 0.1,), (-0.1 * k,)) for k in range(count)]
        self.asked = 0
        self.heard: list[Outcome] = []

    def next_task(self):
        self.asked += 1
        return self.tasks[(self.asked - 1) % len(self.tasks)]

    def report(self, outcome):
        self.heard.append(outcome)

    def log(self):
        return {"level": float(self.asked % len(self.tasks))}


def make(**settings):
    return gymnasium.make("scenegen/TableTop-v0", spec=LEFT, move="mug", **settings)


def walk(env, info):
    """The mug goes left until the episode ends."""
    total, steps, over = 0.0, 0, False
    while not over:
        _, reward, terminated, truncated, info = env.step(1)
        total, steps, over = total + reward, steps + 1, terminated or truncated
    return total, steps, info


def test_every_reset_asks_and_every_end_is_heard():
    ladder = Ladder()
    env = Curriculum(make(max_episode_steps=9), ladder)
    for number in range(10):
        _, info = env.reset(seed=0 if number == 0 else None)
        task = ladder.tasks[number % 5]
        assert task.holds(tuple(info["phi"].values()))
        np.testing.assert_array_equal(info["task"]["task"], [task.low[0], task.high[0]])
        phi = info["phi"]["task"]
        total, steps, info = walk(env, info)
        heard = ladder.heard[-1]
        assert heard == Outcome(task, (phi,), info["is_success"], total, steps)
        assert info["outcome"] == {
            "low": list(task.low), "high": list(task.high), "phi": [phi], "success": heard.success,
            "total": total, "steps": steps,
        }  # fmt: skip
    assert ladder.asked == len(ladder.heard) == 10
    # a step is 5 cm, so 45 cm are as far as it gets, unless the table ends before
    assert all(one.success == (one.phi[0] >= -0.45) for one in ladder.heard if one.total >= 0.0)
    assert any(one.success for one in ladder.heard) and not all(one.success for one in ladder.heard)


def test_options_take_precedence_and_are_not_reported():
    ladder = Ladder()
    env = Curriculum(make(), ladder)
    _, info = env.reset(seed=0, options={"phi": (-0.65, -0.6)})
    assert -0.65 <= info["phi"]["task"] <= -0.6
    *_, info = walk(env, info)
    assert "outcome" not in info
    env.reset(options={"scene": {"mug": (0.7, 0.5, 0.0), "plate": (0.5, 0.5, 0.0)}})
    walk(env, info)
    assert ladder.asked == 0 and not ladder.heard
    env.reset()
    env.step(0)
    env.reset()  # broken off
    assert ladder.asked == 2 and not ladder.heard


def test_a_reset_that_fails_leaves_the_episode_as_it_is():
    ladder = Ladder()
    env = Curriculum(make(max_episode_steps=3), ladder)
    _, begun = env.reset(seed=0)
    with pytest.raises(error.Error):
        env.reset(seed=-1)
    _, _, info = walk(env, begun)
    assert ladder.heard[0].task == ladder.tasks[0] and info["outcome"]["low"] == list(ladder.tasks[0].low)
    assert ladder.heard[0].task.holds(ladder.heard[0].phi)


@pytest.mark.parametrize(
    "options", [{"phy": 1}, {"reset_mask": np.ones(2, dtype=bool)}, {"reset_mask": [[True], [False, True]]}, 3]
)
def test_a_reset_of_tables_that_fails_leaves_them_as_they_are(options):
    ladder = Ladder()
    env = VectorCurriculum(TableTopVector(3, LEFT, move="mug", max_episode_steps=3), ladder)
    env.reset(seed=0)
    with pytest.raises(error.Error):
        env.reset(options=options)
    for _ in range(3):
        env.step(np.ones(3, dtype=int))
    assert [one.task for one in ladder.heard] == ladder.tasks[:3]
    assert all(one.task.holds(one.phi) for one in ladder.heard)


def test_it_can_be_made_again():
    env = Curriculum(make(), Ladder())
    again = gymnasium.make(env.spec)
    assert isinstance(again, Curriculum) and again.strategy is not None


@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
def test_a_vector_of_tables_asks_and_tells_the_same(mode):
    ladder, other = Ladder(), Ladder()
    settings = {"spec": LEFT, "move": "mug"}
    many = gymnasium.make_vec("scenegen/TableTop-v0", 3, max_episode_steps=9, autoreset_mode=mode, **settings)
    ours = VectorCurriculum(many, ladder)
    theirs = SyncVectorEnv([lambda: Curriculum(make(max_episode_steps=9), other)] * 3, autoreset_mode=mode)
    one, two = ours.reset(seed=0), theirs.reset(seed=0)
    np.testing.assert_array_equal(one[0], two[0])
    for _ in range(60):
        one, two = ours.step(np.ones(3, dtype=int)), theirs.step(np.ones(3, dtype=int))
        for a, b in zip(one[:4], two[:4], strict=True):
            np.testing.assert_array_equal(a, b)
        if mode == "Disabled" and (over := one[2] | one[3]).any():
            ours.reset(options={"reset_mask": over.copy()})
            theirs.reset(options={"reset_mask": over.copy()})
    assert len(ladder.heard) > 10
    assert ladder.heard == other.heard and ladder.asked == other.asked


class Kept(KVWriter):
    """Keeps what is logged."""

    def __init__(self):
        self.seen = []

    def write(self, key_values, key_excluded, step=0):
        self.seen.append(dict(key_values))

    def close(self):
        pass


@pytest.mark.long
def test_stable_baselines_learns_with_a_curriculum():
    ladder, kept = Ladder(2), Kept()
    envs = DummyVecEnv([lambda: Monitor(Curriculum(make(max_episode_steps=12), ladder))] * 2)
    model = DQN("MlpPolicy", envs, learning_rate=5e-3, learning_starts=200, target_update_interval=200, gamma=0.9,
                exploration_fraction=0.4, policy_kwargs={"net_arch": [32]}, seed=0)  # fmt: skip
    model.set_logger(Logger(None, [kept]))
    callback = CurriculumCallback(ladder, window=50)
    model.learn(2000, callback=callback, log_interval=20)
    assert callback.episodes == len(ladder.heard) > 200
    early, late = (np.mean([one.success for one in part]) for part in (ladder.heard[:50], ladder.heard[-100:]))
    assert late > 0.7 and late > early + 0.2
    last = kept.seen[-1]
    names = ("success_rate", "phi", "low", "high", "steps", "reward", "level", "episodes")
    assert {f"curriculum/{name}" for name in names} <= set(last)
    assert "rollout/success_rate" in last
    assert -0.2 <= last["curriculum/low"] < last["curriculum/phi"] < last["curriculum/high"] <= 0.0


def test_a_callback_hears_of_many_tables_at_once():
    ladder = Ladder(2)
    tables = VectorCurriculum(
        TableTopVector(8, LEFT, move="mug", max_episode_steps=12, autoreset_mode="SameStep"), ladder
    )
    callback = CurriculumCallback(ladder)
    PPO("MlpPolicy", SB3Vector(tables), n_steps=64, batch_size=128, n_epochs=1, seed=0).learn(512, callback=callback)
    assert callback.episodes == len(ladder.heard) > 30
    assert [one["phi"] for one in callback.outcomes] == [list(one.phi) for one in ladder.heard[-100:]]


def test_outcomes_are_told_of_the_tables_that_ended():
    tables = VectorCurriculum(TableTopVector(8, LEFT, move="mug", max_episode_steps=6), Ladder(2))
    tables.reset(seed=0)
    rng, ended = np.random.default_rng(0), 0
    for _ in range(20):
        _, _, terminated, truncated, infos = tables.step(rng.integers(4, size=8))
        over = terminated | truncated
        assert ("outcome" in infos) == over.any()
        if over.any():
            np.testing.assert_array_equal(infos["_outcome"], over)
            assert [one is not None for one in infos["outcome"]] == over.tolist()
        ended += over.sum()
    assert ended > 10


def test_what_a_callback_cannot_be():
    with pytest.raises(error.Error, match="`strategy` is 'linear'"):
        CurriculumCallback("linear")
    with pytest.raises(error.Error, match="`window` is 0"):
        CurriculumCallback(window=0)
