"""Plain training data, sorted by phi, from easy to hard: the paper finds that this suffices on small tables.

One scene after another, `scenes` of them in a pass, evenly over the difficulties and sorted to within one of `levels`
(a source takes long to find scenes for bands that are asked for but once). Then the next pass begins with the easiest
again, as one goes through a data set in epochs (Bengio, Louradour, Collobert and Weston, Curriculum learning, ICML
2009). Several labels: sorted by the hardest label (axis.py).
"""

from __future__ import annotations

from pydantic import Field

from scenegen.curriculum.strategies.base import Base
from scenegen.curriculum.strategies.levels import Levels
from scenegen.curriculum.strategies.settings import Settings
from scenegen.curriculum.tasks import Outcome, PhiBox


class OrderedSettings(Settings):
    """`scenes` of a pass, in as many `levels`, or one level for each where there are fewer scenes."""

    scenes: int = Field(default=1000, ge=1, le=10**12)
    levels: int = Field(default=50, ge=1, le=1000)


class Ordered(Base):
    settings_class = OrderedSettings
    settings: OrderedSettings
    memory = ("asked",)
    asked: int

    def begin(self) -> None:
        self.asked = 0
        self.levels = Levels(self.axis, min(self.settings.levels, self.settings.scenes))

    def next_task(self) -> PhiBox:
        place = self.asked % self.settings.scenes
        self.asked += 1
        return self.levels.box(place * self.levels.count // self.settings.scenes, self.rng)

    def report(self, outcome: Outcome) -> None:
        """Nothing is learnt from it."""

    def log(self) -> dict[str, float]:
        return {"difficulty": self.asked % self.settings.scenes / self.settings.scenes}
