"""Which exact sampler serves a request: its scenes are to be had for the fewest evaluations of phi.

Pruned rejection is tried first: its scenes are independent, and most requests take it a fraction of a second. Where
pruning takes much work, finds nothing in a part of the range that is not proved empty, or would need many candidates,
a plan of growth is made, which costs as much as some hundred scenes; and where growth does not do well, one of
splitting. Before that, a request that falls into parts which have nothing to do with each other is taken apart, and
each part gets the method that suits it. All of it is counted, never timed, so the same request and seed always get the
same method.
"""

from __future__ import annotations

from dataclasses import dataclass

from scenegen.bounds.effort import TooMuchError
from scenegen.errors import RequestError
from scenegen.sampling.growth.plan import Stalled as NoGrowth
from scenegen.sampling.growth.sampler import Growth, no_growth, plan_growth
from scenegen.sampling.levels import Stalled
from scenegen.sampling.paired import pair
from scenegen.sampling.parts import independent_parts
from scenegen.sampling.pieces import Plan
from scenegen.sampling.problem import Budget, Problem
from scenegen.sampling.rejection import LONG_SEARCH, MOST, SPARE, Trial, first_look, hopeless, make_trial, search
from scenegen.sampling.rejection import Plan as Rejection
from scenegen.sampling.rejection import make_plan as plan_rejection
from scenegen.sampling.report import too_early
from scenegen.sampling.splitting import Splitting, moves, plan_splitting, why_stalled

METHODS = ("auto", "rejection", "growth", "splitting")

LEAST, EACH = 10_000_000, 20  # evaluations that splitting takes at least: for its plan, and for each scene
FIRST = 5e7  # work that pruning may take before growth is tried: under a second, and more than most shipped specs take
POOR = 3.0  # design effect that growth may leave before splitting is tried
SLOW = 0.1  # correlation that splitting's chains may leave to take its place
ADVANTAGE = 2.0  # splitting must be that much cheaper: its scenes are all but independent, those of rejection are


@dataclass(frozen=True, slots=True)
class Choice:
    """A plan, and if the method was chosen here, why, in a few words; else None."""

    plan: Plan
    reason: str | None = None


def choose(problem: Problem, method: str, budget: Budget) -> Choice:
    """A plan by the given method of METHODS, or by the better one. Raises RequestError where there is no scene, or time
    is up before there is a plan."""
    if method == "rejection" or not moves(problem):
        return Choice(plan_rejection(problem, budget))
    if method == "growth":
        grown = plan_growth(problem, budget)
        if not isinstance(grown, Growth):
            raise no_growth(problem, grown)
        return Choice(grown)
    if method == "splitting":
        plan = plan_splitting(problem, budget)
        if isinstance(plan, Stalled):
            raise RequestError(why_stalled(problem, plan))
        return Choice(plan)
    return _better(problem, budget)


def _better(problem: Problem, budget: Budget, *, whole: bool = False) -> Choice:
    """`whole`: the request is not to be taken apart."""
    try:
        trial = make_trial(problem, budget, FIRST)
    except TooMuchError:
        return (None if whole else _apart(problem, budget)) or _after_pruning(problem, budget)
    return _after_trial(problem, budget, trial, whole=whole)


def _apart(problem: Problem, budget: Budget) -> Choice | None:
    """Each independent part by the method that suits it; None where no two of them are rare."""
    parts = independent_parts(problem, budget)
    if not parts:
        return None
    plans = [_better(part.problem, budget, whole=True).plan for part in parts]
    methods = ", ".join(plan.name for plan in plans)
    return Choice(pair(problem, parts, plans), f"{len(parts)} parts share no clause: {methods}")


def _after_pruning(problem: Problem, budget: Budget) -> Choice:
    """Where pruning takes much work: rejection without it, if that is cheap, or growth, if it does well; else pruning
    may go on for a while."""
    simple = first_look(problem, budget)
    if simple is not None:
        return Choice(simple, _in_range(simple))
    grown = plan_growth(problem, budget, patient=False)
    if isinstance(grown, Growth) and grown.recipe.effect <= POOR:
        return Choice(grown, "pruning takes much work, growth does not")
    if not isinstance(grown, Growth) and _time_is_up(grown):
        raise no_growth(problem, grown)
    try:
        trial = make_trial(problem, budget, MOST)
    except TooMuchError:
        return _without_rejection(problem, budget, "pruning takes too much work")
    return _after_trial(problem, budget, trial, whole=True)


def _after_trial(problem: Problem, budget: Budget, trial: Trial, *, whole: bool) -> Choice:
    if not trial.rate.hits:
        why = f"none of {trial.tried:,} candidates of rejection is in range"
        return (None if whole else _apart(problem, budget)) or _without_rejection(problem, budget, why, trial)
    try:
        mine = plan_rejection(problem, budget, trial, MOST)
    except TooMuchError:
        why = "pruning each cell takes too much work"
        return (None if whole else _apart(problem, budget)) or _without_rejection(problem, budget, why)
    in_range = _in_range(mine)
    open_cells = len(problem.possible) - len(mine.reached) - len(mine.ruled_out)
    cheap = mine.evaluations <= ADVANTAGE * (LEAST + EACH * problem.request.n)
    if cheap and open_cells <= len(mine.reached):
        return Choice(mine, in_range)
    apart = None if whole else _apart(problem, budget)
    if apart is not None and ADVANTAGE * apart.plan.evaluations < mine.evaluations:
        return apart
    rival = _other(problem, budget)
    if not isinstance(rival, Growth | Splitting):
        if _time_is_up(rival):
            raise RequestError(too_early(problem, f"{int(rival.evaluations):,} evaluations", open_cells))
        return Choice(mine, f"{in_range}; no other method got there")
    if len(rival.reached) > len(mine.reached):
        count = problem.cells.count
        reason = f"it reaches {len(rival.reached)} of {count} cells, rejection {len(mine.reached)}"
        return Choice(rival, reason)
    costs = f"about {_short(rival.evaluations)} evaluations against {_short(mine.evaluations)} of"
    if len(rival.reached) == len(mine.reached) and ADVANTAGE * rival.evaluations < mine.evaluations:
        return Choice(rival, f"{costs} rejection")
    return Choice(mine, in_range)


def _without_rejection(problem: Problem, budget: Budget, why: str, trial: Trial | None = None) -> Choice:
    """Where rejection has no plan, or its first candidates are all out of the range."""
    plan = _other(problem, budget)
    if isinstance(plan, Growth | Splitting):
        return Choice(plan, why)
    if _time_is_up(plan):
        raise _nothing(problem, plan)
    if trial is None or (isinstance(plan, NoGrowth) and plan.crowded):
        raise _nothing(problem, plan)
    # Levels cannot be told apart where phi is constant: there rejection may be lucky.
    longer = search(problem, trial, lambda: budget.spent, LONG_SEARCH)
    if not longer.rate.hits:
        raise RequestError(hopeless(problem, longer))
    return Choice(plan_rejection(problem, budget, longer), "no other method got there")


def _other(problem: Problem, budget: Budget) -> Growth | Splitting | NoGrowth | Stalled:
    """A plan of growth, or of splitting where growth does not do well and splitting does."""
    quick = plan_growth(problem, budget, patient=False)
    if isinstance(quick, Growth) and quick.recipe.effect <= POOR:
        return quick
    if not isinstance(quick, Growth) and _time_is_up(quick):
        return quick
    crowded = not isinstance(quick, Growth) and quick.crowded
    split = None if crowded else plan_splitting(problem, budget)
    if isinstance(split, Splitting) and split.plan.left < SLOW:
        return split
    grown = plan_growth(problem, budget) if crowded or isinstance(quick, Growth) else quick
    if isinstance(grown, Growth):
        return grown
    return split if isinstance(split, Splitting) else grown


def _nothing(problem: Problem, end: NoGrowth | Stalled) -> RequestError:
    return no_growth(problem, end) if isinstance(end, NoGrowth) else RequestError(why_stalled(problem, end))


def _time_is_up(end: NoGrowth | Stalled) -> bool:
    return end.stuck is None if isinstance(end, NoGrowth) else end.why == "time"


def _in_range(plan: Rejection) -> str:
    parts = sum(len(source.cover.parts) for source in plan.sources)
    boxes = "1 box" if parts == 1 else f"{parts:,} boxes"
    if len(plan.sources) == 1:
        rate = plan.explored
        return f"{_percent(rate.hits / rate.candidates)} of the candidates from {boxes} are in range"
    share = min(1.0, SPARE * plan.wanted / plan.expected)
    return f"about {_percent(share)} of the candidates from {boxes} are of use"


def _percent(share: float) -> str:
    """45 %, 0.3 %; never 100 % for less than all."""
    if share >= 0.995:
        return "all" if share == 1.0 else "over 99%"
    return f"{100.0 * share:.0f}%" if share >= 0.1 else f"{100.0 * share:.2g}%"


def _short(count: float) -> str:
    """1,234,567 -> 1.2 million."""
    for size, name in ((1e9, "billion"), (1e6, "million"), (1e3, "thousand")):
        if count >= size:
            return f"{count / size:.2g} {name}"
    return f"{count:.0f}"
