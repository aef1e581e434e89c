"""How long a spec over time lasts, and in which steps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

MAX_STEPS = 100_000

Movers = Literal["one", "all"]  # what moves in a step


@dataclass(frozen=True, slots=True)
class Horizon:
    """The moments 0, 1, ... `steps` of a motion, `dt` seconds apart: steps + 1 of them."""

    steps: int
    dt: float

    @property
    def moments(self) -> int:
        return self.steps + 1

    @property
    def seconds(self) -> float:
        return self.steps * self.dt
