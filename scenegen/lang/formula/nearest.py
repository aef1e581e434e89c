"""The least of many gaps, of which only those are computed that can be the least.

`noOverlap()` of N objects is the minimum of N (N - 1) / 2 gaps. The gap of two footprints lies between the distance of
their centres less both outer radii and that distance less both inner radii: discs round the centres, around the
footprints and within them. So in any scene only pairs whose distance is near the least can decide. Distances cost a
tenth of gaps: they are computed for all pairs and scenes, gaps for what is left. The least is the same number, bit for
bit. Numbers are arrays of numpy; what computes a gap is given, so that tensors go the same way.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any

import numpy as np
import numpy.typing as npt

from scenegen.arrays import Index
from scenegen.geometry.footprint import Circle, Footprint, measures
from scenegen.lang.formula.core import Apply, Atom, Const, Coord, Core, Junction, children, last_uses

Array = npt.NDArray[Any]
Gap = Callable[..., Any]
"""gap(*shapes, *six arrays of one length): x, y and heading of both."""

FEWEST_GAPS, DOZEN = 30, 12  # gaps of a minimum, and for each pair of shapes; fewer are computed without detours
SEVERAL = 2  # scenes from which on gaps are left out
BLOCK, FEWEST_SCENES = 1 << 16, 64  # distances computed at a time, which stay in cache; and scenes, at least


@dataclass(frozen=True, slots=True)
class Alike:
    """The pairs of two shapes from whose gaps the same is taken off, and the inner and outer radii of both shapes
    together, with that."""

    shapes: tuple[Footprint, ...]
    less: float
    inner: float
    outer: float
    pairs: slice


@dataclass(frozen=True, slots=True, eq=False)
class NearestPairs:
    """The P gaps of one minimum: the nodes of x, y and heading of both places, `args` (6, P), and the `atoms` (P,).
    `others` are the other arguments of the minimum, `within` the nodes that need no values of their own."""

    args: Index
    atoms: Index
    alike: tuple[Alike, ...]
    others: tuple[int, ...]
    within: frozenset[int]

    @property
    def places(self) -> list[int]:
        """The nodes whose values the gaps are computed from."""
        return [int(node) for node in np.unique(self.args)]


@dataclass(frozen=True, slots=True)
class GapMinima:
    """The minima of a tape that are worth it, by node, and the nodes whose values nobody needs."""

    by_node: Mapping[int, NearestPairs]
    skipped: frozenset[int]

    def last_uses(self, core: Core) -> list[list[int]]:
        """last_uses(core), where gaps are computed with their minimum."""
        instead: dict[int, Sequence[int]] = dict.fromkeys(self.skipped, ())
        return last_uses(core, instead | {index: (*one.others, *one.places) for index, one in self.by_node.items()})


def find_groups(
    core: Core, needed: Collection[int], fewest: int = FEWEST_GAPS, dozen: int = DOZEN, *, fixed: bool = False
) -> GapMinima:
    """The minima of a tape where the values of the nodes `needed` will be read, and no others. Those of fewer gaps than
    `fewest`, or than `dozen` for each pair of shapes, are none; gaps to what is `fixed` count where that is set."""
    uses = [0] * len(core.nodes)
    for index in needed:
        uses[index] += 1
    for index in range(len(core.nodes) - 1, -1, -1):  # parents before children
        if uses[index]:
            for child in children(core.nodes[index]):
                uses[child] += 1
    minima, skipped = {}, {index for index, count in enumerate(uses) if not count}
    for index, node in enumerate(core.nodes):
        if not (uses[index] and isinstance(node, Junction) and node.kind == "min" and len(node.args) >= fewest):
            continue
        found = {arg: one for arg in node.args if (one := _gap_below(core, arg, uses, fixed)) is not None}
        if len(found) < fewest:
            continue
        pairs = _make_pairs(tuple(arg for arg in node.args if arg not in found), found)
        if len(found) >= dozen * len({one.shapes for one in pairs.alike}):
            minima[index] = pairs
            skipped |= pairs.within
    return GapMinima(minima, frozenset(skipped))


_Found = tuple[tuple[int, ...], Apply, float]


def _gap_below(core: Core, index: int, uses: Sequence[int], fixed: bool) -> _Found | None:
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
    moving = [isinstance(core.nodes[arg], Coord) for arg in node.args]
    return (below, node, less) if (any(moving) if fixed else all(moving)) else None


def _make_pairs(others: tuple[int, ...], found: Mapping[int, _Found]) -> NearestPairs:
    by_identity: dict[tuple[float, ...], list[int]] = {}  # hashing shapes for each pair takes longer than all else
    for atom, (_, gap, less) in found.items():
        by_identity.setdefault((less, *map(id, gap.shapes)), []).append(atom)
    groups: dict[tuple[tuple[Footprint, ...], float], list[int]] = {}
    for atoms in by_identity.values():
        _, gap, less = found[atoms[0]]
        groups.setdefault((gap.shapes, less), []).extend(atoms)
    alike, end = [], 0
    for (shapes, less), atoms in groups.items():
        begin, end = end, end + len(atoms)
        inner, outer = sum(measures(one).inner for one in shapes), sum(measures(one).outer for one in shapes)
        alike.append(Alike(shapes, less, less + inner, less + outer, slice(begin, end)))
    order = [atom for atoms in groups.values() for atom in atoms]
    args = np.array([found[atom][1].args for atom in order], dtype=np.intp).T
    within = frozenset(found).union(*(nodes for nodes, _, _ in found.values()))
    return NearestPairs(args, np.array(order, dtype=np.intp), tuple(alike), others, within)


def minimum(
    pairs: NearestPairs,
    values: Callable[[int], Any],
    gap: Gap,
    *,
    below: float = math.inf,
    share: float = 1.0,
    which: npt.NDArray[np.int32] | None = None,
) -> Array | None:
    """(B,) the least of the gaps in each scene. `values` gives numbers or arrays (B,) of one dtype for the nodes
    `places`. Gaps of which none is less than `below` may be left out: then something that is not less, infinity at
    most. None where more than a `share` of all would be computed. A scene with a number that is infinite or NaN has the
    value that all its gaps give. The atom of one that is the least is written into `which` (B,), where that is
    given."""
    nodes, at = np.unique(pairs.args, return_inverse=True)
    at = at.reshape(pairs.args.shape)
    given = [np.asarray(values(int(node))) for node in nodes]
    count = max(one.size for one in given)
    table = np.empty((len(nodes), count), next(one.dtype for one in given if one.ndim))
    for row, one in zip(table, given, strict=True):
        row[:] = one
    near = np.empty((len(pairs.atoms), count), dtype=bool)
    step = max(FEWEST_SCENES, BLOCK // len(near))
    for start in range(0, count, step):
        _can_decide(pairs, table[:, start : start + step], at, below, near[:, start : start + step])
    near |= ~np.isfinite(table.sum(axis=0))
    if share < 1.0 and np.count_nonzero(near) > share * near.size:
        return None
    least = np.full(count, np.inf, table.dtype)
    flat = table.reshape(-1)
    for alike in pairs.alike:
        some = near[alike.pairs]
        found, many = np.flatnonzero(some), np.count_nonzero(some, axis=1)
        first = np.arange(len(some)) * count
        numbers = [flat.take(found + (row * count - first).repeat(many)) for row in at[:, alike.pairs]]
        value = gap(*alike.shapes, *numbers) - least.dtype.type(alike.less)
        scene = found - first.repeat(many)
        before = None if which is None else least.copy()
        np.minimum.at(least, scene, value)
        if which is not None and before is not None:
            new = np.flatnonzero((value == least[scene]) & (value < before[scene]))[::-1]  # the first is written last
            which[scene[new]] = pairs.atoms[alike.pairs].repeat(many)[new]
    return least


def _can_decide(pairs: NearestPairs, table: Array, at: Index, below: float, near: npt.NDArray[np.bool_]) -> None:
    """Writes into `near` (P, b) which pairs may have the least gap, or a gap of NaN."""
    square, spare = table[at[3]], table[at[4]]
    square -= table[at[0]]
    spare -= table[at[1]]
    square *= square
    spare *= spare
    square += spare
    highest: Any = below  # no gap is more than the least of these
    for alike in pairs.alike:
        highest = np.minimum(highest, np.sqrt(square[alike.pairs].min(axis=0)) - alike.inner)
    # Rounding: all steps, those of gaps included, together are off by far less than this.
    room = 64.0 * float(np.finfo(square.dtype).eps)
    size = max(abs(alike.inner) for alike in pairs.alike) + max(abs(alike.outer) for alike in pairs.alike)
    for alike in pairs.alike:
        limit = (highest + alike.outer) * (1.0 + room) + room * size
        np.greater(square[alike.pairs], limit * np.abs(limit), out=near[alike.pairs])
    np.logical_not(near, out=near)


def every(pairs: NearestPairs, values: Callable[[int], Any], gap: Gap) -> list[Any]:
    """All the gaps, in the order of `atoms`, less what is taken off."""
    found = []
    for alike in pairs.alike:
        for args in pairs.args[:, alike.pairs].T.tolist():
            value = gap(*alike.shapes, *map(values, args))
            found.append(value - alike.less if alike.less else value)
    return found


def with_others(pairs: NearestPairs, least: Any, values: Callable[[int], Any], step: Callable[[Any, Any], Any]) -> Any:
    """The value of the minimum's node, given that of its gaps and those of the nodes before it."""
    return reduce(step, map(values, pairs.others), least)
