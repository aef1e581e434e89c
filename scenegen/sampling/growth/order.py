"""The order in which objects are placed: what hangs together follows one another, the large and the tightly held
first.

How tightly an object is held shows in the box that contraction leaves of it, and in how many random scenes meet the
clauses and choices that touch it: what asks for much is placed while moves are cheap and nothing stands in the way."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable

import numpy as np

from scenegen.bounds.effort import Effort
from scenegen.pose import rows_of
from scenegen.primitives.outline import measures
from scenegen.sampling.growth.graph import Clause, Graph
from scenegen.sampling.growth.touch import within
from scenegen.sampling.growth.values import make_values

RANDOM = 1024  # random scenes that tell how often clauses are met
LEAST = 0.25 / RANDOM
FEW = 3  # objects of a clause or a choice up to which it says something of any two of them


def insertion_order(
    graph: Graph, last: Collection[int] = (), effort: Effort | None = None
) -> tuple[tuple[int, ...], dict[int, int]]:
    """The objects that phi depends on in the order of their placing, those in `last` after all others, and for each the
    object that it hangs from, if any.

    An object hangs from the first placed one with which it shares a clause that attracts: it is placed near that one,
    and moves together with it. Deterministic: ties go by size, then by place in the spec. Raises what `effort` raises.
    """
    effort = Effort() if effort is None else effort
    # what stands on a surface moves with what carries it by moves of its own: see hop.py
    near = _neighbours(graph, [clause.objects for clause in graph.clauses if clause.node not in graph.switched])
    groups = [clause.objects for clause in graph.clauses] + [choice.objects for choice in graph.choices]
    linked = _neighbours(graph, groups)
    size = _sizes(graph)
    room = _log_room(graph)
    for thing, share in _log_share(graph, effort).items():
        room[thing] += share
    left, none = set(graph.objects), frozenset[int]()
    waits = {  # what stands is placed on what carries it
        thing: {one.carrier for one in stand.options if one.carrier is not None}
        for thing, stand in graph.stands.items()
    }
    order: list[int] = []
    parent: dict[int, int] = {}
    depth: dict[int, int] = {}
    while left:
        effort.check()
        # the neighbours of what was placed last come first: a group is finished before the next one begins
        ready = {thing for thing in left if waits.get(thing, none).isdisjoint(left)}
        now = ready.difference(last) or ready
        held = [thing for thing in now if linked[thing] & depth.keys()]
        pool = held or sorted(now)

        def rank(thing: int) -> tuple[float, float, float, int]:
            last = max((depth[other] for other in linked[thing] & depth.keys()), default=-1)
            root = -float(len(near[thing])) if last < 0 else 0.0
            return root, round(room[thing] - 2.0 * math.log(size[thing] + 1e-3), 1), -float(last), thing

        chosen = min(pool, key=rank)
        above = near[chosen] & depth.keys()
        if above:
            parent[chosen] = min(above, key=depth.__getitem__)
        depth[chosen] = len(order)
        order.append(chosen)
        left.remove(chosen)
    return tuple(order), parent


def _neighbours(graph: Graph, groups: Iterable[frozenset[int]]) -> dict[int, set[int]]:
    """Objects that share one of some groups; those of many objects say little about any two of them."""
    near: dict[int, set[int]] = {thing: set() for thing in graph.objects}
    for group in groups:
        for thing in group if len(group) <= FEW else ():
            near[thing] |= group - {thing}
    return near


def _log_share(graph: Graph, effort: Effort) -> dict[int, float]:
    """The logarithm of the share of random scenes that meet what touches each object, pairs apart; of what touches
    several objects, each gets a part."""
    asked: list[Clause] = [*graph.clauses, *(choice.whole for choice in graph.choices)]
    share = dict.fromkeys(graph.objects, 0.0)
    cell = np.arange(RANDOM) % graph.low.shape[1]
    low, high = graph.low[:, cell], graph.high[:, cell]
    scenes = low + np.random.default_rng(0).random(low.shape) * (high - low)
    with np.errstate(all="ignore"):
        values = make_values(graph.core, [clause.node for clause in asked])(list(scenes), effort.check)
        for clause, value in zip(asked, values, strict=True):
            effort.check()
            inside = within(np.broadcast_to(value, RANDOM), clause, cell)
            if inside is not None:
                for thing in clause.objects:
                    share[thing] += math.log(max(LEAST, float(np.mean(inside)))) / len(clause.objects)
    return share


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
        rows = [row for row in rows_of(thing) if row in graph.rows]
        widths = np.maximum((graph.high[rows] - graph.low[rows]).max(axis=1), 1e-12)
        out[thing] = float(np.log(widths).sum())
    return out
