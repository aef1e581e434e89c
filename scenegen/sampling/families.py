"""Scenes of a spec with random numbers of things: the plan of every member, an ordinary spec, and how they take turns.

The number of things is uniform, or by weights: the members get shares of the scenes by them. Given the number, scenes
are those of the member's own plan, drawn with a seed of its own. Storage is that of the member with all objects; rows
of absent objects are NaN.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from scenegen.arrays import Array, Index
from scenegen.errors import Diagnostic, RequestError
from scenegen.errors.declarations import NO_NUMBER_POSSIBLE, NUMBER_LEFT_OUT
from scenegen.errors.files import DOUBTFUL_POSE
from scenegen.errors.requests import (
    BEYOND_BOUNDS,
    CANNOT_BE_HELD,
    NO_ROOM,
    NO_SUCH_SCENE,
    REQUIREMENT_NOT_FOUND,
    TABLE_TOO_FULL,
    TOO_FEW_IN_RANGE,
    TOO_FEW_MEET_REQUIREMENT,
    TOO_IMPROBABLE,
)
from scenegen.lang.formula.core import gate
from scenegen.lang.spec import CheckedSpec, Picked, combinations, member_weights, numbers_text, rows_among
from scenegen.pose import X, row_count, rows_along
from scenegen.sampling.cells import Cells
from scenegen.sampling.plan import Account, Piece, Plan, Tally, digest
from scenegen.sampling.problem import Problem, hold_fixed
from scenegen.sampling.request import FixedPose, SampleRequest
from scenegen.sampling.streams import MEMBER_SEEDS_STREAM
from scenegen.scenes.blocks import numbers_in
from scenegen.search.effort import Budget


@dataclass(frozen=True, slots=True)
class NumberedCells(Cells):
    """The cells of all members, one member's after the other's. `low` and `high` are those of one of them."""

    members: tuple[Cells, ...] = ()
    names: tuple[str, ...] = ()

    @property
    def count(self) -> int:
        return sum(one.count for one in self.members)

    @property
    def starts(self) -> tuple[int, ...]:
        """The first cell of each member."""
        return tuple(int(start) for start in np.cumsum([0, *(one.count for one in self.members)])[:-1])

    def member_of(self, cell: int) -> tuple[int, int]:
        """The member of a cell, and its cell there."""
        member = int(np.searchsorted(self.starts, cell, side="right")) - 1
        return member, cell - self.starts[member]

    def limits(self, cell: int) -> tuple[Array, Array]:
        member, own = self.member_of(cell)
        return self.members[member].limits(own)

    def describe(self, cell: int) -> str:
        member, own = self.member_of(cell)
        return f"{self.members[member].describe(own)} with {self.names[member]}"


def assets_of(numbers: Mapping[str, int]) -> dict[str, dict[str, str]]:
    """Which assets the objects of categories are, as a scene file tells it."""
    found = {name: one.asset for name, one in numbers.items() if isinstance(one, Picked)}
    return {"assets": found} if found else {}


@dataclass(frozen=True, slots=True, eq=False)
class FamilyPlan(Plan):
    """A plan for one request: the `plans` of the members that have scenes. `numbers` are their numbers of things, drawn
    as often as `shares` say (whole numbers), `rows` the rows of each member's storage in that of all objects. `turns`
    says which member draws each piece; they begin again at the end. `facts` is how many facts a piece of each has.
    `left_out` are the numbers without scenes, and why.

    The facts of a piece are how many pieces and candidates each member has made, then those of the members' own plans.
    """

    plans: tuple[Plan, ...]
    numbers: tuple[dict[str, int], ...]
    rows: tuple[Index, ...]
    turns: Index
    facts: tuple[int, ...]
    shares: tuple[int, ...]
    left_out: tuple[tuple[dict[str, int], str], ...] = ()

    method: ClassVar[str] = "numbered"

    @property
    def plan_digest(self) -> str:
        weighted = (self.shares,) if len(set(self.shares)) > 1 else ()
        return digest("numbered", self.numbers, self.turns, tuple(plan.plan_digest for plan in self.plans), *weighted)

    @property
    def reached_cells(self) -> Sequence[int]:
        return [cell for group in self.groups for cell in group]

    @property
    def groups(self) -> Sequence[Sequence[int]]:
        return [
            [start + cell for cell in plan.reached_cells] for start, plan in zip(self._starts, self.plans, strict=True)
        ]

    @property
    def ruled_out(self) -> frozenset[int]:
        return frozenset(
            start + cell for start, plan in zip(self._starts, self.plans, strict=True) for cell in plan.ruled_out
        )

    @property
    def weights(self) -> Sequence[int]:
        return self.shares

    @property
    def _starts(self) -> tuple[int, ...]:
        assert isinstance(self.cells, NumberedCells)
        return self.cells.starts

    @property
    def evaluations(self) -> float:
        return sum(plan.evaluations for plan in self.plans)

    @property
    def scenes_per_piece(self) -> float:
        return float(np.mean([self.plans[member].scenes_per_piece for member in self.turns]))

    @property
    def is_verified(self) -> bool:
        return all(plan.is_verified for plan in self.plans)

    @property
    def fewest(self) -> int:
        return max(self._until(member, plan.fewest) for member, plan in enumerate(self.plans) if member in self.turns)

    @property
    def patience(self) -> int | None:
        each = [plan.patience for plan in self.plans]
        if None in each:
            return None
        return max(self._until(member, one or 1) for member, one in enumerate(each) if member in self.turns)

    @property
    def shared_by(self) -> int:
        if self.problem.request.settle:
            return 1  # a simulator remembers what it has settled
        return sum(plan.shared_by for plan in self.plans)

    @property
    def fact_count(self) -> int:
        return 2 * len(self.plans) + sum(self.facts)

    def _until(self, member: int, pieces: int) -> int:
        """After how many pieces a member has made so many."""
        mine = np.flatnonzero(self.turns == member)
        rounds, rest = divmod(pieces - 1, len(mine))
        return rounds * len(self.turns) + int(mine[rest]) + 1

    def draw(self, k: int) -> Piece:
        """Piece k: a piece of the member whose turn it is. Raises StoppedError if its deadline passes meanwhile."""
        rounds, turn = divmod(k, len(self.turns))
        member = int(self.turns[turn])
        per_round, before = (int((part == member).sum()) for part in (self.turns, self.turns[:turn]))
        made = self.plans[member].draw(rounds * per_round + before)
        rows = np.full((len(self.problem.lowest), made.rows.shape[1]), np.nan)
        rows[self.rows[member]] = made.rows
        cell = np.where(made.cell >= 0, made.cell + self._starts[member], -1)
        facts = np.zeros(self.fact_count)
        facts[member] = 1.0
        facts[len(self.plans) + member] = float((made.cell >= 0).sum())
        first = self._first_fact(member)
        facts[first : first + len(made.facts)] = made.facts
        return Piece(rows, made.phi[: len(self.problem.spec.labels)], cell, facts)

    def _first_fact(self, member: int) -> int:
        return 2 * len(self.plans) + sum(self.facts[:member])

    def account(self, tally: Tally) -> Account:
        """What the scene file says: the share of each number of things, and its member's own account."""
        accounts = [self._account(member, tally) for member in range(len(self.plans))]
        whole = tally.scenes >= self.scenes_wanted  # a run that was cut short has what was found
        each = zip(self.numbers, self.shares, accounts, strict=True)
        info: dict[str, object] = {
            "method": self.method,
            "seed": self.seed,
            "pieces": tally.pieces,
            "numbers": [
                {
                    "numbers": numbers,
                    **assets_of(numbers),
                    **({"share": share / sum(self.shares)} if whole else {}),
                    **one.info,
                }
                for numbers, share, one in each
            ],
        }
        if self.left_out:
            info["left_out"] = [
                {"numbers": numbers, **assets_of(numbers), "reason": why} for numbers, why in self.left_out
            ]
        warnings = dict[Diagnostic, None]()
        for numbers, one in zip(self.numbers, accounts, strict=True):
            warnings |= dict.fromkeys(_name_numbers(one.warnings, numbers))
        tried = "; ".join(
            f"{one.tried} with {numbers_text(mine)}" for mine, one in zip(self.numbers, accounts, strict=True)
        )
        return Account(info, tried, tuple(warnings))

    def _account(self, member: int, tally: Tally) -> Account:
        plan, count = self.plans[member], len(self.plans)
        facts = tally.facts or (0.0,) * self.fact_count
        first = self._first_fact(member)
        own = facts[first : first + self.facts[member]]
        pieces, candidates = int(facts[member]), int(facts[count + member])
        return plan.account(
            replace(tally, pieces=pieces, candidates=candidates, strays=(), facts=own if pieces else (), scarcest=None)
        )

    def check(self, rows: Array, phi: Array) -> None:
        for member, mine in self._by_member(rows):
            plan = self.plans[member]
            plan.check(np.ascontiguousarray(rows[np.ix_(self.rows[member], mine)]), phi[:, mine])

    def _by_member(self, rows: Array) -> Iterator[tuple[int, Index]]:
        """Each member, and which scenes have its numbers of things; rows (3N, n). Raises AssertionError for a scene of
        no member."""
        spec = self.problem.spec
        there = ~np.isnan(rows[: row_count(len(spec.objects))][rows_along(X)]).T
        try:
            found = numbers_in(spec.objects, spec.counts, there)
        except ValueError as error:
            raise AssertionError(f"a sampler left out an object: {error}") from None
        left = np.ones(rows.shape[1], dtype=bool)
        for member, numbers in enumerate(self.numbers):
            mine = (found == np.array(list(numbers.values()))[:, None]).all(axis=0)
            left &= ~mine
            if mine.any():
                yield member, np.flatnonzero(mine)
        if left.any():
            raise AssertionError("a sampler returned a scene with numbers of things that were not asked for")

    def shortfall_of(self, tally: Tally) -> tuple[Plan, int | None]:
        if tally.scarcest is None:
            return self.plans[0], None
        assert isinstance(self.cells, NumberedCells)
        member, cell = self.cells.member_of(tally.scarcest)
        return self.plans[member], cell

    def close(self) -> None:
        for plan in self.plans:
            plan.close()


MAX_TURNS = 4096  # pieces until the turns begin again
NO_SCENE_KINDS = (NO_SUCH_SCENE, TOO_IMPROBABLE, BEYOND_BOUNDS, TABLE_TOO_FULL, REQUIREMENT_NOT_FOUND, NO_ROOM)
NOT_FOUND_KINDS = (TOO_FEW_IN_RANGE, TOO_FEW_MEET_REQUIREMENT)  # in all the effort that there is, or in too little time

MakePlan = Callable[[CheckedSpec, SampleRequest], Plan]


def seed_of(seed: int, numbers: Mapping[str, int]) -> int:
    """The seed of the member with these numbers of things."""
    words = np.random.SeedSequence([seed, MEMBER_SEEDS_STREAM, *numbers.values()]).generate_state(1, np.uint64)
    return int(words[0] >> np.uint64(1))


def _name_numbers(warnings: Sequence[Diagnostic], numbers: Mapping[str, int]) -> Iterator[Diagnostic]:
    """Warnings of a member with its numbers; what is said of the request is the same for all members."""
    return (one if one.kind is DOUBTFUL_POSE else one.but(counted=numbers_text(numbers)) for one in warnings)


def plan_numbers(
    spec: CheckedSpec,
    request: SampleRequest,
    budget: Budget,
    make: MakePlan,
    last: Callable[[Plan], Plan] = lambda plan: plan,
) -> FamilyPlan:
    """The plan of a spec with random numbers of things; `make` plans a member, `last` takes each plan once the shares
    are known. Members that have no scene in the range are left out. Raises RequestError where all are, for a mistake in
    the request, and where time is up before all members are planned."""
    everything = list(combinations(spec.counts))
    for name, held in request.fix.items():
        if name in spec.objects and any(name not in member.objects for member in spec.members):
            raise RequestError(
                CANNOT_BE_HELD(held.span if isinstance(held, FixedPose) else None, name=name, missing="may be missing")
            )
    weights = member_weights(spec.counts)
    numbers: list[dict[str, int]] = []
    plans: list[Plan] = []
    shares: list[int] = []
    left_out: list[tuple[dict[str, int], str]] = []
    reasons: list[Diagnostic] = []
    for mine, weight, member in zip(everything, weights, spec.members, strict=True):
        n = max(1, -(-request.n * weight // sum(weights)))
        try:
            plan = make(member, replace(request, n=n, seed=seed_of(request.seed, mine)))
        except RequestError as error:
            first = error.diagnostics[0]
            if first.kind not in NO_SCENE_KINDS and (first.kind not in NOT_FOUND_KINDS or budget.is_spent):
                if not budget.is_spent:
                    raise
                raise RequestError(*(one.but(counted=numbers_text(mine)) for one in error.diagnostics)) from None
            left_out.append((mine, first.title))
            reasons.append(first)
            continue
        numbers.append(mine)
        plans.append(plan)
        shares.append(weight)
    if not plans:
        mine, why = left_out[0]
        raise RequestError(NO_NUMBER_POSSIBLE(reasons[0].span, counted=numbers_text(mine), why=why))
    if left_out:
        plans = [
            _with_count(plan, -(-request.n * share // sum(shares))) for plan, share in zip(plans, shares, strict=True)
        ]
    plans = [last(plan) for plan in plans]
    return FamilyPlan(
        _problem(spec, request, plans, numbers, left_out),
        tuple(plans),
        tuple(numbers),
        tuple(rows_among(spec, plan.problem.spec) for plan in plans),
        _turns(
            [
                max(plan.fewest, request.n * share / sum(shares) / max(plan.scenes_per_piece, 1e-9))
                for plan, share in zip(plans, shares, strict=True)
            ]
        ),
        tuple(plan.fact_count for plan in plans),
        tuple(shares),
        tuple(left_out),
        why=_why(plans, numbers),
    )


def _with_count(plan: Plan, n: int) -> Plan:
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
    names = tuple(map(numbers_text, numbers))
    own = first.cells
    each = tuple(plan.problem.cells for plan in plans)
    cells = NumberedCells(own.labels, own.bounded, own.edges, own.low, own.high, each, names)
    members = [(start, plan.problem) for start, plan in zip(cells.starts, plans, strict=True)]
    possible = frozenset(start + cell for start, one in members for cell in one.possible)
    improbable = frozenset(start + cell for start, one in members for cell in one.improbable)
    warnings = dict[Diagnostic, None]()
    for mine, why in left_out:
        warnings[NUMBER_LEFT_OUT(counted=numbers_text(mine), why=why)] = None
    for mine, plan in zip(numbers, plans, strict=True):
        warnings |= dict.fromkeys(_name_numbers(plan.problem.warnings, mine))
    return replace(
        first, spec=spec, core=gate(spec.core), lowest=lowest, highest=highest, request=replace(request, fix=fixed),
        cells=cells, possible=possible, improbable=improbable, warnings=tuple(warnings),
    )  # fmt: skip


def _turns(pieces: Sequence[float]) -> Index:
    """Which member draws each piece of a round, as evenly as can be: each as often as it needs pieces."""
    scale = min(1.0 / min(pieces), MAX_TURNS / sum(pieces))
    often = [max(1, math.ceil(one * scale - 1e-9)) for one in pieces]
    places = [((number + 0.5) / count, member) for member, count in enumerate(often) for number in range(count)]
    return np.array([member for _, member in sorted(places)], dtype=np.intp)


def _why(plans: Sequence[Plan], numbers: Sequence[dict[str, int]]) -> str | None:
    """Which methods `auto` chose, and for how many things."""
    if all(plan.why is None for plan in plans):
        return None
    chosen: dict[str, list[str]] = {}
    for plan, mine in zip(plans, numbers, strict=True):
        chosen.setdefault(plan.method, []).append(numbers_text(mine))
    if len(chosen) == 1:
        return f"{plans[0].method} for each"
    return "; ".join(f"{method} for {', '.join(names)}" for method, names in chosen.items())
