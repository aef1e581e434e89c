"""What a way that was decided on will still cost: the estimate that steers growth before the objects are placed.

A way of a choice asks for clauses of which some touch objects that come later. If a scene that decided on such a way
counted as much as one whose way is met already, growth would be full of scenes with more to meet than they can, and
lose them at the end. So a scene counts less for each clause that is to come, by the share of random poses that meet
it, and gets that back when the clause comes into force (a twisted target, as in look-ahead particle filters: Guarniero
et al. 2017). What the estimate is worth decides how even the weights are, never what the scenes are like in the end.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from scenegen.sampling.growth.graph import Clause, Graph
from scenegen.sampling.growth.touch import within
from scenegen.sampling.growth.values import make_values
from scenegen.sampling.problem import Problem

Array = npt.NDArray[np.float64]

RANDOM = 1024  # random scenes that tell how often a clause is met
TRUST = 0.75  # power of the estimate: one neighbour may meet the clauses of several objects
LEAST = 0.25 / RANDOM  # share taken for clauses that none of them meets


def promises(problem: Problem, graph: Graph, at: Mapping[int, int]) -> tuple[Array, ...]:
    """For each choice, (W, stages): the logarithm of the estimated share of poses that meet what is still to come of a
    way after each stage; 0 once all its clauses are in force."""
    if not graph.choices:
        return ()
    rng = np.random.default_rng(np.random.SeedSequence([problem.request.seed, len(graph.choices)]))
    cell = np.arange(RANDOM) % graph.low.shape[1]
    low, high = graph.low[:, cell], graph.high[:, cell]
    scenes = low + rng.random(low.shape) * (high - low)
    made = []
    for choice in graph.choices:
        table = np.zeros((len(choice.ways), len(at)))
        for row, way in zip(table, choice.ways, strict=True):
            for clause in way.clauses:
                if clause.objects:
                    row[: max(at[thing] for thing in clause.objects)] += TRUST * np.log(
                        _share(problem, clause, scenes, cell)
                    )
        made.append(table)
    return tuple(made)


def _share(problem: Problem, clause: Clause, scenes: Array, cell: npt.NDArray[np.intp]) -> float:
    with np.errstate(all="ignore"):
        (value,) = make_values(problem.core, [clause.node])(list(scenes))
        inside = within(value, clause, cell)
    return 1.0 if inside is None else max(LEAST, float(np.mean(inside)))
