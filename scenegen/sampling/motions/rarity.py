"""How rare each value of phi is among motions: as for scenes (scenegen/sampling/rarity.py), with chains of motions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from scenegen.arrays import Array
from scenegen.lang.spec import CheckedSpec
from scenegen.sampling.motions.problem import GATES, MotionProblem, cost
from scenegen.sampling.motions.schedule import MotionChains
from scenegen.sampling.motions.scores import make_motion_problem
from scenegen.sampling.rarity import (
    COUNTED_EFFORT,
    LEVEL_SHARE,
    MOVES_PER_LEVEL,
    TAIL_ISLANDS,
    PhiDistribution,
    Rarity,
    RequirementUnmet,
    climb,
    margins,
    next_level,
    restrict,
)
from scenegen.sampling.report import Estimate, ratio
from scenegen.sampling.request import SampleRequest
from scenegen.sampling.streams import MOTION_RARITY_STREAM
from scenegen.search.effort import NEVER, Stop

MAX_RUN_CHAINS, MIN_RUN_CHAINS = 4096, 256  # chains of a run
MOTION_LEVELS = 18  # levels that the effort of a run must cover
MOTION_WORK = 2_000_000_000  # node visits, times moments, of the runs together, and of meeting the requirement
REQUIREMENT_ROUNDS, SETTLE_ROUNDS = 2, 4  # rounds of moves on a level of the requirement, and once it is met


def measure(spec: CheckedSpec, labels: Sequence[str], seed: int = 0, stop: Stop = NEVER) -> Rarity | RequirementUnmet:
    """P(phi >= t) and P(phi <= t) of each of the labels of a spec over time, among the motions that meet its
    requirement and stay within the limits. The same arguments give the same numbers. Where `stop` raises StoppedError,
    runs end with what they have. Raises what `make_motion_problem` raises, and StoppedError where it is not known yet
    what meets the requirement."""
    problem = make_motion_problem(spec, SampleRequest({}, n=1, seed=seed), stop)
    with np.errstate(all="ignore"):
        moves = 10 + problem.steps + len(problem.names)
        work = MOTION_WORK // cost(spec)
        count = int(COUNTED_EFFORT * work) // (2 * len(labels) * MOVES_PER_LEVEL * moves * MOTION_LEVELS)
        count = problem.batch_size(min(max(count, MIN_RUN_CHAINS), MAX_RUN_CHAINS), 4 * TAIL_ISLANDS)
        count = count // TAIL_ISLANDS * TAIL_ISLANDS
        base, weights, best = _require(problem, count, moves, seed, work, stop)
        if not weights.any():
            return RequirementUnmet(best, base.evaluations)
        reaches, spent = dict[str, PhiDistribution](), base.evaluations
        for label in labels:
            row, tails = problem.labels.index(label), []
            for sign in (1, -1):
                chains = base.copy()
                tail, made = climb(
                    chains, partial(chains.run, moves), weights, sign, work // (2 * len(labels)), row=row, stop=stop
                )
                tails.append(tail)
                spent += made
            reaches[label] = PhiDistribution(tails[0], tails[1], spent)
    return Rarity(reaches, _requirement(weights, problem.log_excess), spent)


def _requirement(weights: Array, excess: float) -> Estimate | None:
    if (weights == 1.0).all():
        return None
    found = ratio(weights, np.ones(TAIL_ISLANDS))
    return None if found is None else replace(found, log10=found.log10 + excess / math.log(10.0))


def _require(
    problem: MotionProblem, count: int, moves: int, seed: int, work: int, stop: Stop
) -> tuple[MotionChains, Array, float]:
    """Chains that meet the limits, then the requirement, with the weights of their islands (0 if they do not), and the
    largest margin."""
    rng = np.random.Generator(np.random.SFC64(np.random.SeedSequence([seed, MOTION_RARITY_STREAM])))
    chains, weights, best = MotionChains.start(problem, count, rng, stop), np.ones(TAIL_ISLANDS), np.inf
    for row in reversed(range(len(problem.labels), len(problem.labels) + len(GATES))):
        met = bool((margins(chains, 1, row) >= 0.0).all())
        while not met and chains.evaluations < work:
            level = next_level(margins(chains, 1, row), chains.region.low[row], LEVEL_SHARE)
            if level is None:
                break
            met = level >= 0.0
            weights = weights * restrict(chains, min(level, 0.0), 1, row)
            for _ in range(REQUIREMENT_ROUNDS):
                chains.run(moves)
        best = float(margins(chains, 1, row).max())
        if not met:
            return chains, np.zeros(TAIL_ISLANDS), best
        low = chains.region.low.copy()
        low[row] = 0.0
        chains.narrow(type(chains.region)(low, chains.region.high))
    for _ in range(SETTLE_ROUNDS):
        chains.run(moves)
    return chains, weights, best
