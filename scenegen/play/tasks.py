"""What strategies and environments say to each other: tasks and outcomes; and the name of the environment."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol, TypeGuard

ENVIRONMENT_ID = "scenegen/TableTop-v0"


@dataclass(frozen=True, slots=True)
class PhiBox:
    """A task: scenes whose phi lies in a closed box. `low` and `high` have one entry per label, in the spec's order."""

    low: tuple[float, ...]
    high: tuple[float, ...]

    def holds(self, phi: tuple[float, ...]) -> bool:
        """Whether phi, one value per label, lies in the closed box."""
        return all(low <= value <= high for low, value, high in zip(self.low, phi, self.high, strict=True))


@dataclass(frozen=True, slots=True)
class Outcome:
    """The outcome of an episode: its task, phi of its first scene (one value per label), whether the spec was satisfied
    at its end, the sum of its rewards, and its number of steps."""

    task: PhiBox
    phi: tuple[float, ...]
    success: bool
    total: float
    steps: int

    def info(self) -> dict[str, Any]:
        """The content of `info["outcome"]`, in plain numbers."""
        return {
            "low": list(self.task.low),
            "high": list(self.task.high),
            "phi": list(self.phi),
            "success": self.success,
            "total": self.total,
            "steps": self.steps,
        }


class Strategy(Protocol):
    """A strategy, usable with any learner: get a task, run an episode, report the outcome."""

    def next_task(self) -> PhiBox:
        """The phi of the next episode's first scene."""
        ...

    def report(self, outcome: Outcome) -> None:
        """Takes the outcome of an episode. Several episodes may run at once, so outcomes need not come in the order of
        the tasks."""
        ...


def is_strategy(value: object) -> TypeGuard[Strategy]:
    return all(callable(getattr(value, call, None)) for call in ("next_task", "report"))
