"""Growth and splitting beside rejection: which of them serves a request that pruned rejection does not do at once.

If pruning takes much work, finds nothing in a part of the range that is not proved empty, or would need many
candidates, a plan of growth is made, which costs as much as a few hundred scenes; if growth does not do well, a plan of
splitting. Before all this, a request that consists of independent parts is split into them, and each part gets the
method that suits it.
"""

from __future__ import annotations

from scenegen.bounds.effort import TooMuchError
from scenegen.errors import RequestError
from scenegen.sampling.at_once import FIRST, GROWN, MANY, Look, because, in_range, look, moving, open_cells
from scenegen.sampling.growth.plan import Stalled as NoGrowth
from scenegen.sampling.growth.plan import Started
from scenegen.sampling.growth.sampler import Growth, no_growth, plan_growth
from scenegen.sampling.paired import Paired, pair
from scenegen.sampling.parts import independent_parts
from scenegen.sampling.plan import Plan
from scenegen.sampling.problem import Budget, Problem
from scenegen.sampling.rejection.sampler import Rejection, first_look, work_of
from scenegen.sampling.rejection.sampler import make_plan as plan_rejection
from scenegen.sampling.rejection.trial import LONG_SEARCH, MOST, Trial, make_trial, nothing_found, search
from scenegen.sampling.report import too_early
from scenegen.sampling.splitting.levels import Stalled
from scenegen.sampling.splitting.sampler import Splitting, plan_splitting, why_stalled

EASY = 1e8  # work of rejection without pruning that is done without looking at another method
PRUNED = 4.0  # share of the work without pruning, its inverse, that pruning may take
POOR = 3.0  # design effect that growth may leave before splitting is tried
SLOW = 0.1  # correlation that splitting's chains may leave to take its place
ADVANTAGE = 2.0  # splitting must be this much cheaper, because its scenes are only nearly independent


def contest(
    problem: Problem, budget: Budget, found: Look, *, whole: bool = False, started: Started | None = None
) -> Plan:
    """The best plan, given what rejection came to. `whole`: do not split the request into independent parts. `started`
    is what growth has done so far: see `start_growth`. Raises RequestError as `choose` does."""
    if found.trial is None:
        return (None if whole else _apart(problem, budget, started)) or _after_pruning(problem, budget, started)
    return _after_trial(problem, budget, found, found.trial, whole=whole, started=started)


def _apart(problem: Problem, budget: Budget, started: Started | None) -> Paired | None:
    """Each independent part by the method that suits it; None if fewer than two of them are rare."""
    parts = independent_parts(problem, budget)
    if not parts:
        return None
    if started is not None:
        started.give_up()
    plans = [contest(part.problem, budget, look(part.problem, budget, FIRST), whole=True) for part in parts]
    methods = ", ".join(plan.method for plan in plans)
    return because(pair(problem, parts, plans), f"{len(parts)} parts share no clause: {methods}")


def _after_pruning(problem: Problem, budget: Budget, started: Started | None) -> Plan:
    """If pruning takes much work: rejection without pruning if that is cheap, or growth if it does well; else pruning
    continues for a while."""
    simple = _without_pruning(problem, budget)
    if simple is not None:
        return because(simple, in_range(simple))
    grown = plan_growth(problem, budget, patient=False, started=started)
    if isinstance(grown, Growth) and grown.recipe.effect <= POOR:
        return because(grown, "pruning takes much work, growth does not")
    if not isinstance(grown, Growth) and (_time_is_up(grown) or grown.proof):
        raise no_growth(problem, grown)
    if moving(problem) > MANY:  # neither boxes nor chains get anywhere
        grown = plan_growth(problem, budget)
        if isinstance(grown, Growth):
            return because(grown, "pruning takes much work, growth less")
        raise no_growth(problem, grown)
    found = look(problem, budget, MOST)
    if found.trial is None:
        return _without_rejection(problem, budget, "pruning takes too much work", quick=grown)
    return _after_trial(problem, budget, found, found.trial, whole=True, quick=grown)


def _without_pruning(problem: Problem, budget: Budget) -> Rejection | None:
    """Rejection from the contracted box, or pruned for a fraction of that work, if either is cheaper than growth."""
    plan = first_look(problem, budget)
    if plan is None:
        return None
    cheap, work = max(EASY, GROWN * moving(problem) * problem.request.n), work_of(plan)
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
    problem: Problem,
    budget: Budget,
    found: Look,
    trial: Trial,
    *,
    whole: bool,
    quick: Growth | NoGrowth | None = None,
    started: Started | None = None,
) -> Plan:
    """`quick` is a plan of growth on which little was spent, where it has been made."""
    mine = found.plan
    if mine is not None and found.enough:
        return because(mine, in_range(mine))
    apart = None if whole else _apart(problem, budget, started)
    if mine is None and apart is not None:
        return apart
    if mine is None and not trial.rate.hits:
        why = f"none of {trial.tried:,} candidates of rejection is in range"
        return _without_rejection(problem, budget, why, trial, quick, started)
    if mine is None:
        return _after_cells(problem, budget, trial, quick, started)
    if apart is not None and ADVANTAGE * apart.evaluations < mine.evaluations:
        return apart
    rival = _other(problem, budget, quick, started, ahead=False)
    if not isinstance(rival, Growth | Splitting):
        if _time_is_up(rival):
            raise RequestError(too_early(problem, f"{int(rival.evaluations):,} evaluations", open_cells(problem, mine)))
        return because(mine, f"{in_range(mine)}; no other method got there")
    if len(rival.reached) > len(mine.reached):
        count = problem.cells.count
        reason = f"it reaches {len(rival.reached)} of {count} cells, rejection {len(mine.reached)}"
        return because(rival, reason)
    costs = f"about {_short(rival.evaluations)} evaluations against {_short(mine.evaluations)} of"
    if len(rival.reached) == len(mine.reached) and ADVANTAGE * rival.evaluations < mine.evaluations:
        return because(rival, f"{costs} rejection")
    return because(mine, in_range(mine))


def _after_cells(
    problem: Problem, budget: Budget, trial: Trial, quick: Growth | NoGrowth | None, started: Started | None
) -> Plan:
    """If pruning each cell takes much work: another method, or all the work if there is none."""
    why = "pruning each cell takes too much work"
    rival = _other(problem, budget, quick, started)
    if isinstance(rival, Growth | Splitting):
        return because(rival, why)
    if _time_is_up(rival) or (isinstance(rival, NoGrowth) and (rival.proof or rival.crowded)):
        raise _nothing(problem, rival)
    try:
        return because(plan_rejection(problem, budget, trial, MOST), "no other method got there")
    except TooMuchError:
        raise _nothing(problem, rival) from None


def _without_rejection(
    problem: Problem,
    budget: Budget,
    why: str,
    trial: Trial | None = None,
    quick: Growth | NoGrowth | None = None,
    started: Started | None = None,
) -> Plan:
    """If rejection has no plan, or its first candidates are all out of the range."""
    plan = _other(problem, budget, quick, started)
    if isinstance(plan, Growth | Splitting):
        return because(plan, why)
    if _time_is_up(plan) or (isinstance(plan, NoGrowth) and plan.proof):
        raise _nothing(problem, plan)
    if trial is None or (isinstance(plan, NoGrowth) and plan.crowded):
        raise _nothing(problem, plan)
    # A constant phi gives no levels: rejection may be lucky.
    longer = search(problem, trial, budget, LONG_SEARCH)
    if not longer.rate.hits:
        raise RequestError(nothing_found(problem, longer))
    return because(plan_rejection(problem, budget, longer), "no other method got there")


def _other(
    problem: Problem,
    budget: Budget,
    quick: Growth | NoGrowth | None = None,
    started: Started | None = None,
    *,
    ahead: bool = True,
) -> Growth | Splitting | NoGrowth | Stalled:
    """A plan of growth, or of splitting if only splitting does well. `ahead`: it will probably be taken."""
    quick = plan_growth(problem, budget, patient=False, ahead=ahead, started=started) if quick is None else quick
    if isinstance(quick, Growth) and quick.recipe.effect <= POOR:
        return quick
    if not isinstance(quick, Growth) and (_time_is_up(quick) or quick.proof):
        return quick
    if moving(problem) > MANY:  # more patience first: chains of so much take long to get anywhere
        quick = plan_growth(problem, budget)
        if isinstance(quick, Growth) or _time_is_up(quick) or quick.proof or quick.crowded:
            return quick
    crowded = not isinstance(quick, Growth) and quick.crowded
    split = None if crowded else plan_splitting(problem, budget, ahead=ahead)
    if isinstance(split, Splitting) and split.schedule.left < SLOW:
        return split
    if isinstance(split, Stalled) and _time_is_up(split):  # not that it came to nothing: who can tell?
        return split
    grown = plan_growth(problem, budget) if crowded or isinstance(quick, Growth) else quick
    if isinstance(grown, Growth):
        return grown
    return split if isinstance(split, Splitting) else grown


def _nothing(problem: Problem, end: NoGrowth | Stalled) -> RequestError:
    return no_growth(problem, end) if isinstance(end, NoGrowth) else RequestError(why_stalled(problem, end))


def _time_is_up(end: NoGrowth | Stalled) -> bool:
    return end.stuck is None and not end.proof if isinstance(end, NoGrowth) else end.why == "time"


def _short(count: float) -> str:
    """1,234,567 -> 1.2 million."""
    for size, name in ((1e9, "billion"), (1e6, "million"), (1e3, "thousand")):
        if count >= size:
            return f"{count / size:.2g} {name}"
    return f"{count:.0f}"
