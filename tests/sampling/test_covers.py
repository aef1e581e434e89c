"""Covers of a cell each, made by several processes: the same plan, and it is given up at the same place."""

import math
from itertools import pairwise

import pytest

from scenegen.lang.checker import check_text
from scenegen.sampling.methods import make_plan
from scenegen.sampling.problem import Budget, make_problem
from scenegen.sampling.rejection import sampler
from scenegen.sampling.rejection import trial as covers
from scenegen.sampling.rejection.trial import make_trial
from scenegen.sampling.request import Range, SampleRequest
from scenegen.search.effort import StoppedError, TooMuchError

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
    plan = planned(1)
    works = []

    def noted(*asked, honest=sampler.own_covers):
        for own in honest(*asked):
            works.append(own.work)
            yield own

    monkeypatch.setattr(sampler, "own_covers", noted)
    planned(1)
    used = sum(works) + 0.5  # rounding apart
    less = planned(1, math.inf, used - 1.0)
    assert less.plan_digest != plan.plan_digest and less.reached == plan.reached
    assert [planned(w, math.inf, used).plan_digest for w in (1, 2)] == [plan.plan_digest] * 2
    assert planned(2, math.inf, used - 1.0).plan_digest == less.plan_digest


@pytest.mark.long
def test_a_cell_that_no_candidate_hit_must_have_its_cover():
    """The others can do without: the common cover reaches them."""
    problem = make_problem(check_text(TEXT), SampleRequest({"task": Range(0.0, 0.1)}, n=1_000_000))
    trial = make_trial(problem, BUDGET)
    assert trial.hits[sorted(problem.possible)].all()
    assert len(sampler.make_plan(problem, BUDGET, trial, math.inf, 0.0).sources) == 1
    trial.hits[sorted(problem.possible)[-1]] = 0
    with pytest.raises(TooMuchError):
        sampler.make_plan(problem, BUDGET, trial, math.inf, 0.0)


@pytest.mark.long
@pytest.mark.parametrize("spec", ["flat", "choices"])
def test_more_scenes_never_cost_more_each(spec):
    """Covers of rare cells were made for large requests, though they were hit more seldom than the common one."""
    text = """workspace [0, 0.9] x [0, 0.6]
object coaster = cylinder(5.5 cm, 0.5 cm)
object mug, can, apple, book
"""
    if spec == "choices":
        text = text.replace("object mug", "object mug on any of [coaster, workspace]\nobject").replace(
            "object,", "object"
        )
    text += "require noCollision() & insideWorkspace()\ntask: on(mug, coaster)"
    each = []
    for n in (10_000, 100_000, 1_000_000, 10_000_000):
        asked = SampleRequest({"task": Range(-0.6, -0.0625)}, n=n, workers=1)
        plan = make_plan(make_problem(check_text(text), asked), BUDGET, method="auto")
        assert plan.method == "rejection" and len(plan.reached) == 32
        each.append((plan.draws + plan.expected) / n)
    assert all(later <= 1.02 * before for before, later in pairwise(each))


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
