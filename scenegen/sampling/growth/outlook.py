"""What a choice is worth while its objects are being placed: the chance that one of its ways will hold in the end.

A way of a choice asks for clauses, some of which touch objects that come later. The populations on the way to the end
must not be indifferent to that: growth would be full of scenes that have more to meet than they can, and lose them with
the last object. So a scene counts by the chance that at least one of its ways comes to hold: those that nothing placed
so far has ruled out, each with the share of random poses that meet the rest of it (a twisted target, as in look-ahead
particle filters: Guarniero et al. 2017). Ways that hold once all their objects are there count 1, and a scene in which
several hold counts no more than one in which one does. In the end the factor is 1 where the choice is met and 0
elsewhere, so what the chances are worth decides how even the weights are, never what the scenes are like.

The upper end of a range is a choice, too: some atom of a conjunction must be no better than that. Where atoms are many,
most scenes that meet the lower end meet it anyway. Such a choice is left out: scenes out of the range are dropped in
the end, which costs less than to steer every move by it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from scenegen.bounds.effort import Effort
from scenegen.sampling.growth.graph import Choice, Clause, Graph
from scenegen.sampling.growth.touch import within
from scenegen.sampling.growth.values import make_values
from scenegen.sampling.problem import Problem

Array = npt.NDArray[np.float64]
Bool = npt.NDArray[np.bool_]
Index = npt.NDArray[np.intp]

RANDOM = 2048  # random scenes that tell how often a clause is met
TRUST = 0.75  # power of the estimate: one neighbour may meet the clauses of several objects
LEAST = 0.25 / RANDOM  # share taken for clauses that none of them meets
EASY = 0.15  # chance that a scene meets an upper end from which on growth does not mind it
SEEN = 16  # random scenes that meet a lower end, at least, to tell how many of them meet the upper one
SURE = -40.0  # logarithm of 1 - p for ways that hold: 1 - exp of it is 1


def outlooks(problem: Problem, graph: Graph, at: Mapping[int, int], effort: Effort) -> tuple[Array, ...]:
    """For each choice, (W, stages, C or 1): log(1 - p), p the chance that a way will hold which no object placed by
    that stage rules out; SURE once all its objects are placed. Raises what `effort` raises."""
    if not graph.choices:
        return ()
    scenes = _random(problem, graph)
    return tuple(_outlook(problem, choice, at, scenes, graph.low.shape[1], effort) for choice in graph.choices)


def without_easy_ends(problem: Problem, graph: Graph) -> tuple[Graph, Array | None]:
    """The graph without the choices that are upper ends which most scenes of every cell meet by themselves; and how
    many scenes each cell should begin with, (C,) in proportion, None where nothing is left out.

    A scene that is better than its cell falls into one above, so all but the lowest cells lose as many as they get.
    """
    ends = [choice for choice in graph.choices if not np.isfinite(choice.whole.low).any()]
    scenes, lower = _random(problem, graph), {one.node: one.low for one in graph.clauses}
    lower |= {one.node: one.low for one in graph.pairs}
    begin, easy = np.ones(graph.low.shape[1]), set[int]()
    for choice in ends:
        met = _met_anyway(problem, choice, lower, scenes, len(begin))
        if met.min() >= EASY:
            easy.add(choice.whole.node)
            high = choice.whole.high
            begin[high == high.min()] /= met[high == high.min()]
    if not easy:
        return graph, None
    return replace(graph, choices=tuple(one for one in graph.choices if one.whole.node not in easy)), begin


def _met_anyway(problem: Problem, choice: Choice, lower: Mapping[int, Array], scenes: Array, cells: int) -> Array:
    """About which share of the scenes that meet the lower ends meet some way of an upper end, in each cell, (C,)."""
    missed = np.ones(cells)
    with np.errstate(all="ignore"):
        found = make_values(problem.core, [way.whole.node for way in choice.ways])(list(scenes))
    for way, value in zip(choice.ways, found, strict=True):
        value, low = np.broadcast_to(value, RANDOM), np.broadcast_to(lower.get(way.whole.node, -np.inf), cells)
        for cell in range(cells):
            above = value >= low[cell]
            if np.count_nonzero(above) >= SEEN:
                missed[cell] *= np.mean(value[above] > way.whole.high[cell])
    return 1.0 - missed


def _random(problem: Problem, graph: Graph) -> Array:
    """Scenes (3N, RANDOM) uniform over what contraction leaves of the box, of all cells in turn."""
    rng = np.random.default_rng(np.random.SeedSequence([problem.request.seed, len(graph.choices)]))
    cell = np.arange(RANDOM) % graph.low.shape[1]
    low, high = graph.low[:, cell], graph.high[:, cell]
    scenes: Array = low + rng.random(low.shape) * (high - low)
    return scenes


def _outlook(
    problem: Problem, choice: Choice, at: Mapping[int, int], scenes: Array, cells: int, effort: Effort
) -> Array:
    clauses = {(clause.node, id(clause)): clause for way in choice.ways for clause in way.clauses if clause.objects}
    same = all((ends == ends[0]).all() for one in clauses.values() for ends in (one.low, one.high))
    table = np.zeros((len(choice.ways), len(at), 1 if same else cells))
    with np.errstate(all="ignore"):
        found = make_values(problem.core, [node for node, _ in clauses])(list(scenes), effort.check)
        shares = {
            key: np.log(_shares(value, clause, table.shape[2], effort))
            for (key, clause), value in zip(clauses.items(), found, strict=True)
        }
    for row, way in zip(table, choice.ways, strict=True):
        for clause in way.clauses:
            if clause.objects:
                row[: max(at[thing] for thing in clause.objects)] += TRUST * shares[clause.node, id(clause)]
        done = max((at[thing] for thing in way.whole.objects), default=0)
        row[:done] = np.log1p(-np.minimum(np.exp(row[:done]), 1.0 - 1e-9))
        row[done:] = SURE
    return table


def _shares(value: Array, clause: Clause, cells: int, effort: Effort) -> Array:
    """The share of values within the clause's ends, for each cell, (C,)."""
    value = np.broadcast_to(value, RANDOM)
    share = np.ones(cells)
    for cell in range(cells):
        effort.check()
        inside = within(value, clause, np.full(RANDOM, cell))
        if inside is not None:
            share[cell] = max(LEAST, float(np.mean(inside)))
    return share


def chance(held: Bool, table: Array, cell: Index) -> Array:
    """The chance that some way holds in the end, (B,): `held` (W, B) tells which ways nothing rules out so far, `table`
    (W, C or 1) is the outlook's for this stage, `cell` (B,)."""
    total = table[:, 0] @ held if table.shape[1] == 1 else (table[:, cell] * held).sum(axis=0)
    out: Array = -np.expm1(total)
    return out
