"""The order in which objects are placed: what hangs together follows one another, the large and the tightly held
first."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from scenegen.primitives.outline import measures
from scenegen.sampling.growth.graph import Graph


def insertion_order(graph: Graph) -> tuple[tuple[int, ...], dict[int, int]]:
    """The objects that phi depends on in the order of their placing, and for each the object that it hangs from, if
    any.

    An object hangs from the first placed one with which it shares a clause that attracts: it is placed near that one,
    and moves together with it. Deterministic: ties go by size, then by place in the spec.
    """
    near = _neighbours(graph)
    size = _sizes(graph)
    room = _log_room(graph)
    left = set(graph.objects)
    order: list[int] = []
    parent: dict[int, int] = {}
    depth: dict[int, int] = {}
    while left:
        # the neighbours of what was placed last come first: a group is finished before the next one begins
        held = [thing for thing in left if near[thing] & depth.keys()]
        pool = held or sorted(left)

        def rank(thing: int) -> tuple[float, float, float, int]:
            last = max((depth[other] for other in near[thing] & depth.keys()), default=-1)
            root = -float(len(near[thing])) if last < 0 else 0.0
            return root, round(room[thing], 3) - 2.0 * math.log(size[thing] + 1e-3), -float(last), thing

        chosen = min(pool, key=rank)
        above = near[chosen] & depth.keys()
        if above:
            parent[chosen] = min(above, key=depth.__getitem__)
        depth[chosen] = len(order)
        order.append(chosen)
        left.remove(chosen)
    return tuple(order), parent


def _neighbours(graph: Graph) -> dict[int, set[int]]:
    """Objects that share a clause other than a pair's, which only keeps them apart."""
    near: dict[int, set[int]] = {thing: set() for thing in graph.objects}
    for group in _groups(graph):
        for thing in group:
            near[thing] |= group - {thing}
    return near


def _groups(graph: Graph) -> Iterable[frozenset[int]]:
    for clause in graph.clauses:
        if len(clause.objects) <= 3:  # a clause over many objects says little about any two of them
            yield clause.objects


def _sizes(graph: Graph) -> dict[int, float]:
    size = dict.fromkeys(graph.objects, 0.0)
    for pair in graph.pairs:
        for end, shape in ((pair.first, pair.shapes[0]), (pair.second, pair.shapes[1])):
            if isinstance(end, int):
                size[end] = max(size[end], measures(shape).outer)
    return size


def _log_room(graph: Graph) -> dict[int, float]:
    """The logarithm of what contraction leaves of each object's box, in the widest cell."""
    out = {}
    for thing in graph.objects:
        rows = [row for row in range(3 * thing, 3 * thing + 3) if row in graph.rows]
        widths = np.maximum((graph.high[rows] - graph.low[rows]).max(axis=1), 1e-12)
        out[thing] = float(np.log(widths).sum())
    return out
