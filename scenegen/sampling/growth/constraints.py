"""What one object's pose is held against: the clauses that touch it, in the order in which they come into force.

A clause is in force once all of its objects are placed, so at each stage the clauses in force are the first few of a
list that is sorted by stage. Pairs are scored in two steps: discs around the footprints tell nearly all of them apart
at the price of a distance (the broad phase), and clearances are computed only for those that are left.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from scenegen.arrays import Array, Bool, Index
from scenegen.geometry import NUMPY, PRIMITIVES, Footprint
from scenegen.geometry.footprint import Box, Circle, Polygon, corners, edges, measures
from scenegen.geometry.namespace import turning
from scenegen.lang.formula.capped import CappedMinima, find_capped
from scenegen.lang.formula.core import Coord, Core, Node, restrict
from scenegen.lang.formula.interpret import GapMinima, Numbers, PrunedNumbers, fold
from scenegen.pose import FLAT, THETA, rows_along
from scenegen.sampling.growth.graph import Clause, Graph, Pair
from scenegen.search.effort import Effort, dear_seconds

Pose = tuple[Array, ...]

GAP_TOLERANCE = 1e-12  # metres: nearer than that to what is asked, the distance itself is computed


def keeps_distance(a: Footprint, b: Footprint, at: Pose, other: Pose, least: Array | float) -> Bool:
    """Whether the clearance of a at a pose, x, y and heading (B,) each, and b at another is at least `least`, (B,):
    cheaper than how far, and the same answer.

    By the separating-axis theorem two convex polygons overlap unless one lies beyond the line through an edge of the
    other, and how far it lies beyond is never more than the distance. So the distance itself is computed only where
    that leaves the matter open.
    """
    if isinstance(a, Circle) or isinstance(b, Circle):
        gap: Array = PRIMITIVES["gap"].evaluate(NUMPY, a, b, *at, *other)
        return np.asarray(gap >= least)
    beyond = _edge_gap(a, b, at, other)
    clear: Bool = beyond >= np.maximum(least, 0.0) + GAP_TOLERANCE
    open_ = np.flatnonzero(~clear & (beyond >= np.minimum(least, 0.0) - GAP_TOLERANCE))
    if len(open_):
        ends = [np.broadcast_to(value, beyond.shape)[open_] for value in (*at, *other)]
        limit = least if np.ndim(least) == 0 else np.asarray(least)[open_]
        clear[open_] = PRIMITIVES["gap"].evaluate(NUMPY, a, b, *ends) >= limit
    return clear


def _edge_gap(a: Box | Polygon, b: Box | Polygon, at: Pose, other: Pose) -> Array:
    """How far one lies beyond an edge of the other, at best, (B,): at most the clearance, and equal to it where they
    overlap."""
    dx, dy = other[0] - at[0], other[1] - at[1]
    a_cos, a_sin, b_cos, b_sin = np.cos(at[2]), np.sin(at[2]), np.cos(other[2]), np.sin(other[2])
    cos, sin = a_cos * b_cos + a_sin * b_sin, a_cos * b_sin - a_sin * b_cos
    one = _one_sided_gap(a, b, a_cos * dx + a_sin * dy, a_cos * dy - a_sin * dx, cos, sin)
    two = _one_sided_gap(b, a, -b_cos * dx - b_sin * dy, b_sin * dx - b_cos * dy, cos, -sin)
    out: Array = np.maximum(one, two)
    return out


def _one_sided_gap(a: Box | Polygon, b: Box | Polygon, x: Array, y: Array, cos: Array, sin: Array) -> Array:
    """How far b lies beyond an edge of a, at best. In a's frame it stands at (x, y), turned by the angle of these."""
    if isinstance(a, Box):
        least_x, most_x, least_y, most_y = _span(b, cos, sin)
        across = np.maximum(x + least_x, -x - most_x) - a.length / 2.0
        out: Array = np.maximum(across, np.maximum(y + least_y, -y - most_y) - a.width / 2.0)
        return out
    best: Array | None = None
    points = _rotated_corners(b, cos, sin)
    for (nx, ny), offset, *_ in edges(a):
        height = _lowest([nx * u + ny * v for u, v in points]) + (nx * x + ny * y - offset)
        best = height if best is None else np.maximum(best, height)
    assert best is not None
    return best


def _span(footprint: Box | Polygon, cos: Array, sin: Array) -> tuple[Array, Array, Array, Array]:
    """From where to where a footprint reaches along x and along y, when turned."""
    if isinstance(footprint, Box):
        half_length, half_width = footprint.length / 2.0, footprint.width / 2.0
        cos, sin = np.abs(cos), np.abs(sin)
        x, y = half_length * cos + half_width * sin, half_length * sin + half_width * cos
        return -x, x, -y, y
    points = _rotated_corners(footprint, cos, sin)
    rows_along, across = [u for u, _ in points], [v for _, v in points]
    return _lowest(rows_along), -_lowest([-u for u in rows_along]), _lowest(across), -_lowest([-v for v in across])


def _rotated_corners(footprint: Box | Polygon, cos: Array, sin: Array) -> list[tuple[Array, Array]]:
    return [(cos * u - sin * v, sin * u + cos * v) for u, v in corners(footprint)]


def _lowest(values: list[Array]) -> Array:
    lowest = values[0]
    for value in values[1:]:
        lowest = np.minimum(lowest, value)
    return lowest


@dataclass(frozen=True, slots=True, eq=False)
class Values:
    """The values of some formula nodes over many columns of poses. `steps` are the nodes that these need, with
    arguments that count within the steps; `wanted` are the steps of the nodes asked for, `rows` the rows of (3N, B)
    storage that are read, `capped` the minima of which only a part is computed; `dear` see `dear_seconds`."""

    steps: tuple[Node, ...]
    wanted: tuple[int, ...]
    rows: tuple[int, ...]
    capped: CappedMinima
    dear: tuple[float, float]

    def __call__(self, rows: Sequence[Any], check: Callable[[], None] | None = None) -> list[Array]:
        """One value per wanted node. `rows` are 3N arrays that broadcast against each other, or numbers. `check` is
        called before each primitive: what it raises ends the work."""
        values: list[Any] = []
        numbers = Numbers(NUMPY, rows)
        if self.capped.skipped:
            turned = turning(NUMPY, rows[rows_along(THETA)])
            numbers = PrunedNumbers(turned, rows, GapMinima({}, frozenset(), self.capped), values)
        fold(self.steps, numbers, before=check, values=values)
        return [values[place] for place in self.wanted]


def make_values(core: Core, wanted: Sequence[int]) -> Values:
    """The evaluator of some nodes of a core."""
    steps, place = restrict(core.nodes, wanted)
    rows = tuple(sorted({node.row for node in steps if isinstance(node, Coord)}))
    numbers = tuple(place[node] for node in wanted)
    return Values(steps, numbers, rows, find_capped(steps, numbers), dear_seconds(steps))


MAX_DISTANCES_AT_ONCE = 1 << 15  # distances computed at a time: they stay in the cache
NEVER_STAGE = 1 << 40  # a stage that does not come
DISC_SLACK = 1e-9  # by how much smaller discs within footprints are taken than they are


@dataclass(frozen=True, slots=True, eq=False)
class DistancePairs:
    """What one object keeps a distance from, at most one pair with each of N things: other objects of the spec, or
    fixed poses `fixed` (N, 3). `stages` (N,) is when a pair comes into force, past all stages where there is none.
    `low` is the least clearance, `square` the square of the distance of the centres beyond which it is met, `inner`
    that of the distance within which it is not, -1 where there is none, (N, C or 1) each, in metres. `kind` (N,) is an
    index into `kinds`: the footprints, and whether the object is the first of the pair; -1 where both are round, so
    that the distance says it all."""

    fixed: Array | None
    stages: Index
    low: Array
    square: Array
    inner: Array
    kind: Index
    kinds: tuple[tuple[tuple[Footprint, Footprint], bool], ...]


@dataclass(slots=True, eq=False)
class ObjectConstraints:
    """All that touches object `thing`. `rows` are its rows that some clause reads, the switch of what stands first;
    `shapes` are its footprints in pairs, `ways[c]` the ways of choice c that touch it. `cache` holds evaluators by the
    number of clauses that they are for."""

    thing: int
    rows: tuple[int, ...]
    graph: Graph
    clauses: tuple[Clause, ...]
    clause_stages: tuple[int, ...]
    layers: tuple[DistancePairs, ...]
    shapes: frozenset[Footprint]
    ways: Mapping[int, tuple[int, ...]]
    cache: dict[object, Values] = field(default_factory=dict)

    def clauses_at(self, stage: int) -> tuple[Clause, ...]:
        """The clauses over objects placed by then."""
        return self.clauses[: bisect_right(self.clause_stages, stage)]

    def meets(
        self, rows: Sequence[Any], cell: Index, stage: int, check: Callable[[], None] | None = None
    ) -> Bool | None:
        """Which columns meet the clauses in force other than pairs; None where there are none. `rows` are 3N arrays
        that broadcast to the result's shape, `cell` the columns' cells, of the last axis. `check` is called before each
        primitive: what it raises ends the work."""
        clauses = self.clauses_at(stage)
        if not clauses:
            return None
        values = self.values(len(clauses), [clause.node for clause in clauses])(rows, check)
        good: Bool | None = None
        for clause, value in zip(clauses, values, strict=True):
            inside = is_within(value, clause, cell)
            if inside is not None:
                good = inside if good is None else good & inside
        return good

    def values(self, key: object, nodes: Sequence[int]) -> Values:
        if key not in self.cache:
            self.cache[key] = make_values(self.graph.core, nodes)
        return self.cache[key]

    def drop_near(
        self,
        pose: tuple[Array, Array, Array],
        scenes: Array,
        cell: Index,
        stage: int,
        good: Bool,
        columns: Index | None = None,
        but: Sequence[int] = (),
    ) -> None:
        """Take out of `good` (B,) the poses, x, y and heading (B,) each, that are too near to something in `scenes`
        (3N, P), but for some objects. Pose i stands in scene columns[i], or in scene i; `cell` (B,) are its cells."""
        for layer in self.layers:
            _drop_near(layer, pose, scenes, cell, stage, columns, good, but)


def is_within(value: Any, clause: Clause, cell: Index) -> Bool | None:
    """Whether values lie within the clause's ends for their cells; None where every value does."""
    inside: Bool | None = None
    if np.isfinite(clause.low).any():
        low = clause.low[0] if len(clause.low) == 1 else clause.low[cell]
        inside = np.asarray(value >= low)
    if np.isfinite(clause.high).any():
        high = clause.high[0] if len(clause.high) == 1 else clause.high[cell]
        below = np.asarray(value <= high)
        inside = below if inside is None else inside & below
    return inside


def _drop_near(
    layer: DistancePairs,
    pose: tuple[Array, Array, Array],
    scenes: Array,
    cell: Index,
    stage: int,
    columns: Index | None,
    good: Bool,
    but: Sequence[int],
) -> None:
    """Take out of `good` (B,) the columns in which something in force is too near, but for some objects."""
    x, y, theta = pose
    live = layer.stages <= stage
    if but and layer.fixed is None:
        live[list(but)] = False
    if not live.any():
        return
    square = np.where(live[:, None], layer.square, -1.0)
    count, width = len(square), len(good)
    step = max(1, MAX_DISTANCES_AT_ONCE // max(1, width))
    first, last = int(live.argmax()), count - int(live[::-1].argmax())
    room = np.empty((2, min(step, last - first), width))
    for begin in range(first, last, step):
        part = slice(begin, min(last, begin + step))
        dx, dy = room[:, : part.stop - begin]
        np.subtract(_coordinates(layer, 0, part, scenes, columns), x, out=dx)
        np.subtract(_coordinates(layer, 1, part, scenes, columns), y, out=dy)
        np.multiply(dx, dx, out=dx)
        np.multiply(dy, dy, out=dy)
        np.add(dx, dy, out=dx)
        near = dx < (square[part] if square.shape[1] == 1 else square[part][:, cell])
        near &= good
        which, column = np.nonzero(near)
        if not len(which):
            continue
        which = which + begin
        # what lies too near whatever the headings, and round footprints, for which the distance says it all
        distance = dx[which - begin, column]
        inner = layer.inner[which, 0] if layer.inner.shape[1] == 1 else layer.inner[which, cell[column]]
        kind = layer.kind[which]
        good[column[(kind < 0) | (distance < inner)]] = False
        for number, (shapes, is_first) in enumerate(layer.kinds):
            mine = np.flatnonzero((kind == number) & good[column])
            if not len(mine):
                continue
            other, here = which[mine], column[mine]
            scene = here if columns is None else columns[here]
            if layer.fixed is None:
                there = tuple(scenes[rows_along(axis)][other, scene] for axis in FLAT)
            else:
                there = tuple(layer.fixed[other, axis] for axis in FLAT)
            own = x[here], y[here], theta[here]
            least = layer.low[other, 0] if layer.low.shape[1] == 1 else layer.low[other, cell[here]]
            ends: tuple[tuple[Array, ...], ...] = (own, there) if is_first else (there, own)
            clear = keeps_distance(*shapes, ends[0], ends[1], least)
            good[here[~clear]] = False


def _coordinates(layer: DistancePairs, axis: int, part: slice, scenes: Array, columns: Index | None) -> Array:
    """x (axis 0) or y (1) of some things at some columns, (m, B) or (m, 1)."""
    if layer.fixed is not None:
        return layer.fixed[part, axis, None]
    rows = scenes[rows_along(axis)][part]
    return rows if columns is None else rows[:, columns]


def make_constraints(graph: Graph, order: Sequence[int], effort: Effort) -> dict[int, ObjectConstraints]:
    """What touches each object, given the order in which they are placed. Raises what `effort` raises."""
    at = {thing: place for place, thing in enumerate(order)}
    clauses: dict[int, list[Clause]] = {thing: [] for thing in order}
    pairs: dict[int, list[tuple[Pair, bool]]] = {thing: [] for thing in order}
    touched: dict[int, dict[int, list[int]]] = {thing: {} for thing in order}
    for clause in graph.clauses:
        for thing in clause.objects:
            clauses[thing].append(clause)
    for pair in graph.pairs:
        for thing in pair.objects:
            pairs[thing].append((pair, thing == pair.first))
    for index, choice in enumerate(graph.choices):
        for number, way in enumerate(choice.ways):
            for thing in way.whole.objects:
                touched[thing].setdefault(index, []).append(number)

    def stage(objects: frozenset[int]) -> int:
        return max(at[thing] for thing in objects)

    found = {}
    for thing in order:
        effort.check()
        mine = sorted(clauses[thing], key=lambda one: (stage(one.objects), one.node))
        found[thing] = ObjectConstraints(
            thing,
            graph.rows_of(thing),
            graph,
            tuple(mine),
            tuple(stage(one.objects) for one in mine),
            _layers(pairs[thing], at, len(graph.core.objects)),
            frozenset(pair.shapes[0 if first else 1] for pair, first in pairs[thing]),
            {index: tuple(numbers) for index, numbers in touched[thing].items()},
        )
    return found


def _layers(pairs: Sequence[tuple[Pair, bool]], at: Mapping[int, int], count: int) -> tuple[DistancePairs, ...]:
    """The pairs of one of `count` objects: those with other objects in as few layers as may be, then the others."""
    layers: list[dict[int, tuple[Pair, bool]]] = []
    fixed: list[tuple[Pair, bool]] = []
    for pair, first in sorted(pairs, key=lambda one: one[0].node):
        other = pair.second if first else pair.first
        if not isinstance(other, int):
            fixed.append((pair, first))
            continue
        layer = next((layer for layer in layers if other not in layer), None)
        if layer is None:
            layers.append(layer := {})
        layer[other] = pair, first
    made = [_layer(layer, at, count, None) for layer in layers]
    if fixed:
        poses = np.array([pair.second if first else pair.first for pair, first in fixed], dtype=np.float64)
        made.append(_layer(dict(enumerate(fixed)), at, len(fixed), poses))
    return tuple(made)


def _layer(
    members: Mapping[int, tuple[Pair, bool]], at: Mapping[int, int], count: int, fixed: Array | None
) -> DistancePairs:
    cells = max(len(pair.low) for pair, _ in members.values())
    low, square, inner = np.zeros((count, cells)), np.full((count, cells), -1.0), np.full((count, cells), -1.0)
    stages, kind = np.full(count, NEVER_STAGE, dtype=np.intp), np.full(count, -1, dtype=np.intp)
    kinds: dict[tuple[tuple[Footprint, Footprint], bool], int] = {}
    for place, (pair, first) in members.items():
        low[place] = pair.low
        reach = np.maximum(pair.low + sum(measures(shape).outer for shape in pair.shapes), 0.0)
        square[place] = reach * reach
        discs = [measures(shape).inner for shape in pair.shapes]  # each footprint holds such a disc round its centre
        if min(discs) > 0.0:
            near = np.maximum(pair.low + sum(discs), 0.0) * (1.0 - DISC_SLACK)
            inner[place] = near * near
        stages[place] = max(at[thing] for thing in pair.objects)
        if not all(isinstance(shape, Circle) for shape in pair.shapes):
            kind[place] = kinds.setdefault((pair.shapes, first), len(kinds))
    if (low == low[:, :1]).all():
        low, square, inner = low[:, :1], square[:, :1], inner[:, :1]
    return DistancePairs(fixed, stages, low, square, inner, kind, tuple(kinds))
