"""Plain training data, sorted by phi, from easy to hard: the paper finds that this suffices on small tables.

One scene after another in steps of equal difficulty, `scenes` of them in a pass; then the next pass begins with the
easiest again, as one goes through a data set in epochs (Bengio, Louradour, Collobert and Weston, Curriculum learning,
ICML 2009). Several labels: sorted by the hardest label (axis.py).
"""

from __future__ import annotations

from pydantic import Field

from scenegen.curriculum.strategies.base import Base
from scenegen.curriculum.strategies.settings import Settings
from scenegen.curriculum.tasks import Outcome, PhiBox


class OrderedSettings(Settings):
    """`scenes`: of a pass."""

    scenes: int = Field(default=1000, ge=1, le=10_000_000)


class Ordered(Base):
    settings_class = OrderedSettings
    settings: OrderedSettings
    memory = ("asked",)
    asked: int

    def begin(self) -> None:
        self.asked = 0

    def next_task(self) -> PhiBox:
        scenes = self.settings.scenes
        place = self.asked % scenes
        self.asked += 1
        return self.axis.band(place / scenes, (place + 1) / scenes, self.rng)

    def report(self, outcome: Outcome) -> None:
        """Nothing is learnt from it."""

    def log(self) -> dict[str, float]:
        return {"difficulty": self.asked % self.settings.scenes / self.settings.scenes}
