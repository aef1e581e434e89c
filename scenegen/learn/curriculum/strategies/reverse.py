"""Outwards from the goal: starts near those that succeed sometimes (Florensa, Held, Wulfmeier, Zhang and Abbeel,
Reverse curriculum generation for reinforcement learning, CoRL 2017).

In the source, good starts are states whose success rate lies between two bounds; new ones are found by short random
walks from them, and some old ones are replayed. Here a start is a level of difficulty, a walk is a normal step along
the axis, and an old start is a level that succeeds more often than the upper bound. If no level is good, the walk
starts from the hardest old one, at first from the goal. Not in the source: a share of scenes from the whole range,
without which the strategy could not cross a gap without scenes that is wider than the walks.

Several labels: levels are shells around the easy corner (base.py).
"""

from __future__ import annotations

import numpy as np
from pydantic import Field, model_validator

from scenegen.learn.curriculum.strategies.base import Base, Floats, Ints, Levels, Settings, any_of, hear
from scenegen.learn.curriculum.tasks import Outcome, PhiBox

ENOUGH = 3  # outcomes of a level before its rate is believed


class ReverseSettings(Settings):
    """`levels` of the range; `low` and `high` success rate of a good level, over about `window` outcomes; `walk`: a
    walk's standard deviation in levels; `replay`: share of old starts, `share` of scenes from the whole range."""

    levels: int = Field(default=20, ge=1, le=1000)
    low: float = Field(default=0.1, ge=0.0, le=1.0)
    high: float = Field(default=0.9, ge=0.0, le=1.0)
    window: int = Field(default=15, ge=2, le=100_000)
    walk: float = Field(default=1.0, gt=0.0, le=1000.0)
    replay: float = Field(default=0.2, ge=0.0, le=1.0)
    share: float = Field(default=0.1, ge=0.0, le=1.0)

    @model_validator(mode="after")
    def _in_order(self) -> ReverseSettings:
        if self.low >= self.high:
            raise ValueError(f"low {self.low} is not below high {self.high}")
        if self.replay + self.share > 1.0:
            raise ValueError("replay and share make more than all scenes")
        return self


class Reverse(Base):
    settings_class = ReverseSettings
    settings: ReverseSettings
    memory = ("rate", "heard", "good", "old")
    rate: Floats
    heard: Ints
    good: list[int]
    old: list[int]

    def begin(self) -> None:
        self.levels = Levels(self.axis, self.settings.levels)
        self.rate = np.full(self.levels.count, 0.5)
        self.heard = np.zeros(self.levels.count, dtype=np.int64)
        self.good, self.old = [], []

    def next_task(self) -> PhiBox:
        draw = self.rng.random() - self.settings.share
        if draw < 0.0:
            return self.space
        if draw < self.settings.replay and self.old:
            return self.levels.box(self.old[any_of(len(self.old), self.rng)], self.rng)
        start = self.good[any_of(len(self.good), self.rng)] if self.good else max(self.old, default=0)
        level = round(start + self.settings.walk * self.rng.standard_normal())
        return self.levels.box(min(max(level, 0), self.levels.count - 1), self.rng)

    def report(self, outcome: Outcome) -> None:
        level = self.levels.of(outcome)
        if level is None:
            return
        hear(self.rate, self.heard, level, float(outcome.success), self.settings.window)
        if self.heard[level] < ENOUGH:
            return
        for levels in (self.good, self.old):
            if level in levels:
                levels.remove(level)
        rate = self.rate[level]
        if rate > self.settings.high:
            self.old.append(level)
        elif rate >= self.settings.low:
            self.good.append(level)

    def log(self) -> dict[str, float]:
        return {"good": len(self.good), "old": len(self.old), "furthest": max(self.good + self.old, default=0)}
