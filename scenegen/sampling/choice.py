"""Chooses the exact sampler for a request: the one that needs least time.

Pruned rejection is tried first: its scenes are independent, and most requests take a fraction of a second. If pruning
takes much work, finds nothing in a part of the range that is not proved empty, or would need many candidates, a plan of
growth is made, which costs as much as a few hundred scenes; if growth does not do well, one of a larger population, but
for no longer than a plan of splitting takes, then that plan. Before all this, a request that consists of independent
parts is split into them, and each part gets the method that suits it.

Work is counted, never timed: its kinds have prices in seconds, which are constants. So the same request and seed always
get the same method. Growth and splitting are loaded when they are asked for: that takes longer than many requests for
which rejection is enough.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from scenegen.errors import RequestError
from scenegen.sampling.plan import NoPlan, Plan
from scenegen.sampling.problem import Problem
from scenegen.sampling.rejection.sampler import SPARE_SCENES, Rejection, first_look
from scenegen.sampling.rejection.sampler import make_plan as plan_rejection
from scenegen.sampling.rejection.trial import (
    LONG_SEARCH_CANDIDATES,
    TRIAL_WORK,
    Trial,
    make_trial,
    nothing_found,
    search_longer,
)
from scenegen.sampling.report import too_early
from scenegen.search.effort import BOUND_SECONDS, Budget, TooMuchError, moving_seconds

if TYPE_CHECKING:
    from scenegen.sampling.growth.sampler import Growth
    from scenegen.sampling.parts import ProductPlan, SubProblem
    from scenegen.sampling.splitting.sampler import Splitting

AnyPlan = TypeVar("AnyPlan", bound=Plan)

# work that pruning may take before growth is tried: under a second, and more than most shipped specs take
FIRST_PRUNING_WORK = 5e7
CELL_COVERS_WORK = 2.4e8  # work that covers of a cell each may take together before another method is tried: 3 s
CHEAP_PRUNED_SECONDS = 2.0  # seconds of rejection with pruning that are spent without looking at another method
CHEAP_BOX_SECONDS = 1.0  # seconds of rejection without pruning that are spent without looking at another method
MIN_GROWTH_SECONDS = 5e-6  # seconds of growth for a scene and each of its moving rows, at least
MANY_ROWS = 24  # with more moving rows, other methods than growth are not tried if pruning takes much work
PRUNING_SHARE = 4.0  # share of the time without pruning, its inverse, that pruning may take
POOR_EFFECT = 3.0  # design effect that growth may leave before splitting is tried
SLOW_CORRELATION = 0.1  # correlation that splitting's chains may leave to take its place
ADVANTAGE = 2.0  # growth and splitting must be this much cheaper, because their scenes are only nearly independent
RIVAL_SHARE = 2.0  # share of what a plan at hand takes, its inverse, that another method may take to get a plan
# seconds of growth from which on splitting is looked at, too, and the same share for that
LONG_GROWTH_SECONDS, GLANCE_SHARE = 8.0, 8.0
# this share where few rows move, and how much cheaper splitting must be then
SPLITTING_SHARE, SPLITTING_GAIN = 4.0, 1.4
# moves and chains of a plan of splitting, about: growth may take as long to get one
DESCENT_MOVES, DESCENT_CHAINS = 6e3, 4096


def choose(problem: Problem, budget: Budget, *, whole: bool = False) -> Plan:
    """The plan by the better method; its `why` says why. `whole`: the request is not to be split into independent
    parts. Raises RequestError if there is no scene, or if time is up before there is a plan."""
    choice = MethodChoice(problem, budget, () if whole else None)
    found = try_rejection(problem, budget, FIRST_PRUNING_WORK, choice.further)
    if found.plan is not None and found.enough:
        return with_reason(found.plan, in_range(found.plan))
    return choice.best(found)


@dataclass(frozen=True, slots=True)
class RejectionOutcome:
    """What pruned rejection came to: `trial` is None if pruning takes too much work, `plan` if no candidate was in the
    range or pruning each cell takes too much; `enough` says that no other method can be much better. `longer` is a
    trial that took more work than it first was given."""

    trial: Trial | None
    plan: Rejection | None = None
    enough: bool = False
    longer: Trial | None = None


def try_rejection(
    problem: Problem, budget: Budget, most: float, further: Callable[[], float] | None = None
) -> RejectionOutcome:
    """Rejection, if pruning takes no more than that work. `further` is called where it takes more: it then goes on up
    to what that returns."""
    try:
        trial = make_trial(problem, budget, most, further)
    except TooMuchError:
        return RejectionOutcome(None)
    if trial.work > most:
        return RejectionOutcome(None, longer=trial)
    if not trial.hits.any():
        return RejectionOutcome(trial)
    try:
        plan = plan_rejection(problem, budget, trial, TRIAL_WORK, CELL_COVERS_WORK)
    except TooMuchError:
        return RejectionOutcome(trial)
    cheap = plan.seconds <= max(CHEAP_PRUNED_SECONDS, MIN_GROWTH_SECONDS * problem.moving * problem.request.n)
    return RejectionOutcome(trial, plan, cheap and _open_cells(problem, plan) <= len(plan.reached_cells))


def _open_cells(problem: Problem, plan: Rejection) -> int:
    """Cells that are neither reached nor proved empty."""
    return len(problem.possible) - len(plan.reached_cells) - len(plan.ruled_out)


def with_reason(plan: AnyPlan, why: str) -> AnyPlan:
    """The plan, and why it was chosen."""
    return replace(plan, why=why)


def in_range(plan: Rejection) -> str:
    """How many of its candidates are of use."""
    parts = sum([len(source.cover.parts) for source in plan.sources])
    boxes = "1 box" if parts == 1 else f"{parts:,} boxes"
    if len(plan.sources) == 1:
        rate = plan.explored
        return f"{_percent(rate.hits / rate.candidates)} of the candidates from {boxes} are in range"
    share = min(1.0, SPARE_SCENES * plan.scenes_wanted / plan.expected)
    return f"about {_percent(share)} of the candidates from {boxes} are of use"


def _percent(share: float) -> str:
    """`45 %`, `0.3 %`; `100 %` only if it is all of them."""
    if share >= 0.995:
        return "all" if share == 1.0 else "over 99%"
    return f"{100.0 * share:.0f}%" if share >= 0.1 else f"{100.0 * share:.2g}%"


@dataclass(slots=True)
class MethodChoice:
    """Of the methods for one request. `parts` are the independent ones into which it can be split; None if nobody has
    looked yet. `box` is rejection without pruning; None if it has no plan, or nobody has looked."""

    problem: Problem
    budget: Budget
    parts: tuple[SubProblem, ...] | None = None
    box: Rejection | None = None

    def further(self) -> float:
        """The work that pruning may take where it takes more than it was given: a fraction of what it can save. 0 if it
        has taken so much already, or would save too little. Raises RequestError if there turns out to be no scene."""
        if not self._independent():
            self.box = first_look(self.problem, self.budget)
        return self._affordable

    @property
    def _affordable(self) -> float:
        work = 0.0 if self.box is None else self.box.seconds / BOUND_SECONDS
        worth = 2.0 * PRUNING_SHARE * FIRST_PRUNING_WORK < work <= PRUNING_SHARE * self._cheap / BOUND_SECONDS
        return work / PRUNING_SHARE if worth else 0.0

    def best(self, found: RejectionOutcome) -> Plan:
        """The best plan, given what rejection came to. Raises RequestError as `choose` does."""
        if found.trial is None:
            return self._by_parts() or self._after_pruning(found.longer)
        return self._after_trial(found, found.trial)

    @property
    def _cheap(self) -> float:
        """The seconds of rejection up to which no other method is looked at."""
        return max(CHEAP_BOX_SECONDS, MIN_GROWTH_SECONDS * self.problem.moving * self.problem.request.n)

    def _independent(self) -> tuple[SubProblem, ...]:
        if self.parts is None:
            from scenegen.sampling.parts import independent_parts

            self.parts = independent_parts(self.problem, self.budget)
        return self.parts

    def _by_parts(self) -> ProductPlan | None:
        """Each independent part by the method that suits it; None if fewer than two of them are rare."""
        parts = self._independent()
        if not parts:
            return None
        from scenegen.sampling.parts import pair

        plans = [choose(part.problem, self.budget, whole=True) for part in parts]
        methods = ", ".join(plan.method for plan in plans)
        return with_reason(pair(self.problem, parts, plans), f"{len(parts)} parts share no clause: {methods}")

    def _after_pruning(self, longer: Trial | None) -> Plan:
        """If pruning takes much work: rejection if that is cheap, or growth if it does well; else pruning continues for
        a while. `longer` is what pruning came to, if it was affordable."""
        problem, budget = self.problem, self.budget
        simple = self._cheapest(longer)
        if simple is not None and simple.seconds <= self._cheap:
            return with_reason(simple, in_range(simple))
        grown = self._growth(patient=False, longest=np.inf if simple is None else simple.seconds / RIVAL_SHARE)
        good = isinstance(grown, Plan) and grown.recipe.effect <= POOR_EFFECT
        if isinstance(grown, Plan) and good and (simple is None or _better(grown, simple)):
            best = self._or_splitting(grown)
            why = "growth does not" if best is grown else "and splitting less than growth"
            return with_reason(best, f"pruning takes much work, {why}")
        if simple is not None and (good or (isinstance(grown, NoPlan) and grown.too_dear)):
            return with_reason(simple, in_range(simple))
        if isinstance(grown, NoPlan) and grown.final:
            raise grown.error(problem)
        if problem.moving > MANY_ROWS:  # neither boxes nor chains get anywhere
            grown = self._growth()
            if isinstance(grown, NoPlan):
                raise grown.error(problem)
            return with_reason(grown, "pruning takes much work, growth less")
        found = try_rejection(problem, budget, TRIAL_WORK)
        if found.trial is None:
            return self._without_rejection("pruning takes too much work", quick=grown)
        self.parts = ()
        return self._after_trial(found, found.trial, quick=grown)

    def _cheapest(self, longer: Trial | None) -> Rejection | None:
        """Rejection from the contracted box, or pruned; None if neither has a plan."""
        plan = self.box
        if plan is None:
            return None
        if longer is not None:
            with suppress(TooMuchError):  # the box remains
                pruned = plan_rejection(self.problem, self.budget, longer, self._affordable)
                if len(pruned.reached_cells) == len(plan.reached_cells) and pruned.seconds < plan.seconds:
                    plan = pruned
        return plan

    def _after_trial(self, found: RejectionOutcome, trial: Trial, quick: Growth | NoPlan | None = None) -> Plan:
        """`quick` is a plan of growth on which little was spent, where it has been made."""
        mine = found.plan
        if mine is not None and found.enough:
            return with_reason(mine, in_range(mine))
        parts = self._by_parts()
        if parts is not None and (mine is None or ADVANTAGE * parts.seconds < mine.seconds):
            return parts
        if mine is not None:
            return self._against(mine, quick)
        if not trial.hits.any():
            why = f"none of {trial.tried:,} candidates of rejection is in range"
            return self._without_rejection(why, trial, quick)
        return self._after_cells(trial, quick)

    def _against(self, mine: Rejection, quick: Growth | NoPlan | None) -> Plan:
        """Rejection, or another method that reaches more or costs much less."""
        problem = self.problem
        rival = self._rival(quick, longest=np.inf if _open_cells(problem, mine) else mine.seconds / RIVAL_SHARE)
        if isinstance(rival, NoPlan):
            if rival.time_is_up:
                tried = f"{int(rival.evaluations):,} evaluations"
                raise RequestError(too_early(problem, tried, _open_cells(problem, mine)))
            return with_reason(mine, f"{in_range(mine)}; no other method got there")
        if len(rival.reached_cells) > len(mine.reached_cells):
            count = problem.cells.count
            why = f"it reaches {len(rival.reached_cells)} of {count} cells, rejection {len(mine.reached_cells)}"
        elif _better(rival, mine):
            why = f"about {_short(rival.seconds)} s against {_short(mine.seconds)} s of rejection"
        else:
            return with_reason(mine, in_range(mine))
        return with_reason(rival, why)

    def _after_cells(self, trial: Trial, quick: Growth | NoPlan | None) -> Plan:
        """If pruning each cell takes much work: another method, or all the work if there is none."""
        rival = self._rival(quick)
        if isinstance(rival, Plan):
            return with_reason(rival, "pruning each cell takes too much work")
        if rival.final or rival.is_crowded:
            raise rival.error(self.problem)
        try:
            return with_reason(
                plan_rejection(self.problem, self.budget, trial, TRIAL_WORK), "no other method got there"
            )
        except TooMuchError:
            raise rival.error(self.problem) from None

    def _without_rejection(self, why: str, trial: Trial | None = None, quick: Growth | NoPlan | None = None) -> Plan:
        """If rejection has no plan, or its first candidates are all out of the range."""
        problem, budget = self.problem, self.budget
        rival = self._rival(quick)
        if isinstance(rival, Plan):
            return with_reason(rival, why)
        if rival.final or rival.is_crowded or trial is None:
            raise rival.error(problem)
        # A constant phi gives no levels: rejection may be lucky.
        longer = search_longer(problem, trial, budget, LONG_SEARCH_CANDIDATES)
        if not longer.hits.any():
            raise RequestError(nothing_found(problem, longer))
        return with_reason(plan_rejection(problem, budget, longer), "no other method got there")

    def _rival(self, quick: Growth | NoPlan | None = None, *, longest: float = np.inf) -> Growth | Splitting | NoPlan:
        """A plan of growth, or of splitting if only splitting does well. Each may take `longest` seconds to get a
        plan."""
        if quick is None:
            quick = self._growth(patient=False, longest=longest)
        if isinstance(quick, Plan) and quick.recipe.effect <= POOR_EFFECT:
            return self._or_splitting(quick, longest)
        if isinstance(quick, NoPlan) and quick.final:
            return quick
        if self.problem.moving > MANY_ROWS:  # more patience first: chains of so much take long to get anywhere
            quick = self._growth(longest=longest)
            if isinstance(quick, Plan) or quick.final or quick.is_crowded:
                return quick
        if isinstance(quick, NoPlan) and quick.is_crowded:
            return self._growth(longest=longest)
        grown = quick
        if isinstance(quick, Plan):  # its scenes have too few ancestors: those of a larger population may have enough
            descent = moving_seconds(self.problem.core.nodes, DESCENT_MOVES * DESCENT_CHAINS, DESCENT_MOVES)
            grown = self._growth(longest=min(longest, descent), larger=True)
            if isinstance(grown, Plan):
                return self._or_splitting(grown, longest)
            if grown.final:
                return grown
        split = self._splitting(longest)
        if isinstance(split, Plan) or split.time_is_up:  # then nobody can tell what it would have come to
            return split
        cut = isinstance(quick, Plan) and isinstance(grown, NoPlan) and grown.too_dear
        return self._growth(longest=longest) if cut else grown

    def _or_splitting(self, grown: Growth, longest: float = np.inf) -> Growth | Splitting:
        """Growth; or splitting, where growth takes long and a look of `longest` seconds at most shows that splitting
        takes less. Chains of many moving rows take long to get anywhere: of these, only a glance is taken."""
        if grown.seconds < LONG_GROWTH_SECONDS:
            return grown
        many = self.problem.moving > MANY_ROWS
        split = self._splitting(min(longest, grown.seconds / (GLANCE_SHARE if many else SPLITTING_SHARE)))
        if isinstance(split, NoPlan) or len(split.reached_cells) < len(grown.reached_cells):
            return grown
        cheaper = (ADVANTAGE if many else SPLITTING_GAIN) * split.seconds < grown.seconds
        return split if cheaper and not (many and split.schedule.left >= SLOW_CORRELATION) else grown

    def _growth(self, *, patient: bool = True, longest: float = np.inf, larger: bool = False) -> Growth | NoPlan:
        from scenegen.sampling.growth.sampler import plan_growth

        return plan_growth(self.problem, self.budget, patient=patient, longest=longest, larger=larger)

    def _splitting(self, longest: float) -> Splitting | NoPlan:
        from scenegen.sampling.splitting.sampler import plan_splitting

        return plan_splitting(self.problem, self.budget, longest=longest)


def _better(rival: Plan, mine: Rejection) -> bool:
    """Whether another method reaches more cells than rejection, or as many at much less cost."""
    more = len(rival.reached_cells) - len(mine.reached_cells)
    return more > 0 or (more == 0 and ADVANTAGE * rival.seconds < mine.seconds)


def _short(seconds: float) -> str:
    """1234.5 -> 1,200; 0.0123 -> 0.012."""
    return f"{float(f'{seconds:.2g}'):,.10g}"
