"""Pairs of a start and a goal: two scenes of one spec, the rearrangement task.

The goal is drawn as scenes are. Without `moved` the start is, too, independently of it. With `moved`, K of the objects
that can move, chosen uniformly, get new poses, uniform over their limits, until the start is in its range; the others
stay where they are. With a grasp (`scenegen.sampling.grasps`) a start is tried until it has one, too, and all that can
move but robots does, where `moved` does not say how many.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from scenegen.arrays import Array, Bool, Index
from scenegen.errors import Diagnostic, RequestError
from scenegen.errors.declarations import NO_NUMBER_POSSIBLE, NUMBER_LEFT_OUT
from scenegen.errors.requests import CANNOT_MOVE_SO_MANY, TOO_FEW_MOTIONS
from scenegen.lang.spec import CheckedSpec, combinations, member_weights, numbers_text, rows_among
from scenegen.pose import PLACE, X, owner, row_count, row_of, rows_along, rows_of
from scenegen.sampling.families import NO_SCENE_KINDS, NOT_FOUND_KINDS, assets_of, seed_of
from scenegen.sampling.grasps import PairGrasp
from scenegen.sampling.plans import draw
from scenegen.sampling.prior import pull_back
from scenegen.sampling.problem import SCENES_IN_CACHE, Problem
from scenegen.sampling.request import SampleRequest
from scenegen.sampling.streams import PAIRS_STREAM
from scenegen.search.effort import Budget

STARTS_PER_GOAL = 4096  # starts that are tried for a goal before it is given up
MOST_IN_VAIN = 64  # goals one after the other without a start, after which no more are drawn
STARTS_PER_PAIR = 64  # starts for a pair at most, where the start is anything but the goal


@dataclass(frozen=True, slots=True)
class Pairs:
    """`start` and `goal` (3N, n), phi of every label at each (L, n), `moved` (n,) objects whose place differs,
    `distance` (n,) metres between their centres, summed. `given_up` goals had no start in so many tries; `shortfall`
    says why there are fewer pairs than wanted, if there are. `grasps` (1 + N, n) is what `PairGrasp.grasps` gives, if a
    grasp was wanted."""

    start: Array
    goal: Array
    start_phi: Array
    goal_phi: Array
    moved: Index
    distance: Array
    given_up: int
    shortfall: Diagnostic | None = None
    grasps: Array | None = None


@dataclass(frozen=True, slots=True)
class PairStarts:
    """Which scenes are starts: those of a problem's range, or, with `unless`, those of it that are not in the goal's
    range. With `grasp`, a start goes with goals to which a grasp of it leads."""

    problem: Problem
    unless: Problem | None = None
    grasp: PairGrasp | None = None

    def holds(self, rows: Array) -> tuple[Bool, Array]:
        """Which scenes (3N, B) are starts, and phi (L, B)."""
        phi = self.problem.phi(rows)
        flags: Bool = self.problem.cells.find(phi) >= 0
        if self.unless is not None:
            flags &= self.unless.cells.find(phi) < 0
        return flags, phi

    def go_with(self, rows: Array, goals: Array) -> Index:
        """Which of the scenes (3N, B) are starts of the goals (3N, B)."""
        found = np.flatnonzero(self.holds(rows)[0])
        if self.grasp is not None:
            found = found[self.grasp.holds(self.grasp.grasps(rows[:, found], goals[:, found]))]
        return found


def draw_pairs(goal: Problem, starts: PairStarts, moved: int | None, budget: Budget) -> Pairs:
    """The pairs of two requests for the same spec: as many as the goal's. Raises RequestError where there is no scene,
    and for more moved objects than can move; AssertionError for a pair that fails the last check."""
    wanted = goal.request.n
    can_move = [k for k in range(len(goal.spec.objects)) if _moves(goal, k)]
    if starts.grasp is not None:
        can_move = [k for k in can_move if k in starts.grasp.cores]
        moved = moved or len(can_move)
    free = np.array(can_move, dtype=np.intp)
    if moved is not None and moved > len(free):
        raise RequestError(CANNOT_MOVE_SO_MANY(wanted=moved, free=len(free), most=len(free)))
    rng = np.random.default_rng(np.random.SeedSequence([goal.request.seed, PAIRS_STREAM]))
    if moved is None:
        found = draw(goal, budget)
        if found.shortfall is not None:
            raise RequestError(found.shortfall)
        start, reason = _independent(starts, wanted, budget, rng)
        ends, given_up = found.rows[:, : start.shape[1]], 0
    else:
        start, ends, given_up, reason = _rounds(goal, starts, free, moved, budget, rng)
    shortfall = None
    if start.shape[1] < wanted:
        shortfall = TOO_FEW_MOTIONS(pairs="pairs", found=start.shape[1], wanted=wanted, reason=reason)
    return _check_pairs(goal, starts, start, ends, moved, given_up, shortfall)


def _rounds(
    goal: Problem, starts: PairStarts, free: Index, moved: int, budget: Budget, rng: np.random.Generator
) -> tuple[Array, Array, int, str]:
    """Starts and goals; goals without a start are replaced by others. Returns how many there were, and why there are
    too few."""
    wanted, pairs, count, given_up, reason = goal.request.n, list[tuple[Array, Array]](), 0, 0, ""
    in_vain = 0
    while True:
        request = goal.request
        if given_up:
            request = replace(request, n=wanted - count, seed=int(rng.integers(1 << 31)))
        found = draw(replace(goal, request=request), budget)
        if found.shortfall is not None:
            raise RequestError(found.shortfall)
        start, kept, reason = _start_elsewhere(starts, found.rows, free, moved, budget, rng)
        pairs.append((start, found.rows[:, kept]))
        count, given_up = count + len(kept), given_up + found.count - len(kept)
        in_vain = 0 if len(kept) else in_vain + found.count
        if count == wanted or budget.is_spent or in_vain >= MOST_IN_VAIN:
            break
    begins, ends = (np.concatenate(parts, axis=1) for parts in zip(*pairs, strict=True))
    return begins, ends, given_up, reason


def _moves(problem: Problem, thing: int) -> bool:
    return any(problem.lowest[row_of(thing, axis)] < problem.highest[row_of(thing, axis)] for axis in PLACE)


def _independent(starts: PairStarts, wanted: int, budget: Budget, rng: np.random.Generator) -> tuple[Array, str]:
    """Starts that know nothing of the goals, (3N, m), and why there are too few."""
    problem, count, drawn = starts.problem, 0, 0
    parts = [np.empty((len(problem.lowest), 0))]  # the goals may have taken all the time
    while count < wanted and drawn < STARTS_PER_PAIR * wanted and not budget.is_spent:
        # scenes of one run are spread over the range together, so the first run has all that are wanted
        request = replace(problem.request, n=max(wanted - count, 256), seed=int(rng.integers(1 << 31)))
        made = draw(replace(problem, request=request), budget)
        flags, _ = starts.holds(made.rows)
        parts.append(made.rows[:, flags])
        count, drawn = count + int(flags.sum()), drawn + made.count
        if made.shortfall is not None:
            break
    found = np.concatenate(parts, axis=1)
    found = found[:, rng.permutation(found.shape[1])[:wanted]]
    return found, f"of {drawn:,} scenes {count:,} are starts" if drawn else "time is up"


def _start_elsewhere(
    starts: PairStarts, goals: Array, free: Index, moved: int, budget: Budget, rng: np.random.Generator
) -> tuple[Array, Index, str]:
    """Starts in which so many objects stand elsewhere than in the goal; the goals that have one, in order; why the
    others have none."""
    problem = starts.problem
    found, done = goals.copy(), np.zeros(goals.shape[1], dtype=bool)
    tries = 0
    while tries < STARTS_PER_GOAL and not done.all() and not budget.is_spent:
        open_ = np.flatnonzero(~done)
        each = min(max(1, SCENES_IN_CACHE // len(open_)), STARTS_PER_GOAL - tries)  # several tries of a goal at once
        tries += each
        for part in np.array_split(open_, -(-len(open_) * each // SCENES_IN_CACHE)):
            which = np.repeat(part, each)
            rows = _elsewhere(problem, goals[:, which], free, moved, rng)
            good = starts.go_with(rows, goals[:, which])
            first, place = np.unique(which[good], return_index=True)
            found[:, first], done[first] = rows[:, good[place]], True
    kept = np.flatnonzero(done)
    reason = "time is up" if tries < STARTS_PER_GOAL else f"{STARTS_PER_GOAL:,} starts were tried for each goal"
    return found[:, kept], kept, reason


def _elsewhere(problem: Problem, rows: Array, free: Index, moved: int, rng: np.random.Generator) -> Array:
    """The scenes with so many of the free objects at new poses, each as its prior has it where the others are, or
    uniform over its limits."""
    low, high, count = problem.lowest, problem.highest, rows.shape[1]
    rank = np.argsort(np.argsort(rng.random((len(free), count)), axis=0), axis=0)
    rows = rows.copy()
    given = rows.copy()
    for place, thing in enumerate(free.tolist()):
        goes = rank[place] < moved
        for row in rows_of(thing):
            new = low[row] + (high[row] - low[row]) * rng.random(count)
            np.copyto(rows[row], new, where=goes)
            given[row][goes] = np.nan
    _, base = pull_back(problem.spec, low, high)
    return base.poses(rows, given)


def _check_pairs(
    goal: Problem,
    starts: PairStarts,
    start: Array,
    ends: Array,
    moved: int | None,
    given_up: int,
    shortfall: Diagnostic | None,
) -> Pairs:
    """Pairs, each scored once more."""
    flags, start_phi = starts.holds(start)
    goal_phi = goal.phi(ends)
    assert flags.all() and (goal.cells.find(goal_phi) >= 0).all(), "a scene of a pair is out of its range"
    inside = goal.spec.workspace.contains
    assert inside(start).all() and inside(ends).all(), "an object of a pair is outside the workspace"
    apart = [start[rows_along(axis)] - ends[rows_along(axis)] for axis in PLACE]
    far = np.hypot(*apart)
    differs = (far > 0.0).sum(axis=0)
    assert moved is None or (differs == moved).all(), "a pair moves another number of objects"
    grasps = None if starts.grasp is None else starts.grasp.grasps(start, ends)
    assert starts.grasp is None or grasps is None or starts.grasp.holds(grasps).all(), "a pair has no grasp in range"
    labels = len(goal.spec.labels)
    return Pairs(
        start, ends, start_phi[:labels], goal_phi[:labels], differs, far.sum(axis=0), given_up, shortfall, grasps
    )


# Pairs of a spec that draws how many things there are: those of its members, ordinary specs.
#
# The number of things is uniform or by weights, as in scenes (scenegen.sampling.families): numbers that have pairs get
# their shares of them; which get one more where they do not come out even, and the order of the pairs, is drawn. Given
# the number, pairs are those of the member's own request, drawn with a seed of its own. Storage is that of the member
# with all objects; rows of absent objects are NaN.


PAIR_ORDER = 1  # of the random numbers of pairs: shares and order, apart from those of a member's pairs

DrawPairs = Callable[[CheckedSpec, SampleRequest], Pairs]


@dataclass(frozen=True, slots=True)
class NumberedPairs:
    """The pairs of all numbers, `given_up` those of all. `info` says for a file how many pairs each number has;
    `warnings` are of those that have none."""

    pairs: Pairs
    info: dict[str, object]
    warnings: tuple[Diagnostic, ...]


def draw_numbered(spec: CheckedSpec, request: SampleRequest, budget: Budget, draw: DrawPairs) -> NumberedPairs:
    """The pairs of a request; `draw` makes those of a member, with a shortfall where there are too few. Raises
    RequestError where no number has a pair, where one has fewer than its share, for a mistake in the request, and where
    time is up."""
    everything, weights = list(combinations(spec.counts)), member_weights(spec.counts)
    rng = np.random.default_rng(np.random.SeedSequence([request.seed, PAIRS_STREAM, PAIR_ORDER]))
    order = rng.permutation(len(everything)).tolist()
    found: dict[int, Pairs] = {}
    without: dict[int, Diagnostic] = {}
    while True:
        left = [member for member in order if member not in without]
        if not left:
            first = min(without)
            why = without[first]
            raise RequestError(NO_NUMBER_POSSIBLE(why.span, counted=numbers_text(everything[first]), why=why.title))
        shares = _shares(max(request.n, 1), left, weights)
        todo = [one for one, share in sorted(shares.items()) if share and _count(found.get(one)) != share]
        if not todo:
            break
        for member in todo:
            numbers = everything[member]
            n = min(shares[member], request.n)  # an invalid number gives the same error as with an ordinary spec
            own = replace(request, n=n, seed=seed_of(request.seed, numbers))
            made = _member(spec.members[member], own, numbers, budget, draw)
            if isinstance(made, Diagnostic):
                without[member] = made
            else:
                found[member] = made
    used = [member for member in sorted(found) if shares.get(member)]
    parts = [_widen(spec, spec.members[member], found[member]) for member in used]
    pairs = _join(parts, rng.permutation(request.n))
    each = [(everything[member], found[member]) for member in used]
    info: dict[str, object] = {"numbers": [_member_info(numbers, one) for numbers, one in each]}
    if without:
        info["left_out"] = [
            {"numbers": everything[one], **assets_of(everything[one]), "reason": without[one].title}
            for one in sorted(without)
        ]
    warnings = (
        NUMBER_LEFT_OUT(counted=numbers_text(everything[one]), why=without[one].title) for one in sorted(without)
    )
    return NumberedPairs(pairs, info, tuple(warnings))


def _member_info(numbers: Mapping[str, int], pairs: Pairs) -> dict[str, object]:
    counted = {"pairs": _count(pairs), "goals_without_start": pairs.given_up}
    return {"numbers": dict(numbers), **assets_of(numbers), **counted}


def _shares(n: int, members: Sequence[int], weights: Sequence[int]) -> dict[int, int]:
    """How many pairs each member has: those with the largest remainders, and of these the first, have one more where
    they do not come out even."""
    total = sum(weights[member] for member in members)
    shares = {member: n * weights[member] // total for member in members}
    rest = sorted(members, key=lambda member: -(n * weights[member] % total))
    return shares | {member: shares[member] + 1 for member in rest[: n - sum(shares.values())]}


def _count(pairs: Pairs | None) -> int:
    return 0 if pairs is None else pairs.start.shape[1]


def _member(
    spec: CheckedSpec, request: SampleRequest, numbers: Mapping[str, int], budget: Budget, draw: DrawPairs
) -> Pairs | Diagnostic:
    """The pairs of a member, or why it has none. Raises RequestError."""
    try:
        made = draw(spec, request)
        if made.shortfall is None:
            return made
        if _count(made) or budget.is_spent:
            raise RequestError(made.shortfall)
        return made.shortfall
    except RequestError as error:
        first = error.diagnostics[0]
        if first.kind in (*NO_SCENE_KINDS, CANNOT_MOVE_SO_MANY) or (
            first.kind in NOT_FOUND_KINDS and not budget.is_spent
        ):
            return first
        if first.kind not in (*NOT_FOUND_KINDS, TOO_FEW_MOTIONS) and not budget.is_spent:
            raise
        raise RequestError(*(one.but(counted=numbers_text(numbers)) for one in error.diagnostics)) from None


def _widen(spec: CheckedSpec, member: CheckedSpec, pairs: Pairs) -> Pairs:
    """Pairs of a member in the storage of all objects."""
    rows = rows_among(spec, member)

    def wide(own: Array) -> Array:
        whole = np.full((row_count(len(spec.objects)), own.shape[1]), np.nan)
        whole[rows] = own
        return whole

    grasps = pairs.grasps
    if grasps is not None:
        yaws = np.full((len(spec.objects), grasps.shape[1]), np.nan)
        yaws[[owner(row) for row in rows[rows_along(X)]]] = grasps[1:]
        grasps = np.concatenate([grasps[:1], yaws])
    return replace(pairs, start=wide(pairs.start), goal=wide(pairs.goal), grasps=grasps)


def _join(parts: Sequence[Pairs], order: Index) -> Pairs:
    def columns(name: str) -> Any:
        return np.concatenate([getattr(one, name) for one in parts], axis=-1)[..., order]

    return Pairs(
        start=columns("start"), goal=columns("goal"), start_phi=columns("start_phi"), goal_phi=columns("goal_phi"),
        moved=columns("moved"), distance=columns("distance"), given_up=sum(one.given_up for one in parts),
        grasps=None if parts[0].grasps is None else columns("grasps"),
    )  # fmt: skip
