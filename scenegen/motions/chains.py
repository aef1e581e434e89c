"""A population of motions that is narrowed to a region level by level and moves within it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from scenegen.bounds.effort import NEVER, Stop
from scenegen.motions.mixture import Meter, statistics
from scenegen.motions.moves import changes
from scenegen.motions.problem import Array, Index, MotionProblem
from scenegen.motions.variables import Flags, Variables, draw, poses_of
from scenegen.sampling.splitting.chains import Region


def _refill(gain: Array, islands: int, rng: np.random.Generator) -> Index:
    """As many chains as there are, in proportion to `gain`; islands without any refill from all."""
    each = gain.reshape(islands, -1)
    if islands == 1 or not each.sum(axis=1).all():
        return systematic(gain, rng)
    size = each.shape[1]
    return np.concatenate([number * size + systematic(share, rng) for number, share in enumerate(each)])


def systematic(share: Array, rng: np.random.Generator) -> Index:
    """As many indices as shares, in proportion to them, in order: systematic resampling (Kitagawa 1996)."""
    place = np.cumsum(share)
    points = (np.arange(len(share)) + rng.random()) * (place[-1] / len(share))
    index: Index = np.minimum(np.searchsorted(place, points, side="right"), len(share) - 1).astype(np.intp)
    return index


@dataclass(slots=True)
class Chains:
    """P chains: their variables, scores (L + 2, P), the region in which they are, and their weights there (P,).
    `evaluations` counts motions scored."""

    problem: MotionProblem
    rng: np.random.Generator
    now: Variables
    scores: Array
    region: Region
    weight: Array
    stop: Stop = NEVER
    evaluations: int = 0

    @classmethod
    def start(cls, problem: MotionProblem, count: int, rng: np.random.Generator, stop: Stop = NEVER) -> Chains:
        """Chains at the base distribution, allowed everywhere."""
        now = draw(problem, count, rng)
        anywhere = np.full(len(problem.cells.low), -np.inf)
        _, scores = problem.judge(poses_of(problem, now), anywhere, -anywhere, stop)
        return cls(problem, rng, now, scores, Region(anywhere, -anywhere), np.ones(count), stop, count)

    @property
    def count(self) -> int:
        return int(self.scores.shape[1])

    @property
    def phi(self) -> list[Array]:
        """The scores, a row each."""
        return list(self.scores)

    def copy(self) -> Chains:
        """Chains that go on from the same motions."""
        return replace(self, now=self.now.take(np.arange(self.count)), scores=self.scores.copy(), evaluations=0)

    def narrow(self, region: Region, islands: int = 1) -> float:
        """Restrict the chains to a region: survivors are resampled to the old number in proportion to the change of
        their weight; islands, blocks of equally many chains, each from their own. Returns the share that survived (0:
        none did, and the chains are unchanged)."""
        alive = region.holds(list(self.scores))
        gain = np.where(alive, self._weigh(region, self.scores) / self.weight, 0.0)
        if not gain.sum() > 0.0:
            return 0.0
        index = _refill(gain, islands, self.rng)
        self.now, self.scores, self.region = self.now.take(index), self.scores[:, index], region
        self.weight = self._weigh(region, self.scores)
        return float(alive.mean())

    def run(self, moves: int, mixture: Array | None = None, meter: Meter | None = None) -> float:
        """That many changes of every chain, each taken if it stays in the region (Metropolis, with the cells' weights
        where there are any). `mixture` is how often each is made; without it all are equally often. A meter measures
        them. Returns the share taken. Raises what `stop` raises."""
        kinds, taken = changes(self.problem), 0
        if not kinds:
            return 0.0
        often = np.cumsum(np.full(len(kinds), 1.0 / len(kinds)) if mixture is None else mixture)
        if meter is not None:
            meter.begin(self.statistics())
        for _ in range(moves):
            self.stop.check()
            kind = min(int(np.searchsorted(often, self.rng.random(), side="right")), len(kinds) - 1)
            new, good = kinds[kind](self.problem, self.now, self.rng)
            taken += self._accept(kind, new, good, meter)
        return taken / max(1, moves * self.count)

    def statistics(self) -> Array:
        """What is watched of the motions, (S, P)."""
        return statistics(self.problem, self.now, poses_of(self.problem, self.now), self.scores)

    def _accept(self, kind: int, new: Variables, good: Flags, meter: Meter | None) -> int:
        some = np.flatnonzero(good)
        self.evaluations += len(some)
        if not len(some):
            return 0
        part = new if len(some) == self.count else new.take(some)
        poses = poses_of(self.problem, part)
        held, scores = self.problem.judge(poses, self.region.low, self.region.high, self.stop)
        weight = self._weigh(self.region, scores)
        held &= self.rng.random(len(some)) * self.weight[some] < weight
        kept = some[held]
        if meter is not None:
            watched = statistics(self.problem, part.take(held), poses[..., held], scores[:, held])
            meter.add(kind, self.count, len(some), kept, watched)
        taken = np.zeros(self.count, dtype=bool)
        taken[kept] = True
        self.now.put(new, taken)
        self.scores[:, kept] = scores[:, held]
        self.weight[kept] = weight[held]
        return len(kept)

    def _weigh(self, region: Region, scores: Array) -> Array:
        if region.weights is None:
            return np.ones(scores.shape[1])
        return region.weigh(list(scores), self.problem.cells)
