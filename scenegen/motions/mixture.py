"""How often each change is made: so that what is slowest to be forgotten is forgotten sooner.

Each change moves each statistic of the motions by some mean square. The rate at which a statistic is forgotten is about
their mean over the mixture of changes, so its inverse is a time. The mixture is the one that has the least sum of
times for the same number of evaluations; it is found by the multiplicative algorithm for A-optimal designs (Silvey,
Titterington and Torsney 1978). It is fixed before any motion is kept.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from scenegen.motions.problem import Array, Index, MotionProblem
from scenegen.motions.variables import Variables

KEEP = 0.7  # of what was measured, when the region narrows
SHARED = 0.5  # of the evaluations, which all changes share equally: none is left out
OWN_COST = 0.4  # of a change, in evaluations: what it takes to make it
STEPS = 200  # of the algorithm


def statistics(problem: MotionProblem, variables: Variables, poses: Array, scores: Array) -> Array:
    """What is watched to see whether motions are independent, (S, P): places, headings, the mean place and how far the
    nearest other object is, at a few moments; how often objects move; and phi."""
    some = poses[:, :, [0, problem.steps // 2, problem.steps]]
    count = poses.shape[-1]
    parts = [some[:, :2], np.cos(some[:, 2]), np.sin(some[:, 2]), _gaps(poses[:, :2, moments(problem.steps)])]
    if len(poses) > 1:  # where all are: changes that exchange objects move each of them, and leave this as it is
        parts.append(some[:, :2].mean(axis=0))
    if problem.moves == "one":
        parts.append(np.stack([(variables.mover == slot).sum(axis=0) for slot in range(len(problem.movable))]))
    rows = [part.reshape(math.prod(part.shape[:-1]), count) for part in parts]
    return np.concatenate([*rows, scores[: len(problem.labels)]])


def moments(steps: int) -> list[int]:
    """Up to five moments, evenly apart."""
    return sorted({steps * part // 4 for part in range(5)})


def _gaps(places: Array) -> Array:
    """The distance of every object (N, 2, ...) to the nearest other one, (N, ...)."""
    out = np.full((len(places), *places.shape[2:]), np.inf)
    for one in range(len(places)):
        for other in range(one):
            apart = np.hypot(*(places[one] - places[other]))
            np.minimum(out[one], apart, out=out[one])
            np.minimum(out[other], apart, out=out[other])
    return np.zeros_like(out) if len(places) < 2 else out


@dataclass(slots=True)
class Meter:
    """Measures changes, K of them: the sums of squares by which they moved the statistics (K, S), their evaluations,
    and how many times they were tried, both (K,)."""

    count: int
    jumps: Array = field(init=False)
    cost: Array = field(init=False)
    tried: Array = field(init=False)
    now: Array = field(init=False)  # the statistics of all chains, (S, P)

    def __post_init__(self) -> None:
        self.jumps = np.zeros((self.count, 0))
        self.cost, self.tried = np.zeros(self.count), np.zeros(self.count)

    def begin(self, now: Array) -> None:
        """Chains whose statistics are `now`; what was measured before counts less."""
        if not self.jumps.shape[1]:
            self.jumps = np.zeros((self.count, len(now)))
        self.now = now.copy()
        for one in (self.jumps, self.cost, self.tried):
            one *= KEEP

    def add(self, kind: int, tried: int, scored: int, chains: Index, statistics: Array) -> None:
        """A change was tried by so many chains, scored by some, and taken by `chains` (indices), whose statistics are
        now (S, len(chains))."""
        self.tried[kind] += tried
        self.cost[kind] += OWN_COST * tried + scored
        self.jumps[kind] += ((statistics - self.now[:, chains]) ** 2).sum(axis=1)
        self.now[:, chains] = statistics

    def mixture(self) -> Array:
        """How often each change is to be made, (K,), in all 1."""
        variance = self.now.var(axis=1)
        moved = (variance > 1e-12) & (self.jumps > 0.0).any(axis=0)
        tried = np.where(self.tried > 0.0, self.tried, 1.0)
        cost = np.where(self.tried > 0.0, self.cost / tried, 1.0 + OWN_COST)
        rate = self.jumps[:, moved] / variance[moved] / (tried * cost)[:, None]
        share = np.full(self.count, 1.0 / self.count)
        for _ in range(STEPS if moved.any() else 0):
            gain = (rate / (share @ rate) ** 2).sum(axis=1)
            share *= np.sqrt(gain)
            share /= share.sum()
            share = np.maximum(share, 1e-12)
        often = ((1.0 - SHARED) * share + SHARED / self.count) / cost
        found: Array = often / often.sum()
        return found
