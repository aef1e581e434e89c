"""Drawing scenes uniformly from a set of known volume that holds every scene of a part.

A proposal is a product: spans (coordinates on their own), orders and chains (coordinates along one axis tied by
differences) and grids (boxes over a few coupled coordinates). Objects that lie close to others hang from them: what is
covered and drawn then is where they lie relative to each other, a change of variables with determinant 1.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from scenegen.arrays import Array
from scenegen.lang.formula.core import Coord, Junction, restrict
from scenegen.pose import PLACE, row_of
from scenegen.search.effort import PYTHON_WORK, Effort
from scenegen.search.grid import (
    TINY_VOLUME,
    Chain,
    Coupled,
    DifferenceBound,
    Forest,
    Grid,
    Grids,
    Open,
    empty,
    groups_of,
    make_chain,
    make_forest,
    row_at,
    trees,
    variables,
)
from scenegen.search.tape import Tape

if TYPE_CHECKING:
    from scenegen.search.surfaces import Stand, Step

# Coordinates in a row, each at least so far from the one before: x1 + l1 <= x2, x2 + l2 <= x3, ...
#
# Where all have the same room, what is left after taking the distances l off is a simplex, and uniform points of it
# are sorted uniform numbers: no bins, nothing rejected. One of the gaps may be bounded from above as well: its excess
# g has the survival function ((L - g) / L)^n, and the others share what it leaves (spacings of uniform samples: Pyke
# 1965).


ROOM_TOLERANCE = 1e-5  # of the room: how much the rooms may differ, for contraction loosens every gap a little
NETWORK_SIZE = 12  # numbers that are sorted by comparing and swapping rows


@dataclass(frozen=True, slots=True)
class Order:
    """Row `rows[k]` is `offset[k]` plus the k-th smallest of n numbers in [0, room].

    `narrow` is the gap (after point `narrow`, counted from 0) whose excess is at most `most`; -1 for none.
    """

    rows: tuple[int, ...]
    offset: Array
    room: float
    narrow: int = -1
    most: float = math.inf

    @property
    def log_volume(self) -> float:
        count = len(self.rows)
        whole = count * math.log(self.room) - math.lgamma(count + 1)
        return whole if self.narrow < 0 else whole + math.log(self._share)

    @property
    def _share(self) -> float:
        return -math.expm1(len(self.rows) * math.log1p(-self.most / self.room))

    def draw(self, count: int, rng: np.random.Generator) -> list[Array]:
        """`count` points: one array per row."""
        points = len(self.rows)
        if self.narrow < 0:
            values = _sort_rows(points, count, rng)
            for value, offset in zip(values, self.offset, strict=True):
                value *= self.room
                value += offset
            return values
        gap = rng.random(count)
        gap *= -self._share
        np.log1p(gap, out=gap)
        gap /= points
        np.exp(gap, out=gap)  # what the gap leaves, as a share of the room
        gap *= self.room
        values = _sort_rows(points - 1, count, rng)
        for value in values:
            value *= gap
        np.subtract(self.room, gap, out=gap)
        later = [value + gap for value in values[self.narrow : self.narrow + 1]]
        for value in values[self.narrow + 1 :]:
            value += gap
        values[self.narrow + 1 : self.narrow + 1] = later
        for value, offset in zip(values, self.offset, strict=True):
            value += offset
        return values


def _sort_rows(points: int, count: int, rng: np.random.Generator) -> list[Array]:
    """Uniform numbers in [0, 1), sorted along the list."""
    if points > NETWORK_SIZE:
        return list(np.sort(rng.random((points, count)), axis=0))
    values = [rng.random(count) for _ in range(points)]
    spare = np.empty(count)
    for last in range(1, points):
        for k in range(last, 0, -1):
            np.minimum(values[k - 1], values[k], out=spare)
            np.maximum(values[k - 1], values[k], out=values[k])
            values[k - 1], spare = spare, values[k - 1]
    return values


def make_order(edges: Sequence[DifferenceBound], intervals: Mapping[int, tuple[float, float]]) -> Order | None:
    """The order that a tree of edges makes, None where it is none: not a path, rooms of different size, or more than
    one gap with an upper end that matters."""
    near: dict[int, list[tuple[int, float, float]]] = {}
    for edge in edges:
        near.setdefault(edge.parent, []).append((edge.child, edge.low, edge.high))
        near.setdefault(edge.child, []).append((edge.parent, -edge.high, -edge.low))
    ends = sorted(row for row, others in near.items() if len(others) == 1)
    if len(ends) != 2 or any(len(others) > 2 for others in near.values()):
        return None
    for begin in ends:
        rows, gaps = _walk(begin, near)
        order = _fit(rows, gaps, intervals)
        if order is not None:
            return order
    return None


def _walk(
    begin: int, near: Mapping[int, Sequence[tuple[int, float, float]]]
) -> tuple[list[int], list[tuple[float, float]]]:
    rows, gaps = [begin], list[tuple[float, float]]()
    before = -1
    while True:
        following = [step for step in near[rows[-1]] if step[0] != before]
        if not following:
            return rows, gaps
        before = rows[-1]
        row, low, high = following[0]
        rows.append(row)
        gaps.append((low, high))


def _fit(
    rows: list[int], gaps: list[tuple[float, float]], intervals: Mapping[int, tuple[float, float]]
) -> Order | None:
    if not all(math.isfinite(low) for low, _ in gaps):
        return None
    offset = np.concatenate([np.zeros(1), np.cumsum([low for low, _ in gaps])])
    # Contraction may have stopped before the ends had told each other along a long row.
    low = np.maximum.accumulate(np.array([intervals[row][0] for row in rows]) - offset)
    high = np.minimum.accumulate((np.array([intervals[row][1] for row in rows]) - offset)[::-1])[::-1]
    begin, room = float(low.min()), float(high.max() - low.min())
    if room <= 0.0 or low.max() - low.min() > ROOM_TOLERANCE * room or high.max() - high.min() > ROOM_TOLERANCE * room:
        return None
    bounded = [
        (k, most - least) for k, (least, most) in enumerate(gaps) if most - least < room * (1.0 - ROOM_TOLERANCE)
    ]
    if len(bounded) > 1 or any(most <= 0.0 for _, most in bounded):
        return None
    narrow, most = bounded[0] if bounded else (-1, math.inf)
    return Order(tuple(rows), offset + begin, room, narrow, most)


MAX_GRID_DIMS = 6  # coupled coordinates along which a grid may be cut; more cannot be covered well by boxes


@dataclass(frozen=True, slots=True)
class Hang:
    """Row `child` is row `parent` plus `sign` times what grid `grid` draws at `position`."""

    child: int
    parent: int
    grid: int
    position: int
    sign: float


@dataclass(frozen=True, slots=True)
class Proposal:
    """How scenes of a part are drawn. `lowest` and `highest` (3N,) are the box that they must lie in, which only the
    rows in `hangs` and `loose` can leave. `log_volume` is the natural logarithm of the volume, over free rows."""

    lowest: Array
    highest: Array
    spans: tuple[tuple[int, float, float], ...]
    chains: tuple[Chain, ...]
    orders: tuple[Order, ...]
    grids: tuple[Grid, ...]
    rows_of_grids: tuple[tuple[int, ...], ...]  # -1 for a difference
    hangs: tuple[Hang, ...]
    loose: tuple[int, ...]
    log_volume: float
    steps: tuple[Step, ...] = ()  # what stands on something, drawn after what carries it

    def draw(self, out: Array, rng: np.random.Generator) -> npt.NDArray[np.bool_] | None:
        """Fill `out` (3N, m) with scenes; returns which of them lie in the box, None for all."""
        count = out.shape[1]
        for row, low, width in self.spans:
            if width == 0.0:
                out[row] = low
                continue
            out[row] = rng.random(count)
            out[row] *= width
            out[row] += low
        for chain in self.chains:
            for row, value in zip(chain.rows, chain.draw(count, rng), strict=True):
                out[row] = value
        for order in self.orders:
            for row, value in zip(order.rows, order.draw(count, rng), strict=True):
                out[row] = value
        points = [grid.draw(count, rng) for grid in self.grids]
        for rows, values in zip(self.rows_of_grids, points, strict=True):
            for row, value in zip(rows, values, strict=True):
                if row >= 0:
                    out[row] = value
        for hang in self.hangs:
            value, row = points[hang.grid][hang.position], out[hang.child]
            (np.add if hang.sign > 0.0 else np.subtract)(out[hang.parent], value, out=row)
        for step in self.steps:
            step.draw(out, rng)
        standing = (row_of(step.thing, axis) for step in self.steps for axis in PLACE)
        inside: npt.NDArray[np.bool_] | None = None
        for child in (*(hang.child for hang in self.hangs), *self.loose, *standing):
            held = (out[child] >= self.lowest[child]) & (out[child] <= self.highest[child])
            inside = held if inside is None else np.logical_and(inside, held, out=inside)
        return inside


def propose(
    tape: Tape,
    lowest: Array,
    highest: Array,
    lo: Array,
    hi: Array,
    pending: Sequence[Open],
    coupling: Collection[int],
    relative: bool,
    budget: int,
    effort: Effort,
    known: Grids,
    stands: Collection[Stand] = (),
) -> Proposal | None:
    """The proposal for one contracted box lo, hi (T,). None where it is proved that there is no solution.

    `pending` are the demands that the box leaves open; those whose core node is in `coupling` are worth a grid.
    `relative`: objects that they couple hang from one another. What is in `stands` is drawn on its surfaces, and tied
    to nothing else. Grids are taken from those `known`, and added to them. Raises what `effort` raises.
    """
    steps: tuple[Step, ...] = ()
    if stands:
        from scenegen.search.surfaces import steps_for

        placing = steps_for(stands, tape, lowest, highest, lo, hi, effort)
        if placing is None:
            return None
        steps = placing
    taken = {row for step in steps for row in step.rows}
    placed = {tape.rows[row] for row in taken if row in tape.rows}
    placed.update(node for node, pair in tape.differences.items() if steps and not taken.isdisjoint(pair))
    mine = [
        one
        for one in pending
        if one.core in coupling
        and not isinstance(tape.nodes[one.node], Junction)
        and (not steps or placed.isdisjoint(one.support))
    ]
    forest = make_forest(tape, lo, hi, mine) if relative else Forest()
    groups = groups_of(tape, forest, mine, effort)
    grids: list[Grid] = []
    rows_of: list[tuple[int, ...]] = []
    slot: dict[int, tuple[int, int]] = {}
    log_volume = sum(step.log_volume for step in steps)
    for dims in groups:
        names = sorted(dims)
        # more are cut only along what quantiles are relative to, which narrows the numbers of those quantiles
        cuts = names if len(names) <= MAX_GRID_DIMS else [name for name in names if name in tape.middles]
        few = 0 < len(cuts) <= MAX_GRID_DIMS
        if not few and all(isinstance(tape.nodes[name], Coord) for name in names):
            continue
        grid = _grid(tape, forest, lo, hi, names, cuts, pending, budget if few else 1, effort, known)
        if grid.volume <= 0.0:
            return None
        for position, name in enumerate(names):
            slot[name] = len(grids), position
        rows = tuple(row_at(tape, name) for name in names)
        taken.update(row for row in rows if row >= 0)
        grids.append(grid)
        rows_of.append(rows)
        log_volume += math.log(grid.volume)
    hangs = []
    for child in forest.order:
        parent, node = forest.up[child]
        sign = 1.0 if tape.differences[node][0] == child else -1.0
        hangs.append(Hang(child, parent, *slot[node], sign))
        taken.add(child)
    chains, orders, loose = [], [], []
    for edges in trees(tape, lo, hi, taken):
        rows_in = [edges[0].parent, *(edge.child for edge in edges)]
        intervals = {row: (float(lo[tape.rows[row]]), float(hi[tape.rows[row]])) for row in rows_in}
        order = make_order(edges, intervals)
        if order is not None:
            taken.update(rows_in)
            orders.append(order)
            loose += [
                row
                for row, low in zip(order.rows, order.offset, strict=True)
                if low < lowest[row] or low + order.room > highest[row]
            ]
            log_volume += order.log_volume
            continue
        chain = make_chain(edges, intervals)
        if chain.volume <= 0.0:
            if empty(edges, intervals):
                return None
            continue  # too small for a number: each coordinate is drawn by itself
        taken.update(rows_in)
        chains.append(chain)
        log_volume += math.log(chain.volume)
    spans = []
    for row in range(len(lowest)):
        if row in taken:
            continue
        node = tape.rows.get(row, -1)
        low, high = (float(lo[node]), float(hi[node])) if node >= 0 else (float(lowest[row]), float(highest[row]))
        spans.append((row, low, high - low))
        if lowest[row] < highest[row]:
            if high < low:
                return None
            log_volume += math.log(max(high - low, TINY_VOLUME))
    return Proposal(
        lowest,
        highest,
        tuple(spans),
        tuple(chains),
        tuple(orders),
        tuple(grids),
        tuple(rows_of),
        tuple(hangs),
        tuple(loose),
        log_volume,
        steps,
    )


def _grid(
    tape: Tape,
    forest: Forest,
    lo: Array,
    hi: Array,
    names: list[int],
    cuts: Sequence[int],
    pending: Sequence[Open],
    budget: int,
    effort: Effort,
    known: Grids,
) -> Grid:
    """The cover of one group by boxes, from the demands that depend on nothing else."""
    effort.spend(PYTHON_WORK * sum(len(one.support) for one in pending) + 50 * len(tape.nodes))
    inside = set(names)
    demands = [one for one in pending if variables(tape, forest, one.support) <= inside]
    # rows that are sums along the forest keep within the workspace, so they are part of what is contracted
    hanging = [tape.rows[row] for row in forest.up if {forest.up[row][1]} & inside]
    wanted = [*names, *(one.node for one in demands), *hanging]
    nodes, number = restrict(tape.nodes, wanted)
    loops = [loop for loop in tape.loops if tape.support(loop) <= number.keys()]
    if loops:
        nodes, number = restrict(tape.nodes, [*wanted, *loops])
    old = list(number)
    what = Coupled(
        nodes,
        tuple(names),
        lo[old],
        hi[old],
        dims=tuple(number[name] for name in names),
        cuts=tuple(number[name] for name in cuts),
        given=tuple(number[index] for index in old if index in tape.differences),
        demands=tuple((number[one.node], one.low, one.high) for one in demands),
    )
    return known.grid(what, budget, effort)
