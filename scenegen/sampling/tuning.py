"""Learning to move: step lengths on the way down, and which kinds of moves make chains forget soonest.

All of it is learned while the plan is made and frozen before a scene is taken.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from scenegen.sampling.chains import Chains
from scenegen.sampling.kinds import kinds_for
from scenegen.sampling.mirrors import COMPOSED
from scenegen.sampling.mixing import Statistics, forgetting, helps
from scenegen.sampling.moves import Tuning
from scenegen.sampling.steps import SCALED, STEPS

Array = npt.NDArray[np.float64]

LONGEST = 2048  # moves between two scenes of a chain at most
_TARGET = 0.3  # share of chains that a well-tuned walk moves
_PER_MOVE, _PER_ROW = 15, 15  # what a move costs beside its phi, in nodes of the tape (measured)
_TRIAL = 1024  # chains on which it is seen which kinds move at all
_SHOTS = 12  # moves of a kind for that
_RACERS = 2048  # chains on which ways to share the moves among the kinds race each other
_RACES, _BOOST = 7, 0.25  # ways that are tried, and what each moves to the kind that helps most
_USEFUL = 0.01  # share of chains that a mirror must move to be made for every scene


class Tuner:
    """What is known so far about moving an ensemble of chains. `evaluations` counts those of trials on copies."""

    def __init__(self, chains: Chains) -> None:
        self._chains, self._frame = chains, chains.frame
        self._kinds = kinds_for(self._frame)
        self._length = 0.25 * (self._frame.high - self._frame.low)
        self._scale = dict.fromkeys(self._kinds, 1.0)
        self._weight = dict.fromkeys(self._kinds, 1.0)
        self.evaluations = 0

    def tuning(self) -> Tuning:
        """A copy of what is known now."""
        low, high = self._reach()
        return Tuning(dict(self._weight), dict(self._scale), self._length.copy(), low, high)

    def _reach(self) -> tuple[Array, Array]:
        """Where the chains live, row by row, and a little beyond."""
        low = np.array([row.min() for row in self._chains.rows])
        high = np.array([row.max() for row in self._chains.rows])
        margin = 0.02 * (high - low)
        return np.maximum(low - margin, self._frame.low), np.minimum(high + margin, self._frame.high)

    def adapt(self) -> int:
        """Move until the copies have parted, tuning step lengths on the way; returns the number of moves."""
        state, rng = self._chains, self._chains.rng
        enough = max(3.0, 0.5 * self._frame.dimension)
        least, most = 6, 24 + 6 * self._frame.dimension
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
        """Longer steps where many chains took one, shorter where few did; kinds that nobody takes get rare."""
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
                continue  # it led nowhere on the way here
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
        """The shares of the K kinds of steps: even at first, then ever more of what helps most, by its `cost` (K,),
        against the correlations that fade last. The shares by which chains forget most cheaply win."""
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
