"""Pairs of a spec that draws how many things there are: those of its members, ordinary specs.

The number of things is uniform, as in scenes (scenegen.sampling.numbered): numbers that have pairs get equal shares of
them; which get one more where they do not come out even, and the order of the pairs, is drawn. Given the number, pairs
are those of the member's own request, drawn with a seed of its own. Storage is that of the member with all objects;
rows of absent objects are NaN.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from scenegen.errors import Diagnostic, RequestError
from scenegen.errors.counts import NO_NUMBER_POSSIBLE, NUMBER_LEFT_OUT
from scenegen.errors.motions import CANNOT_MOVE_SO_MANY, TOO_FEW_PAIRS
from scenegen.lang.counts import combinations, written
from scenegen.lang.members import rows_among
from scenegen.lang.spec import CheckedSpec
from scenegen.motions.pairs import STREAM, Pairs
from scenegen.pose import row_count
from scenegen.sampling.numbered import assets_of
from scenegen.sampling.numbered_planning import NOT_FOUND, WITHOUT, seed_of
from scenegen.sampling.problem import Budget
from scenegen.sampling.request import SampleRequest, check_seed

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.intp]

ORDER = 1  # of the random numbers of pairs: shares and order, apart from those of a member's pairs

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
    everything = list(combinations(spec.counts))
    check_seed(request.seed)
    rng = np.random.default_rng(np.random.SeedSequence([request.seed, STREAM, ORDER]))
    order = rng.permutation(len(everything)).tolist()
    found: dict[int, Pairs] = {}
    without: dict[int, Diagnostic] = {}
    while True:
        left = [member for member in order if member not in without]
        if not left:
            first = min(without)
            why = without[first]
            raise RequestError(NO_NUMBER_POSSIBLE(why.span, counted=written(everything[first]), why=why.title))
        shares = _shares(max(request.n, 1), left)
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
    parts = [_among(spec, spec.members[member], found[member]) for member in used]
    pairs = _joined(parts, rng.permutation(request.n))
    each = [(everything[member], found[member]) for member in used]
    info: dict[str, object] = {"numbers": [_told(numbers, one) for numbers, one in each]}
    if without:
        info["left_out"] = [
            {"numbers": everything[one], **assets_of(everything[one]), "reason": without[one].title}
            for one in sorted(without)
        ]
    warnings = (NUMBER_LEFT_OUT(counted=written(everything[one]), why=without[one].title) for one in sorted(without))
    return NumberedPairs(pairs, info, tuple(warnings))


def _told(numbers: Mapping[str, int], pairs: Pairs) -> dict[str, object]:
    counted = {"pairs": _count(pairs), "goals_without_start": pairs.given_up}
    return {"numbers": dict(numbers), **assets_of(numbers), **counted}


def _shares(n: int, members: Sequence[int]) -> dict[int, int]:
    """How many pairs each member has: the first ones have one more where they do not come out even."""
    each, more = divmod(n, len(members))
    return {member: each + (place < more) for place, member in enumerate(members)}


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
        if _count(made) or budget.spent:
            raise RequestError(made.shortfall)
        return made.shortfall
    except RequestError as error:
        first = error.diagnostics[0]
        if first.kind in (*WITHOUT, CANNOT_MOVE_SO_MANY) or (first.kind in NOT_FOUND and not budget.spent):
            return first
        if first.kind not in (*NOT_FOUND, TOO_FEW_PAIRS) and not budget.spent:
            raise
        raise RequestError(*(one.but(counted=written(numbers)) for one in error.diagnostics)) from None


def _among(spec: CheckedSpec, member: CheckedSpec, pairs: Pairs) -> Pairs:
    """Pairs of a member in the storage of all objects."""
    rows = rows_among(spec, member)

    def wide(own: Array) -> Array:
        whole = np.full((row_count(len(spec.objects)), own.shape[1]), np.nan)
        whole[rows] = own
        return whole

    return replace(pairs, start=wide(pairs.start), goal=wide(pairs.goal))


def _joined(parts: Sequence[Pairs], order: Index) -> Pairs:
    def columns(name: str) -> Any:
        return np.concatenate([getattr(one, name) for one in parts], axis=-1)[..., order]

    return Pairs(
        start=columns("start"), goal=columns("goal"), start_phi=columns("start_phi"), goal_phi=columns("goal_phi"),
        moved=columns("moved"), distance=columns("distance"), given_up=sum(one.given_up for one in parts),
    )  # fmt: skip
