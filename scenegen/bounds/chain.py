"""Coordinates along one axis that are tied by differences: x_j - x_i within [l, u] along the edges of a tree.

Chains of `leftOf` are the case in point. Axis-aligned boxes fill such a set badly (sorting seven numbers takes 1/7! of
their box), but it can be counted: each coordinate's interval is cut into bins, and the tree is summed up from its
leaves (dynamic programming). What is drawn is uniform over all products of bins that the edges allow, a union of
disjoint boxes that nobody has to write down; it is larger than the set itself by less than a bin along each edge.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.bounds.alias import Alias, make_alias

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.intp]

BINS = 256
HAIR = 1e-9  # of a bin: how far a border may lie off by rounding
ROUNDING = 2.0**-50  # of a sum along an edge, relative


@dataclass(frozen=True, slots=True)
class Edge:
    """child - parent lies within [low, high]."""

    parent: int
    child: int
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Link:
    """What the child can be for each bin of the parent, (BINS,) each: a stretch of `weight` from `offset`, of its
    coordinate where it has no children itself (`leaf`), else of the sum over its bins."""

    parent: int  # positions within Chain.rows
    child: int
    leaf: bool
    offset: Array
    weight: Array


@dataclass(frozen=True, slots=True)
class Chain:
    """A tree of coordinates, parents before children; row `rows[k]` has BINS bins of width `width[k]` from `low[k]`.
    `sums[k]` adds up the weights of its bins; `root` draws a bin of the first."""

    rows: tuple[int, ...]
    low: Array
    width: Array
    sums: tuple[Array, ...]
    links: tuple[Link, ...]
    volume: float
    root: Alias

    def draw(self, count: int, rng: np.random.Generator) -> Array:
        """`count` points uniform over the union of the bins that the edges allow, (d, count)."""
        out = rng.random((len(self.rows), count))
        bins: list[Index] = [np.empty(0, dtype=np.intp)] * len(self.rows)
        bins[0] = self.root.draw(count, rng)
        out[0] += bins[0]
        out[0] *= self.width[0]
        out[0] += self.low[0]
        for link in self.links:
            above = bins[link.parent]
            value = out[link.child]
            value *= link.weight.take(above)
            value += link.offset.take(above)
            if not link.leaf:
                bins[link.child] = self._place(link.child, value, value)
        return out

    def _place(self, which: int, mass: Array, out: Array) -> Index:
        """The bin where the sum reaches `mass`, and the coordinate, uniform in it, into `out`."""
        total = self.sums[which]
        found = np.searchsorted(total, mass, side="right")
        found -= 1
        np.clip(found, 0, BINS - 1, out=found)
        start = total.take(found)
        # A mass that rounding put at the very end may meet a bin of no weight.
        share = (mass - start) / np.maximum(total.take(found + 1) - start, 1e-300)
        np.clip(share, 0.0, 1.0, out=share)
        share += found
        share *= self.width[which]
        np.add(share, self.low[which], out=out)
        return found


def make_chain(edges: Sequence[Edge], intervals: Mapping[int, tuple[float, float]]) -> Chain:
    """The chain of a tree of edges, parents first, over rows with the given intervals. Its volume is 0 where no point
    meets all edges, and where it is too small for a number."""
    rows = [edges[0].parent, *(edge.child for edge in edges)]
    at = {row: position for position, row in enumerate(rows)}
    low = np.array([intervals[row][0] for row in rows])
    width = np.array([max(intervals[row][1] - intervals[row][0], 0.0) / BINS for row in rows])
    weight = [np.full(BINS, wide) for wide in width]
    sums: list[Array] = [np.empty(0)] * len(rows)
    links: list[Link] = []
    inner = {edge.parent for edge in edges}
    for edge in reversed(edges):
        parent, child = at[edge.parent], at[edge.child]
        leaf = edge.child not in inner
        borders = low[parent] + width[parent] * np.arange(BINS + 1)
        if leaf:
            offset = np.maximum(low[child], borders[:-1] + edge.low)
            inside = np.minimum(low[child] + BINS * width[child], borders[1:] + edge.high) - offset
            np.maximum(inside, 0.0, out=inside)
            weight[parent] = weight[parent] * inside
            links.append(Link(parent, child, True, offset, inside))
            continue
        sums[child] = _sum(weight[child])
        step = width[child] if width[child] > 0.0 else 1.0
        first = np.floor((borders[:-1] + edge.low - low[child]) / step - HAIR)
        last = np.ceil((borders[1:] + edge.high - low[child]) / step + HAIR)
        first, last = np.clip(first, 0, BINS).astype(np.intp), np.clip(last, 0, BINS).astype(np.intp)
        offset = sums[child][first]
        inside = np.where(last > first, sums[child][last] - offset, 0.0)
        weight[parent] = weight[parent] * inside
        links.append(Link(parent, child, False, offset, inside))
    volume = float(weight[0].sum())
    root = make_alias(weight[0] if volume > 0.0 else np.ones(1))
    return Chain(tuple(rows), low, width, tuple(sums), tuple(reversed(links)), volume, root)


def empty(edges: Sequence[Edge], intervals: Mapping[int, tuple[float, float]]) -> bool:
    """Whether it is proved that no point meets all edges of a tree: from its leaves to its root, what each child leaves
    to its parent."""
    left = dict(intervals)
    for edge in reversed(edges):
        (low, high), (least, most) = left[edge.parent], left[edge.child]
        left[edge.parent] = max(low, least - edge.high), min(high, most - edge.low)
    room = ROUNDING * len(edges) * max(abs(end) for ends in intervals.values() for end in ends)
    return any(low > high + room for low, high in left.values())


def _sum(weight: Array) -> Array:
    return np.concatenate([np.zeros(1), np.cumsum(weight)])
