"""The plan of a splitting run: levels, tuned moves, weights of cells, and how far apart scenes are taken.

A level is a range of phi for every label that narrows from "anything" to the wanted range; the half of the scenes that
is nearest to it makes the next one (adaptive multilevel splitting, Cerou and Guyader 2007). What a spec requires comes
first, so that the shares from there on multiply to the probability under the base distribution. The plan is fixed by
spec, request and seed, and measured in evaluations of phi: the pieces that follow it can run anywhere.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from scenegen.bounds.effort import StoppedError
from scenegen.lang.core import REQUIRE
from scenegen.sampling.chains import Chains, Region
from scenegen.sampling.frame import Tape, frame_of
from scenegen.sampling.mixing import Statistics, forgetting
from scenegen.sampling.moves import Tuning
from scenegen.sampling.problem import Budget, Problem
from scenegen.sampling.spreading import even_out
from scenegen.sampling.tuning import LONGEST, Tuner

Array = npt.NDArray[np.float64]

SPLIT = 4  # random stream of splitting: plan and pieces, apart from the base draws and their kin
KEPT = 0.5  # share of the chains that makes a level
PIECES = 8  # pieces that a request is spread over, if it is large enough
CHAINS = 8192  # chains of a piece: a row of that length stays in the cache, and numpy's calls cost little
FEWEST = 1024  # chains of a piece at least: fewer ancestors would tell in the shares of modes
TAKES = 16  # scenes of one chain at most
NUMBERS = 1 << 21  # coordinates of a piece's chains at most
LEVELS = 1000
STALL = 20  # levels over which the distance must shrink by a hundredth, or the range counts as out of reach


@dataclass(frozen=True, slots=True)
class Stage:
    """Narrow the chains to `region`, then make `moves` moves by `tuning`. `counts` says whether the share that survives
    is a factor of the probability: not for what the spec requires, nor between cells."""

    region: Region
    tuning: Tuning
    moves: int
    counts: bool


@dataclass(frozen=True, slots=True)
class Plan:
    """Everything that pieces need.

    The first `levels` stages are levels, the others even the cells out; `cells` are those that get scenes. A piece has
    `chains` chains and takes `takes` scenes from each, `thinning` moves apart; `left` is the correlation that remains
    over that distance.
    """

    stages: tuple[Stage, ...]
    levels: int
    cells: frozenset[int]
    chains: int
    takes: int
    thinning: int
    left: float
    evaluations: int


@dataclass(frozen=True, slots=True)
class Stalled:
    """No plan: `why` the descent ended, the scenes it ended with, D rows and L phi, (P,) each, and its cost. There are
    none where time was up before the first."""

    why: Literal["time", "range"]
    rows: tuple[Array, ...]
    phi: tuple[Array, ...]
    evaluations: int
    levels: int


def generator(seed: int, piece: int) -> np.random.Generator:
    """Random numbers of piece k; the plan's are those of piece -1."""
    return np.random.Generator(np.random.SFC64(np.random.SeedSequence([seed, SPLIT, piece + 1])))


def make_plan(problem: Problem, budget: Budget) -> Plan | Stalled:
    """The plan for a problem; Stalled where the range cannot be reached, or time is up."""
    try:
        planner = _Planner(problem, budget)
    except StoppedError:
        return Stalled("time", (), (), 0, 0)
    return planner.plan()


class _Planner:
    """One descent of one ensemble of chains that writes down what it does."""

    def __init__(self, problem: Problem, budget: Budget) -> None:
        self._problem, self._budget = problem, budget
        frame, cells = frame_of(problem), problem.cells
        most = max(256, NUMBERS // frame.dimension)
        wanted = max(FEWEST, 8 * cells.count, -(-problem.request.n // PIECES))
        self._chains = min(most, CHAINS, wanted)
        ensemble = min(most, max(CHAINS // 2, self._chains))
        tape = Tape(frame, stop=budget)
        self._state = Chains.start(frame, tape, cells, ensemble, generator(problem.request.seed, -1))
        self._tuner = Tuner(self._state)
        self._stages: list[Stage] = []

    def plan(self) -> Plan | Stalled:
        try:
            return self._plan()
        except StoppedError:
            return self._stalled("time")

    def _plan(self) -> Plan | Stalled:
        cells, labels, state = self._problem.cells, tuple(self._problem.core.labels), self._state
        low, high = np.full(len(labels), -np.inf), np.full(len(labels), np.inf)
        arrived = True
        if labels[-1] == REQUIRE:
            low[-1] = 0.0
            arrived = self._descend(low, high, low, counts=False)
        arrived = arrived and self._descend(cells.low, cells.high, low, counts=True)
        if not arrived:
            return self._stalled("time" if self._budget.spent else "range")
        levels, reached = len(self._stages), frozenset({0})
        if cells.count > 1:
            for region, moves in even_out(state, self._tuner):
                self._stages.append(Stage(region, self._tuner.tuning(), moves, False))
                if self._budget.spent:
                    return self._stalled("time")
            assert state.region.weights is not None
            reached = frozenset(map(int, np.flatnonzero(state.region.weights)))
        statistics = Statistics(state.frame, self._budget)
        tuning = self._tuner.tune(statistics)
        memory = forgetting(state, statistics, tuning, LONGEST)
        self._stages[-1] = replace(self._stages[-1], tuning=tuning)
        takes = min(TAKES, max(1, -(-self._problem.request.n * 51 // (50 * PIECES * self._chains))))
        evaluations = state.evaluations + self._tuner.evaluations
        return Plan(tuple(self._stages), levels, reached, self._chains, takes, memory.moves, memory.left, evaluations)

    def _stalled(self, why: Literal["time", "range"]) -> Stalled:
        state = self._state
        evaluations = state.evaluations + self._tuner.evaluations
        return Stalled(why, tuple(state.rows), tuple(state.phi), evaluations, len(self._stages))

    def _descend(self, low: Array, high: Array, held: Array, *, counts: bool) -> bool:
        """Narrow the chains to phi from `low` to `high`, level by level; `held` (L,) are lower ends that always hold.
        Returns whether they have arrived."""
        state = self._state
        scale = self._scales(low, high)
        history: list[float] = []
        while not self._budget.spent:
            distance = self._distance(low, high, scale)
            level = float(np.quantile(distance, KEPT, method="lower"))
            if level <= 0.0 or (distance <= 0.0).mean() >= KEPT:
                level = 0.0
            elif not np.isfinite(level):  # phi is undefined in most scenes: first of all, leave those
                level = float(distance[np.isfinite(distance)].max(initial=-1.0))
            history.append(level)
            stuck = len(history) > STALL and level > 0.99 * history[-1 - STALL]
            if level < 0.0 or (level > 0.0 and (stuck or len(history) > LEVELS)):
                return False
            slack = level * (1.0 + 1e-9) * scale  # rounding must not shut out those that stand on the level
            region = Region(np.maximum(low - slack, held) if level else low, high + slack)
            state.narrow(region)
            moves = self._tuner.adapt()
            self._stages.append(Stage(region, self._tuner.tuning(), moves, counts))
            if level == 0.0:
                return True
        return False

    def _scales(self, low: Array, high: Array) -> Array:
        """How far from its range each label is, typically: what makes metres and radians comparable."""
        out = np.ones(len(low))
        for label, phi in enumerate(self._state.phi):
            off = np.maximum(low[label] - phi, phi - high[label])
            off = off[np.isfinite(off) & (off > 0.0)]
            if len(off):
                out[label] = np.median(off)
        return out

    def _distance(self, low: Array, high: Array, scale: Array) -> Array:
        """(P,) distance of the chains to the range, 0 within; infinite where phi is not a number."""
        worst = np.zeros(self._state.count)
        for phi, least, most, unit in zip(self._state.phi, low, high, scale, strict=True):
            worst = np.maximum(worst, np.maximum(least - phi, phi - most) / unit)
        return np.where(np.isnan(worst), np.inf, worst)
