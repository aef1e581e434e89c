"""A few scenes of a request, soon: something to look at while a plan is made.

One small population is grown for each of them, in a box that is contracted once, without the moves that make its scenes
differ and without any account of how they are distributed. They are in range, and no more than that. Where none of the
populations lives, larger ones are tried, with all that growth has.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from scenegen.pose import BELOW_TURN, THETA, along
from scenegen.sampling.growth.grow import HITS, PlacementFailed, explore
from scenegen.sampling.growth.machine import make_machine
from scenegen.sampling.growth.particles import MoveTally
from scenegen.sampling.growth.population import GROWTH
from scenegen.sampling.problem import Budget, Problem
from scenegen.search.effort import StoppedError, TooMuchError

Array = npt.NDArray[np.float64]

SIZES = (12, 96)  # scenes of a population: the larger one where none of the smaller ones lives
QUICK = 4.0  # poses that meet all clauses that a scene of the smaller one should have among its tries
ROUNDS = 1  # of contraction
ASIDE = (GROWTH, 0, 1)  # the stream of its random numbers: no plan reads it


def glimpse(problem: Problem, budget: Budget, count: int, sizes: Sequence[int] = SIZES) -> Array:
    """At most `count` scenes in the range of the request, (3N, m), of its first cells, its last, and some between; none
    where nothing is found soon."""
    try:
        with np.errstate(all="ignore"):  # phi may overflow or be undefined far from the range
            return _glimpse(problem, budget, count, sizes)
    except (StoppedError, TooMuchError):
        return np.empty((len(problem.lowest), 0))


def _glimpse(problem: Problem, budget: Budget, count: int, sizes: Sequence[int]) -> Array:
    machine = make_machine(problem, rounds=ROUNDS, deadline=budget.ends)
    possible = sorted(problem.possible)
    cells = np.array([possible[round(k * (len(possible) - 1) / max(1, count - 1))] for k in range(count)])
    rng = np.random.default_rng(np.random.SeedSequence([problem.request.seed, *ASIDE]))
    rows = np.empty((len(problem.lowest), 0))
    for size in sizes:
        island = np.repeat(np.arange(count), size)
        quick = size < sizes[-1]
        hits = QUICK if quick else HITS
        grown, _ = explore(machine, cells[island], island, rng, MoveTally(), hits=hits, moves=not quick)
        if not isinstance(grown, PlacementFailed):
            _, first = np.unique(grown.particles.island, return_index=True)
            rows = grown.particles.scenes[:, first].copy()
            break
    low, high = problem.lowest, problem.highest
    for row in range(len(low)):
        if row not in machine.graph.rows and low[row] < high[row]:  # no clause reads it
            rows[row] = low[row] + rng.random(rows.shape[1]) * (high[row] - low[row])
    np.minimum(rows[along(THETA)], BELOW_TURN, out=rows[along(THETA)])
    phi = problem.phi(rows)
    return rows[:, ((phi >= problem.cells.low[:, None]) & (phi <= problem.cells.high[:, None])).all(axis=0)]
