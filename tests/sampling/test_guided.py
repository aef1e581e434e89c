"""Whatever a proposer proposes, only verified scenes are handed out."""

import numpy as np
import pytest
import torch

from scenegen.errors import RequestError
from scenegen.lang.checker import check_text
from scenegen.sampling.problem import Budget, make_problem
from scenegen.sampling.request import Range, SampleRequest

from .proposers import Constant, Uniform, guided

BOTH = {"task": Range(0.05, 0.2), "safe": Range(0.0)}


def test_a_uniform_proposer(exp1, phi1):
    problem = make_problem(exp1, SampleRequest(BOTH, n=3200, seed=5))
    found = guided(problem, Uniform(problem.spec.box()))
    phi = phi1(found.rows)
    assert found.count == 3200 and found.shortfall is None
    assert phi[0].min() >= 0.05 - 1e-12 and phi[0].max() <= 0.2 + 1e-12 and phi[1].min() >= -1e-12
    assert exp1.workspace.contains(found.rows).all()
    assert np.histogram(found.phi[0], np.linspace(0.05, 0.2, 33))[0].tolist() == [100] * 32
    assert found.info["method"] == "model" and found.info["raw"] is False and found.info["refined"] > 0


def test_a_rare_range_is_no_harder(exp2):
    problem = make_problem(exp2, SampleRequest({"task": Range(0.02, 0.06)}, n=320, seed=5))
    found = guided(problem, Uniform(problem.spec.box()))
    assert found.count == 320 and found.shortfall is None
    assert ((found.phi >= 0.02) & (found.phi <= 0.06)).all()


def test_the_same_seed_gives_the_same_scenes(exp1):
    runs = []
    for seed in (1, 1, 2):
        problem = make_problem(exp1, SampleRequest(BOTH, n=100, seed=seed))
        runs.append(guided(problem, Uniform(problem.spec.box())).rows.tobytes())
    assert runs[0] == runs[1] != runs[2]


HOPELESS = {
    "far away": Constant((0.99, 0.01, 0.0, 0.01, 0.99, 0.0)),
    "in one place": Constant((0.5, 0.5, 0.0, 0.5, 0.5, 0.0)),
    "outside": Constant((7.0, -8.0, 100.0, -9.0, 55.0, -3.0)),
    "infinite": Constant((float("inf"), 0.5, float("-inf"), 0.5, 0.5, 0.0)),
    "not a number": Constant((float("nan"),) * 6),
    "half a number": Constant((0.5, float("nan"), 0.0, 0.5, 0.5, 0.0)),
}


@pytest.mark.long
@pytest.mark.parametrize("name", HOPELESS)
def test_a_hopeless_proposer_yields_no_bad_scene(name, exp1, phi1):
    """task 0.97..0.99 needs both objects in their corners: out of reach for some, a long way for all."""
    wanted = {"task": Range(0.97, 0.99), "safe": Range(1.0)}
    problem = make_problem(exp1, SampleRequest(wanted, n=64, seed=0, spread="base"))
    try:
        found = guided(problem, HOPELESS[name], Budget(20))
    except RequestError as error:
        assert error.diagnostics[0].title.startswith("found none of 64 scenes in ")
        return
    phi = phi1(found.rows)
    assert exp1.workspace.contains(found.rows).all()
    assert phi[0].min() >= 0.97 and phi[0].max() <= 0.99 and phi[1].min() >= 1.0
    assert found.count == 64 or found.shortfall is not None


@pytest.mark.parametrize("name", ["infinite", "not a number", "half a number"])
def test_nothing_usable_ends_in_a_diagnostic(name, exp1):
    problem = make_problem(exp1, SampleRequest(BOTH, n=8, seed=0, spread="base"))
    with pytest.raises(RequestError) as caught:
        guided(problem, HOPELESS[name], Budget(20))
    (problem,) = caught.value.diagnostics
    assert problem.title.startswith("found none of 8 scenes in ") and "candidates of the hopeless" in problem.title
    assert "not a number" in problem.note


@pytest.mark.long
def test_a_range_out_of_reach_ends_by_itself():
    """Every point of it is infeasible, though no bound over the whole workspace says so."""
    spec = check_text("closeTo(a, b, 0.1) & closeTo(b, c, 0.1) & farFrom(a, c, 0.25)", "triangle")
    problem = make_problem(spec, SampleRequest({"task": Range(0.0)}, n=16, seed=0, spread="base"))
    with pytest.raises(RequestError, match="found none of 16 scenes in 2,048 candidates of the uniform") as caught:
        guided(problem, Uniform(problem.spec.box()))
    assert caught.value.diagnostics[0].span.source.name == "triangle"


def test_time_that_is_up_while_planning_is_told(exp1):
    problem = make_problem(exp1, SampleRequest(BOTH, n=8))
    with pytest.raises(RequestError, match="found none of 8 scenes in 0 candidates of the uniform"):
        guided(problem, Uniform(problem.spec.box()), Budget(0.0))


def test_raw_output_is_untouched_and_marked(exp1):
    problem = make_problem(exp1, SampleRequest(BOTH, n=50, seed=0, raw=True))
    found = guided(problem, HOPELESS["far away"])
    assert found.count == 50 and found.info["raw"] is True and "cells" not in found.info
    expected = HOPELESS["far away"](torch.zeros(2, 50), None).double().numpy()
    assert np.array_equal(found.rows, expected)
    assert (found.phi[0] < 0.05).all()
