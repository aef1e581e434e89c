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

from scenegen.geometry import Footprint
from scenegen.geometry.footprint import Circle, measures
from scenegen.lang.formula.core import Apply, Atom, Const, Coord, Core, Junction, children, last_uses

Array = npt.NDArray[Any]
Index = npt.NDArray[np.intp]
Shapes = tuple[Footprint, ...]
Gap = Callable[..., Any]
"""gap(*shapes, *six arrays of one length): x, y and heading of both."""

FEWEST_GAPS, DOZEN = 30, 12  # gaps of a minimum, and for each pair of shapes; fewer are computed without detours
SEVERAL = 2  # scenes from which on gaps are left out
BLOCK, FEWEST_SCENES = 1 << 16, 64  # distances computed at a time, which stay in cache; and scenes, at least


@dataclass(frozen=True, slots=True, eq=False)
class NearestPairs:
    """The P gaps of one minimum: the nodes of x, y and heading of both places, `args` (6, P), what is taken off each
    gap, `less` (P,), and the inner and outer radii of both together, with that, (P,). `alike` are the pairs of each two
    shapes, `atoms` (P,) their atoms, `others` the other arguments of the minimum, `within` the nodes that need no
    values of their own."""

    args: Index
    less: Array
    inner: Array
    outer: Array
    alike: tuple[tuple[Shapes, Index], ...]
    atoms: Index
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
        if len(found) >= dozen * len(pairs.alike):
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
    gaps = [gap for _, gap, _ in found.values()]
    less = np.array([constant for _, _, constant in found.values()])
    by_identity: dict[tuple[int, ...], list[int]] = {}  # hashing shapes for each pair takes longer than all else
    for pair, gap in enumerate(gaps):
        by_identity.setdefault(tuple(map(id, gap.shapes)), []).append(pair)
    by_shapes: dict[Shapes, list[int]] = {}
    inner, outer = less.copy(), less.copy()
    for pairs in by_identity.values():
        shapes = gaps[pairs[0]].shapes
        by_shapes.setdefault(shapes, []).extend(pairs)
        inner[pairs] += sum(measures(shape).inner for shape in shapes)
        outer[pairs] += sum(measures(shape).outer for shape in shapes)
    alike = tuple((shapes, np.array(pairs)) for shapes, pairs in by_shapes.items())
    args = np.array([gap.args for gap in gaps], dtype=np.intp).T
    within = frozenset(found).union(*(nodes for nodes, _, _ in found.values()))
    return NearestPairs(args, less, inner, outer, alike, np.array(list(found), dtype=np.intp), others, within)


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
    near = np.empty((len(pairs.less), count), dtype=bool)
    step = max(FEWEST_SCENES, BLOCK // len(near))
    for start in range(0, count, step):
        near[:, start : start + step] = _can_decide(pairs, table[:, start : start + step], at, below)
    near |= ~np.isfinite(table.sum(axis=0))
    if share < 1.0 and np.count_nonzero(near) > share * near.size:
        return None
    least = np.full(count, np.inf, table.dtype)
    flat, less = table.reshape(-1), pairs.less.astype(table.dtype)
    for shapes, alike in pairs.alike:
        some = near[alike] if len(pairs.alike) > 1 else near
        found, many = np.flatnonzero(some), np.count_nonzero(some, axis=1)
        first = np.arange(len(alike)) * count
        numbers = [flat.take(found + (row[alike] * count - first).repeat(many)) for row in at]
        value = gap(*shapes, *numbers) - less[alike].repeat(many)
        scene = found - first.repeat(many)
        if which is None:
            np.minimum.at(least, scene, value)
            continue
        before = least.copy()
        np.minimum.at(least, scene, value)
        new = np.flatnonzero((value == least[scene]) & (value < before[scene]))[::-1]  # the first is written last
        which[scene[new]] = pairs.atoms[alike].repeat(many)[new]
    return least


def _can_decide(pairs: NearestPairs, table: Array, at: Index, below: float) -> npt.NDArray[np.bool_]:
    """Which pairs may have the least gap, (P, b), or a number that is none."""
    distance, spare = table[at[3]], table[at[4]]
    distance -= table[at[0]]
    spare -= table[at[1]]
    distance *= distance
    spare *= spare
    distance += spare
    np.sqrt(distance, out=distance)
    inner, outer = (ends.astype(distance.dtype)[:, None] for ends in (pairs.inner, pairs.outer))
    distance -= inner
    highest = np.minimum(distance.min(axis=0), below)  # no gap is more than the least of these
    distance -= outer - inner
    # Rounding: all steps, those of gaps included, together are off by far less than this.
    room = 64.0 * float(np.finfo(distance.dtype).eps)
    highest += room * (np.abs(highest) + float(np.abs(inner).max() + np.abs(outer).max()))
    can: npt.NDArray[np.bool_] = ~(distance > highest)
    return can


def every(pairs: NearestPairs, values: Callable[[int], Any], gap: Gap) -> list[Any]:
    """All the gaps, in the order of `atoms`, less what is taken off."""
    found: list[Any] = [None] * len(pairs.less)
    for shapes, alike in pairs.alike:
        for pair in alike.tolist():
            value, less = gap(*shapes, *(values(int(node)) for node in pairs.args[:, pair])), float(pairs.less[pair])
            found[pair] = value - less if less else value
    return found


def with_others(pairs: NearestPairs, least: Any, values: Callable[[int], Any], step: Callable[[Any, Any], Any]) -> Any:
    """The value of the minimum's node, given that of its gaps and those of the nodes before it."""
    return reduce(step, map(values, pairs.others), least)
