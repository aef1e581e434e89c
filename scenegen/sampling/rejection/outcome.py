"""What pruned rejection comes to for a request: whether it is enough, or other methods have to be looked at."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeVar

from scenegen.sampling.plan import Plan
from scenegen.sampling.problem import Budget, Problem
from scenegen.sampling.rejection.sampler import SPARE, Rejection
from scenegen.sampling.rejection.sampler import make_plan as plan_rejection
from scenegen.sampling.rejection.trial import MOST, Trial, make_trial
from scenegen.search.effort import TooMuchError

P = TypeVar("P", bound=Plan)

CELLS = 2.4e8  # work that covers of a cell each may take together before another method is tried: 3 s
TRIED = 2.0  # seconds of rejection with pruning that are spent without looking at another method
FIRST = 5e7  # work that pruning may take before growth is tried: under a second, and more than most shipped specs take
MANY = 24  # with more moving rows, other methods than growth are not tried if pruning takes much work
GROWN = 5e-6  # seconds of growth for a scene and each of its moving rows, at least


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
    problem: Problem,
    budget: Budget,
    most: float,
    on_quarter: Callable[[], object] | None = None,
    further: Callable[[], float] | None = None,
) -> RejectionOutcome:
    """Rejection, if pruning takes no more than that work. `on_quarter` is called where it takes a quarter of it,
    `further` where it takes more: it then goes on up to what that returns."""
    try:
        trial = make_trial(problem, budget, most, on_quarter, further)
    except TooMuchError:
        return RejectionOutcome(None)
    if trial.work > most:
        return RejectionOutcome(None, longer=trial)
    if not trial.rate.hits:
        return RejectionOutcome(trial)
    try:
        plan = plan_rejection(problem, budget, trial, MOST, CELLS)
    except TooMuchError:
        return RejectionOutcome(trial)
    cheap = plan.seconds <= max(TRIED, GROWN * moving(problem) * problem.request.n)
    return RejectionOutcome(trial, plan, cheap and open_cells(problem, plan) <= len(plan.reached))


def cheap_enough(found: RejectionOutcome) -> Rejection | None:
    """Rejection, if it is enough."""
    return with_reason(found.plan, in_range(found.plan)) if found.plan is not None and found.enough else None


def open_cells(problem: Problem, plan: Rejection) -> int:
    """Cells that are neither reached nor proved empty."""
    return len(problem.possible) - len(plan.reached) - len(plan.ruled_out)


def moving(problem: Problem) -> int:
    """Rows of the scenes that are not held."""
    return int((problem.lowest < problem.highest).sum())


def with_reason(plan: P, why: str) -> P:
    """The plan, and why it was chosen."""
    return replace(plan, why=why)


def in_range(plan: Rejection) -> str:
    """How many of its candidates are of use."""
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
