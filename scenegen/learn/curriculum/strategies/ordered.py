"""Plain training data, sorted by phi, from easy to hard: the paper finds that this suffices on small tables.

One scene after another, `scenes` of them in a pass, evenly over the difficulties and sorted up to one of `levels` (a
source needs long to find scenes for bands that are requested only once). The next pass begins with the easiest again,
like the epochs of a data set (Bengio, Louradour, Collobert and Weston, Curriculum learning, ICML 2009). Several labels:
sorted by the hardest label (base.py).
"""

from __future__ import annotations

from pydantic import Field

from scenegen.learn.curriculum.strategies.base import Base, Levels, Settings
from scenegen.learn.curriculum.tasks import Outcome, PhiBox


class OrderedSettings(Settings):
    """`scenes` of a pass, in `levels` levels, but at most one level per scene."""

    scenes: int = Field(default=1000, ge=1, le=10**12)
    levels: int = Field(default=50, ge=1, le=1000)


class Ordered(Base):
    settings_class = OrderedSettings
    settings: OrderedSettings
    memory = ("tasks",)
    tasks: int
    """How many were drawn so far."""

    def begin(self) -> None:
        self.tasks = 0
        self.levels = Levels(self.axis, min(self.settings.levels, self.settings.scenes))

    def next_task(self) -> PhiBox:
        place = self.tasks % self.settings.scenes
        self.tasks += 1
        return self.levels.box(place * self.levels.count // self.settings.scenes, self.rng)

    def report(self, outcome: Outcome) -> None:
        """Does nothing: outcomes do not change the order."""

    def log(self) -> dict[str, float]:
        return {"difficulty": self.tasks % self.settings.scenes / self.settings.scenes}
