"""Chains of motions, and the descent that plans a request for motions: see `scenegen.sampling.splitting.levels`."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from scenegen.arrays import Array, Index
from scenegen.sampling.motions.moves import changes
from scenegen.sampling.motions.problem import GATES, Flags, MotionProblem, Variables, draw, poses_of, within_a_turn
from scenegen.sampling.resampling import resample
from scenegen.sampling.splitting.levels import Descent, Region, Schedule, Stage, which_cell
from scenegen.sampling.streams import MOTIONS_STREAM
from scenegen.search.effort import NEVER, Budget, Stop

METER_MEMORY = 0.7  # of what was measured, when the region narrows
EQUAL_SHARE = 0.5  # of the evaluations, which all changes share equally: none is left out
CHANGE_COST = 0.4  # of a change, in evaluations: what it takes to make it
DESIGN_STEPS = 200  # of the algorithm


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
            one *= METER_MEMORY

    def add(self, kind: int, tried: int, scored: int, chains: Index, statistics: Array) -> None:
        """A change was tried by so many chains, scored by some, and taken by `chains` (indices), whose statistics are
        now (S, len(chains))."""
        self.tried[kind] += tried
        self.cost[kind] += CHANGE_COST * tried + scored
        self.jumps[kind] += ((statistics - self.now[:, chains]) ** 2).sum(axis=1)
        self.now[:, chains] = statistics

    def mixture(self) -> Array:
        """How often each change is to be made, (K,), in all 1: what is slowest to be forgotten is forgotten sooner.

        Each change moves each statistic of the motions by some mean square. The rate at which a statistic is forgotten
        is about their mean over the mixture of changes, so its inverse is a time. The mixture is the one that has the
        least sum of times for the same number of evaluations, by the multiplicative algorithm for A-optimal designs
        (Silvey, Titterington and Torsney 1978). It is fixed before any motion is kept.
        """
        variance = self.now.var(axis=1)
        moved = (variance > 1e-12) & (self.jumps > 0.0).any(axis=0)
        tried = np.where(self.tried > 0.0, self.tried, 1.0)
        cost = np.where(self.tried > 0.0, self.cost / tried, 1.0 + CHANGE_COST)
        rate = self.jumps[:, moved] / variance[moved] / (tried * cost)[:, None]
        share = np.full(self.count, 1.0 / self.count)
        for _ in range(DESIGN_STEPS if moved.any() else 0):
            gain = (rate / (share @ rate) ** 2).sum(axis=1)
            share *= np.sqrt(gain)
            share /= share.sum()
            share = np.maximum(share, 1e-12)
        often = ((1.0 - EQUAL_SHARE) * share + EQUAL_SHARE / self.count) / cost
        found: Array = often / often.sum()
        return found


@dataclass(slots=True)
class MotionChains:
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
    def start(cls, problem: MotionProblem, count: int, rng: np.random.Generator, stop: Stop = NEVER) -> MotionChains:
        """Chains at the base distribution, allowed everywhere."""
        now = draw(problem, count, rng)
        anywhere = np.full(len(problem.cells.low), -np.inf)
        _, scores = problem.judge(poses_of(problem, now), anywhere, -anywhere, stop)
        return cls(problem, rng, now, scores, Region(anywhere, -anywhere), np.ones(count), stop, count)

    @property
    def count(self) -> int:
        return int(self.scores.shape[1])

    def copy(self) -> MotionChains:
        """Chains that go on from the same motions."""
        return replace(self, now=self.now.take(np.arange(self.count)), scores=self.scores.copy(), evaluations=0)

    def narrow(self, region: Region, islands: int = 1) -> float:
        """Restrict the chains to a region: survivors are resampled to the old number in proportion to the change of
        their weight; islands, blocks of equally many chains, each from their own. Returns the share that survived (0:
        none did, and the chains are unchanged)."""
        alive = region.holds(self.scores)
        gain = np.where(alive, self._weigh(region, self.scores) / self.weight, 0.0)
        if not gain.sum() > 0.0:
            return 0.0
        each = gain.reshape(islands, -1)
        if not each.any(axis=1).all():  # where an island has died out, all are refilled from all
            each = gain[None]
        size = each.shape[1]
        index = np.concatenate([number * size + resample(own, size, self.rng) for number, own in enumerate(each)])
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
        return region.weigh(scores, self.problem.cells)


MIN_MOTION_CHAINS, MOTION_PIECES = 64, 4  # chains of a piece, and pieces of a request, at least
MIN_LARGE_CHAINS = 16  # chains, of motions so large that more would not fit
INDEPENDENT_CORRELATION = 0.1  # correlation of a motion with its chain's earlier one at which they count as independent
MAX_SETTLE_ROUNDS = 32  # rounds of moves until then, at most
CORRELATION_DEVIATIONS = 2.5  # of the largest of some hundred sample correlations whose true value is 0
EVEN_OUT_ROUNDS = 24  # of weights that even out the cells


def generator(seed: int, piece: int) -> np.random.Generator:
    """Random numbers of piece k; the plan's are those of piece -1, and the pilot has its own."""
    return np.random.Generator(np.random.SFC64(np.random.SeedSequence([seed, MOTIONS_STREAM, piece + 2])))


Watch = Callable[[Array, int], None]
"""Is shown motions (n, T + 1, N, 3) while there are none of the request yet: those nearest to its range, the nearest
first, and how many of them lie in it. They are in range, but not distributed like those that the request gets."""


def make_schedule(problem: MotionProblem, budget: Budget, watch: Watch | None = None) -> Schedule | None:
    """The schedule of a problem; None if its range is not reached. The moves of stages without a region make the
    motions independent. `watch` is shown the motions of each level. Raises StoppedError when time is up."""
    return _MotionDescent(problem, budget, watch).plan()


class _MotionDescent(Descent[MotionChains]):
    """The descent of a request for motions."""

    kept = 0.4

    def __init__(self, problem: MotionProblem, budget: Budget, watch: Watch | None = None) -> None:
        wanted = max(MIN_MOTION_CHAINS, 4 * problem.cells.count, -(-problem.request.n // MOTION_PIECES))
        self._piece = problem.batch_size(min(wanted, 4096), MIN_LARGE_CHAINS)
        self._moves = 10 + problem.steps + len(problem.names)
        many = problem.batch_size(max(512, self._piece), MIN_LARGE_CHAINS)
        super().__init__(MotionChains.start(problem, many, generator(problem.request.seed, -1), budget))
        kinds = len(changes(problem))
        self._meter, self._mixture = Meter(kinds), np.full(kinds, 1.0 / max(1, kinds))
        self._watch = watch

    def plan(self) -> Schedule | None:
        chains, problem = self.chains, self.chains.problem
        labels = len(problem.labels)
        if not self.reach(problem.cells, [*reversed(range(labels, labels + len(GATES)))]):
            return None
        levels = len(self.stages)
        reached = self._even_out() if problem.cells.count > 1 else (0,)
        left = self._settle()
        return Schedule(tuple(self.stages), levels, reached, self._piece, left, chains.evaluations)

    def move(self) -> tuple[Array, int]:
        """Moves by the mixture so far, which then follows from what was measured."""
        mixture = self._mixture
        self.chains.run(self._moves, mixture, self._meter)
        if len(mixture):
            self._mixture = self._meter.mixture()
        return mixture, self._moves

    def look(self, distance: Array, last: bool) -> None:
        """Show the nearest motions; chains that began as copies of one and have not moved since count once."""
        if self._watch is None:
            return
        problem, n = self.chains.problem, self.chains.problem.request.n
        nearest = np.argsort(distance, kind="stable")[: 4 * n]
        poses = within_a_turn(poses_of(problem, self.chains.now.take(nearest)))
        motions = np.ascontiguousarray(poses.transpose(3, 2, 0, 1))
        _, first = np.unique(motions.reshape(len(motions), -1), axis=0, return_index=True)
        first = np.sort(first)[:n]
        self._watch(motions[first], int((distance[nearest[first]] == 0.0).sum()) if last else 0)

    def _even_out(self) -> tuple[int, ...]:
        """Weights under which the chains visit all cells about equally often (Berg and Neuhaus 1992). Returns the cells
        that were visited; the others are closed."""
        chains, cells, base = self.chains, self.chains.problem.cells, self.chains.region
        log_weight, visited = np.zeros(cells.count), np.zeros(cells.count, dtype=bool)
        for done in range(EVEN_OUT_ROUNDS):
            counts = np.zeros(cells.count)
            for _ in range(4):
                chains.run(self._moves // 2, self._mixture)
                counts += np.bincount(which_cell(chains.scores, cells), minlength=cells.count)
            visited |= counts > 0
            if done >= 6 and counts[visited].min() >= 0.4 * counts[visited].mean():
                break
            change = np.log(np.maximum(counts, 0.5) / counts[visited].mean())
            log_weight -= np.clip(change, -3.0, 3.0)
            self._narrow(replace(base, weights=_weights(log_weight)))
        self._narrow(replace(base, weights=np.where(visited, _weights(log_weight), 0.0)))
        return tuple(map(int, np.flatnonzero(visited)))

    def _narrow(self, region: Region) -> None:
        self.chains.narrow(region)
        self.stages.append(Stage(region, self._mixture, self._moves))

    def _settle(self) -> float:
        """Moves until motions are independent of where their chains were, and as stages twice as many for the pieces:
        they can follow at once. Returns the largest correlation then."""
        chains = self.chains
        before, left = chains.statistics(), 1.0
        noise = CORRELATION_DEVIATIONS / np.sqrt(
            chains.count
        )  # the largest of some hundred correlations of independent motions
        spread = before.std(axis=1) > 1e-12
        rounds = 0
        while left > INDEPENDENT_CORRELATION and rounds < MAX_SETTLE_ROUNDS:
            rounds += 1
            self.move()
            self.stages.append(Stage(None, self._mixture, 2 * self._moves))
            after = chains.statistics()
            kept = spread & (after.std(axis=1) > 1e-12)
            pairs = zip(before[kept], after[kept], strict=True)
            found = [float(np.corrcoef(one, two)[0, 1]) for one, two in pairs]
            left = max(found, default=0.0) - noise
        return float(max(left, 0.0))


def _weights(log_weight: Array) -> Array:
    out: Array = np.exp(np.clip(log_weight - log_weight.max(), -600.0, 0.0))
    return out
