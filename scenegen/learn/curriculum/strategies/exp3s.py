"""A bandit over cells, rewarded with the student's progress (Graves, Bellemare, Menick, Munos and Kavukcuoglu,
Automated curriculum learning for neural networks, ICML 2017; Exp3.S: Auer, Cesa-Bianchi, Freund and Schapire, SIAM
Journal on Computing 2002).

The source measures progress by the decrease of the learner's loss, which an outcome does not have; here progress is the
distance between a fast and a slow running mean of the cell's success. As in the source, it is scaled to [-1, 1] by the
20 % and 80 % quantiles of recent rewards and divided by the cell's probability, and some weight flows from every cell
to the others, so that a cell can always come back.

Several labels: a grid of cells over all of them.
"""

from __future__ import annotations

import math

import numpy as np
from pydantic import Field

from scenegen.learn.curriculum.strategies.base import Base, DifficultyGrid, Floats, Ints, Settings, drawn, hear
from scenegen.learn.curriculum.tasks import Outcome, PhiBox

REWARDS = 200  # recent rewards, which determine the scale
RESCALED = 20  # outcomes between two updates of the scale
LONGEST = 1.0  # maximum step of a log weight, which a small probability would make huge
FASTER = 3  # time constants of the two running means
LEAST_FLOW = 1e-3  # share of the weight that flows, per outcome; with the source's 1 / t changes would stop


class Exp3SSettings(Settings):
    """`cells` along each label (None: 16, or fewer where there are several); `eta`: step of the log weights; `share` of
    scenes from any cell; `window`: outcomes of the slow mean."""

    cells: int | None = Field(default=None, ge=1, le=1000)
    eta: float = Field(default=0.1, gt=0.0, le=10.0)
    share: float = Field(default=0.1, gt=0.0, le=1.0)
    window: int = Field(default=30, ge=2 * FASTER, le=100_000)


class Exp3S(Base):
    settings_class = Exp3SSettings
    settings: Exp3SSettings
    memory = (*DifficultyGrid.memory, "weight", "slow", "fast", "heard", "rewards", "told", "low", "high")
    weight: Floats
    """Sums to 1."""
    slow: Floats
    fast: Floats
    heard: Ints
    rewards: Floats
    told: int
    low: float
    high: float

    def begin(self) -> None:
        self.cells = DifficultyGrid(self.axis, self.settings.cells)
        count = self.cells.count
        self.weight = np.full(count, 1.0 / count)
        self.slow, self.fast = np.full(count, 0.5), np.full(count, 0.5)
        self.heard, self.rewards = np.zeros(count, dtype=np.int64), np.zeros(REWARDS)
        self.told, self.low, self.high = 0, 0.0, 0.0

    def next_task(self) -> PhiBox:
        by_chance = self.rng.random() < self.settings.share
        cell = self.cells.any(self.rng) if by_chance else drawn(self.weight * self.cells.open, self.rng)
        return self.cells.box(cell)

    def report(self, outcome: Outcome) -> None:
        cell = self.cells.of(outcome)
        if cell is None:
            return
        score, span, count = float(outcome.success), self.settings.window, self.cells.count
        self.slow[cell] += (score - self.slow[cell]) / min(int(self.heard[cell]) + 2, span)
        hear(self.fast, self.heard, cell, score, span // FASTER)
        reward = self._scaled(abs(float(self.fast[cell] - self.slow[cell])))
        chance = (1.0 - self.settings.share) * self.weight[cell] + self.settings.share / count  # if all cells were open
        self.weight[cell] *= math.exp(min(max(self.settings.eta * reward / chance, -LONGEST), LONGEST))
        flow = max(1.0 / self.told, LEAST_FLOW)
        self.weight = (1.0 - flow) / self.weight.sum() * self.weight + flow / count

    def _scaled(self, reward: float) -> float:
        self.rewards[self.told % REWARDS] = reward
        self.told += 1
        if self.told % RESCALED == 0:
            recent = np.sort(self.rewards[: min(self.told, REWARDS)])
            self.low, self.high = float(recent[len(recent) // 5]), float(recent[len(recent) * 4 // 5])
        if self.high <= self.low:
            return 0.0
        return min(max(2.0 * (reward - self.low) / (self.high - self.low) - 1.0, -1.0), 1.0)

    def log(self) -> dict[str, float]:
        return {"likeliest": int(self.weight.argmax()), "weight": float(self.weight.max())}
