"""The plan of a splitting run: levels, tuned moves, weights of cells, and thinning.

A level is a range of phi for every label. Levels narrow from "anything" to the requested range; the half of the scenes
that is nearest to the range determines the next level (adaptive multilevel splitting, Cerou and Guyader 2007). The
requirement comes first. The shares of all levels multiply to the probability of requirement and range for a uniform
draw. The plan is determined by spec, request and seed, and its cost is counted in evaluations of phi: the pieces that
follow it can run anywhere.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Literal

import numpy as np
import numpy.typing as npt

from scenegen.bounds.effort import StoppedError
from scenegen.lang.core import REQUIRE
from scenegen.processes.ahead import Ahead
from scenegen.processes.process import cores
from scenegen.sampling.begun import Pieces
from scenegen.sampling.problem import Budget, Problem
from scenegen.sampling.splitting.autocorrelation import Statistics, forgetting
from scenegen.sampling.splitting.chain_state import Tape, frame_of
from scenegen.sampling.splitting.chains import Chains, Region
from scenegen.sampling.splitting.spreading import even_out
from scenegen.sampling.splitting.stages import Stage, begin, generator
from scenegen.sampling.splitting.tuning import LONGEST, Tuner

Array = npt.NDArray[np.float64]

KEPT = 0.5  # share of the chains that makes a level
PIECES = 8  # pieces of a request that is large enough
CHAINS = 8192  # chains of a piece: a row of this length stays in the cache, and numpy's overhead per call is small
FEWEST = 1024  # minimum number of chains of a piece: with fewer ancestors the shares of modes would be noisy
TAKES = 16  # maximum number of scenes from one chain
NUMBERS = 1 << 21  # maximum number of coordinates of a piece's chains
LEVELS = 1000
LEAST = 16  # chains beyond a value that most of them share, for a level to leave it behind
STALL = 20  # if so many levels shrink the distance by less than 1 %, the range counts as unreachable


@dataclass(frozen=True, slots=True)
class Schedule:
    """Everything that pieces need.

    The first `levels` stages are levels, the others balance the cells; `cells` are those that get scenes. A piece has
    `chains` chains and takes `takes` scenes from each, `thinning` moves apart; `left` is the correlation that remains
    after so many moves. `begun` are the first pieces as far as they were drawn while the plan was made: see `stages`.
    """

    stages: tuple[Stage, ...]
    levels: int
    cells: frozenset[int]
    chains: int
    takes: int
    thinning: int
    left: float
    evaluations: int
    begun: Mapping[int, bytes] = field(default_factory=dict, repr=False, compare=False)


@dataclass(frozen=True, slots=True)
class Stalled:
    """No plan: `why` the descent ended, the scenes it ended with, D rows and L phi, (P,) each, and its cost. There are
    no scenes if time was up before the first."""

    why: Literal["time", "range"]
    rows: tuple[Array, ...]
    phi: tuple[Array, ...]
    evaluations: int
    levels: int


def make_schedule(problem: Problem, budget: Budget, *, ahead: bool = False, most: float = np.inf) -> Schedule | Stalled:
    """The plan for a problem; Stalled if the range cannot be reached, or time is up. `ahead`: another process may begin
    to draw meanwhile, if the request is large. The descent may take `most` evaluations."""
    try:
        planner = _Planner(problem, budget, most)
    except StoppedError:
        return Stalled("time", (), (), 0, 0)
    return planner.plan(ahead=ahead)


class _Planner:
    """One descent of one ensemble of chains, which records its stages."""

    def __init__(self, problem: Problem, budget: Budget, most: float = np.inf) -> None:
        self._problem, self._budget, self._most = problem, budget, most
        chain_state, cells = frame_of(problem), problem.cells
        most = max(256, NUMBERS // chain_state.dimension)
        least, n = max(FEWEST, 8 * cells.count), problem.request.n * 51 // 50  # a few come out of the range by rounding
        self._chains = min(most, CHAINS, max(least, -(-n // PIECES)))
        self._takes = min(TAKES, -(-n // (PIECES * self._chains)))
        if self._takes > 1:  # as many pieces as planned, none for a few last scenes
            self._chains = min(self._chains, max(least, -(-n // (PIECES * self._takes))))
        ensemble = min(most, max(CHAINS // 2, least))  # one process makes the plan: more would only keep others waiting
        tape = Tape(chain_state, stop=budget)
        self._state = Chains.start(chain_state, tape, cells, ensemble, generator(problem.request.seed, -1))
        self._tuner = Tuner(self._state)
        self._stages: list[Stage] = []
        self._ahead: Ahead[Stage] | None = None

    def plan(self, *, ahead: bool) -> Schedule | Stalled:
        problem, budget = self._problem, self._budget
        pieces = -(-problem.request.n // (self._chains * self._takes))
        workers = problem.request.workers
        try:
            if not ahead or pieces < PIECES // 2 or (cores() if workers is None else workers) < 2:
                return self._plan()
            job = Pieces[Stage](partial(begin, problem, self._chains, stop=budget))
            work: Ahead[Stage] = Ahead(job, min(pieces, PIECES), budget.reserve)
            with work as self._ahead:
                found = self._plan()
                return replace(found, begun=work.states()) if isinstance(found, Schedule) else found
        except StoppedError:
            return self._stalled("time")

    def _plan(self) -> Schedule | Stalled:
        cells, labels, state = self._problem.cells, tuple(self._problem.core.labels), self._state
        low, high = np.full(len(labels), -np.inf), np.full(len(labels), np.inf)
        arrived = True
        if labels[-1] == REQUIRE:
            low[-1] = 0.0
            arrived = self._descend(low, high, np.full(len(labels), -np.inf))
        arrived = arrived and self._descend(cells.low, cells.high, low)
        if not arrived:
            return self._stalled("time" if self._budget.spent else "range")
        levels, reached = len(self._stages), frozenset({0})
        if cells.count > 1:
            for region, moves in even_out(state, self._tuner):
                self._add(Stage(region, self._tuner.tuning(), moves, False))
                if self._budget.spent:
                    return self._stalled("time")
            assert state.region.weights is not None
            reached = frozenset(map(int, np.flatnonzero(state.region.weights)))
        statistics = Statistics(state.chain_state, self._budget)
        tuning = self._tuner.tune(statistics)
        memory = forgetting(state, statistics, tuning, LONGEST)
        self._stages[-1] = replace(self._stages[-1], tuning=tuning)
        evaluations = state.evaluations + self._tuner.evaluations
        return Schedule(
            tuple(self._stages), levels, reached, self._chains, self._takes, memory.moves, memory.left, evaluations
        )

    def _add(self, stage: Stage) -> None:
        """One more stage. Pieces may begin with the one before: only the last one's tuning will still change."""
        if self._ahead is not None and self._stages:
            self._ahead.add(self._stages[-1])
        self._stages.append(stage)

    def _stalled(self, why: Literal["time", "range"]) -> Stalled:
        state = self._state
        evaluations = state.evaluations + self._tuner.evaluations
        return Stalled(why, tuple(state.rows), tuple(state.phi), evaluations, len(self._stages))

    def _descend(self, low: Array, high: Array, held: Array) -> bool:
        """Restrict the chains to phi from `low` to `high`, level by level; `held` (L,) are lower ends that always hold.
        Returns whether they have arrived."""
        state = self._state
        scale = self._scales(low, high)
        history: list[float] = []
        while not self._budget.spent and state.evaluations <= self._most:
            distance = self._distance(low, high, scale)
            level = float(np.quantile(distance, KEPT, method="lower"))
            if level <= 0.0 or (distance <= 0.0).mean() >= KEPT:
                level = 0.0
            elif not np.isfinite(level):  # phi is undefined in most scenes: leave those first
                level = float(distance[np.isfinite(distance)].max(initial=-1.0))
            elif history and level >= history[-1]:  # most share one value, say of an alternative that is a constant
                beyond = distance[distance < level]
                level = float(beyond.max()) if len(beyond) >= LEAST else level
            history.append(level)
            stuck = len(history) > STALL and level > 0.99 * history[-1 - STALL]
            if level < 0.0 or (level > 0.0 and (stuck or len(history) > LEVELS)):
                return False
            slack = level * (1.0 + 1e-9) * scale  # rounding must not exclude chains exactly on the level
            region = Region(np.maximum(low - slack, held) if level else low, high + slack)
            state.narrow(region)
            moves = self._tuner.adapt()
            self._add(Stage(region, self._tuner.tuning(), moves, True))
            if level == 0.0:
                return True
        return False

    def _scales(self, low: Array, high: Array) -> Array:
        """The typical distance of each label from its range, which makes metres and radians comparable."""
        out = np.ones(len(low))
        for label, phi in enumerate(self._state.phi):
            off = np.maximum(low[label] - phi, phi - high[label])
            off = off[np.isfinite(off) & (off > 0.0)]
            if len(off):
                out[label] = np.median(off)
        return out

    def _distance(self, low: Array, high: Array, scale: Array) -> Array:
        """(P,) distance of the chains to the range, 0 within; infinite if phi is NaN."""
        worst = np.zeros(self._state.count)
        for phi, least, most, unit in zip(self._state.phi, low, high, scale, strict=True):
            worst = np.maximum(worst, np.maximum(least - phi, phi - most) / unit)
        return np.where(np.isnan(worst), np.inf, worst)
