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
from scenegen.sampling.splitting.moves import COMPOSED, SCALED, STEPS, Tuning, moves_for

# --------------------------------------------------------------------------------------------------------------------
# Step lengths during the descent, and the mix of kinds that decorrelates chains fastest.


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


def _weights(log_weight: Array, visited: Bool) -> Array:
    out: Array = np.exp(np.clip(log_weight - log_weight[visited].max(), -600.0, 600.0))
    return out


def _around(log_weight: Array, visited: Bool, cells: Cells) -> Array:
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
