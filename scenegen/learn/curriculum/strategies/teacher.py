"""A teacher that chooses tasks on which the student's score changes most (Matiisen, Oliver, Cohen and Schulman,
Teacher-student curriculum learning, 2017: the `window` algorithm).

Each cell keeps its last outcomes; the absolute slope of a line through them, in success per outcome, is the cell's
progress. The cell with the greatest progress is chosen, sometimes a random one. Falling counts like rising: what the
learner forgets should be practised again. In the source the line is a function of time; here of the cell's own
outcomes, so that the age of outcomes does not matter for rarely chosen cells. Cells without enough outcomes come first:
their slope is unknown.

Several labels: a grid of cells over all of them.
"""

from __future__ import annotations

import numpy as np
from pydantic import Field

from scenegen.learn.curriculum.strategies.base import Base, DifficultyGrid, Floats, Ints, Settings, any_of
from scenegen.learn.curriculum.tasks import Outcome, PhiBox

UNKNOWN = 1.0  # more than any slope over three outcomes or more
DIGITS = 9  # rounding of a slope: ties are broken at random, not by rounding errors


class TeacherSettings(Settings):
    """`cells` along each label (None: 16, or fewer for several labels); `window`: number of outcomes for a slope;
    `share` of scenes from any cell."""

    cells: int | None = Field(default=None, ge=1, le=1000)
    window: int = Field(default=20, ge=3, le=1000)
    share: float = Field(default=0.2, gt=0.0, le=1.0)


class Teacher(Base):
    settings_class = TeacherSettings
    settings: TeacherSettings
    memory = (*DifficultyGrid.memory, "score", "heard", "progress")
    score: Floats
    """(cells, window): a ring of each cell's last outcomes."""
    heard: Ints
    progress: Floats

    def begin(self) -> None:
        self.cells = DifficultyGrid(self.axis, self.settings.cells)
        count, window = self.cells.count, self.settings.window
        self.score = np.zeros((count, window))
        self.heard = np.zeros(count, dtype=np.int64)
        self.progress = np.full(count, UNKNOWN)
        time = np.arange(window) - (window - 1) / 2
        # row k: weights of the slope when the oldest outcome stands at k in the ring
        self._slope = np.array([np.roll(time, k) for k in range(window)]) / (time @ time)

    def next_task(self) -> PhiBox:
        if self.rng.random() < self.settings.share:
            return self.cells.box(self.cells.any(self.rng))
        progress = np.where(self.cells.open, self.progress, -1.0)
        best = np.flatnonzero(progress == progress.max())
        return self.cells.box(int(best[any_of(len(best), self.rng)]))

    def report(self, outcome: Outcome) -> None:
        cell = self.cells.of(outcome)
        if cell is None:
            return
        window, heard = self.settings.window, int(self.heard[cell])
        self.score[cell, heard % window] = outcome.success
        self.heard[cell] = heard + 1
        if heard + 1 >= window:
            slope = float(self._slope[(heard + 1) % window] @ self.score[cell])
            self.progress[cell] = round(abs(slope), DIGITS)

    def log(self) -> dict[str, float]:
        known = self.progress[self.progress < UNKNOWN]
        return {"progress": float(known.max(initial=0.0)), "rate": float(self.score.mean())}
