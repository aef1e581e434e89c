"""Which coordinates of a part its open demands tie together, and along which differences."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from scenegen.bounds.chain import Edge
from scenegen.bounds.contract import SLACK, forward
from scenegen.bounds.effort import PYTHON, Effort
from scenegen.bounds.requirements import Ends
from scenegen.bounds.tape import Tape
from scenegen.lang.core import Coord

Array = npt.NDArray[np.float64]


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


@dataclass(slots=True)
class Forest:
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


def row_at(tape: Tape, node: int) -> int:
    at = tape.nodes[node]
    return at.row if isinstance(at, Coord) else -1


def make_forest(tape: Tape, lo: Array, hi: Array, mine: Iterable[Open]) -> Forest:
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
    forest = Forest()
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
                    forest.up[other] = row, node
                    forest.order.append(other)
                    waiting.append(other)
    return forest


def _find(joined: dict[int, int], item: int) -> int:
    while item in joined:
        item = joined[item]
    return item


def variables(tape: Tape, forest: Forest, support: Iterable[int]) -> set[int]:
    """The drawn nodes, coordinates of roots and differences to parents, that a set of leaves depends on."""
    found: set[int] = set()
    for node in support:
        pair = tape.differences.get(node)
        if pair is None:
            root, way = forest.path(row_at(tape, node))
            found.update((tape.rows[root], *way))
            continue
        (root_a, way_a), (root_b, way_b) = (forest.path(row) for row in pair)
        if root_a == root_b:
            found.update(set(way_a) ^ set(way_b))
        else:
            found.update((tape.rows[root_a], *way_a, tape.rows[root_b], *way_b))
    return found


def groups_of(tape: Tape, forest: Forest, mine: Iterable[Open], effort: Effort) -> list[set[int]]:
    """The drawn nodes that the demands tie together; every difference of the forest is in one of them."""
    groups: list[set[int]] = []
    for part in (*(variables(tape, forest, one.support) for one in mine), *({node} for _, node in forest.up.values())):
        effort.spend(PYTHON * (1 + len(part)) + 5 * len(groups))
        touching = [group for group in groups if group & part]
        groups = [group for group in groups if not group & part]
        groups.append(part.union(*touching))
    return sorted((group for group in groups if group), key=min)


def trees(tape: Tape, lo: Array, hi: Array, taken: Collection[int]) -> list[list[Edge]]:
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
