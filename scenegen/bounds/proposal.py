"""Drawing scenes uniformly from a set of known volume that holds every scene of a part.

A proposal is a product: spans (coordinates on their own), orders and chains (coordinates along one axis tied by
differences) and grids (boxes over a few coupled coordinates). Objects that lie close to others hang from them: what is
covered and drawn then is where they lie relative to each other, a change of variables with determinant 1.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from scenegen.bounds.chain import Chain, Edge, make_chain
from scenegen.bounds.contract import SLACK, forward
from scenegen.bounds.effort import PYTHON, Effort
from scenegen.bounds.grid import Grid, make_grid
from scenegen.bounds.order import Order, make_order
from scenegen.bounds.tape import Tape
from scenegen.bounds.wanted import Ends
from scenegen.lang.core import Coord, Junction

Array = npt.NDArray[np.float64]

MOST_DIMS = 6  # coupled coordinates that a grid may have; more cannot be covered well by boxes
BELOW_TURN = float(np.nextafter(2.0 * math.pi, 0.0))


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
        inside: npt.NDArray[np.bool_] | None = None
        for child in (*(hang.child for hang in self.hangs), *self.loose):
            held = (out[child] >= self.lowest[child]) & (out[child] <= self.highest[child])
            inside = held if inside is None else np.logical_and(inside, held, out=inside)
        return inside


@dataclass(slots=True)
class _Frame:
    """A forest over rows along differences: `up[row]` is (parent row, difference node)."""

    up: dict[int, tuple[int, int]] = field(default_factory=dict)
    order: list[int] = field(default_factory=list)  # children, parents before them

    def path(self, row: int) -> tuple[int, list[int]]:
        """The root above a row and the differences on the way."""
        way = []
        while row in self.up:
            row, node = self.up[row]
            way.append(node)
        return row, way


@dataclass(frozen=True, slots=True)
class Open:
    """A formula node of the tape whose demand its box does not settle."""

    core: int
    node: int
    low: float
    high: float
    support: frozenset[int]


def open_nodes(tape: Tape, demand: Mapping[int, Ends], lo: Array, hi: Array, effort: Effort) -> list[Open]:
    """The demands (by core node) that do not hold everywhere in one contracted box, lo and hi (T,)."""
    low, high = forward(
        tape.nodes, lo[:, None], hi[:, None], tuple(tape.differences), batches=tape.batches, effort=effort
    )
    found = []
    for index, (least, most) in demand.items():
        node = tape.where[index]
        room = 8 * SLACK * (1.0 + sum(abs(end) for end in (least, most) if math.isfinite(end)))
        if low[node, 0] < least - room or high[node, 0] > most + room:
            support = tape.support(node)
            effort.spend(PYTHON * (1 + len(support)))
            found.append(Open(index, node, least, most, support))
    return found


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
) -> Proposal | None:
    """The proposal for one contracted box lo, hi (T,). None where a cover comes out empty: there is no solution.

    `pending` are the demands that the box leaves open; those whose core node is in `coupling` are worth a grid.
    `relative`: objects that they couple hang from one another. Raises what `effort` raises.
    """
    mine = [one for one in pending if one.core in coupling and not isinstance(tape.nodes[one.node], Junction)]
    frame = _hang(tape, lo, hi, mine) if relative else _Frame()
    groups = _groups(tape, frame, mine, effort)
    grids: list[Grid] = []
    rows_of: list[tuple[int, ...]] = []
    slot: dict[int, tuple[int, int]] = {}
    taken: set[int] = set()
    log_volume = 0.0
    for dims in groups:
        names = sorted(dims)
        few = len(names) <= MOST_DIMS
        if not few and all(isinstance(tape.nodes[name], Coord) for name in names):
            continue
        grid = _grid(tape, frame, lo, hi, names, pending, budget if few else 1, effort)
        if grid.volume <= 0.0:
            return None
        for position, name in enumerate(names):
            slot[name] = len(grids), position
        rows = tuple(_row(tape, name) for name in names)
        taken.update(row for row in rows if row >= 0)
        grids.append(grid)
        rows_of.append(rows)
        log_volume += math.log(grid.volume)
    hangs = []
    for child in frame.order:
        parent, node = frame.up[child]
        sign = 1.0 if tape.differences[node][0] == child else -1.0
        hangs.append(Hang(child, parent, *slot[node], sign))
        taken.add(child)
    chains, orders, loose = [], [], []
    for edges in _trees(tape, lo, hi, taken):
        rows_in = [edges[0].parent, *(edge.child for edge in edges)]
        intervals = {row: (float(lo[tape.rows[row]]), float(hi[tape.rows[row]])) for row in rows_in}
        taken.update(rows_in)
        order = make_order(edges, intervals)
        if order is not None:
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
            return None
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
            if high <= low:
                return None
            log_volume += math.log(high - low)
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
    )


def _row(tape: Tape, node: int) -> int:
    at = tape.nodes[node]
    return at.row if isinstance(at, Coord) else -1


def _hang(tape: Tape, lo: Array, hi: Array, mine: Iterable[Open]) -> _Frame:
    """Let coupled rows hang from one another along the narrowest differences; roots are the rows that are held best."""
    nodes = sorted({node for one in mine for node in one.support if node in tape.differences})
    width = {row: float(hi[node] - lo[node]) for row, node in tape.rows.items()}
    joined: dict[int, int] = {}
    near: dict[int, list[tuple[int, int]]] = {}
    for node in sorted(nodes, key=lambda node: (float(hi[node] - lo[node]), node)):
        a, b = tape.differences[node]
        if _find(joined, a) != _find(joined, b):
            joined[_find(joined, a)] = _find(joined, b)
            near.setdefault(a, []).append((b, node))
            near.setdefault(b, []).append((a, node))
    frame = _Frame()
    seen: set[int] = set()
    for root in sorted(near, key=lambda row: (width[row], row)):
        if root in seen:
            continue
        seen.add(root)
        waiting = [root]
        while waiting:
            row = waiting.pop(0)
            for other, node in near[row]:
                if other not in seen:
                    seen.add(other)
                    frame.up[other] = row, node
                    frame.order.append(other)
                    waiting.append(other)
    return frame


def _find(joined: dict[int, int], item: int) -> int:
    while item in joined:
        item = joined[item]
    return item


def _variables(tape: Tape, frame: _Frame, support: Iterable[int]) -> set[int]:
    """The drawn nodes, coordinates of roots and differences to parents, that a set of leaves depends on."""
    found: set[int] = set()
    for node in support:
        pair = tape.differences.get(node)
        if pair is None:
            root, way = frame.path(_row(tape, node))
            found.update((tape.rows[root], *way))
            continue
        (root_a, way_a), (root_b, way_b) = (frame.path(row) for row in pair)
        if root_a == root_b:
            found.update(set(way_a) ^ set(way_b))
        else:
            found.update((tape.rows[root_a], *way_a, tape.rows[root_b], *way_b))
    return found


def _groups(tape: Tape, frame: _Frame, mine: Iterable[Open], effort: Effort) -> list[set[int]]:
    """The drawn nodes that the demands tie together; every difference of the frame is in one of them."""
    groups: list[set[int]] = []
    for part in (*(_variables(tape, frame, one.support) for one in mine), *({node} for _, node in frame.up.values())):
        effort.spend(PYTHON * (1 + len(part)) + 5 * len(groups))
        touching = [group for group in groups if group & part]
        groups = [group for group in groups if not group & part]
        groups.append(part.union(*touching))
    return sorted((group for group in groups if group), key=min)


def _grid(
    tape: Tape,
    frame: _Frame,
    lo: Array,
    hi: Array,
    names: list[int],
    pending: Sequence[Open],
    budget: int,
    effort: Effort,
) -> Grid:
    """The cover of one group by boxes, from the demands that depend on nothing else."""
    effort.spend(PYTHON * sum(len(one.support) for one in pending) + 50 * len(tape.nodes))
    inside = set(names)
    demands = [one for one in pending if _variables(tape, frame, one.support) <= inside]
    # rows that are sums along the frame keep within the workspace, so they are part of what is contracted
    hanging = [tape.rows[row] for row in frame.up if {frame.up[row][1]} & inside]
    wanted = [*names, *(one.node for one in demands), *hanging]
    nodes, number = tape.restrict(wanted)
    loops = [loop for loop in tape.loops if tape.support(loop) <= number.keys()]
    if loops:
        nodes, number = tape.restrict([*wanted, *loops])
    old = sorted(number, key=lambda index: number[index])
    dims = [number[name] for name in names]
    given = [number[index] for index in old if index in tape.differences]
    ends = [(number[one.node], one.low, one.high) for one in demands]
    return make_grid(nodes, names, lo[old], hi[old], dims, given, ends, budget, effort)


def _trees(tape: Tape, lo: Array, hi: Array, taken: Collection[int]) -> list[list[Edge]]:
    """Trees of differences that say more than the rows' own intervals, among the rows that are not taken."""
    edges = []
    for node, (a, b) in tape.differences.items():
        if a in taken or b in taken:
            continue
        at_a, at_b = tape.rows[a], tape.rows[b]
        least, most = lo[at_a] - hi[at_b], hi[at_a] - lo[at_b]
        low, high = max(float(lo[node]), float(least)), min(float(hi[node]), float(most))
        full = float(most - least)
        if full > 0.0 and high - low < (1.0 - 1e-6) * full:
            edges.append(((high - low) / full, a, b, low, high))
    joined: dict[int, int] = {}
    near: dict[int, list[tuple[int, float, float]]] = {}
    for _, a, b, low, high in sorted(edges):
        if _find(joined, a) != _find(joined, b):
            joined[_find(joined, a)] = _find(joined, b)
            near.setdefault(b, []).append((a, low, high))
            near.setdefault(a, []).append((b, -high, -low))
    trees: list[list[Edge]] = []
    seen: set[int] = set()
    for root in sorted(near):
        if root in seen:
            continue
        seen.add(root)
        tree: list[Edge] = []
        waiting = [root]
        while waiting:
            row = waiting.pop(0)
            for other, low, high in near[row]:
                if other not in seen:
                    seen.add(other)
                    tree.append(Edge(row, other, low, high))
                    waiting.append(other)
        trees.append(tree)
    return trees
