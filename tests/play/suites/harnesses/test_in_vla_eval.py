"""A suite in vla-eval itself: a model server, its orchestrator, what it records, and our report of that."""

import logging

import numpy as np
import pytest

from scenegen.play.suites.suite import Suite

from . import worlds

pytestmark = pytest.mark.harnesses

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
    params = {"suite": str(small), "world": f"{worlds.__name__}:Forgetful", "steps": 20, **given}
    entry = {"benchmark": BENCHMARK, "params": params, "episodes_per_task": 6, "name": "small"}
    return {"benchmarks": [entry], "output_dir": str(tmp_path), "render": "cpu"}


def test_episode_i_has_start_i(api, stopping, small, tmp_path):
    worlds.BEGUN.clear()
    (found,) = api.evaluate(stopping, config_of(small, tmp_path))
    import json
    print(json.dumps(found, indent=1))
    assert [(number, poses) for number, poses in worlds.BEGUN] == [
        (start.number, start.poses.tobytes()) for start in Suite.load(small)
    ]
