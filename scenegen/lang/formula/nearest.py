"""The least of many gaps, of which only those are computed that can be the least.

`noOverlap()` of N objects is the minimum of N (N - 1) / 2 gaps. The gap of two footprints lies between the distance of
their poses less both outer radii and that distance less both inner radii: discs about the poses, around the footprints
and within them. What lies farther off than the nearest upper bound is not the least. The value is the same to the bit.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any

import numpy as np
import numpy.typing as npt

from scenegen.geometry import NUMPY, PRIMITIVES, Footprint
from scenegen.geometry.footprint import Circle, measures
from scenegen.geometry.namespace import Turning
from scenegen.lang.formula.core import Apply, Atom, Const, Coord, Core, Junction, children, last_uses

Floats = npt.NDArray[np.float64]

FEWEST_GAPS = (
    30  # gaps of a minimum, and a dozen for each pair of shapes; fewer are computed as they are, without detours
)
DOZEN = 12
SEVERAL = 2  # scenes from which on gaps are left out
BATCH = 2048  # scenes; for fewer, calls cost more than numbers
BLOCK = 2048  # scenes at a time, so that distances stay in cache
SLACK = 1e-9  # metres, for rounding


@dataclass(frozen=True, slots=True)
class Alike:
    """Gaps of footprints of the same shapes: which of the group's pairs, (P,)."""

    shapes: tuple[Footprint, ...]
    pairs: npt.NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class GapMinimum:
    """The gaps of one minimum: rows of the coordinates of both objects (2, 3, P), what is taken off each gap (P,), and
    the inner and outer radii of both together, with that, (P,). `rest` are the other arguments of the minimum."""

    rows: npt.NDArray[np.intp]
    less: Floats
    inner: Floats
    outer: Floats
    alike: tuple[Alike, ...]
    rest: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class GapMinima:
    """The minima of a tape that are worth it, by node, and the nodes whose values nobody needs."""

    by_node: Mapping[int, GapMinimum]
    skipped: frozenset[int]


def find_groups(core: Core, needed: Collection[int], fewest: int = FEWEST_GAPS, dozen: int = DOZEN) -> GapMinima:
    """The groups of a tape where the values of the nodes `needed` will be read, and no others. Minima of fewer gaps
    than `fewest`, or than `dozen` for each pair of shapes, are none."""
    uses = [0] * len(core.nodes)
    for index in needed:
        uses[index] += 1
    for index in range(len(core.nodes) - 1, -1, -1):  # parents before children
        if uses[index]:
            for child in children(core.nodes[index]):
                uses[child] += 1
    groups, skipped = {}, {index for index, count in enumerate(uses) if not count}
    for index, node in enumerate(core.nodes):
        if not (uses[index] and isinstance(node, Junction) and node.kind == "min" and len(node.args) >= fewest):
            continue
        found = {arg: mine for arg in node.args if (mine := _gap_below(core, arg, uses)) is not None}
        if len(found) < fewest:
            continue
        group = _make_group(core, tuple(arg for arg in node.args if arg not in found), found)
        if len(found) >= dozen * len(group.alike):
            groups[index] = group
            skipped.update(found, *(nodes for nodes, _, _ in found.values()))
    return GapMinima(groups, frozenset(skipped))


_Found = tuple[tuple[int, ...], Apply, float]


def _gap_below(core: Core, index: int, uses: Sequence[int]) -> _Found | None:
    """Of an atom `gap(...)` or `gap(...) - constant` of two objects that nothing else needs: the nodes below it, the
    gap, and the constant."""
    atom = core.nodes[index]
    if not isinstance(atom, Atom) or uses[index] > 1:
        return None
    below: tuple[int, ...] = (atom.margin,)
    less, node = 0.0, core.nodes[atom.margin]
    if isinstance(node, Apply) and node.primitive == "sub":
        constant = core.nodes[node.args[1]]
        if not isinstance(constant, Const) or uses[atom.margin] > 1:
            return None
        below, less, node = (*below, node.args[0]), constant.value, core.nodes[node.args[0]]
    if not (isinstance(node, Apply) and node.primitive == "gap") or uses[below[-1]] > 1 or not math.isfinite(less):
        return None
    if all(isinstance(shape, Circle) for shape in node.shapes):
        return None  # as cheap as its bounds
    return (below, node, less) if all(isinstance(core.nodes[arg], Coord) for arg in node.args) else None


def _make_group(core: Core, rest: tuple[int, ...], found: Mapping[int, _Found]) -> GapMinimum:
    gaps = [gap for _, gap, _ in found.values()]
    rows = np.array([[_row(core, arg) for arg in gap.args] for gap in gaps]).T.reshape(2, 3, len(gaps))
    less = np.array([constant for _, _, constant in found.values()])
    by_identity: dict[tuple[int, ...], list[int]] = {}  # hashing shapes for each pair takes longer than all else
    for pair, gap in enumerate(gaps):
        by_identity.setdefault(tuple(map(id, gap.shapes)), []).append(pair)
    by_shapes: dict[tuple[Footprint, ...], list[int]] = {}
    inner, outer = less.copy(), less + SLACK
    for pairs in by_identity.values():
        shapes = gaps[pairs[0]].shapes
        by_shapes.setdefault(shapes, []).extend(pairs)
        inner[pairs] += sum(measures(shape).inner for shape in shapes)
        outer[pairs] += sum(measures(shape).outer for shape in shapes)
    alike = tuple(Alike(shapes, np.array(pairs)) for shapes, pairs in by_shapes.items())
    return GapMinimum(rows, less, inner, outer, alike, rest)


def _row(core: Core, arg: int) -> int:
    node = core.nodes[arg]
    assert isinstance(node, Coord)
    return node.row


def least_gap(group: GapMinimum, rows: Sequence[Any], turn: Callable[[Any], tuple[Any, Any]]) -> Floats:
    """The least of a group's gaps, (B,). `rows` holds 3N coordinates, (B,) each; `turn` gives cosine and sine. All
    are computed of a scene with a number that is infinite or NaN."""
    used = np.unique(group.rows[:, :2])
    place = np.empty(used[-1] + 1, dtype=np.intp)
    place[used] = np.arange(len(used))
    at = place[group.rows[:, :2]]
    count = len(rows[used[0]])
    near = np.empty((len(group.inner), count), dtype=bool)
    for start in range(0, count, BLOCK):
        part = slice(start, start + BLOCK)
        _look(group, at, np.stack([rows[row][part] for row in used]), near[:, part])
    near |= ~np.isfinite(reduce(np.add, [rows[row] for row in np.unique(group.rows)]))
    out = np.full(count, math.inf)
    compute = _compute if count >= BATCH else _compute_few
    for alike in group.alike:
        compute(group, alike, rows, turn, near[alike.pairs], out)
    return out


def _look(group: GapMinimum, at: npt.NDArray[np.intp], places: Floats, near: npt.NDArray[np.bool_]) -> None:
    """Which pairs (P, b) can be the least, where `places` (R, b) are x and y, at the rows `at` (2, 2, P)."""
    across = places[at[1, 0]]
    across -= places[at[0, 0]]
    across *= across
    distance = places[at[1, 1]]
    distance -= places[at[0, 1]]
    distance *= distance
    distance += across
    np.sqrt(distance, out=distance)
    bound = np.subtract(distance, group.inner[:, None], out=across).min(axis=0)
    distance -= group.outer[:, None]
    np.less_equal(distance, bound, out=near)


def _compute(
    group: GapMinimum,
    alike: Alike,
    rows: Sequence[Any],
    turn: Callable[[Any], tuple[Any, Any]],
    near: npt.NDArray[np.bool_],
    out: Floats,
) -> None:
    """Lower `out` (B,) to the gaps of pairs alike where they are `near`, (P, B)."""
    scenes = [np.flatnonzero(one) for one in near]
    poses = [
        np.concatenate(
            [rows[row].take(scene) for row, scene in zip(group.rows[side, axis, alike.pairs], scenes, strict=True)]
        )
        for side in (0, 1)
        for axis in (0, 1, 2)
    ]
    namespace = Turning(NUMPY, ())
    for side, heading in enumerate((poses[2], poses[5])):
        turns = [turn(rows[row]) for row in group.rows[side, 2, alike.pairs]]
        cosine, sine = (
            np.concatenate([one[which].take(scene) for one, scene in zip(turns, scenes, strict=True)])
            for which in (0, 1)
        )
        namespace.know(heading, (cosine, sine))
    gaps = PRIMITIVES["gap"].evaluate(namespace, *alike.shapes, *poses)
    end = 0
    for pair, scene in zip(alike.pairs, scenes, strict=True):
        begin, end = end, end + len(scene)
        value, less = gaps[begin:end], group.less[pair]
        out[scene] = np.minimum(out[scene], value - less if less else value)


def _compute_few(
    group: GapMinimum,
    alike: Alike,
    rows: Sequence[Any],
    turn: Callable[[Any], tuple[Any, Any]],
    near: npt.NDArray[np.bool_],
    out: Floats,
) -> None:
    """The same in few scenes: fewer calls, more numbers."""
    pair, scene = np.nonzero(near)
    used, at = np.unique(group.rows[:, :, alike.pairs], return_inverse=True)
    at = at.reshape(2, 3, -1)[:, :, pair]
    poses = np.stack([rows[row] for row in used])[at, scene]
    turns = {row: turn(rows[row]) for row in np.unique(group.rows[:, 2, alike.pairs])}
    namespace = Turning(NUMPY, ())
    table = np.zeros((2, len(used), len(out)))
    for place, row in enumerate(used):
        if row in turns:
            table[:, place] = turns[row]
    headings = [poses[side, 2] for side in (0, 1)]
    for side, heading in enumerate(headings):
        cosine, sine = table[:, at[side, 2], scene]
        namespace.know(heading, (cosine, sine))
    values = PRIMITIVES["gap"].evaluate(
        namespace, *alike.shapes, *poses[0, :2], headings[0], *poses[1, :2], headings[1]
    )
    less = group.less[alike.pairs][pair]
    np.minimum.at(out, scene, np.where(less == 0.0, values, values - less))


def minimum(
    group: GapMinimum, rows: Sequence[Any], turn: Callable[[Any], tuple[Any, Any]], values: Sequence[Any]
) -> Any:
    """The value of the group's node, given those of the nodes before it."""
    return reduce(np.minimum, [values[arg] for arg in group.rest], least_gap(group, rows, turn))


def negative(group: GapMinimum, rows: Floats) -> Floats:
    """The least of a group's gaps where it is negative, else infinity, of coordinates (3N, B). Gaps of objects that
    stand farther apart than their outer radii are not computed."""
    count = rows.shape[1]
    pairs, scenes = [], []
    near = (group.outer * np.abs(group.outer))[:, None]
    for start in range(0, count, BLOCK):
        places = rows[:, start : start + BLOCK]
        square, other = (places[group.rows[1, axis]] - places[group.rows[0, axis]] for axis in (0, 1))
        square *= square
        other *= other
        square += other
        pair, scene = np.nonzero(~(square > near))  # so that NaN is looked at
        pairs.append(pair)
        scenes.append(scene + start)
    pair, scene = np.concatenate(pairs), np.concatenate(scenes)
    out = np.full(count, math.inf)
    for alike in group.alike:
        some = slice(None) if len(group.alike) == 1 else np.isin(pair, alike.pairs)
        which, where = pair[some], scene[some]
        poses = [rows[group.rows[side, axis, which], where] for side in (0, 1) for axis in (0, 1, 2)]
        gaps = PRIMITIVES["gap"].evaluate(NUMPY, *alike.shapes, *poses)
        np.minimum.at(out, where, gaps - group.less[which])
    return np.where(out < 0.0, out, math.inf)


# --------------------------------------------------------------------------------------------------------------------
# The least of many clearances, without computing most of them.
#
# `noOverlap()` takes the least clearance of all pairs. A clearance lies between the distance of the two centres less
# both outer radii and that distance less both inner radii; so in any scene, only pairs whose distance is near the
# least can decide. Distances cost a tenth of clearances: they are computed for all pairs and scenes, clearances for
# what is left. The least is the same number, bit for bit.


Array = npt.NDArray[Any]
Shapes = tuple[Footprint, ...]
FEWEST_PAIRS = 3  # pairs; the distances of fewer cost more than they save


@dataclass(frozen=True, slots=True)
class ConjunctionTerms:
    """What a conjunction takes the least of: clearances, grouped by the footprints (pairs of nodes (x, y, theta, x, y,
    theta) for each two shapes), and the arguments `others`. `atoms` are the nodes of the clearances' atoms, one pair
    after another; `nodes` are the nodes that need no values of their own."""

    groups: tuple[tuple[Shapes, tuple[tuple[int, ...], ...]], ...]
    others: tuple[int, ...]
    atoms: tuple[int, ...]
    nodes: frozenset[int]

    @property
    def needs(self) -> set[int]:
        """The nodes whose values the clearances are computed from."""
        return {arg for _, pairs in self.groups for pair in pairs for arg in pair}

    @property
    def instead(self) -> tuple[int, ...]:
        """What the conjunction is computed from, its own arguments being left out."""
        return (*self.others, *sorted(self.needs))

    @property
    def count(self) -> int:
        return sum(len(pairs) for _, pairs in self.groups)


def find(core: Core) -> dict[int, ConjunctionTerms]:
    """The conjunctions of enough clearances, by node. Clearances that are wanted elsewhere, too, are no part of them,
    nor are those of two circles, which cost no more than a distance."""
    uses = Counter(child for node in core.nodes for child in children(node))
    kept = {*core.labels.values(), core.requirement}
    found = {}
    for index, node in enumerate(core.nodes):
        if not isinstance(node, Junction) or node.kind != "min":
            continue
        groups: dict[Shapes, dict[int, tuple[int, ...]]] = {}
        inner: set[int] = set()
        for arg in node.args:
            atom = core.nodes[arg]
            margin = core.nodes[atom.margin] if isinstance(atom, Atom) else None
            if isinstance(atom, Atom) and isinstance(margin, Apply) and margin.primitive == "gap":
                alone = uses[arg] == uses[atom.margin] == 1 and not kept & {arg, atom.margin}
                moves = any(isinstance(core.nodes[one], Coord) for one in margin.args)
                if alone and moves and not all(isinstance(shape, Circle) for shape in margin.shapes):
                    groups.setdefault(margin.shapes, {})[arg] = margin.args
                    inner |= {arg, atom.margin}
        if len(inner) >= 2 * FEWEST_PAIRS:
            others = tuple(arg for arg in node.args if arg not in inner)
            pairs = tuple((key, tuple(of.values())) for key, of in groups.items())
            atoms = tuple(atom for of in groups.values() for atom in of)
            found[index] = ConjunctionTerms(pairs, others, atoms, frozenset(inner))
    return found


def last_uses_of(core: Core, found: dict[int, ConjunctionTerms]) -> list[list[int]]:
    """last_uses(core), where the clearances in `found` are computed with their conjunctions."""
    instead: dict[int, tuple[int, ...]] = {node: () for closest in found.values() for node in closest.nodes}
    return last_uses(core, instead | {index: closest.instead for index, closest in found.items()})


def least(
    closest: ConjunctionTerms, values: Mapping[int, Any], gap: Callable[..., Array], which: Array | None = None
) -> Array | None:
    """(B,) the least of the clearances in each scene. `values` are those of the nodes `needs`, arrays (B,) or () of one
    dtype; gap(*shapes, *six arrays of any one length) computes clearances. None where most pairs may decide, so that
    computing all of them is cheaper. The atom of the least one is written into `which` (B,), where that is given."""
    dtype = next(value.dtype for value in values.values())
    count = max(value.size for value in values.values())
    squares = np.empty((closest.count, count), dtype)
    spare = np.empty(count, dtype)
    pairs = [(shapes, pair) for shapes, group in closest.groups for pair in group]
    for square, (_, (ax, ay, _, bx, by, _)) in zip(squares, pairs, strict=True):
        np.subtract(values[bx], values[ax], out=square)
        np.subtract(values[by], values[ay], out=spare)
        np.multiply(square, square, out=square)
        np.multiply(spare, spare, out=spare)
        np.add(square, spare, out=square)
    where = _deciding(closest, squares)
    if sum(len(scenes) for scenes in where) > squares.size // 2:
        return None
    result = np.full(count, np.inf, dtype)
    first = 0
    for shapes, group in closest.groups:
        scenes, atoms = where[first : first + len(group)], closest.atoms[first : first + len(group)]
        first += len(group)
        columns = zip(*(_taken(values, pair, some) for pair, some in zip(group, scenes, strict=True)), strict=True)
        found = gap(*shapes, *map(np.concatenate, columns))
        start = 0
        for atom, some in zip(atoms, scenes, strict=True):
            new, old = found[start : start + len(some)], result[some]
            result[some] = np.minimum(old, new)
            if which is not None:
                which[some[new < old]] = atom
            start += len(some)
    return result


def _taken(values: Mapping[int, Any], pair: tuple[int, ...], scenes: Array) -> list[Array]:
    return [values[arg].take(scenes) if values[arg].ndim else np.broadcast_to(values[arg], len(scenes)) for arg in pair]


def _deciding(closest: ConjunctionTerms, squares: Array) -> list[Array]:
    """For every pair, the scenes in which it may have the least clearance, given the squares of the distances."""
    radii = []
    for (a, b), _ in closest.groups:
        of_a, of_b = measures(a), measures(b)
        radii.append((of_a.inner + of_b.inner, of_a.outer + of_b.outer))
    rows, first = [], 0
    for _, group in closest.groups:
        rows.append(squares[first : first + len(group)])
        first += len(group)
    highest: Any = np.inf  # no clearance is more than the least of these
    for square, (inside, _) in zip(rows, radii, strict=True):
        highest = np.minimum(highest, np.sqrt(square.min(axis=0)) - inside)
    # Rounding: all steps, those of clearances included, together are off by far less than this.
    room = 64.0 * float(np.finfo(squares.dtype).eps)
    size = sum(max(abs(radius) for radius in column) for column in zip(*radii, strict=True))
    where: list[Array] = []
    for square, (_, outside) in zip(rows, radii, strict=True):
        limit = (highest + outside) * (1.0 + room) + room * size
        limit *= limit
        where += [np.flatnonzero(~(row > limit)) for row in square]  # NaN may decide
    return where
