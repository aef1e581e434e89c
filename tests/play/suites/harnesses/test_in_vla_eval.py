"""A suite in vla-eval itself: a model server, its orchestrator, what it records, and our report of that."""

import logging

import numpy as np
import pytest

from scenegen.errors import DataError, RequestError, ScenegenError
from scenegen.play.suites.harnesses.results import read_results
from scenegen.play.suites.report import report_suite
from scenegen.play.suites.suite import Suite

from . import worlds

pytestmark = pytest.mark.harnesses

WORLD = f"{worlds.__name__}:Forgetful"
BENCHMARK = "scenegen.play.suites.harnesses.vla_eval:SuiteBenchmark"


@pytest.fixture(scope="module")
def api():
    api = pytest.importorskip("vla_eval.api", reason="needs vla-eval: make test-harnesses installs it")
    logging.getLogger("vla_eval").setLevel(logging.ERROR)
    return api


@pytest.fixture
def stopping():
    """A policy that stops at random moments, and fails in one of its episodes; it keeps the first observations."""
    from vla_eval.model_servers.predict import PredictModelServer

    class Stopping(PredictModelServer):
        def __init__(self):
            super().__init__()
            self.rng, self.seen, self.failing = np.random.default_rng(3), [], None

        def get_action_spec(self):
            return {}

        def get_observation_spec(self):
            return {}

        def predict(self, obs, ctx):
            if ctx.is_first:
                self.seen.append(obs)
                if len(self.seen) - 1 == self.failing:
                    raise ValueError("no plan")
            push = -30.0 * obs["environment_state"][:2] if len(self.seen) % 2 else self.rng.uniform(-1.0, 1.0, 2)
            return {"actions": np.array([*push, float(self.rng.random() < 0.1)])}

    return Stopping()


def config_of(small, tmp_path, **given):
    params = {"suite": str(small), "world": WORLD, "steps": 20, **given}
    entry = {"benchmark": BENCHMARK, "params": params, "episodes_per_task": 6, "name": "small"}
    return {"benchmarks": [entry], "output_dir": str(tmp_path), "render": "cpu"}


def test_episode_i_has_start_i_and_outcomes_come_back(api, stopping, small, tmp_path):
    """The poses are those of the suite bit for bit, also after an episode that failed."""
    stopping.failing, suite = 2, Suite.load(small)
    for _ in range(2):
        worlds.begun.clear()
        (found,) = api.evaluate(stopping, config_of(small, tmp_path))
        assert worlds.begun == [(start.number, start.poses.tobytes()) for start in suite]
    assert stopping.seen[0]["task_description"] == suite[0].task.instruction
    assert stopping.seen[0]["images"]["eye"].shape == (8, 8, 3) and stopping.seen[0]["state"].shape == (7,)
    assert stopping.seen[1]["environment_state"].tobytes() == suite[1].poses.tobytes()

    (file,) = tmp_path.glob("*_aggregate.json")
    read = read_results(file, suite)
    played = {one["episode_id"]: one for one in found["tasks"][0]["episodes"]}
    assert {one.episode: (one.success, one.steps) for one in read.episodes} == {
        number: (one["metrics"]["success"], one["steps"]) for number, one in played.items()
    }
    assert 0 < sum(one.success for one in read.episodes) < 6
    assert (read.header.world, read.header.policy, read.header.steps) == (WORLD, "Stopping", 20)
    assert "small" in report_suite(small, [file], tmp_path / "report.md").read_text()


def test_an_episode_that_fails_in_the_harness_is_a_failure(api, stopping, small, tmp_path):
    stopping.failing = 3
    api.evaluate(stopping, config_of(small, tmp_path))
    (file,) = tmp_path.glob("*_aggregate.json")
    errors = {one.episode: one.error for one in read_results(file, Suite.load(small)).episodes}
    assert [number for number, error in errors.items() if error] == [3]


def test_reversed_tasks_and_shards(api, stopping, small, tmp_path):
    """Two shards have all starts between them, each the ones that it would have alone."""
    import anyio
    from vla_eval.orchestrator import Orchestrator

    back, begun = Suite.load(small, reverse=True), []
    with api.serve_background(stopping) as server:
        config = {**config_of(small, tmp_path, reverse=True), "server": {"url": server.url}}
        for shard in range(2):
            worlds.begun.clear()
            anyio.run(Orchestrator(config, shard_id=shard, num_shards=2, no_save=True).run)
            begun.append(list(worlds.begun))
    assert len(begun[0]) == len(begun[1]) == 3
    assert sorted(begun[0] + begun[1]) == [(start.number, start.poses.tobytes()) for start in back]


def test_bad_input(api, small):
    benchmark = resolve_benchmark()
    with pytest.raises(DataError):
        benchmark(str(small / "nothing"), WORLD)
    with pytest.raises(RequestError, match="task"):
        benchmark(str(small), WORLD, tasks=["besides"])
    with pytest.raises(ScenegenError, match="no display"):
        benchmark(str(small), f"{worlds.__name__}:broken").reset({"name": "beside", "episode_idx": 0})
    with pytest.raises(RequestError, match="episode"):
        benchmark(str(small), WORLD).reset({"name": "beside", "episode_idx": 6})


def resolve_benchmark():
    from vla_eval.registry import resolve_import_string

    return resolve_import_string(BENCHMARK)
