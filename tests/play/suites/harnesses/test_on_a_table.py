"""The table in the real robosuite: the simulator begins a start in the same state in every harness, bit for bit."""

import logging

import numpy as np
import pytest

from scenegen.play.suites.episodes import TaskEpisodes
from scenegen.play.suites.suite import Suite

pytestmark = pytest.mark.harnesses

SUITE, STARTS = "tabletop", 4


@pytest.fixture(scope="module")
def states():
    """The simulator's state at the first starts of the suite's first task, begun in their order in a fresh world."""
    pytest.importorskip("robosuite", reason="needs robosuite: make test-harnesses installs it")
    logging.getLogger("robosuite_logs").setLevel(logging.ERROR)
    suite = Suite.load(SUITE)
    episodes = TaskEpisodes("table", suite.tasks[0], 1000)
    found = {}
    for number in suite.numbers(suite.tasks[0])[:STARTS]:
        episodes.begin(suite[number])
        found[number] = state_of(episodes)
        assert np.allclose(episodes.observation["objects"], suite[number].poses, atol=1e-12)
    assert len(set(found.values())) == STARTS
    return found


def state_of(episodes):
    return episodes.env.sim.get_state().flatten().tobytes()


def actions():
    rng = np.random.default_rng(1)
    while True:
        yield rng.uniform(-1.0, 1.0, 7)


def test_in_lerobot(states):
    pytest.importorskip("lerobot")
    from scenegen.play.suites.harnesses.lerobot import SuiteEnv

    env = SuiteEnv(Suite.load(SUITE), 0, "table", 200)
    for turn, steps in ((2, 7), (0, 3), (3, 1), (2, 0), (1, 5)):
        _, info = env.reset(options={"start": turn})
        assert state_of(env._episodes) == states[info["start"]] == list(states.values())[turn]
        for _, action in zip(range(steps), actions(), strict=False):
            env.step(action)
    env.close()


def test_in_vla_eval(states):
    pytest.importorskip("vla_eval")
    from scenegen.play.suites.harnesses.vla_eval import SuiteBenchmark

    benchmark = SuiteBenchmark(SUITE, "table", tasks=[Suite.load(SUITE).tasks[0].name])
    (task,) = benchmark.get_tasks()
    for turn, steps in ((1, 2), (3, 4), (1, 0), (0, 1)):
        benchmark.reset({**task, "episode_idx": turn})
        assert state_of(benchmark._episodes) == list(states.values())[turn]
        for _, action in zip(range(steps), actions(), strict=False):
            benchmark.step({"actions": action})
    benchmark.cleanup()


def test_in_inspect_robots(states):
    pytest.importorskip("inspect_robots")
    from inspect_robots.types import Action

    from scenegen.play.suites.harnesses.inspect_robots import WorldEmbodiment, suite_task

    scenes = suite_task(SUITE).scenes[:STARTS]
    embodiment = WorldEmbodiment(SUITE, "table")
    for turn, steps in ((3, 2), (0, 4), (2, 0), (3, 1)):
        embodiment.reset(scenes[turn])
        assert state_of(embodiment._episodes) == states[scenes[turn].metadata["start"]]
        for _, action in zip(range(steps), actions(), strict=False):
            embodiment.step(Action(action))
    embodiment.close()
