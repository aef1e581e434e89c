"""Chooses the exact sampler for a request: the one that needs the fewest evaluations of phi.

Pruned rejection is tried first: its scenes are independent, and most requests take a fraction of a second. If pruning
takes much work, finds nothing in a part of the range that is not proved empty, or would need many candidates, a plan of
growth is made, which costs as much as a few hundred scenes; if growth does not do well, a plan of splitting. Before all
this, a request that consists of independent parts is split into them, and each part gets the method that suits it. Work
is counted, never timed, so the same request and seed always get the same method.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

from scenegen.bounds.effort import TooMuchError
from scenegen.errors import RequestError
from scenegen.sampling.growth.plan import Stalled as NoGrowth
from scenegen.sampling.growth.sampler import Growth, no_growth, plan_growth
from scenegen.sampling.paired import Paired, pair
from scenegen.sampling.parts import independent_parts
from scenegen.sampling.plan import Plan
from scenegen.sampling.problem import Budget, Problem
from scenegen.sampling.rejection.sampler import SPARE, Rejection, first_look, work_of
from scenegen.sampling.rejection.sampler import make_plan as plan_rejection
from scenegen.sampling.rejection.trial import LONG_SEARCH, MOST, Trial, make_trial, nothing_found, search
from scenegen.sampling.report import too_early
from scenegen.sampling.splitting.levels import Stalled
from scenegen.sampling.splitting.sampler import Splitting, plan_splitting, why_stalled

P = TypeVar("P", bound=Plan)

CELLS = 2.4e8  # work that covers of a cell each may take together before another method is tried: 3 s
TRIED = 2e8  # work of rejection with pruning that is done without looking at another method
FIRST = 5e7  # work that pruning may take before growth is tried: under a second, and more than most shipped specs take
EASY = 1e8  # work of rejection without pruning that is done without looking at another method
GROWN = 350.0  # work of growth for a scene and each of its moving rows, at least
PRUNED = 4.0  # share of the work without pruning, its inverse, that pruning may take
POOR = 3.0  # design effect that growth may leave before splitting is tried
SLOW = 0.1  # correlation that splitting's chains may leave to take its place
MANY = 24  # with more moving rows, rejection and splitting are not tried if pruning takes much work
ADVANTAGE = 2.0  # splitting must be this much cheaper, because its scenes are only nearly independent


def choose(problem: Problem, budget: Budget) -> Plan:
    """The plan by the better method; its `why` says why. Raises RequestError if there is no scene, or if time is up
    before there is a plan."""
    return _better(problem, budget)


def _because(plan: P, why: str) -> P:
    return replace(plan, why=why)


def _better(problem: Problem, budget: Budget, *, whole: bool = False) -> Plan:
    """`whole`: do not split the request into independent parts."""
    try:
        trial = make_trial(problem, budget, FIRST)
    except TooMuchError:
        return (None if whole else _apart(problem, budget)) or _after_pruning(problem, budget)
    return _after_trial(problem, budget, trial, whole=whole)


def _apart(problem: Problem, budget: Budget) -> Paired | None:
    """Each independent part by the method that suits it; None if fewer than two of them are rare."""
    parts = independent_parts(problem, budget)
    if not parts:
        return None
    plans = [_better(part.problem, budget, whole=True) for part in parts]
    methods = ", ".join(plan.method for plan in plans)
    return _because(pair(problem, parts, plans), f"{len(parts)} parts share no clause: {methods}")


def _after_pruning(problem: Problem, budget: Budget) -> Plan:
    """If pruning takes much work: rejection without pruning if that is cheap, or growth if it does well; else pruning
    continues for a while."""
    simple = _without_pruning(problem, budget)
    if simple is not None:
        return _because(simple, _in_range(simple))
    grown = plan_growth(problem, budget, patient=False)
    if isinstance(grown, Growth) and grown.recipe.effect <= POOR:
        return _because(grown, "pruning takes much work, growth does not")
    if not isinstance(grown, Growth) and (_time_is_up(grown) or grown.proof):
        raise no_growth(problem, grown)
    if _moving(problem) > MANY:  # neither boxes nor chains get anywhere
        grown = plan_growth(problem, budget)
        if isinstance(grown, Growth):
            return _because(grown, "pruning takes much work, growth less")
        raise no_growth(problem, grown)
    try:
        trial = make_trial(problem, budget, MOST)
    except TooMuchError:
        return _without_rejection(problem, budget, "pruning takes too much work", quick=grown)
    return _after_trial(problem, budget, trial, whole=True, quick=grown)


def _without_pruning(problem: Problem, budget: Budget) -> Rejection | None:
    """Rejection from the contracted box, or pruned for a fraction of that work, if either is cheaper than growth."""
    plan = first_look(problem, budget)
    if plan is None:
        return None
    moving = _moving(problem)
    cheap, work = max(EASY, GROWN * moving * problem.request.n), work_of(plan)
    if 2.0 * PRUNED * FIRST < work <= PRUNED * cheap:  # less pruning has not been enough
        try:
            pruned = plan_rejection(problem, budget, make_trial(problem, budget, work / PRUNED), work / PRUNED)
        except TooMuchError:
            pass  # the box remains
        else:
            less = work_of(pruned)
            if len(pruned.reached) == len(plan.reached) and less < work:
                plan, work = pruned, less
    return plan if work <= cheap else None


def _after_trial(
    problem: Problem, budget: Budget, trial: Trial, *, whole: bool, quick: Growth | NoGrowth | None = None
) -> Plan:
    """`quick` is a plan of growth on which little was spent, where it has been made."""
    if not trial.rate.hits:
        why = f"none of {trial.tried:,} candidates of rejection is in range"
        apart = None if whole else _apart(problem, budget)
        return apart or _without_rejection(problem, budget, why, trial, quick)
    try:
        mine = plan_rejection(problem, budget, trial, MOST, CELLS)
    except TooMuchError:
        apart = None if whole else _apart(problem, budget)
        return apart or _after_cells(problem, budget, trial, quick)
    in_range = _in_range(mine)
    open_cells = len(problem.possible) - len(mine.reached) - len(mine.ruled_out)
    moving = _moving(problem)
    cheap = work_of(mine) <= max(TRIED, GROWN * moving * problem.request.n)
    if cheap and open_cells <= len(mine.reached):
        return _because(mine, in_range)
    apart = None if whole else _apart(problem, budget)
    if apart is not None and ADVANTAGE * apart.evaluations < mine.evaluations:
        return apart
    rival = _other(problem, budget, quick)
    if not isinstance(rival, Growth | Splitting):
        if _time_is_up(rival):
            raise RequestError(too_early(problem, f"{int(rival.evaluations):,} evaluations", open_cells))
        return _because(mine, f"{in_range}; no other method got there")
    if len(rival.reached) > len(mine.reached):
        count = problem.cells.count
        reason = f"it reaches {len(rival.reached)} of {count} cells, rejection {len(mine.reached)}"
        return _because(rival, reason)
    costs = f"about {_short(rival.evaluations)} evaluations against {_short(mine.evaluations)} of"
    if len(rival.reached) == len(mine.reached) and ADVANTAGE * rival.evaluations < mine.evaluations:
        return _because(rival, f"{costs} rejection")
    return _because(mine, in_range)


def _after_cells(problem: Problem, budget: Budget, trial: Trial, quick: Growth | NoGrowth | None) -> Plan:
    """If pruning each cell takes much work: another method, or all the work if there is none."""
    why = "pruning each cell takes too much work"
    rival = _other(problem, budget, quick)
    if isinstance(rival, Growth | Splitting):
        return _because(rival, why)
    if _time_is_up(rival) or (isinstance(rival, NoGrowth) and (rival.proof or rival.crowded)):
        raise _nothing(problem, rival)
    try:
        return _because(plan_rejection(problem, budget, trial, MOST), "no other method got there")
    except TooMuchError:
        raise _nothing(problem, rival) from None


def _without_rejection(
    problem: Problem, budget: Budget, why: str, trial: Trial | None = None, quick: Growth | NoGrowth | None = None
) -> Plan:
    """If rejection has no plan, or its first candidates are all out of the range."""
    plan = _other(problem, budget, quick)
    if isinstance(plan, Growth | Splitting):
        return _because(plan, why)
    if _time_is_up(plan) or (isinstance(plan, NoGrowth) and plan.proof):
        raise _nothing(problem, plan)
    if trial is None or (isinstance(plan, NoGrowth) and plan.crowded):
        raise _nothing(problem, plan)
    # A constant phi gives no levels: rejection may be lucky.
    longer = search(problem, trial, budget, LONG_SEARCH)
    if not longer.rate.hits:
        raise RequestError(nothing_found(problem, longer))
    return _because(plan_rejection(problem, budget, longer), "no other method got there")


def _other(
    problem: Problem, budget: Budget, quick: Growth | NoGrowth | None = None
) -> Growth | Splitting | NoGrowth | Stalled:
    """A plan of growth, or of splitting if only splitting does well."""
    quick = plan_growth(problem, budget, patient=False) if quick is None else quick
    if isinstance(quick, Growth) and quick.recipe.effect <= POOR:
        return quick
    if not isinstance(quick, Growth) and (_time_is_up(quick) or quick.proof):
        return quick
    if _moving(problem) > MANY:  # more patience first: chains of so much take long to get anywhere
        quick = plan_growth(problem, budget)
        if isinstance(quick, Growth) or _time_is_up(quick) or quick.proof or quick.crowded:
            return quick
    crowded = not isinstance(quick, Growth) and quick.crowded
    split = None if crowded else plan_splitting(problem, budget)
    if isinstance(split, Splitting) and split.schedule.left < SLOW:
        return split
    if isinstance(split, Stalled) and _time_is_up(split):  # not that it came to nothing: who can tell?
        return split
    grown = plan_growth(problem, budget) if crowded or isinstance(quick, Growth) else quick
    if isinstance(grown, Growth):
        return grown
    return split if isinstance(split, Splitting) else grown


def _moving(problem: Problem) -> int:
    """Rows of the scenes that are not held."""
    return int((problem.lowest < problem.highest).sum())


def _nothing(problem: Problem, end: NoGrowth | Stalled) -> RequestError:
    return no_growth(problem, end) if isinstance(end, NoGrowth) else RequestError(why_stalled(problem, end))


def _time_is_up(end: NoGrowth | Stalled) -> bool:
    return end.stuck is None and not end.proof if isinstance(end, NoGrowth) else end.why == "time"


def _in_range(plan: Rejection) -> str:
    parts = sum(len(source.cover.parts) for source in plan.sources)
    boxes = "1 box" if parts == 1 else f"{parts:,} boxes"
    if len(plan.sources) == 1:
        rate = plan.explored
        return f"{_percent(rate.hits / rate.candidates)} of the candidates from {boxes} are in range"
    share = min(1.0, SPARE * plan.wanted / plan.expected)
    return f"about {_percent(share)} of the candidates from {boxes} are of use"


def _percent(share: float) -> str:
    """`45 %`, `0.3 %`; `100 %` only if it is all of them."""
    if share >= 0.995:
        return "all" if share == 1.0 else "over 99%"
    return f"{100.0 * share:.0f}%" if share >= 0.1 else f"{100.0 * share:.2g}%"


def _short(count: float) -> str:
    """1,234,567 -> 1.2 million."""
    for size, name in ((1e9, "billion"), (1e6, "million"), (1e3, "thousand")):
        if count >= size:
            return f"{count / size:.2g} {name}"
    return f"{count:.0f}"
