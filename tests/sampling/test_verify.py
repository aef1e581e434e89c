"""The second look finds every kind of scene that must not be handed out."""

import dataclasses

import numpy as np
import pytest

from scenegen.sampling.engine.run import draw
from scenegen.sampling.plan import CHUNK, verify
from scenegen.sampling.problem import make_problem
from scenegen.sampling.request import Range, SampleRequest


@pytest.fixture(scope="module")
def made(exp1):
    core = dataclasses.replace(exp1.core, labels={"task": exp1.core.labels["task"]})
    spec = dataclasses.replace(exp1, core=dataclasses.replace(core, requirement=exp1.core.labels["safe"]))
    problem = make_problem(spec, SampleRequest({"task": Range(0.1, 0.2)}, n=CHUNK + 100, fix={"plate": (0.6, 0.3)}))
    return problem, draw(problem)


LAST = CHUNK + 7  # a scene of the second chunk


def off(row, value):
    def change(rows, phi):
        rows[row, LAST] = value

    return change


def phi_off(rows, phi):
    phi[0, LAST] += 1e-8


def nan(rows, phi):
    rows[2, LAST] = np.nan


def swapped(rows, phi):
    rows[:, LAST] = rows[:, 0]


def too_close(rows, phi):
    """The requirement fails, where the label is as wanted: 0.11 to the left and above is closer than 0.25."""
    rows[:2, LAST] = 0.6 - 0.11, 0.3 + 0.11
    phi[0, LAST] = 0.11


def too_far(rows, phi):
    rows[:2, LAST] = 0.2, 0.9
    phi[0, LAST] = 0.6 - 0.2


WRONG = {
    "phi": (phi_off, "disagree"),
    "another scene": (swapped, "disagree"),
    "range": (too_far, "outside the requested range"),
    "requirement": (too_close, "outside the requested range"),
    "heading": (off(2, 7.0), "outside the workspace"),
    "no number": (nan, "outside the workspace"),
    "held": (off(3, 0.6 + 1e-12), "held in place"),
}


def test_what_comes_out_passes(made):
    problem, found = made
    verify(problem, found.rows, found.phi)


@pytest.mark.parametrize("name", WRONG)
def test_what_must_not_come_out(name, made):
    problem, found = made
    change, said = WRONG[name]
    rows, phi = found.rows.copy(), found.phi.copy()
    change(rows, phi)
    with pytest.raises(AssertionError, match=said):
        verify(problem, rows, phi)


def test_out_of_the_workspace(exp1):
    problem = make_problem(exp1, SampleRequest(n=10))
    rows = draw(problem).rows
    rows[1, 3] = 1.0 + 1e-12
    with pytest.raises(AssertionError, match="outside the workspace"):
        verify(problem, rows, problem.phi(rows))
