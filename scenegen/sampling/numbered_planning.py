"""Planning scenes of a spec with random numbers of things: every member's plan, and which of them have no scenes."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from scenegen.errors import Diagnostic, RequestError
from scenegen.errors.counts import HELD_MAY_BE_MISSING, NO_NUMBER_POSSIBLE, NUMBER_LEFT_OUT
from scenegen.errors.requests import (
    BEYOND_BOUNDS,
    NO_ROOM,
    NO_SUCH_SCENE,
    REQUIREMENT_NOT_FOUND,
    TABLE_TOO_FULL,
    TOO_FEW_IN_RANGE,
    TOO_FEW_MEET_REQUIREMENT,
    TOO_IMPROBABLE,
)
from scenegen.lang.core import gated
from scenegen.lang.counts import combinations, written
from scenegen.lang.members import rows_among
from scenegen.lang.spec import CheckedSpec
from scenegen.sampling.fixed_objects import hold_fixed
from scenegen.sampling.numbered import Index, Numbered, NumberedCells
from scenegen.sampling.plan import Plan
from scenegen.sampling.problem import Budget, Problem
from scenegen.sampling.request import FixedPose, SampleRequest, check_seed

SEEDS = 9  # the stream of random numbers for the members' seeds; sampling/problem.py names the others
MOST_TURNS = 4096  # pieces until the turns begin again
WITHOUT = (NO_SUCH_SCENE, TOO_IMPROBABLE, BEYOND_BOUNDS, TABLE_TOO_FULL, REQUIREMENT_NOT_FOUND, NO_ROOM)
NOT_FOUND = (TOO_FEW_IN_RANGE, TOO_FEW_MEET_REQUIREMENT)  # in all the effort that there is, or in too little time

MakePlan = Callable[[CheckedSpec, SampleRequest], Plan]


def seed_of(seed: int, numbers: Mapping[str, int]) -> int:
    """The seed of the member with these numbers of things."""
    return int(np.random.SeedSequence([seed, SEEDS, *numbers.values()]).generate_state(1, np.uint64)[0] >> np.uint64(1))


def plan_numbers(
    spec: CheckedSpec,
    request: SampleRequest,
    budget: Budget,
    make: MakePlan,
    last: Callable[[Plan], Plan] = lambda plan: plan,
) -> Numbered:
    """The plan of a spec with random numbers of things; `make` plans a member, `last` takes each plan once the shares
    are known. Members that have no scene in the range are left out. Raises RequestError where all are, for a mistake in
    the request, and where time is up before all members are planned."""
    check_seed(request.seed)
    everything = list(combinations(spec.counts))
    for name, held in request.fix.items():
        if name in spec.objects and any(name not in member.objects for member in spec.members):
            raise RequestError(HELD_MAY_BE_MISSING(held.span if isinstance(held, FixedPose) else None, name=name))
    each = max(1, -(-request.n // len(everything))) if isinstance(request.n, int) and request.n > 0 else request.n
    numbers: list[dict[str, int]] = []
    plans: list[Plan] = []
    left_out: list[tuple[dict[str, int], str]] = []
    reasons: list[Diagnostic] = []
    for mine, member in zip(everything, spec.members, strict=True):
        try:
            plan = make(member, replace(request, n=each, seed=seed_of(request.seed, mine)))
        except RequestError as error:
            first = error.diagnostics[0]
            if first.kind not in WITHOUT and (first.kind not in NOT_FOUND or budget.spent):
                if not budget.spent:
                    raise
                raise RequestError(*(one.but(counted=written(mine)) for one in error.diagnostics)) from None
            left_out.append((mine, first.title))
            reasons.append(first)
            continue
        numbers.append(mine)
        plans.append(plan)
    if not plans:
        mine, why = left_out[0]
        raise RequestError(NO_NUMBER_POSSIBLE(reasons[0].span, counted=written(mine), why=why))
    if left_out:
        plans = [_asked(plan, -(-request.n // len(plans))) for plan in plans]
    plans = [last(plan) for plan in plans]
    return Numbered(
        _problem(spec, request, plans, numbers, left_out),
        tuple(plans),
        tuple(numbers),
        tuple(rows_among(spec, plan.problem.spec) for plan in plans),
        _turns([max(plan.fewest, request.n / len(plans) / max(plan.scenes_per_piece, 1e-9)) for plan in plans]),
        tuple(plan.fact_count for plan in plans),
        tuple(left_out),
        why=_why(plans, numbers),
    )


def _asked(plan: Plan, n: int) -> Plan:
    return replace(plan, problem=replace(plan.problem, request=replace(plan.problem.request, n=n)))


def _problem(
    spec: CheckedSpec,
    request: SampleRequest,
    plans: Sequence[Plan],
    numbers: Sequence[dict[str, int]],
    left_out: Sequence[tuple[dict[str, int], str]],
) -> Problem:
    """The request as the engine sees it: its storage has all objects, its cells are those of all members."""
    lowest, highest, fixed = hold_fixed(spec, request.fix)
    first = plans[0].problem
    names = tuple(map(written, numbers))
    own = first.cells
    each = tuple(plan.problem.cells for plan in plans)
    cells = NumberedCells(own.labels, own.bounded, own.edges, own.low, own.high, each, names)
    members = [(start, plan.problem) for start, plan in zip(cells.starts, plans, strict=True)]
    possible = frozenset(start + cell for start, one in members for cell in one.possible)
    improbable = frozenset(start + cell for start, one in members for cell in one.improbable)
    warnings = dict[Diagnostic, None]()
    for mine, why in left_out:
        warnings[NUMBER_LEFT_OUT(counted=written(mine), why=why)] = None
    for mine, plan in zip(numbers, plans, strict=True):
        warnings |= dict.fromkeys(one.but(counted=written(mine)) for one in plan.problem.warnings)
    return replace(
        first, spec=spec, core=gated(spec.core), lowest=lowest, highest=highest, request=replace(request, fix=fixed),
        cells=cells, possible=possible, improbable=improbable, warnings=tuple(warnings),
    )  # fmt: skip


def _turns(pieces: Sequence[float]) -> Index:
    """Which member draws each piece of a round, as evenly as can be: each as often as it needs pieces."""
    scale = min(1.0 / min(pieces), MOST_TURNS / sum(pieces))
    often = [max(1, math.ceil(one * scale - 1e-9)) for one in pieces]
    places = [((number + 0.5) / count, member) for member, count in enumerate(often) for number in range(count)]
    return np.array([member for _, member in sorted(places)], dtype=np.intp)


def _why(plans: Sequence[Plan], numbers: Sequence[dict[str, int]]) -> str | None:
    """Which methods `auto` chose, and for how many things."""
    if all(plan.why is None for plan in plans):
        return None
    chosen: dict[str, list[str]] = {}
    for plan, mine in zip(plans, numbers, strict=True):
        chosen.setdefault(plan.method, []).append(written(mine))
    if len(chosen) == 1:
        return f"{plans[0].method} for each"
    return "; ".join(f"{method} for {', '.join(names)}" for method, names in chosen.items())
