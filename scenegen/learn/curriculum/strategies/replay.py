"""Prioritised level replay: cells with surprising outcomes, and cells that were not used recently (Jiang, Grefenstette
and Rocktäschel, Prioritized level replay, ICML 2021).

In the source, a level is one seed of a generator, and its score is the mean absolute error of the value function over
an episode. Here a level is a cell of phi, and no value function is used: the cell keeps a running mean of its episodes'
worth, and its score is the running mean of an episode's distance from that mean. So randomness within a cell counts as
a surprise for ever, while the learner's own errors would decrease. An episode is worth its success, or with
`worth="total"` its total reward; then falls from the table count most, and the edge of the table gets more episodes
than the way there. Only the rank of scores matters, so the scale of rewards does not. As in the source, cells that were
not used yet are drawn in proportion to their number.

Several labels: a grid of cells over all of them.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from pydantic import Field

from scenegen.learn.curriculum.strategies.base import Base, DifficultyGrid, Floats, Ints, Settings, drawn, hear
from scenegen.learn.curriculum.tasks import Outcome, PhiBox


class ReplaySettings(Settings):
    """`cells` along each label (None: 16, or fewer for several labels); `temperature`: weight is rank^(-1 /
    temperature); `staleness`: share of draws by how long ago a cell was chosen; means over about `window` outcomes;
    `worth` of an episode: its success or its total reward."""

    cells: int | None = Field(default=None, ge=1, le=1000)
    temperature: float = Field(default=0.5, gt=0.0, le=1000.0)
    staleness: float = Field(default=0.2, gt=0.0, le=1.0)
    window: int = Field(default=15, ge=2, le=100_000)
    worth: Literal["success", "total"] = "success"


class Replay(Base):
    settings_class = ReplaySettings
    settings: ReplaySettings
    memory = (*DifficultyGrid.memory, "mean", "score", "heard", "last", "tasks")
    mean: Floats
    score: Floats
    heard: Ints
    last: Ints
    """When a cell was last chosen, as a count of tasks; -1: never."""
    tasks: int
    """How many were drawn so far."""

    def begin(self) -> None:
        self.cells = DifficultyGrid(self.axis, self.settings.cells)
        count = self.cells.count
        self.mean, self.score = np.zeros(count), np.zeros(count)
        self.heard, self.last, self.tasks = np.zeros(count, dtype=np.int64), np.full(count, -1), 0
        self._by_rank = (1.0 + np.arange(count)) ** (-1.0 / self.settings.temperature)

    def next_task(self) -> PhiBox:
        cell = self._cell()
        self.last[cell] = self.tasks
        self.tasks += 1
        return self.cells.box(cell)

    def _cell(self) -> int:
        count, there = self.cells.count, self.cells.open
        if self.tasks < 100 * count:  # after so many draws none is left, with probability 1 - e^-100
            new = np.flatnonzero(self.last < 0)
            draw = self.rng.random() * count
            if draw < len(new):
                return int(new[int(draw)])
        if self.rng.random() < self.settings.staleness:
            return drawn((self.tasks - self.last) * there, self.rng)
        place = drawn(self._by_rank[: int(there.sum())], self.rng)
        # the cell of that rank, closed ones last; sorting all of them for each draw would cost more
        return int(np.argpartition(1.0 - there - self.score * there, place)[place])

    def report(self, outcome: Outcome) -> None:
        cell = self.cells.of(outcome)
        worth = float(outcome.success) if self.settings.worth == "success" else outcome.total
        if cell is None or not math.isfinite(worth):
            return
        surprise = abs(worth - self.mean[cell]) if self.heard[cell] else 0.0
        span = self.settings.window
        self.mean[cell] += (worth - self.mean[cell]) / min(int(self.heard[cell]) + 1, span)
        hear(self.score, self.heard, cell, surprise, span)

    def log(self) -> dict[str, float]:
        return {"seen": int((self.last >= 0).sum()), "surprise": float(self.score.mean())}
