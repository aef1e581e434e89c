"""Covers of a cell each, made by several processes: the same plan, and it is given up at the same place."""

import math

import pytest

from scenegen.bounds.effort import StoppedError, TooMuchError
from scenegen.lang.check import check_text
from scenegen.sampling.problem import Budget, make_problem
from scenegen.sampling.rejection import covers, sampler
from scenegen.sampling.rejection.trial import make_trial
from scenegen.sampling.request import Range, SampleRequest

TEXT = "task: closeTo(a, (0.5, 0.5), 0.2) & closeTo(b, (0.2, 0.2), 0.2)"
BUDGET = Budget(math.inf)  # this module is read long before its tests are run


def posed(workers):
    return make_problem(
        check_text(TEXT), SampleRequest({"task": Range(0.0, 0.2)}, n=1_000_000, seed=3, workers=workers), BUDGET
    )


@pytest.fixture
def pools(monkeypatch):
    """Two cores, and processes from the second cover on; noted is how many processes each pool has."""
    sizes = []

    class Noted(covers.Pool):
        def __init__(self, job, workers, **more):
            sizes.append(workers)
            super().__init__(job, workers, **more)

    monkeypatch.setattr(covers, "Pool", Noted)
    monkeypatch.setattr(covers, "cores", lambda: 2)
    monkeypatch.setattr(covers, "WORTH", 1.0)
    return sizes


def planned(workers, *limits):
    problem = posed(workers)
    return sampler.make_plan(problem, BUDGET, make_trial(problem, BUDGET), *limits)


@pytest.mark.long
def test_processes_make_the_same_plan(pools):
    alone = planned(1)
    assert pools == []
    for workers in (2, None):
        shared = planned(workers)
        assert shared.plan_digest == alone.plan_digest
        assert (shared.draws, shared.reachable, shared.empty) == (alone.draws, alone.reachable, alone.empty)
    assert pools == [2, 2]


@pytest.mark.long
def test_too_much_work_is_found_at_the_same_limit(pools):
    """Each cover may take what the first takes; whether the second is already begun by then changes nothing."""
    one, two = posed(1), posed(2)
    rest = sorted(one.possible)[-6:]
    works = [own.work for own in covers.own_covers(one, rest, BUDGET, lambda: 1e18)]
    assert works == [own.work for own in covers.own_covers(two, rest, BUDGET, lambda: 1e18)]
    assert min(works) < max(works)
    for problem in (one, two):
        made = list(covers.own_covers(problem, rest, BUDGET, lambda: min(works)))
        assert [own.cover is None for own in made] == [work > min(works) for work in works]
    assert pools == [2, 2]


@pytest.mark.long
def test_what_is_left_is_what_covers_before_did_not_take(pools, monkeypatch):
    """To the last unit, and though processes begin covers when more is left."""
    monkeypatch.setattr(sampler, "_hopeless", lambda *_: False)
    problem = posed(1)
    plan = planned(1)
    rare = [cell for cell in sorted(problem.possible) if not plan.sources[0].cells[cell]]
    used = sum(own.work for own in covers.own_covers(problem, rare, BUDGET, lambda: 1e18))
    for workers in (1, 2):
        assert planned(workers, math.inf, used).plan_digest == plan.plan_digest
        with pytest.raises(TooMuchError):
            planned(workers, math.inf, used - 1.0)


@pytest.mark.long
def test_time_that_is_up_reaches_this_process(pools, monkeypatch):
    monkeypatch.setattr(covers, "_sharers", lambda *_: 2)
    with pytest.raises(StoppedError):
        next(covers.own_covers(posed(2), [3, 4], Budget(-1.0), lambda: 1e18))
    assert pools == [2]


def test_little_work_starts_few_processes(pools, monkeypatch):
    monkeypatch.setattr(covers, "WORTH", 1e15)
    monkeypatch.setattr(covers, "cores", lambda: 6)
    problem = posed(None)
    next(covers.own_covers(problem, sorted(problem.possible), BUDGET, lambda: 1e18))
    assert pools == []
    assert [covers._sharers(problem, count, 1e14) for count in (8, 19, 20, 35, 200)] == [1, 1, 2, 3, 6]
    assert covers._sharers(problem, 4, 1e16) == 4
    assert covers._sharers(posed(3), 200, 1e14) == 3
    assert covers._sharers(posed(8), 200, 1e14) == 6
