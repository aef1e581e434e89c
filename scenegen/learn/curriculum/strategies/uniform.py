"""The baseline: the whole range, at all times.

How scenes are spread in one wide box is left to their source. With `levels` above 1, every level of difficulty is
chosen equally often instead. Several labels: the whole box, or its shells.
"""

from __future__ import annotations

from pydantic import Field

from scenegen.learn.curriculum.strategies.base import Base, Levels, Settings, any_of
from scenegen.learn.curriculum.tasks import Outcome, PhiBox


class UniformSettings(Settings):
    """`levels`: of difficulty, each as likely as the others; 1 leaves the spread to the source."""

    levels: int = Field(default=1, ge=1, le=1000)


class Uniform(Base):
    settings_class = UniformSettings
    settings: UniformSettings

    def begin(self) -> None:
        self.levels = Levels(self.axis, self.settings.levels)

    def next_task(self) -> PhiBox:
        if self.levels.count == 1:
            return self.space
        return self.levels.box(any_of(self.levels.count, self.rng), self.rng)

    def report(self, outcome: Outcome) -> None:
        """Does nothing: outcomes do not change the tasks."""
