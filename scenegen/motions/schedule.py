"""The levels of a request for motions, found by one descent (adaptive multilevel splitting, Cerou and Guyader 2007)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from scenegen.motions.chains import Chains
from scenegen.motions.mixture import Meter
from scenegen.motions.moves import changes
from scenegen.motions.problem import GATES, Array, MotionProblem
from scenegen.motions.stages import Stage, begin, generator
from scenegen.motions.variables import poses_of, within_a_turn
from scenegen.processes.ahead import Ahead
from scenegen.sampling.begun import Pieces
from scenegen.sampling.problem import Budget
from scenegen.sampling.splitting.chains import Region, which_cell

KEPT = 0.4
FEWEST, PIECES = 64, 4
AT_LEAST = 16  # chains, of motions so large that more would not fit
LEVELS, STALL = 400, 20
LEFT = 0.1  # correlation of a motion with its chain's earlier one at which they count as independent
LONGEST = 32  # rounds of moves until then, at most
LUCK = 2.5
ROUNDS = 24  # of weights that even out the cells


Watch = Callable[[Array, int], None]
"""Is shown motions (n, T + 1, N, 3) while there are none of the request yet: those nearest to its range, the nearest
first, and how many of them lie in it. They are in range, but not distributed like those that the request gets."""


@dataclass(frozen=True, slots=True)
class Schedule:
    """The first `levels` stages are factors of the probability. The moves of those without a region make the motions
    independent; `left` is the correlation that remains. `cells` get motions. `begun` are the first pieces as far as
    they were drawn while the plan was made: see `stages`."""

    stages: tuple[Stage, ...]
    levels: int
    left: float
    cells: tuple[int, ...]
    chains: int
    evaluations: int
    begun: Mapping[int, bytes] = field(default_factory=dict, repr=False, compare=False)

    @property
    def settling(self) -> int:
        """Moves that make the motions independent."""
        return sum(stage.moves for stage in self.stages if stage.region is None)


def make_schedule(problem: MotionProblem, budget: Budget, watch: Watch | None = None) -> Schedule | None:
    """The schedule of a problem; None if its range is not reached. With several workers, pieces are begun meanwhile.
    `watch` is shown the motions of each level. Raises StoppedError when time is up."""
    planner = _Planner(problem, budget, watch)
    if (problem.request.workers or 1) < 2:
        return planner.plan()
    with planner.pieces() as ahead:
        found = planner.plan(ahead)
        return None if found is None else replace(found, begun=ahead.states())


class _Planner:
    """One descent of one ensemble of chains, which records its stages."""

    def __init__(self, problem: MotionProblem, budget: Budget, watch: Watch | None = None) -> None:
        wanted = max(FEWEST, 4 * problem.cells.count, -(-problem.request.n // PIECES))
        self._piece = problem.at_once(min(wanted, 4096), AT_LEAST)
        self._moves = 10 + problem.steps + len(problem.names)
        many = problem.at_once(max(512, self._piece), AT_LEAST)
        self._chains = Chains.start(problem, many, generator(problem.request.seed, -1), budget)
        kinds = len(changes(problem))
        self._meter, self._mixture = Meter(kinds), np.full(kinds, 1.0 / max(1, kinds))
        self._stages: list[Stage] = []
        self._budget = budget
        self._ahead: Ahead[Stage] | None = None
        self._watch = watch

    def pieces(self) -> Ahead[Stage]:
        """Pieces that begin in another process."""
        problem, budget = self._chains.problem, self._budget
        job = Pieces[Stage](partial(begin, problem, self._piece, stop=budget))
        return Ahead(job, PIECES, budget.reserve)

    def plan(self, ahead: Ahead[Stage] | None = None) -> Schedule | None:
        """The schedule; `ahead` gets each stage."""
        self._ahead = ahead
        chains, problem = self._chains, self._chains.problem
        low, high = np.full(len(chains.scores), -np.inf), np.full(len(chains.scores), np.inf)
        held = low.copy()
        for gate in reversed(range(len(problem.labels), len(problem.labels) + len(GATES))):
            low = held.copy()
            low[gate] = 0.0
            if not self._descend(low, high, held):
                return None
            held = low
        if not self._descend(problem.cells.low, problem.cells.high, held, last=True):
            return None
        levels = len(self._stages)
        reached: tuple[int, ...] = (0,)
        if problem.cells.count > 1:
            reached = self._even_out()
        left = self._settle()
        return Schedule(
            tuple(self._stages), levels, left, reached, self._piece, chains.evaluations,
        )  # fmt: skip

    def _narrow(self, region: Region, *, counts: bool) -> None:
        self._chains.narrow(region)
        self._add(Stage(region, self._mixture, self._moves, counts))

    def _add(self, stage: Stage) -> None:
        self._stages.append(stage)
        if self._ahead is not None:
            self._ahead.add(stage)

    def _move(self, moves: int, tune: bool = True) -> None:
        """Moves by the mixture so far, which then follows from what was measured."""
        self._chains.run(moves, self._mixture, self._meter if tune else None)
        if tune and len(self._mixture):
            self._mixture = self._meter.mixture()

    def _descend(self, low: Array, high: Array, held: Array, *, last: bool = False) -> bool:
        """Restrict the chains to scores from `low` to `high`, level by level; `held` are lower ends that always
        hold. In the `last` descent, what is within is in the request's range."""
        chains = self._chains
        scale, history = _scales(chains.scores, low, high), list[float]()
        while len(history) < LEVELS:
            distance = _distance(chains.scores, low, high, scale)
            if self._watch is not None:
                self._show(distance, last)
            level = float(np.quantile(distance, KEPT, method="lower"))
            if not np.isfinite(level):
                level = float(distance[np.isfinite(distance)].max(initial=-1.0))
            if level < 0.0:
                return False
            if history and level >= history[-1]:  # most share one value
                below = distance[distance < level]
                level = float(below.max()) if len(below) >= 16 else level
            history.append(level)
            if len(history) > STALL and level > 0.99 * history[-1 - STALL]:
                return False
            slack = level * (1.0 + 1e-9) * scale
            self._narrow(Region(np.maximum(low - slack, held) if level else low.copy(), high + slack), counts=True)
            self._move(self._moves)
            if level == 0.0:
                return True
        return False

    def _show(self, distance: Array, last: bool) -> None:
        """Show the nearest motions; chains that began as copies of one and have not moved since count once."""
        assert self._watch is not None
        problem, n = self._chains.problem, self._chains.problem.request.n
        nearest = np.argsort(distance, kind="stable")[: 4 * n]
        poses = within_a_turn(poses_of(problem, self._chains.now.take(nearest)))
        motions = np.ascontiguousarray(poses.transpose(3, 2, 0, 1))
        _, first = np.unique(motions.reshape(len(motions), -1), axis=0, return_index=True)
        first = np.sort(first)[:n]
        self._watch(motions[first], int((distance[nearest[first]] == 0.0).sum()) if last else 0)

    def _even_out(self) -> tuple[int, ...]:
        """Weights under which the chains visit all cells about equally often (Berg and Neuhaus 1992). Returns the cells
        that were visited; the others are closed."""
        chains, cells, base = self._chains, self._chains.problem.cells, self._chains.region
        log_weight, visited = np.zeros(cells.count), np.zeros(cells.count, dtype=bool)
        for done in range(ROUNDS):
            counts = np.zeros(cells.count)
            for _ in range(4):
                self._move(self._moves // 2, tune=False)
                counts += np.bincount(which_cell(list(chains.scores), cells), minlength=cells.count)
            visited |= counts > 0
            if done >= 6 and counts[visited].min() >= 0.4 * counts[visited].mean():
                break
            change = np.log(np.maximum(counts, 0.5) / counts[visited].mean())
            log_weight -= np.clip(change, -3.0, 3.0)
            self._narrow(replace(base, weights=_weights(log_weight)), counts=False)
        self._narrow(replace(base, weights=np.where(visited, _weights(log_weight), 0.0)), counts=False)
        return tuple(map(int, np.flatnonzero(visited)))

    def _settle(self) -> float:
        """Moves until motions are independent of where their chains were, and as stages twice as many for the pieces:
        they can follow at once. Returns the largest correlation then."""
        chains = self._chains
        before, left = chains.statistics(), 1.0
        noise = LUCK / np.sqrt(chains.count)  # the largest of some hundred correlations of independent motions
        spread = before.std(axis=1) > 1e-12
        rounds = 0
        while left > LEFT and rounds < LONGEST:
            rounds += 1
            self._move(self._moves)
            self._add(Stage(None, self._mixture, 2 * self._moves))
            after = chains.statistics()
            kept = spread & (after.std(axis=1) > 1e-12)
            pairs = zip(before[kept], after[kept], strict=True)
            found = [float(np.corrcoef(one, two)[0, 1]) for one, two in pairs]
            left = max(found, default=0.0) - noise
        return float(max(left, 0.0))


def _scales(scores: Array, low: Array, high: Array) -> Array:
    """The typical distance of each score from its range, which makes metres and radians comparable."""
    out = np.ones(len(scores))
    for row, values in enumerate(scores):
        off = np.maximum(low[row] - values, values - high[row])
        off = off[np.isfinite(off) & (off > 0.0)]
        if len(off):
            out[row] = np.median(off)
    return out


def _distance(scores: Array, low: Array, high: Array, scale: Array) -> Array:
    """How far (P,) motions are from the range, 0 within; infinite if a score is NaN."""
    with np.errstate(invalid="ignore"):
        below = np.where(np.isneginf(low)[:, None], -np.inf, low[:, None] - scores)
        above = np.where(np.isposinf(high)[:, None], -np.inf, scores - high[:, None])
    worst = (np.maximum(below, above) / scale[:, None]).max(axis=0)
    return np.where(np.isnan(scores).any(axis=0), np.inf, np.maximum(worst, 0.0))


def _weights(log_weight: Array) -> Array:
    out: Array = np.exp(np.clip(log_weight - log_weight.max(), -600.0, 0.0))
    return out
