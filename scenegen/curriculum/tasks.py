"""What a strategy chooses, and what it hears of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol


@dataclass(frozen=True, slots=True)
class PhiBox:
    """A task: scenes whose phi lies in a closed box. `low` and `high` have one entry per label, in the spec's order."""

    low: tuple[float, ...]
    high: tuple[float, ...]

    def holds(self, phi: tuple[float, ...]) -> bool:
        """Whether phi, one value per label, lies in the box, its faces included."""
        return all(low <= value <= high for low, value, high in zip(self.low, phi, self.high, strict=True))


@dataclass(frozen=True, slots=True)
class Outcome:
    """How an episode went: the box it was asked for, phi of the scene it began with (one value per label), whether
    the spec was satisfied at its end, the sum of its rewards, and its steps."""

    task: PhiBox
    phi: tuple[float, ...]
    success: bool
    total: float
    steps: int


class Strategy(Protocol):
    """A curriculum, usable with any learner: ask for a task, play an episode, report it."""

    def next_task(self) -> PhiBox:
        """The phi of the next episode's first scene."""
        ...

    def report(self, outcome: Outcome) -> None:
        """Hear how an episode went. Several may run at once, so outcomes need not come in the order of the tasks."""
        ...
