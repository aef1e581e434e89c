"""The plan of a splitting run: levels, tuned moves, weights of cells, and thinning.

A level is a range of phi for every label. Levels narrow from "anything" to the requested range; the half of the scenes
that is nearest to the range determines the next level (adaptive multilevel splitting, Cerou and Guyader 2007). The
requirement comes first. The shares of all levels multiply to the probability of requirement and range for a uniform
draw. The plan is determined by spec, request and seed, and its cost is counted in evaluations of phi: the pieces that
follow it can run anywhere.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from scenegen.errors import RequestError
from scenegen.lang.formula.core import REQUIRE
from scenegen.sampling.plan import NoPlan
from scenegen.sampling.problem import Budget, Problem
from scenegen.sampling.report import SHOWN, shortfall, too_early
from scenegen.sampling.request import Cells
from scenegen.sampling.splitting.chain_state import ChainTape, frame_of
from scenegen.sampling.splitting.chains import Chains, Region, Statistics, forgetting, helps, which_cell
from scenegen.sampling.splitting.moves import COMPOSED, SCALED, STEPS, Tuning, moves_for
from scenegen.search.effort import NEVER, Stop, StoppedError

# --------------------------------------------------------------------------------------------------------------------
# Tuning of moves: step lengths during the descent, and the mix of kinds that decorrelates chains fastest.
#
# All tuning happens while the plan is made, and is frozen before a scene is taken.


Array = npt.NDArray[np.float64]

LONGEST = 2048  # maximum number of moves between two scenes of a chain
_TARGET = 0.3  # acceptance rate of a well-tuned walk
_PER_MOVE, _PER_ROW = 15, 15  # cost of a move in addition to its phi, in nodes of the tape (measured)
_TRIAL = 1024  # chains for the test which kinds move at all
_SHOTS = 12  # moves of a kind in this test
_RACERS = 2048  # chains on which different mixes of kinds are compared
_RACES, _BOOST = 7, 0.25  # mixes that are tried, and the share that each shifts to the kind that helps most
_USEFUL = 0.01  # minimum acceptance rate of a mirror that is applied for every scene


def longest(dimension: int) -> int:
    """The maximum number of moves of one call of `Tuner.adapt`, for that many rows."""
    return 24 + 6 * dimension


class Tuner:
    """The state of the tuning of an ensemble of chains. `evaluations` counts those of trials on copies."""

    def __init__(self, chains: Chains) -> None:
        self._chains, self._frame = chains, chains.chain_state
        self._kinds = moves_for(self._frame)
        self._length = 0.25 * (self._frame.high - self._frame.low)
        self._scale = dict.fromkeys(self._kinds, 1.0)
        self._weight = dict.fromkeys(self._kinds, 1.0)
        self.evaluations = 0

    def tuning(self) -> Tuning:
        """A copy of the current state."""
        low, high = self._reach()
        return Tuning(dict(self._weight), dict(self._scale), self._length.copy(), low, high)

    def _reach(self) -> tuple[Array, Array]:
        """The interval that the chains occupy, row by row, slightly widened."""
        low = np.array([row.min() for row in self._chains.rows])
        high = np.array([row.max() for row in self._chains.rows])
        margin = 0.02 * (high - low)
        return np.maximum(low - margin, self._frame.low), np.minimum(high + margin, self._frame.high)

    def adapt(self) -> int:
        """Move until copies differ, tuning step lengths meanwhile; returns the number of moves."""
        state, rng = self._chains, self._chains.rng
        enough = max(3.0, 0.5 * self._frame.dimension)
        least, most = 6, longest(self._frame.dimension)
        moved, moves = 0.0, 0
        tuning = self.tuning()
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
        """Longer steps if many chains accepted one, shorter if few did; kinds that no chain accepts become rare."""
        if row >= 0:
            width = float(self._frame.high[row] - self._frame.low[row])
            factor = np.exp(share - _TARGET)
            self._length[row] = np.clip(self._length[row] * factor, 1e-9 * width, 0.5 * width)
        elif kind in SCALED:
            self._scale[kind] = float(np.clip(self._scale[kind] * np.exp(share - _TARGET), 1e-6, 8.0))
        alive = 1.0 if share > 0.01 else 0.03
        self._weight[kind] += 0.3 * (alive - self._weight[kind])

    def tune(self, statistics: Statistics) -> Tuning:
        """The frozen tuning: step lengths, the mirrors that work, and how often to make each kind of step."""
        state = self._chains
        for _ in range(12):
            for kind in self._kinds:
                if kind in SCALED:
                    share, proposal = state.move(kind, self.tuning())
                    self._learn(kind, share, proposal.row)
        state.pool = list(state.rows)
        tuning = self.tuning()
        trial = state.some(_TRIAL)
        steps: list[str] = []
        mirrors: list[str] = []
        costs: list[float] = []
        for kind in self._kinds:
            if kind in STEPS and self._weight[kind] < 0.1:
                continue  # it was never accepted during the descent
            moved, rows = 0.0, 0
            for _ in range(_SHOTS):
                share, proposal = trial.move(kind, tuning)
                moved += share / _SHOTS
                rows += len(proposal.rows)
            if kind in STEPS:
                steps.append(kind)
                costs.append(trial.tape.length + _PER_MOVE + _PER_ROW * rows / _SHOTS)
            elif moved > _USEFUL and not any(made <= set(mirrors) for made in COMPOSED.get(kind, ())):
                mirrors.append(kind)
        self.evaluations += trial.evaluations
        if not steps:
            return tuning
        return self._race(statistics, replace(tuning, mirrors=tuple(mirrors)), steps, np.array(costs))

    def _race(self, statistics: Statistics, tuning: Tuning, kinds: Sequence[str], cost: Array) -> Tuning:
        """The shares of the K kinds of steps: equal at first, then more and more of the kind that reduces the slowest
        correlations most for its `cost` (K,). The shares that decorrelate chains at the least cost are chosen."""
        weight = np.full(len(kinds), 1.0 / len(kinds))
        best, least = tuning, np.inf
        for _ in range(_RACES):
            tried = replace(tuning, weight=dict(zip(kinds, map(float, weight), strict=True)))
            trial = self._chains.some(_RACERS)
            memory = forgetting(trial, statistics, tried, LONGEST // 4)
            self.evaluations += trial.evaluations
            price = memory.moves * float(weight @ cost) * (1.0 + 10.0 * memory.left)
            if price < least:
                best, least = tried, price
            gain = np.zeros(len(kinds))
            for index, kind in enumerate(kinds):
                gain[index], spent = helps(memory, statistics, tuning, kind)
                self.evaluations += spent
            weight *= 1.0 - _BOOST
            weight[int((gain / cost).argmax())] += _BOOST
        return best


# --------------------------------------------------------------------------------------------------------------------
# Weights under which chains visit all cells of a range about equally often, so that one descent serves every cell.


_PATIENCE = 48  # maximum number of rounds until the cells are balanced
_QUIET = 4  # after so many rounds without a new cell the others count as unreachable
_EVEN = 0.4  # the least visited cell must have this share of the mean
_LOOKS = 4  # counts of the chains in a round
_LEAP = 3.0  # maximum change of a log weight in a round


def even_out(chains: Chains, tuner: Tuner) -> Iterator[tuple[Region, int]]:
    """A sequence of regions whose weights balance the cells better and better, each with the moves that were made in
    it. The last one closes cells that no chain has entered, by weight 0. The chains end in the last region.

    A cell with too few chains gains weight; one without chains gets its neighbours' weight (multicanonical recursion,
    Berg and Neuhaus 1992).
    """
    cells, base = chains.cells, chains.region
    log_weight = np.zeros(cells.count)
    visited = np.zeros(cells.count, dtype=bool)
    quiet = 0
    for _ in range(_PATIENCE):
        counts, moves = np.zeros(cells.count), 0
        for _ in range(_LOOKS):
            moves += tuner.adapt()
            counts += np.bincount(which_cell(chains.phi, cells), minlength=cells.count)
        yield chains.region, moves
        known = counts > 0
        quiet = 0 if (known & ~visited).any() else quiet + 1
        visited |= known
        if quiet >= _QUIET and counts[visited].min() >= _EVEN * counts[visited].mean():
            break
        share = np.log(np.maximum(counts, 1.0) / counts[known].mean())
        log_weight -= np.where(known, np.clip(share, -_LEAP, _LEAP), 0.0)
        log_weight = np.where(visited, log_weight, _around(log_weight, visited, cells))
        chains.narrow(replace(base, weights=_weights(log_weight, visited)))
    chains.narrow(replace(base, weights=np.where(visited, _weights(log_weight, visited), 0.0)))
    yield chains.region, tuner.adapt()


def _weights(log_weight: Array, visited: npt.NDArray[np.bool_]) -> Array:
    out: Array = np.exp(np.clip(log_weight - log_weight[visited].max(), -600.0, 600.0))
    return out


def _around(log_weight: Array, visited: npt.NDArray[np.bool_], cells: Cells) -> Array:
    """For every cell, the mean log weight of the visited cells beside it; the smallest of all if there are none."""
    shape = tuple(len(edge) - 1 for edge in cells.edges)
    values, known = np.where(visited, log_weight, 0.0).reshape(shape), visited.reshape(shape).astype(np.float64)
    total, many = np.zeros(shape), np.zeros(shape)
    for axis in range(len(shape)):
        for here, there in ((slice(1, None), slice(None, -1)), (slice(None, -1), slice(1, None))):
            before: tuple[slice, ...] = (slice(None),) * axis
            total[(*before, here)] += values[(*before, there)]
            many[(*before, here)] += known[(*before, there)]
    least = float(log_weight[visited].min())
    out: Array = np.where(many > 0, total / np.maximum(many, 1.0), least).ravel()
    return out


# --------------------------------------------------------------------------------------------------------------------
# The stages that the plan of a splitting run finds, and a piece that goes through them one by one.


SPLIT = 4  # random stream of splitting (plan and pieces), separate from those of base draws and rejection


@dataclass(frozen=True, slots=True)
class Stage:
    """Restrict the chains to `region`, then make `moves` moves by `tuning`. `counts` says whether the share that
    survives is a factor of the probability: not between cells."""

    region: Region
    tuning: Tuning
    moves: int
    counts: bool


@dataclass(slots=True)
class PartialPiece:
    """A piece after its first `stages` stages. `probability` is its estimate of that of their regions: 0 if no chain
    survived."""

    chains: Chains
    stages: int = 0
    probability: float = 1.0

    def follow(self, stage: Stage) -> None:
        """One more stage. Raises what `stop` raises."""
        self.stages += 1
        share = self.chains.narrow(stage.region) if self.probability else 0.0
        if stage.counts or not share:
            self.probability *= share
        if share:
            self.chains.run(stage.moves, stage.tuning)


def generator(seed: int, piece: int) -> np.random.Generator:
    """Random numbers of piece k; the plan's are those of piece -1."""
    return np.random.Generator(np.random.SFC64(np.random.SeedSequence([seed, SPLIT, piece + 1])))


def aside(seed: int, piece: int) -> np.random.Generator:
    """Random numbers for the processing of the finished scenes of piece k, or of the plan (-1)."""
    return np.random.default_rng(np.random.SeedSequence([seed, SPLIT, piece + 1, 1]))


def begin(problem: Problem, chains: int, number: int, stop: Stop = NEVER) -> PartialPiece:
    """Piece `number`, of so many chains, before its first stage."""
    frame = frame_of(problem)
    rng = generator(problem.request.seed, number)
    return PartialPiece(Chains.start(frame, ChainTape(frame, stop=stop), problem.cells, chains, rng))


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
    after so many moves.
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
class SplittingStalled(NoPlan):
    """No plan: `why` the descent ended, the scenes it ended with, D rows and L phi, (P,) each, and its cost. There are
    no scenes if time was up before the first."""

    why: Literal["time", "range"]
    rows: tuple[Array, ...]
    phi: tuple[Array, ...]
    evaluations: int
    levels: int

    @property
    def time_is_up(self) -> bool:
        return self.why == "time"

    def error(self, problem: Problem) -> RequestError:
        """The nearest scenes show which atoms fail."""
        tried = f"{self.evaluations:,} evaluations of splitting, {self.levels} levels"
        if not self.phi:
            return RequestError(too_early(problem, tried, len(problem.possible)))
        shown = min(len(self.phi[0]), SHOWN)
        rng = aside(problem.request.seed, -1)
        rows = frame_of(problem).complete([row[:shown] for row in self.rows], problem.lowest, problem.highest, rng)
        return RequestError(shortfall(problem, 0, tried, rows, np.array([phi[:shown] for phi in self.phi])))


def make_schedule(problem: Problem, budget: Budget, most: float = np.inf) -> Schedule | SplittingStalled:
    """The plan for a problem; SplittingStalled if the range cannot be reached, or time is up. The descent may take
    `most` evaluations."""
    try:
        planner = _LevelPlanner(problem, budget, most)
    except StoppedError:
        return SplittingStalled("time", (), (), 0, 0)
    return planner.plan()


class _LevelPlanner:
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
        tape = ChainTape(chain_state, stop=budget)
        self._state = Chains.start(chain_state, tape, cells, ensemble, generator(problem.request.seed, -1))
        self._tuner = Tuner(self._state)
        self._stages: list[Stage] = []

    def plan(self) -> Schedule | SplittingStalled:
        try:
            return self._plan()
        except StoppedError:
            return self._stalled("time")

    def _plan(self) -> Schedule | SplittingStalled:
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
                self._stages.append(Stage(region, self._tuner.tuning(), moves, False))
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

    def _stalled(self, why: Literal["time", "range"]) -> SplittingStalled:
        state = self._state
        evaluations = state.evaluations + self._tuner.evaluations
        return SplittingStalled(why, tuple(state.rows), tuple(state.phi), evaluations, len(self._stages))

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
            self._stages.append(Stage(region, self._tuner.tuning(), moves, True))
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
