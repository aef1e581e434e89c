"""Covers of a cell each are given up once those that are made show that all of them take too much work."""

import math

import pytest

from scenegen.lang.checker import check_text
from scenegen.sampling.choice import CELLS
from scenegen.sampling.problem import Budget, make_problem
from scenegen.sampling.rejection import sampler
from scenegen.sampling.rejection import trial as covers
from scenegen.sampling.rejection.trial import MOST, make_trial
from scenegen.sampling.request import Range, SampleRequest
from scenegen.search.effort import TooMuchError

from ..fuzz.tables import table


@pytest.fixture
def efforts(monkeypatch):
    """The efforts of all covers, as they are begun."""
    begun, original = [], covers.effort_of

    def noted(*given):
        begun.append(original(*given))
        return begun[-1]

    monkeypatch.setattr(covers, "effort_of", noted)
    return begun


def posed(text, ranges, n=16):
    return make_problem(check_text(text), SampleRequest(ranges, n=n, workers=1))


@pytest.mark.long
def test_covers_that_all_take_too_much_are_given_up_early(efforts):
    """One cover takes a fifth of the work allowed, and there are 32 cells."""
    case = table(500, 77)
    problem = posed(case.text, {name: Range(*ends) for name, ends in case.ranges.items()})
    trial = make_trial(problem, Budget(600.0))
    with pytest.raises(TooMuchError):
        sampler.make_plan(problem, Budget(600.0), trial, MOST, CELLS)
    assert 0.2 * CELLS <= sum(effort.used for effort in efforts) < 0.5 * CELLS


@pytest.mark.long
def test_covers_that_fit_are_made(efforts):
    """The work that the covers take in fact is enough, nearly to the last of it, and the plan is the same."""
    text = "task: closeTo(a, b, 0.05) & angle(a, EAST, 0.2) & angle(b, EAST, 0.2)"
    problem = posed(text, {"task": Range(-0.01, 0.04)}, n=1_000_000)
    trial = make_trial(problem, Budget(600.0))
    free = sampler.make_plan(problem, Budget(600.0), trial)
    assert len(efforts) > 4
    used = sum(effort.used for effort in efforts)
    bounded = sampler.make_plan(problem, Budget(600.0), trial, math.inf, 1.01 * used)
    assert bounded.plan_digest == free.plan_digest


@pytest.mark.parametrize(
    ("spent", "done", "count", "hopeless"),
    [
        (0, 0, 32, False),  # nothing is known
        (10, 1, 32, False),  # 310 more of 90 that are left: too little is spent to tell
        (25, 1, 32, True),  # 775 more of 75
        (25, 20, 32, False),  # 15 more of 75
        (80, 20, 32, True),  # 48 more of 20
        (60, 20, 32, False),  # 36 more of 40
    ],
)
def test_what_is_hopeless(spent, done, count, hopeless):
    assert sampler._hopeless(100.0, 100.0 - spent, done, count) == hopeless
    assert not sampler._hopeless(math.inf, math.inf, done, count)
