"""Objects that are held in place stay there, and the others are distributed as if those had been drawn there."""

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import scenegen
from scenegen.errors import RequestError
from scenegen.sampling.engine.run import draw as run
from scenegen.sampling.problem import Budget, make_problem
from scenegen.sampling.request import FixedPose, Range, SampleRequest, hold_fixed, parse_fix

from .proposers import Uniform, guided

rejection = partial(run, method="rejection")


def test_forms():
    assert parse_fix(["plate=0.5,0.25", "block[2]= 1 , 0 ,-1.5"]) == {
        "plate": FixedPose(0.5, 0.25),
        "block[2]": FixedPose(1.0, 0.0, -1.5),
    }
    assert parse_fix([]) == {}


@pytest.mark.parametrize(
    "texts, said, place",
    [
        (["plate"], "NAME=X,Y", 1),
        (["=0.5,0.5"], "NAME=X,Y", 1),
        (["plate=0.5"], "NAME=X,Y", 1),
        (["plate=1,2,3,4"], "NAME=X,Y", 1),
        (["plate=0.5,here"], "`here` is not a number", 11),
        (["plate=nan,0"], "`nan` is not a number", 7),
        (["plate=0,0", "plate=1,1"], "given twice", 1),
    ],
)
def test_what_cannot_be_read(texts, said, place):
    with pytest.raises(RequestError, match=said) as caught:
        parse_fix(texts)
    (problem,) = caught.value.diagnostics
    assert problem.span.place == f"fix:1:{place}"


@pytest.mark.parametrize(
    "fixed, said",
    [
        ({"plat": (0.5, 0.5)}, "did you mean `plate`"),
        ({"plate": (1.5, 0.5)}, "outside the workspace"),
        ({"plate": (0.5, 0.5, 0.0, 1.0)}, "x, y, theta"),
        ({"plate": (0.5, math.nan)}, "x, y, theta"),
        ({"plate": "middle"}, "x, y, theta"),
        ({"plate": (0.1, 0.1, 0), "mug": (0.2, 0.2, 0)}, "nothing is left to sample"),
    ],
)
def test_what_cannot_be_held(exp1, fixed, said):
    with pytest.raises(RequestError, match=said):
        make_problem(exp1, SampleRequest(n=1, fix=fixed))


def test_an_object_of_the_spec_cannot_be_moved(exp1):
    with pytest.raises(RequestError, match="held in place by the spec already"):
        make_problem(replace(exp1, fixed={1: (0.5, 0.5, 0.0)}), SampleRequest(n=1, fix={"plate": (0.1, 0.1)}))


def test_headings_are_brought_to_the_circle(exp1):
    low, _, _ = hold_fixed(replace(exp1, fixed={0: (0.5, 0.5, -1.0)}), {})
    _, high, held = hold_fixed(exp1, {"plate": (0.5, 0.5, 7.0)})
    assert low[2] == pytest.approx(2 * math.pi - 1)
    assert held["plate"][2] == high[5] == pytest.approx(7 - 2 * math.pi)


def test_the_free_object_is_uniform_in_what_is_left(exp1, same_distribution):
    """task >= 0.1 around a plate at (0.6, 0.3): the mug fills the rectangle [0, 0.5] x [0.4, 1]."""
    found = rejection(
        make_problem(exp1, SampleRequest({"task": Range(0.1)}, n=20_000, seed=1, fix={"plate": (0.6, 0.3)})), Budget()
    )
    assert (found.rows[3] == 0.6).all() and (found.rows[4] == 0.3).all()
    truth = np.random.default_rng(0).random((3, 20_000)) * np.array([[0.5], [0.6], [2 * math.pi]])
    truth[1] += 0.4
    assert all(same_distribution(found.rows[row], truth[row]) for row in range(3))
    assert same_distribution(found.rows[5], truth[2])
    assert found.info["log10_probability"] == pytest.approx(math.log10(0.3), abs=1e-3)
    assert found.info["fix"] == {"plate": [0.6, 0.3]}


def test_objects_that_the_spec_holds(exp1):
    found = rejection(
        make_problem(replace(exp1, fixed={0: (0.2, 0.9, 1.0)}), SampleRequest({"task": Range(0.0, 0.4)}, n=320)),
        Budget(),
    )
    assert found.count == 320 and (found.rows[:3] == np.array([[0.2], [0.9], [1.0]])).all()


def test_refinement_does_not_move_them(exp1):
    problem = make_problem(exp1, SampleRequest({"task": Range(0.05, 0.2)}, n=320, seed=5, fix={"mug": (0.3, 0.6, 1.5)}))
    found = guided(problem, Uniform(exp1.box()))
    assert found.count == 320 and found.shortfall is None and found.info["refined"] > 0
    assert (found.rows[:3] == np.array([[0.3], [0.6], [1.5]])).all()


def test_through_the_api():
    spec = scenegen.parse("leftOf(mug, plate)")
    scenes = scenegen.sample(spec, {"task": (0.1, None)}, n=10, fix={"plate": (0.5, 0.5, 0.25)})
    assert (scenes.poses[:, 1] == [0.5, 0.5, 0.25]).all() and scenes.poses[:, 0, 0].max() <= 0.4
    assert scenes.header.sampler["fix"] == {"plate": [0.5, 0.5, 0.25]}
    with pytest.raises(RequestError, match="no scene can have phi of `task`"):
        scenegen.sample(spec, {"task": (0.6, None)}, n=10, fix={"plate": (0.5, 0.5)})
