"""Tuning of the moves of scenes' chains, and of the weights of cells.

All tuning happens while the plan is made, and is frozen before a scene is taken.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from scenegen.arrays import Array, Bool
from scenegen.sampling.cells import Cells
from scenegen.sampling.splitting.chains import Chains, Statistics, forgetting, helps
from scenegen.sampling.splitting.levels import Region, which_cell
from scenegen.sampling.splitting.moves import COMPOSED_MIRRORS, SCALED_KINDS, STEP_PROPOSALS, Tuning, moves_for

MAX_THINNING = 2048  # maximum number of moves between two scenes of a chain
TARGET_ACCEPTANCE = 0.3  # acceptance rate of a well-tuned walk
MOVE_COST, ROW_COST = 15, 15  # cost of a move in addition to its phi, in nodes of the tape (measured)
TRIAL_CHAINS = 1024  # chains for the test which kinds move at all
TRIAL_MOVES = 12  # moves of a kind in this test
RACE_CHAINS = 2048  # chains on which different mixes of kinds are compared
MAX_RACES, RACE_SHIFT = 7, 0.25  # mixes that are tried, and the share that each shifts to the kind that helps most
MIN_MIRROR_ACCEPTANCE = 0.01  # minimum acceptance rate of a mirror that is applied for every scene


def max_moves(dimension: int) -> int:
    """The maximum number of moves of one call of `Tuner.adapt`, for that many rows."""
    return 24 + 6 * dimension


class Tuner:
    """The state of the tuning of an ensemble of chains. `evaluations` counts those of trials on copies."""

    def __init__(self, chains: Chains) -> None:
        self._chains, self._chain_state = chains, chains.chain_state
        self._kinds = moves_for(self._chain_state)
        self._length = 0.25 * (self._chain_state.high - self._chain_state.low)
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
        return np.maximum(low - margin, self._chain_state.low), np.minimum(high + margin, self._chain_state.high)

    def adapt(self) -> int:
        """Move until copies differ, tuning step lengths meanwhile; returns the number of moves."""
        state, rng = self._chains, self._chains.rng
        enough = max(3.0, 0.5 * self._chain_state.dimension)
        least, most = 6, max_moves(self._chain_state.dimension)
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
            width = float(self._chain_state.high[row] - self._chain_state.low[row])
            factor = np.exp(share - TARGET_ACCEPTANCE)
            self._length[row] = np.clip(self._length[row] * factor, 1e-9 * width, 0.5 * width)
        elif kind in SCALED_KINDS:
            self._scale[kind] = float(np.clip(self._scale[kind] * np.exp(share - TARGET_ACCEPTANCE), 1e-6, 8.0))
        alive = 1.0 if share > 0.01 else 0.03
        self._weight[kind] += 0.3 * (alive - self._weight[kind])

    def tune(self, statistics: Statistics) -> Tuning:
        """The frozen tuning: step lengths, the mirrors that work, and how often to make each kind of step."""
        state = self._chains
        for _ in range(12):
            for kind in self._kinds:
                if kind in SCALED_KINDS:
                    share, proposal = state.move(kind, self.tuning())
                    self._learn(kind, share, proposal.row)
        state.pool = list(state.rows)
        tuning = self.tuning()
        trial = state.pick_chains(TRIAL_CHAINS)
        steps: list[str] = []
        mirrors: list[str] = []
        costs: list[float] = []
        for kind in self._kinds:
            if kind in STEP_PROPOSALS and self._weight[kind] < 0.1:
                continue  # it was never accepted during the descent
            moved, rows = 0.0, 0
            for _ in range(TRIAL_MOVES):
                share, proposal = trial.move(kind, tuning)
                moved += share / TRIAL_MOVES
                rows += len(proposal.rows)
            if kind in STEP_PROPOSALS:
                steps.append(kind)
                costs.append(trial.tape.length + MOVE_COST + ROW_COST * rows / TRIAL_MOVES)
            elif moved > MIN_MIRROR_ACCEPTANCE and not any(
                made <= set(mirrors) for made in COMPOSED_MIRRORS.get(kind, ())
            ):
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
        for _ in range(MAX_RACES):
            tried = replace(tuning, weight=dict(zip(kinds, map(float, weight), strict=True)))
            trial = self._chains.pick_chains(RACE_CHAINS)
            memory = forgetting(trial, statistics, tried, MAX_THINNING // 4)
            self.evaluations += trial.evaluations
            price = memory.moves * float(weight @ cost) * (1.0 + 10.0 * memory.left)
            if price < least:
                best, least = tried, price
            gain = np.zeros(len(kinds))
            for index, kind in enumerate(kinds):
                gain[index], spent = helps(memory, statistics, tuning, kind)
                self.evaluations += spent
            weight *= 1.0 - RACE_SHIFT
            weight[int((gain / cost).argmax())] += RACE_SHIFT
        return best


MAX_EVEN_ROUNDS = 48  # maximum number of rounds until the cells are balanced
QUIET_ROUNDS = 4  # after so many rounds without a new cell the others count as unreachable
EVEN_CELL_SHARE = 0.4  # the least visited cell must have this share of the mean
COUNTS_PER_ROUND = 4  # counts of the chains in a round
MAX_LOG_CHANGE = 3.0  # maximum change of a log weight in a round


def even_out(chains: Chains, tuner: Tuner) -> Iterator[tuple[Region, int]]:
    """A sequence of regions whose weights balance the cells better and better, so that one descent serves every cell,
    each with the moves that were made in it. The last one closes cells that no chain has entered, by weight 0. The
    chains end in the last region.

    A cell with too few chains gains weight; one without chains gets its neighbours' weight (multicanonical recursion,
    Berg and Neuhaus 1992).
    """
    cells, base = chains.cells, chains.region
    log_weight = np.zeros(cells.count)
    visited = np.zeros(cells.count, dtype=bool)
    quiet = 0
    for _ in range(MAX_EVEN_ROUNDS):
        counts, moves = np.zeros(cells.count), 0
        for _ in range(COUNTS_PER_ROUND):
            moves += tuner.adapt()
            counts += np.bincount(which_cell(chains.scores, cells), minlength=cells.count)
        yield chains.region, moves
        known = counts > 0
        quiet = 0 if (known & ~visited).any() else quiet + 1
        visited |= known
        if quiet >= QUIET_ROUNDS and counts[visited].min() >= EVEN_CELL_SHARE * counts[visited].mean():
            break
        share = np.log(np.maximum(counts, 1.0) / counts[known].mean())
        log_weight -= np.where(known, np.clip(share, -MAX_LOG_CHANGE, MAX_LOG_CHANGE), 0.0)
        log_weight = np.where(visited, log_weight, _neighbour_weights(log_weight, visited, cells))
        chains.narrow(replace(base, weights=_weights(log_weight, visited)))
    chains.narrow(replace(base, weights=np.where(visited, _weights(log_weight, visited), 0.0)))
    yield chains.region, tuner.adapt()


def _weights(log_weight: Array, visited: Bool) -> Array:
    out: Array = np.exp(np.clip(log_weight - log_weight[visited].max(), -600.0, 600.0))
    return out


def _neighbour_weights(log_weight: Array, visited: Bool, cells: Cells) -> Array:
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
