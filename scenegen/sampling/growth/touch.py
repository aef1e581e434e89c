"""What one object's pose is held against: the clauses that touch it, in the order in which they come into force.

A clause is in force once all of its objects are placed, so at each stage the clauses in force are the first few of a
list that is sorted by stage. Pairs are scored in two steps: discs around the footprints tell nearly all of them apart at
the price of a distance (the broad phase), and clearances are computed only for those that are left.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from scenegen.primitives import NUMPY, PRIMITIVES, Footprint
from scenegen.primitives.footprint import Circle
from scenegen.primitives.outline import measures
from scenegen.sampling.growth.graph import Clause, Graph, Pair
from scenegen.sampling.growth.values import Values, make_values

Array = npt.NDArray[np.float64]
Bool = npt.NDArray[np.bool_]
Index = npt.NDArray[np.intp]

BLOCK = 1 << 19  # distances computed at a time


@dataclass(frozen=True, slots=True, eq=False)
class Partners:
    """What one object keeps a distance from, m of them by ascending stage. Partner i stands where rows `rows[i]` (x, y
    and heading) of the scenes with the fixed poses below them say. `low` (m, C or 1) in metres, `reach` the same for
    the centres: what is further away is clear. `kind[i]` is an index into `kinds`: the footprints of the pair, and
    whether the object is the first of the two; for `round_` partners the reach says it all."""

    rows: Index
    fixed: Array
    low: Array
    reach: Array
    round_: Bool
    kind: Index
    kinds: tuple[tuple[tuple[Footprint, Footprint], bool], ...]
    stages: tuple[int, ...]


@dataclass(frozen=True, slots=True, eq=False)
class WayClause:
    """A clause of way `way` of choice `choice`."""

    choice: int
    way: int
    clause: Clause


@dataclass(slots=True, eq=False)
class Touch:
    """All that touches object `thing`. `rows` are its rows that some clause reads; `ways[c]` the ways of choice c that
    touch it. `cache` holds evaluators by the number of clauses that they are for."""

    thing: int
    rows: tuple[int, ...]
    graph: Graph
    clauses: tuple[Clause, ...]
    clause_stages: tuple[int, ...]
    partners: Partners | None
    way_clauses: tuple[WayClause, ...]
    way_stages: tuple[int, ...]
    ways: Mapping[int, tuple[int, ...]]
    cache: dict[object, Values] = field(default_factory=dict)

    def in_force(self, stage: int) -> tuple[Clause, ...]:
        """The clauses over objects placed by then."""
        return self.clauses[: bisect_right(self.clause_stages, stage)]

    def way_clauses_in_force(self, stage: int) -> tuple[WayClause, ...]:
        return self.way_clauses[: bisect_right(self.way_stages, stage)]

    def meets(self, rows: Sequence[Any], cell: Index, stage: int) -> Bool | None:
        """Which columns meet the clauses in force other than pairs; None where there are none. `rows` are 3N arrays
        that broadcast to the result's shape, `cell` the columns' cells, of the last axis."""
        clauses = self.in_force(stage)
        if not clauses:
            return None
        values = self.values(len(clauses), [clause.node for clause in clauses])(rows)
        good: Bool | None = None
        for clause, value in zip(clauses, values, strict=True):
            inside = within(value, clause, cell)
            if inside is not None:
                good = inside if good is None else good & inside
        return good

    def values(self, key: object, nodes: Sequence[int]) -> Values:
        if key not in self.cache:
            self.cache[key] = make_values(self.graph.core, nodes)
        return self.cache[key]

    def clear(
        self, pose: tuple[Array, Array, Array], scenes: Array, cell: Index, stage: int, columns: Index | None = None
    ) -> Bool:
        """Which of B poses, x, y and heading (B,) each, keep their distance from what is placed in `scenes` (3N, P).

        Pose i stands in scene columns[i], or in scene i; `cell` (B,) are its cells."""
        good = np.ones(len(pose[0]), dtype=bool)
        partners = self.partners
        if partners is None:
            return good
        count = bisect_right(partners.stages, stage)
        step = max(1, BLOCK // max(1, len(good)))
        for begin in range(0, count, step):
            _clear(partners, slice(begin, min(count, begin + step)), pose, scenes, cell, columns, good)
        return good


def within(value: Any, clause: Clause, cell: Index) -> Bool | None:
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


def _clear(
    partners: Partners,
    part: slice,
    pose: tuple[Array, Array, Array],
    scenes: Array,
    cell: Index,
    columns: Index | None,
    good: Bool,
) -> None:
    """Take out of `good` (B,) the columns in which one of some partners is too near."""
    x, y, theta = pose
    rows, reach = partners.rows[part], partners.reach[part]
    dx, dy = _coordinates(partners, rows[:, 0], scenes, columns), _coordinates(partners, rows[:, 1], scenes, columns)
    dx = dx - x
    dy = dy - y
    dx *= dx
    dy *= dy
    dx += dy
    near = dx < (reach * reach if reach.shape[1] == 1 else (reach * reach)[:, cell])
    which, column = np.nonzero(near)
    if not len(which):
        return
    touching = partners.round_[part][which]
    good[column[touching]] = False
    open_ = np.flatnonzero(~touching & good[column])
    which, column = which[open_], column[open_]
    kind = partners.kind[part][which]
    for number in np.unique(kind):
        shapes, first = partners.kinds[number]
        mine = np.flatnonzero(kind == number)
        other, here = which[mine], column[mine]
        scene = here if columns is None else columns[here]
        there = tuple(_values(partners, rows[other, axis], scenes, scene) for axis in range(3))
        own = x[here], y[here], theta[here]
        gap = PRIMITIVES["gap"].evaluate(NUMPY, *shapes, *((*own, *there) if first else (*there, *own)))
        low = partners.low[part]
        least = low[other, 0] if low.shape[1] == 1 else low[other, cell[here]]
        good[here[gap < least]] = False


def _coordinates(partners: Partners, rows: Index, scenes: Array, columns: Index | None) -> Array:
    """Some rows of the scenes at some columns, (m, B) or (m, 1) where all of them are fixed."""
    count = len(scenes)
    free = rows < count
    if free.all():
        return scenes[rows] if columns is None else scenes[rows[:, None], columns]
    if not free.any():
        return partners.fixed[rows - count][:, None]
    out = np.empty((len(rows), scenes.shape[1] if columns is None else len(columns)))
    out[free] = scenes[rows[free]] if columns is None else scenes[rows[free][:, None], columns]
    out[~free] = partners.fixed[rows[~free] - count][:, None]
    return out


def _values(partners: Partners, rows: Index, scenes: Array, columns: Index) -> Array:
    """The value of a row at a column, pair by pair."""
    count = len(scenes)
    if rows.max() < count:
        return scenes[rows, columns]
    fixed = rows >= count
    out = scenes[np.where(fixed, 0, rows), columns]
    out[fixed] = partners.fixed[rows[fixed] - count]
    return out


def touches(graph: Graph, order: Sequence[int]) -> dict[int, Touch]:
    """What touches each object, given the order in which they are placed."""
    at = {thing: place for place, thing in enumerate(order)}
    clauses: dict[int, list[Clause]] = {thing: [] for thing in order}
    pairs: dict[int, list[tuple[Pair, bool]]] = {thing: [] for thing in order}
    ways: dict[int, list[WayClause]] = {thing: [] for thing in order}
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
            for clause in way.clauses:
                for thing in clause.objects:
                    ways[thing].append(WayClause(index, number, clause))

    def stage(objects: frozenset[int]) -> int:
        return max(at[thing] for thing in objects)

    found = {}
    for thing in order:
        mine = sorted(clauses[thing], key=lambda one: (stage(one.objects), one.node))
        further = sorted(ways[thing], key=lambda one: (stage(one.clause.objects), one.choice, one.way, one.clause.node))
        found[thing] = Touch(
            thing,
            tuple(row for row in range(3 * thing, 3 * thing + 3) if row in graph.rows),
            graph,
            tuple(mine),
            tuple(stage(one.objects) for one in mine),
            _partners(pairs[thing], at, 3 * len(graph.core.objects)),
            tuple(further),
            tuple(stage(one.clause.objects) for one in further),
            {index: tuple(numbers) for index, numbers in touched[thing].items()},
        )
    return found


def _partners(pairs: Sequence[tuple[Pair, bool]], at: Mapping[int, int], count: int) -> Partners | None:
    """The pairs of one object; `count` is the number of rows of the scenes, after which those of fixed poses come."""
    if not pairs:
        return None
    ranked = sorted(pairs, key=lambda one: (_stage(one[0], at), one[0].node))
    kinds: dict[tuple[tuple[Footprint, Footprint], bool], int] = {}
    rows: list[tuple[int, int, int]] = []
    fixed: list[float] = []
    for pair, first in ranked:
        other = pair.second if first else pair.first
        begin = 3 * other if isinstance(other, int) else count + len(fixed)
        fixed += () if isinstance(other, int) else other
        rows.append((begin, begin + 1, begin + 2))
        kinds.setdefault((pair.shapes, first), len(kinds))
    low = np.array([pair.low for pair, _ in ranked])
    low = low[:, :1] if (low == low[:, :1]).all() else low
    outer = np.array([[sum(measures(shape).outer for shape in pair.shapes)] for pair, _ in ranked])
    return Partners(
        np.array(rows, dtype=np.intp),
        np.array(fixed),
        low,
        np.maximum(low + outer, 0.0),
        np.array([all(isinstance(shape, Circle) for shape in pair.shapes) for pair, _ in ranked]),
        np.array([kinds[pair.shapes, first] for pair, first in ranked], dtype=np.intp),
        tuple(kinds),
        tuple(_stage(pair, at) for pair, _ in ranked),
    )


def _stage(pair: Pair, at: Mapping[int, int]) -> int:
    return max(at[thing] for thing in pair.objects)
