"""Learning to move: step lengths on the way down, and which kinds of moves make chains forget soonest.

All of it is learned while the plan is made and frozen before a scene is taken.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from scenegen.sampling.chains import Chains
from scenegen.sampling.kinds import kinds_for
from scenegen.sampling.mirrors import COMPOSED, MIRRORS
from scenegen.sampling.mixing import Statistics, correlation, forgetting
from scenegen.sampling.moves import Tuning
from scenegen.sampling.steps import SCALED

Array = npt.NDArray[np.float64]

LONGEST = 2048  # moves between two scenes of a chain at most
_TARGET = 0.3  # share of chains that a well-tuned walk moves
_PER_MOVE, _PER_ROW = 15, 15  # what a move costs beside its phi, in nodes of the tape (measured)
_TRIAL = 1024  # chains on which kinds of moves are compared
_RACERS = 2048  # chains on which ways to share the moves among the kinds race each other
_RACES, _BOOST = 8, 0.25  # ways that are tried, and what each moves to the kind that helps most
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
        enough = max(2.0, 0.25 * self._frame.dimension)
        least, most = 6, 24 + 4 * self._frame.dimension
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
        """The shares of the kinds of moves, from what one move of each does to every statistic."""
        state = self._chains
        for _ in range(12):
            for kind in self._kinds:
                if kind in SCALED:
                    share, proposal = state.move(kind, self.tuning())
                    self._learn(kind, share, proposal.row)
        state.pool = list(state.rows)
        tuning = self.tuning()
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
        self.evaluations += trial.evaluations
        tuning = replace(tuning, mirrors=tuple(mirrors))
        return self._race(
            statistics, tuning, tuple(steps), np.array(list(steps.values())), np.array(list(costs.values()))
        )

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
            trial = self._chains.some(_RACERS)
            memory = forgetting(trial, statistics, tried, LONGEST // 4)
            self.evaluations += trial.evaluations
            price = memory.moves * float(weight @ cost) * (1.0 + 10.0 * memory.left)
            if price < least:
                best, least = tried, price
            helper = int((rates @ memory.late**6).argmax())
            weight *= 1.0 - _BOOST
            weight[helper] += _BOOST
        return best
