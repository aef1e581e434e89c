"""Growth and splitting beside rejection: which of them serves a request that pruned rejection does not do at once.

If pruning takes much work, finds nothing in a part of the range that is not proved empty, or would need many
candidates, a plan of growth is made, which costs as much as a few hundred scenes; if growth does not do well, a plan of
splitting. Before all this, a request that consists of independent parts is split into them, and each part gets the
method that suits it.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace

import numpy as np

from scenegen.errors import RequestError
from scenegen.processes.ahead import BackgroundTask
from scenegen.sampling.growth.population import GrowthFailed as NoGrowth
from scenegen.sampling.growth.population import StartedGrowth, start_growth
from scenegen.sampling.growth.sampler import Growth, no_growth, plan_growth
from scenegen.sampling.parts import ProductPlan, SubProblem, independent_parts, pair
from scenegen.sampling.plan import Plan
from scenegen.sampling.problem import Budget, Problem
from scenegen.sampling.rejection.outcome import (
    FIRST,
    GROWN,
    MANY,
    RejectionOutcome,
    cheap_enough,
    in_range,
    moving,
    open_cells,
    try_rejection,
    with_reason,
)
from scenegen.sampling.rejection.sampler import Rejection, first_look
from scenegen.sampling.rejection.sampler import make_plan as plan_rejection
from scenegen.sampling.rejection.trial import LONG_SEARCH, MOST, Trial, nothing_found, search
from scenegen.sampling.report import too_early
from scenegen.sampling.splitting.levels import SplittingStalled
from scenegen.sampling.splitting.sampler import Splitting, plan_splitting, why_stalled
from scenegen.search.effort import BOUNDED, TooMuchError

EASY = 1.0  # seconds of rejection without pruning that are spent without looking at another method
PRUNED = 4.0  # share of the time without pruning, its inverse, that pruning may take
POOR = 3.0  # design effect that growth may leave before splitting is tried
SLOW = 0.1  # correlation that splitting's chains may leave to take its place
ADVANTAGE = 2.0  # growth and splitting must be this much cheaper, because their scenes are only nearly independent
LOOKED = 2.0  # share of what a plan at hand takes, its inverse, that another method may take to get a plan
LONG, GLANCE = 8.0, 8.0  # seconds of growth from which on splitting is looked at, too, and the same share for that

Seen = tuple[RejectionOutcome, Rejection | None] | RequestError
"""What rejection came to, and rejection without pruning, if pruning takes much work; or that there is no plan."""


@dataclass(frozen=True, slots=True)
class MethodChoice:
    """Of the methods for one request. `started` is what growth has done so far: see `start_growth`. `parts` are the
    independent ones, into which the request can be split; None if nobody has looked yet. `choose` makes the plan of
    such a part; `seen` is what another process begins these plans with: see `PartsTrial`. `box` is rejection without
    pruning; None if it has no plan."""

    problem: Problem
    budget: Budget
    choose: Callable[[Problem, Budget], Plan]
    started: StartedGrowth | None = None
    parts: tuple[SubProblem, ...] | None = None
    seen: BackgroundTask[tuple[SubProblem, ...], list[Seen]] | None = None
    box: Rejection | None = None

    def with_box(self) -> MethodChoice:
        """The same with its parts, and rejection without pruning if there are none. Raises RequestError if it turns out
        that there is no scene."""
        parts = independent_parts(self.problem, self.budget) if self.parts is None else self.parts
        return replace(self, parts=parts, box=None if parts else first_look(self.problem, self.budget))

    @property
    def affordable(self) -> float:
        """The work that pruning may take."""
        return _affordable(self.problem, self.box)

    def best(self, found: RejectionOutcome) -> Plan:
        """The best plan, given what rejection came to. Raises RequestError as `choose` does."""
        with ExitStack() as stack:
            contest = self
            if self.started is None:
                started = start_growth(self.problem, self.budget)
                contest = self if started is None else replace(self, started=stack.enter_context(started))
            plan = contest._best(found)
            if isinstance(plan, Growth) and plan.started is not None:
                plan.started.kept = True
            return plan

    def _best(self, found: RejectionOutcome) -> Plan:
        if found.trial is None:
            return self._apart() or self._after_pruning(found.longer)
        return self._after_trial(found, found.trial)

    def _apart(self) -> ProductPlan | None:
        """Each independent part by the method that suits it; None if fewer than two of them are rare."""
        parts = independent_parts(self.problem, self.budget) if self.parts is None else self.parts
        if not parts:
            return None
        if self.started is not None:
            self.started.give_up()
        seen = [None] * len(parts) if self.seen is None else self.seen.result()
        plans = [self._of_part(part.problem, one).joined() for part, one in zip(parts, seen, strict=True)]
        methods = ", ".join(plan.method for plan in plans)
        return with_reason(pair(self.problem, parts, plans), f"{len(parts)} parts share no clause: {methods}")

    def _of_part(self, problem: Problem, seen: Seen | None) -> Plan:
        if seen is None:
            return self.choose(problem, self.budget)
        if isinstance(seen, RequestError):
            raise seen
        found, box = seen
        return cheap_enough(found) or MethodChoice(problem, self.budget, self.choose, parts=(), box=box).best(found)

    def _after_pruning(self, longer: Trial | None) -> Plan:
        """If pruning takes much work: rejection if that is cheap, or growth if it does well; else pruning continues for
        a while. `longer` is what pruning came to, if it was affordable."""
        problem, budget = self.problem, self.budget
        simple = self._cheapest(longer)
        if simple is not None and simple.seconds <= _cheap(problem):
            return with_reason(simple, in_range(simple))
        longest = np.inf if simple is None else simple.seconds / LOOKED
        grown = plan_growth(problem, budget, patient=False, started=self.started, longest=longest)
        good = isinstance(grown, Growth) and grown.recipe.effect <= POOR
        if isinstance(grown, Growth) and good and (simple is None or _better(grown, simple)):
            best = self._or_splitting(grown)
            why = "growth does not" if best is grown else "and splitting less than growth"
            return with_reason(best, f"pruning takes much work, {why}")
        if simple is not None and (good or (not isinstance(grown, Growth) and grown.dear)):
            if isinstance(grown, Growth):
                grown.close()
            return with_reason(simple, in_range(simple))
        if not isinstance(grown, Growth) and (_time_is_up(grown) or grown.proof):
            raise no_growth(problem, grown)
        if moving(problem) > MANY:  # neither boxes nor chains get anywhere
            grown = plan_growth(problem, budget)
            if isinstance(grown, Growth):
                return with_reason(grown, "pruning takes much work, growth less")
            raise no_growth(problem, grown)
        found = try_rejection(problem, budget, MOST)
        if found.trial is None:
            return self._without_rejection("pruning takes too much work", quick=grown)
        return replace(self, parts=())._after_trial(found, found.trial, quick=grown)

    def _cheapest(self, longer: Trial | None) -> Rejection | None:
        """Rejection from the contracted box, or pruned; None if neither has a plan."""
        plan = self.box
        if plan is None:
            return None
        if longer is not None:
            with suppress(TooMuchError):  # the box remains
                pruned = plan_rejection(self.problem, self.budget, longer, self.affordable)
                if len(pruned.reached) == len(plan.reached) and pruned.seconds < plan.seconds:
                    plan = pruned
        return plan

    def _after_trial(self, found: RejectionOutcome, trial: Trial, quick: Growth | NoGrowth | None = None) -> Plan:
        """`quick` is a plan of growth on which little was spent, where it has been made."""
        mine = found.plan
        if mine is not None and found.enough:
            return with_reason(mine, in_range(mine))
        apart = self._apart()
        if mine is None and apart is not None:
            return apart
        if mine is None and not trial.rate.hits:
            why = f"none of {trial.tried:,} candidates of rejection is in range"
            return self._without_rejection(why, trial, quick)
        if mine is None:
            return self._after_cells(trial, quick)
        if apart is not None and ADVANTAGE * apart.seconds < mine.seconds:
            return apart
        return self._against(mine, quick)

    def _against(self, mine: Rejection, quick: Growth | NoGrowth | None) -> Plan:
        """Rejection, or another method that reaches more or costs much less."""
        problem = self.problem
        longest = np.inf if open_cells(problem, mine) else mine.seconds / LOOKED
        rival = self.other(quick, ahead=False, longest=longest)
        if not isinstance(rival, Growth | Splitting):
            if _time_is_up(rival):
                tried = f"{int(rival.evaluations):,} evaluations"
                raise RequestError(too_early(problem, tried, open_cells(problem, mine)))
            return with_reason(mine, f"{in_range(mine)}; no other method got there")
        if len(rival.reached) > len(mine.reached):
            count = problem.cells.count
            why = f"it reaches {len(rival.reached)} of {count} cells, rejection {len(mine.reached)}"
        elif _better(rival, mine):
            why = f"about {_short(rival.seconds)} s against {_short(mine.seconds)} s of rejection"
        else:
            rival.close()
            return with_reason(mine, in_range(mine))
        return with_reason(rival, why)

    def _after_cells(self, trial: Trial, quick: Growth | NoGrowth | None) -> Plan:
        """If pruning each cell takes much work: another method, or all the work if there is none."""
        rival = self.other(quick)
        if isinstance(rival, Growth | Splitting):
            return with_reason(rival, "pruning each cell takes too much work")
        if _time_is_up(rival) or (isinstance(rival, NoGrowth) and (rival.proof or rival.crowded)):
            raise _nothing(self.problem, rival)
        try:
            return with_reason(plan_rejection(self.problem, self.budget, trial, MOST), "no other method got there")
        except TooMuchError:
            raise _nothing(self.problem, rival) from None

    def _without_rejection(self, why: str, trial: Trial | None = None, quick: Growth | NoGrowth | None = None) -> Plan:
        """If rejection has no plan, or its first candidates are all out of the range."""
        problem, budget = self.problem, self.budget
        plan = self.other(quick)
        if isinstance(plan, Growth | Splitting):
            return with_reason(plan, why)
        if _time_is_up(plan) or (isinstance(plan, NoGrowth) and plan.proof):
            raise _nothing(problem, plan)
        if trial is None or (isinstance(plan, NoGrowth) and plan.crowded):
            raise _nothing(problem, plan)
        # A constant phi gives no levels: rejection may be lucky.
        longer = search(problem, trial, budget, LONG_SEARCH)
        if not longer.rate.hits:
            raise RequestError(nothing_found(problem, longer))
        return with_reason(plan_rejection(problem, budget, longer), "no other method got there")

    def other(
        self, quick: Growth | NoGrowth | None = None, *, ahead: bool = True, longest: float = np.inf
    ) -> Growth | Splitting | NoGrowth | SplittingStalled:
        """A plan of growth, or of splitting if only splitting does well. `ahead`: it will probably be taken. Each may
        take `longest` seconds to get a plan."""
        problem, budget = self.problem, self.budget
        if quick is None:
            quick = plan_growth(problem, budget, patient=False, started=self.started, longest=longest)
        if isinstance(quick, Growth) and quick.recipe.effect <= POOR:
            return self._or_splitting(quick)
        if not isinstance(quick, Growth) and (_time_is_up(quick) or quick.proof):
            return quick
        if isinstance(quick, Growth):
            quick.close()  # it will not be taken
        if moving(problem) > MANY:  # more patience first: chains of so much take long to get anywhere
            quick = plan_growth(problem, budget, longest=longest)
            if isinstance(quick, Growth) or _time_is_up(quick) or quick.proof or quick.crowded:
                return quick
        crowded = not isinstance(quick, Growth) and quick.crowded
        split = None if crowded else plan_splitting(problem, budget, ahead=ahead, longest=longest)
        if isinstance(split, Splitting) and split.schedule.left < SLOW:
            return split
        if isinstance(split, SplittingStalled) and _time_is_up(split):  # not that it came to nothing: who can tell?
            return split
        grown = plan_growth(problem, budget, longest=longest) if crowded or isinstance(quick, Growth) else quick
        if isinstance(grown, Growth):
            return grown
        return split if isinstance(split, Splitting) else grown

    def _or_splitting(self, grown: Growth) -> Growth | Splitting:
        """Growth; or splitting, where growth takes long and a glance shows that splitting takes far less."""
        if grown.seconds < LONG:
            return grown
        split = plan_splitting(self.problem, self.budget, ahead=False, longest=grown.seconds / GLANCE)
        if not isinstance(split, Splitting) or split.schedule.left >= SLOW or len(split.reached) < len(grown.reached):
            return grown
        if ADVANTAGE * split.seconds >= grown.seconds:
            return grown
        grown.close()
        return split


@dataclass(frozen=True, slots=True)
class PartsTrial:
    """What `choose` begins with for each part, in any process."""

    budget: Budget

    def __call__(self, parts: tuple[SubProblem, ...]) -> list[Seen]:
        return [self._look(part.problem) for part in parts]

    def _look(self, problem: Problem) -> Seen:
        box: Rejection | None = None

        def further() -> float:
            nonlocal box
            box = first_look(problem, self.budget)
            return _affordable(problem, box)

        try:
            return try_rejection(problem, self.budget, FIRST, further=further), box
        except RequestError as error:  # that of a part before may have to be raised first
            return error


def _better(rival: Growth | Splitting, mine: Rejection) -> bool:
    """Whether another method reaches more cells than rejection, or as many at much less cost."""
    more = len(rival.reached) - len(mine.reached)
    return more > 0 or (more == 0 and ADVANTAGE * rival.seconds < mine.seconds)


def _cheap(problem: Problem) -> float:
    """The seconds of rejection up to which no other method is looked at."""
    return max(EASY, GROWN * moving(problem) * problem.request.n)


def _affordable(problem: Problem, box: Rejection | None) -> float:
    """The work that pruning may take: a fraction of what it can save. 0 if it has taken so much already, or would save
    too little."""
    work = 0.0 if box is None else box.seconds / BOUNDED
    return work / PRUNED if 2.0 * PRUNED * FIRST < work <= PRUNED * _cheap(problem) / BOUNDED else 0.0


def _nothing(problem: Problem, end: NoGrowth | SplittingStalled) -> RequestError:
    return no_growth(problem, end) if isinstance(end, NoGrowth) else RequestError(why_stalled(problem, end))


def _time_is_up(end: NoGrowth | SplittingStalled) -> bool:
    return end.stuck is None and not end.proof and not end.dear if isinstance(end, NoGrowth) else end.why == "time"


def _short(seconds: float) -> str:
    """1234.5 -> 1,200; 0.0123 -> 0.012."""
    return f"{float(f'{seconds:.2g}'):,.10g}"
