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

from scenegen.lang.core import REQUIRE
from scenegen.sampling.chains import Chains, Region, which_cell
from scenegen.sampling.frame import Frame, Tape, frame_of
from scenegen.sampling.mixing import Statistics, correlation, forgetting
from scenegen.sampling.moves import COMPOSED, MIRRORS, SCALED, Tuning, kinds_for
from scenegen.sampling.problem import Budget, Problem

Array = npt.NDArray[np.float64]

SPLIT = 4  # random stream of splitting: plan and pieces, apart from the base draws and their kin
KEPT = 0.5  # share of the chains that makes a level
PIECES = 8  # pieces at least: their spread is the error bar of the probability
CHAINS = 8192  # chains of a piece: a row of that length stays in the cache, and numpy's calls cost little
FEWEST = 1024  # chains of a piece at least: fewer ancestors would tell in the shares of modes
TAKES = 16  # scenes of one chain at most
NUMBERS = 1 << 21  # coordinates of a piece's chains at most
LEVELS = 1000
STALL = 20  # levels over which the distance must shrink by a hundredth, or the range counts as out of reach
PATIENCE = 48  # rounds in which the weights of the cells must become even
LONGEST = 2048  # moves between scenes at most
_PER_MOVE, _PER_ROW = 15, 15  # what a move costs beside its phi, in nodes of the tape (measured)
_RACERS = 4096  # chains on which ways to share the moves among the kinds race each other
_RACES, _BOOST = 8, 0.25  # trials of shares, and what each moves to the kind that helps most
_TRIAL = 1024  # chains on which kinds of moves are compared
_USEFUL = 0.01  # share of chains that a mirror must move to be made for every scene
_TARGET = 0.3  # share of chains that a well-tuned walk moves


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
    """Everything that pieces need. `cells` are those that get scenes; `thinning` moves lie between two scenes of a
    chain; `left` is the correlation that remains over `thinning` moves."""

    stages: tuple[Stage, ...]
    cells: frozenset[int]
    chains: int
    takes: int
    thinning: int
    left: float
    evaluations: int


@dataclass(frozen=True, slots=True)
class Stalled:
    """No plan: `why` the descent ended, the scenes it ended with, rows (D,) arrays and phi (L,) arrays, and cost."""

    why: Literal["time", "range", "require"]
    rows: tuple[Array, ...]
    phi: tuple[Array, ...]
    evaluations: int
    levels: int


def generator(seed: int, piece: int) -> np.random.Generator:
    """Random numbers of piece k; the plan's are those of piece -1."""
    return np.random.Generator(np.random.SFC64(np.random.SeedSequence([seed, SPLIT, piece + 1])))


def make_plan(problem: Problem, budget: Budget) -> Plan | Stalled:
    """The plan for a problem; Stalled where the range cannot be reached, or time is up."""
    return _Planner(problem, budget).plan()


class _Planner:
    """One descent of one ensemble of chains that writes down what it does."""

    def __init__(self, problem: Problem, budget: Budget) -> None:
        self._problem, self._budget = problem, budget
        self._frame: Frame = frame_of(problem)
        cells = problem.cells
        most = max(256, NUMBERS // max(1, self._frame.dimension))
        wanted = max(FEWEST, min(CHAINS, -(-problem.request.n // PIECES)))
        self._chains = min(most, max(wanted, min(CHAINS, 8 * cells.count)))
        ensemble = min(most, max(CHAINS // 2, self._chains))
        self.state = Chains.start(
            self._frame, Tape(self._frame), cells, ensemble, generator(problem.request.seed, -1)
        )
        self._stages: list[Stage] = []
        self._kinds = kinds_for(self._frame)
        width = self._frame.high - self._frame.low
        self._length = 0.25 * width
        self._scale = dict.fromkeys(self._kinds, 1.0)
        self._weight = dict.fromkeys(self._kinds, 1.0)
        self._levels = self._trials = 0

    def plan(self) -> Plan | Stalled:
        cells, labels = self._problem.cells, tuple(self._problem.core.labels)
        low, high = np.full(len(labels), -np.inf), np.full(len(labels), np.inf)
        if labels[-1] == REQUIRE:
            low[-1] = 0.0
            stalled = self._descend(low, high, low, counts=False)
            if stalled is not None:
                return replace(stalled, why="require" if stalled.why == "range" else stalled.why)
        stalled = self._descend(cells.low, cells.high, low, counts=True)
        if stalled is not None:
            return stalled
        reached = frozenset({0})
        if cells.count > 1:
            reached = self._even_out()
        statistics = Statistics(self._frame)
        tuning = self._tune(statistics)
        memory = forgetting(self.state, statistics, tuning, LONGEST)
        self._stages[-1] = replace(self._stages[-1], tuning=tuning)
        takes = min(TAKES, max(1, -(-self._problem.request.n * 51 // (50 * PIECES * self._chains))))
        evaluations = self.state.evaluations + self._trials
        return Plan(
            tuple(self._stages), reached, self._chains, takes, memory.moves, memory.left, evaluations
        )

    def _descend(self, low: Array, high: Array, held: Array, *, counts: bool) -> Stalled | None:
        """Narrow the chains to phi from `low` to `high`, level by level; `held` (L,) are lower ends that hold throughout."""
        state = self.state
        scale = self._scales(low, high)
        history: list[float] = []
        while True:
            distance = self._distance(low, high, scale)
            level = float(np.quantile(distance, KEPT, method="lower"))
            if not level > 0.0 or (distance <= 0.0).mean() >= KEPT:
                level = 0.0
            history.append(level)
            stuck = len(history) > STALL and level > 0.99 * history[-1 - STALL]
            out = self._budget.spent
            if not np.isfinite(level) or (level > 0.0 and (stuck or len(history) > LEVELS)) or out:
                why: Literal["time", "range"] = "time" if out else "range"
                return Stalled(why, tuple(state.rows), tuple(state.phi), state.evaluations, self._levels)
            region = Region(np.maximum(low - level * scale, held) if level else low, high + level * scale)
            self._levels += 1
            state.narrow(region)
            moves = self._adapt()
            self._stages.append(Stage(region, self._tuning(), moves, counts))
            if level == 0.0:
                return None

    def _scales(self, low: Array, high: Array) -> Array:
        """How far from its range each label is, typically: what makes metres and radians comparable."""
        out = np.ones(len(low))
        for label, phi in enumerate(self.state.phi):
            off = np.maximum(low[label] - phi, phi - high[label])
            off = off[np.isfinite(off) & (off > 0.0)]
            if len(off):
                out[label] = np.median(off)
        return out

    def _distance(self, low: Array, high: Array, scale: Array) -> Array:
        """(P,) distance of the chains to the range, 0 within; infinite where phi is not a number."""
        worst = np.zeros(self.state.count)
        for phi, least, most, unit in zip(self.state.phi, low, high, scale, strict=True):
            worst = np.maximum(worst, np.maximum(least - phi, phi - most) / unit)
        return np.where(np.isnan(worst), np.inf, worst)

    def _tuning(self) -> Tuning:
        low, high = self._reach()
        return Tuning(dict(self._weight), dict(self._scale), self._length.copy(), low, high)

    def _reach(self) -> tuple[Array, Array]:
        """Where the chains live, row by row, and a little beyond; the whole circle for headings on both sides of 0."""
        low = np.array([row.min() for row in self.state.rows])
        high = np.array([row.max() for row in self.state.rows])
        margin = 0.02 * (high - low)
        return np.maximum(low - margin, self._frame.low), np.minimum(high + margin, self._frame.high)

    def _adapt(self) -> int:
        """Move until the copies have parted, tuning step lengths on the way; returns the number of moves."""
        state, rng = self.state, self.state.rng
        enough = max(2.0, 0.25 * self._frame.dimension)
        least, most = 6, 24 + 4 * self._frame.dimension
        moved, moves = 0.0, 0
        tuning = self._tuning()
        while moves < least or (moved < enough and moves < most):
            kinds = list(self._kinds)
            weight = np.array([self._weight[kind] for kind in kinds])
            kind = kinds[int(rng.choice(len(kinds), p=weight / weight.sum()))]
            share, proposal = state.move(kind, replace(tuning, scale=self._scale, length=self._length))
            if proposal.parting:
                moved += share
            moves += 1
            self._learn(kind, share, proposal.row)
        return moves

    def _learn(self, kind: str, share: float, row: int) -> None:
        """Longer steps where many chains took one, shorter where few did; kinds that nobody takes get rare."""
        if row >= 0:
            width = float(self._frame.high[row] - self._frame.low[row])
            factor = np.exp(share - _TARGET)
            self._length[row] = np.clip(self._length[row] * factor, 1e-9 * width, 0.5 * width)
        elif kind in SCALED:
            self._scale[kind] = float(np.clip(self._scale[kind] * np.exp(share - _TARGET), 1e-6, 8.0))
        alive = 1.0 if share > 0.01 else 0.03
        self._weight[kind] += 0.3 * (alive - self._weight[kind])

    def _even_out(self) -> frozenset[int]:
        """Weights under which the chains visit all cells that can be reached about equally often; the cells.

        A cell that holds too few chains gains weight, one in which there are none takes its neighbours' (multicanonical
        recursion, Berg and Neuhaus 1992). Cells that no chain has entered in the end are closed.
        """
        cells, state = self._problem.cells, self.state
        shape = tuple(len(edge) - 1 for edge in cells.edges)
        base = self._stages[-1].region
        log_weight = np.zeros(cells.count)
        visited = np.zeros(cells.count, dtype=bool)
        quiet = 0
        for _ in range(PATIENCE):
            counts = np.zeros(cells.count)
            moves = 0
            for _ in range(4):
                moves += self._adapt()
                counts += np.bincount(which_cell(state.phi, cells), minlength=cells.count)
            known = counts > 0
            new = known & ~visited
            visited |= known
            quiet = 0 if new.any() else quiet + 1
            mean = counts[known].mean()
            log_weight -= np.where(known, np.clip(np.log(np.maximum(counts, 1.0) / mean), -3.0, 3.0), 0.0)
            unseen = ~visited
            log_weight = np.where(unseen, _neighbours(log_weight, visited, shape), log_weight)
            log_weight -= log_weight[visited].max()
            weights = np.exp(np.clip(log_weight, -600.0, 600.0))
            region = replace(base, weights=weights)
            self._stages[-1] = replace(self._stages[-1], tuning=self._tuning())
            state.narrow(region)
            self._stages.append(Stage(region, self._tuning(), moves, False))
            even = counts[visited].min() >= 0.4 * counts[visited].mean()
            if (even and quiet >= 4) or self._budget.spent:
                break
        closed = np.where(visited, weights, 0.0)
        region = replace(base, weights=closed)
        state.narrow(region)
        self._stages.append(Stage(region, self._tuning(), self._adapt(), False))
        return frozenset(map(int, np.flatnonzero(visited)))

    def _tune(self, statistics: Statistics) -> Tuning:
        """The shares of the kinds of moves, from what one move of each does to every statistic."""
        state = self.state
        for _ in range(12):
            for kind in self._kinds:
                if kind in SCALED:
                    share, proposal = state.move(kind, self._tuning())
                    self._learn(kind, share, proposal.row)
        state.pool = list(state.rows)
        tuning = self._tuning()
        trial = state.some(_TRIAL)
        kinds = [kind for kind in self._kinds if kind in MIRRORS or self._weight[kind] >= 0.1]  # the others led nowhere
        repeats = int(np.clip(4 * self._frame.dimension, 24, 64))
        now = statistics(trial)
        steps: dict[str, Array] = {}
        costs: dict[str, float] = {}
        mirrors: list[str] = []
        for kind in kinds:
            rate, cost, moved = np.zeros(len(now)), 0.0, 0.0
            for _ in range(repeats):
                share, proposal = trial.move(kind, tuning)
                moved += share / repeats
                cost += (trial.tape.length + _PER_MOVE + _PER_ROW * len(proposal.rows)) / repeats
                if kind in MIRRORS:
                    continue
                then = statistics(trial)
                rate += np.clip(1.0 - correlation(now, then), 0.0, None)
                now = then
            if kind not in MIRRORS:
                steps[kind] = rate / cost
                costs[kind] = cost
            elif moved > _USEFUL and not any(made <= set(mirrors) for made in COMPOSED.get(kind, ())):
                mirrors.append(kind)
            now = statistics(trial)
        self._trials += trial.evaluations
        tuning = replace(tuning, mirrors=tuple(mirrors))
        return self._race(statistics, tuning, tuple(steps), np.array(list(steps.values())), np.array(list(costs.values())))

    def _race(
        self, statistics: Statistics, tuning: Tuning, kinds: tuple[str, ...], rates: Array, cost: Array
    ) -> Tuning:
        """The shares of the K kinds of steps: even at first, then ever more of what helps the statistics that came in
        last; the shares that were forgotten by most cheaply win. `rates` (K, S) is what a move takes off each
        correlation, by its `cost` (K,)."""
        weight = np.full(len(kinds), 1.0 / len(kinds))
        best, least = tuning, np.inf
        for _ in range(_RACES):
            tried = replace(tuning, weight=dict(zip(kinds, map(float, weight), strict=True)))
            trial = self.state.some(_RACERS)
            memory = forgetting(trial, statistics, tried, LONGEST // 4)
            self._trials += trial.evaluations
            price = memory.moves * float(weight @ cost) * (1.0 + 10.0 * memory.left)
            if price < least:
                best, least = tried, price
            helper = int((rates @ memory.late**2).argmax())
            weight *= 1.0 - _BOOST
            weight[helper] += _BOOST
        return best


def _neighbours(log_weight: Array, visited: npt.NDArray[np.bool_], shape: tuple[int, ...]) -> Array:
    """For every cell, the mean log weight of the visited cells around it; the smallest of all where there are none."""
    values, known = np.where(visited, log_weight, 0.0).reshape(shape), visited.reshape(shape).astype(np.float64)
    total, many = np.zeros(shape), np.zeros(shape)
    for axis in range(len(shape)):
        for step in (-1, 1):
            from_ = [slice(None)] * len(shape)
            to = [slice(None)] * len(shape)
            from_[axis] = slice(1, None) if step < 0 else slice(None, -1)
            to[axis] = slice(None, -1) if step < 0 else slice(1, None)
            total[tuple(to)] += values[tuple(from_)]
            many[tuple(to)] += known[tuple(from_)]
    least = float(log_weight[visited].min())
    out: Array = np.where(many > 0, total / np.maximum(many, 1.0), least).ravel()
    return out
