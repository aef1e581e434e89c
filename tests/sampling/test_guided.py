"""Whatever a proposer proposes, only verified scenes are handed out."""

import numpy as np
import pytest
import torch

from scenegen.lang.check import check_text
from scenegen.sampling.base import draw
from scenegen.sampling.guided import guided, unrefined
from scenegen.sampling.problem import Budget, pose
from scenegen.sampling.request import Range

BOTH = {"task": Range(0.05, 0.2), "safe": Range(0.0)}


def uniform(problem):
    return lambda phi, generator: draw(*problem.spec.box(), phi.shape[1], generator)


def test_a_uniform_proposer(exp1, phi1):
    problem = pose(exp1, BOTH, n=3200, seed=5)
    found = guided(problem, uniform(problem), "uniform", Budget())
    phi = phi1(found.rows)
    assert found.count == 3200 and found.shortfall is None
    assert phi[0].min() >= 0.05 - 1e-12 and phi[0].max() <= 0.2 + 1e-12 and phi[1].min() >= -1e-12
    assert exp1.workspace.contains(found.rows).all()
    assert np.histogram(found.phi[0], np.linspace(0.05, 0.2, 33))[0].tolist() == [100] * 32
    assert found.info["method"] == "model" and found.info["raw"] is False and found.info["refined"] > 0


def test_a_rare_range_is_no_harder(exp2):
    problem = pose(exp2, {"task": Range(0.02, 0.06)}, n=320, seed=5)
    found = guided(problem, uniform(problem), "uniform", Budget())
    assert found.count == 320 and found.shortfall is None
    assert ((found.phi >= 0.02) & (found.phi <= 0.06)).all()


def test_the_same_seed_gives_the_same_scenes(exp1):
    runs = []
    for seed in (1, 1, 2):
        problem = pose(exp1, BOTH, n=100, seed=seed)
        runs.append(guided(problem, uniform(problem), "uniform", Budget()).rows.tobytes())
    assert runs[0] == runs[1] != runs[2]


def constant(*columns):
    def propose(phi, generator):
        return torch.tensor(columns, dtype=torch.float32)[:, None].expand(-1, phi.shape[1]).clone()

    return propose


HOPELESS = {
    "far away": constant(0.99, 0.01, 0.0, 0.01, 0.99, 0.0),
    "in one place": constant(0.5, 0.5, 0.0, 0.5, 0.5, 0.0),
    "outside": constant(7.0, -8.0, 100.0, -9.0, 55.0, -3.0),
    "infinite": constant(float("inf"), 0.5, float("-inf"), 0.5, 0.5, 0.0),
    "not a number": constant(*[float("nan")] * 6),
    "half a number": constant(0.5, float("nan"), 0.0, 0.5, 0.5, 0.0),
}


@pytest.mark.parametrize("name", HOPELESS)
def test_a_hopeless_proposer_yields_no_bad_scene(name, exp1, phi1):
    """task 0.97..0.99 needs both objects in their corners: out of reach for some, a long way for all."""
    problem = pose(exp1, {"task": Range(0.97, 0.99), "safe": Range(1.0)}, n=64, seed=0, spread="base")
    found = guided(problem, HOPELESS[name], "hopeless", Budget(20))
    assert exp1.workspace.contains(found.rows).all()
    if found.count:
        phi = phi1(found.rows)
        assert phi[0].min() >= 0.97 and phi[0].max() <= 0.99 and phi[1].min() >= 1.0
    assert found.count == 64 or found.shortfall is not None


@pytest.mark.parametrize("name", ["infinite", "not a number", "half a number"])
def test_nothing_usable_ends_in_a_diagnostic(name, exp1):
    problem = pose(exp1, BOTH, n=8, seed=0, spread="base")
    found = guided(problem, HOPELESS[name], "hopeless", Budget(20))
    assert found.count == 0
    assert found.shortfall.title.startswith("found none of 8 scenes in ")
    assert "candidates of the hopeless" in found.shortfall.title
    assert "not a number" in found.shortfall.note


def test_a_range_out_of_reach_ends_by_itself():
    """Every point of it is infeasible, though no bound over the whole workspace says so."""
    spec = check_text("closeTo(a, b, 0.1) & closeTo(b, c, 0.1) & farFrom(a, c, 0.25)", "triangle")
    problem = pose(spec, {"task": Range(0.0)}, n=16, seed=0, spread="base")
    found = guided(problem, uniform(problem), "uniform", Budget(60))
    assert found.count == 0 and found.shortfall is not None
    assert found.shortfall.span.source.name == "triangle"
    assert found.info["candidates"] == 2048


def test_raw_output_is_untouched_and_marked(exp1):
    problem = pose(exp1, BOTH, n=50, seed=0)
    found = unrefined(problem, HOPELESS["far away"], "hopeless")
    assert found.count == 50 and found.info["raw"] is True
    expected = HOPELESS["far away"](torch.zeros(2, 50), None).double().numpy()
    assert np.array_equal(found.rows, expected)
    assert (found.phi[0] < 0.05).all()
