"""What a choice is worth while its objects are being placed: the chance that one of its ways will hold in the end.

A way of a choice asks for clauses, some of which touch objects that come later. The populations on the way to the end
must not be indifferent to that: growth would be full of scenes that have more to meet than they can, and lose them with
the last object. So a scene counts by the chance that at least one of its ways comes to hold: those that nothing placed
so far has ruled out, each with the share of random poses that meet the rest of it (a twisted target, as in look-ahead
particle filters: Guarniero et al. 2017). Ways that hold once all their objects are there count 1, and a scene in which
several hold counts no more than one in which one does. In the end the factor is 1 where the choice is met and 0
elsewhere, so what the chances are worth decides how even the weights are, never what the scenes are like.
"""

from __future__ import annotations

from collections.abc import Mapping

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
SURE = -40.0  # logarithm of 1 - p for ways that hold: 1 - exp of it is 1


def outlooks(problem: Problem, graph: Graph, at: Mapping[int, int], effort: Effort) -> tuple[Array, ...]:
    """For each choice, (W, stages, C or 1): log(1 - p), p the chance that a way will hold which no object placed by
    that stage rules out; SURE once all its objects are placed. Raises what `effort` raises."""
    if not graph.choices:
        return ()
    rng = np.random.default_rng(np.random.SeedSequence([problem.request.seed, len(graph.choices)]))
    cells = graph.low.shape[1]
    cell = np.arange(RANDOM) % cells
    low, high = graph.low[:, cell], graph.high[:, cell]
    scenes = low + rng.random(low.shape) * (high - low)
    return tuple(_outlook(problem, choice, at, scenes, cells, effort) for choice in graph.choices)


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
