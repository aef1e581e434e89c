"""Difficulty that grows with the number of episodes, independently of the learner (the paper's Fig. 5, `linear`).

The range is cut into levels; over `episodes` episodes one level after another is used equally often, from easy to hard.
After that the strategy is `uniform`. With `grow` the easier levels stay in: the range grows, instead of a band that
moves. Several labels: levels are shells around the easy corner (base.py).
"""

from __future__ import annotations

from pydantic import Field

from scenegen.learn.curriculum.strategies.base import Base, Levels, Settings
from scenegen.learn.curriculum.tasks import Outcome, PhiBox


class LinearSettings(Settings):
    """`episodes` until the last level is over, `levels` of equal length; `grow`: keep the easier ones."""

    episodes: int = Field(default=10_000, ge=1, le=10**12)
    levels: int = Field(default=20, ge=1, le=1000)
    grow: bool = False


class Linear(Base):
    settings_class = LinearSettings
    settings: LinearSettings
    memory = ("tasks",)
    tasks: int
    """How many were drawn so far."""

    def begin(self) -> None:
        self.tasks = 0
        self.levels = Levels(self.axis, self.settings.levels)
        grown = [(level + 1) / self.levels.count for level in range(self.levels.count)]
        self._grown = [self.axis.shell(0.0, far)[0][1] for far in grown]

    @property
    def level(self) -> int:
        """The current level; after the last one, the number of levels."""
        return min(self.tasks * self.levels.count // self.settings.episodes, self.levels.count)

    def next_task(self) -> PhiBox:
        level = self.level
        self.tasks += 1
        if level == self.levels.count:
            return self.space
        return self._grown[level] if self.settings.grow else self.levels.box(level, self.rng)

    def report(self, outcome: Outcome) -> None:
        """Does nothing: the number of episodes determines the level."""

    def log(self) -> dict[str, float]:
        return {"level": self.level}
