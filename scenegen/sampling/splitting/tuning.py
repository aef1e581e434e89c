"""Tuning of moves: step lengths during the descent, and the mix of kinds that decorrelates chains fastest.

All tuning happens while the plan is made, and is frozen before a scene is taken.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from scenegen.sampling.splitting.autocorrelation import Statistics, forgetting, helps
from scenegen.sampling.splitting.chains import Chains
from scenegen.sampling.splitting.involutions import COMPOSED
from scenegen.sampling.splitting.local_moves import SCALED, STEPS
from scenegen.sampling.splitting.move_registry import moves_for
from scenegen.sampling.splitting.moves import Tuning

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
