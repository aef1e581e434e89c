"""Scenes with uncertain success: a scene teaches most if its probability p of success is neither 0 nor 1.

A cell's weight is exp(beta p (1 - p)) (Tzannetos, Ribeiro, Kamalaruban and Singla, Proximal curriculum for
reinforcement learning agents, TMLR 2023, with a best value of 1); Rutherford, Beukman, Willi, Lacerda, Hawes and
Foerster, No regrets, NeurIPS 2024, choose levels by the same score, and also draw a share of levels at random. p is a
running mean of success, not a learner's own value estimate, and begins at one half, so that untried cells are tried.

Several labels: a grid of cells over all of them.
"""

from __future__ import annotations

import math

import numpy as np
from pydantic import Field

from scenegen.learn.curriculum.strategies.base import Base, DifficultyGrid, Floats, Ints, Settings, drawn, hear
from scenegen.learn.curriculum.tasks import Outcome, PhiBox


class LearnabilitySettings(Settings):
    """`cells` along each label (None: 16, or fewer where there are several); `beta`: how strongly p (1 - p) counts; p
    over about `window` outcomes; `share` of scenes from any cell."""

    cells: int | None = Field(default=None, ge=1, le=1000)
    beta: float = Field(default=20.0, ge=0.0, le=1000.0)
    window: int = Field(default=15, ge=2, le=100_000)
    share: float = Field(default=0.1, gt=0.0, le=1.0)


class Learnability(Base):
    settings_class = LearnabilitySettings
    settings: LearnabilitySettings
    memory = (*DifficultyGrid.memory, "rate", "heard", "weight")
    rate: Floats
    heard: Ints
    weight: Floats

    def begin(self) -> None:
        self.cells = DifficultyGrid(self.axis, self.settings.cells)
        self.rate = np.full(self.cells.count, 0.5)
        self.heard = np.zeros(self.cells.count, dtype=np.int64)
        self.weight = np.ones(self.cells.count)  # relative to the largest weight: exp(beta (p (1 - p) - 1 / 4))

    def next_task(self) -> PhiBox:
        by_chance = self.rng.random() < self.settings.share
        cell = self.cells.any(self.rng) if by_chance else drawn(self.weight * self.cells.open, self.rng)
        return self.cells.box(cell)

    def report(self, outcome: Outcome) -> None:
        cell = self.cells.of(outcome)
        if cell is None:
            return
        hear(self.rate, self.heard, cell, float(outcome.success), self.settings.window)
        rate = float(self.rate[cell])
        self.weight[cell] = math.exp(self.settings.beta * (rate * (1.0 - rate) - 0.25))

    def log(self) -> dict[str, float]:
        return {"learnability": float((self.rate * (1.0 - self.rate)).mean()), "rate": float(self.rate.mean())}
