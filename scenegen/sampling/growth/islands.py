"""Growth as an estimate: the probability of a range, and phi of scenes in it, from independent populations."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.bounds.effort import TooMuchError
from scenegen.pose import BELOW_TURN, THETA, along
from scenegen.sampling.growth.grow import Grown, Stuck, explore, grow
from scenegen.sampling.growth.machine import Machine, make_machine
from scenegen.sampling.growth.moves import Settings, sweep
from scenegen.sampling.growth.population import tuned
from scenegen.sampling.growth.sampler import log_base
from scenegen.sampling.growth.tally import Tally
from scenegen.sampling.problem import Problem

Array = npt.NDArray[np.float64]

SETTLE = 2  # sweeps over all objects after the last one is placed
EXPLORED = 512  # scenes by which it is seen what a run needs


@dataclass(frozen=True, slots=True)
class Islands:
    """`log_share` (I,) is the natural logarithm of each island's estimate of the probability of the range, -inf where
    it died out; `phi` (I, L, P) are the labels of its scenes, NaN there. `work` counts visits of formula nodes."""

    log_share: Array
    phi: Array
    work: float


@dataclass(frozen=True, slots=True)
class NoRoom:
    """No scene was found: there was no room for some object, or (`stuck` is None) it took too much work."""

    machine: Machine
    stuck: Stuck | None
    work: float


def grow_islands(
    problem: Problem, islands: int, each: int, seed: Sequence[int], most: float = math.inf, deadline: float = math.inf
) -> Islands | NoRoom:
    """`islands` independent populations of `each` scenes for a problem of one cell; equal seeds give equal numbers.

    What a run needs is found out by scenes of its own, so that the estimates are unbiased. `most` is how many visits of
    formula nodes it may take. Raises StoppedError after `deadline`, by the monotonic clock.
    """
    assert problem.cells.count == 1
    machine = make_machine(problem, deadline=deadline)
    machine.most = most / len(problem.core.nodes)
    try:
        return _grow_islands(problem, machine, islands, each, seed)
    except TooMuchError:
        return NoRoom(machine, None, machine.work * len(problem.core.nodes))


def _grow_islands(problem: Problem, machine: Machine, islands: int, each: int, seed: Sequence[int]) -> Islands | NoRoom:
    nodes = len(problem.core.nodes)
    tally = Tally()
    for many in (EXPLORED, 4 * EXPLORED):
        number = np.arange(many)
        found, steps = explore(machine, np.zeros_like(number), number % 4, _generator(seed, 0), tally)
        if isinstance(found, Grown):
            break
    else:
        assert isinstance(found, Stuck)
        return NoRoom(machine, found, machine.work * nodes)
    settings = _settings(found, tally)
    rng = _generator(seed, 1)
    number = np.arange(islands * each)
    grown = grow(machine, np.zeros_like(number), number % islands, steps, settings, rng)
    if isinstance(grown, Stuck):
        return NoRoom(machine, grown, machine.work * nodes)
    particles = grown.particles
    for _ in range(SETTLE):
        sweep(particles, settings)
    rows = particles.scenes.copy()
    lowest, highest = problem.lowest, problem.highest
    for row in range(len(lowest)):
        if row not in machine.graph.rows and lowest[row] < highest[row]:
            rows[row] = lowest[row] + rng.random(rows.shape[1]) * (highest[row] - lowest[row])
    np.minimum(rows[along(THETA)], BELOW_TURN, out=rows[along(THETA)])
    values = problem.phi(rows)
    phi = np.full((islands, len(values), each), np.nan)
    for island in range(islands):
        mine = np.flatnonzero(particles.island == island)
        phi[island, :, : len(mine)] = values[:, mine]
    return Islands((grown.log_share + log_base(machine))[:, 0], phi, machine.work * nodes)


def _settings(found: Grown, tally: Tally) -> Settings:
    """The lengths of steps that scenes take; a few sweeps tell, where growing took none."""
    if not tally.steps:
        sweep(found.particles, Settings({}), tally)
    return tuned(tally)


def _generator(seed: Sequence[int], part: int) -> np.random.Generator:
    return np.random.Generator(np.random.SFC64(np.random.SeedSequence([*seed, part])))
