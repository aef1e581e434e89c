"""What a plan learns about moves."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass(slots=True)
class Tally:
    """How often each kind of move was tried and taken, in scenes; and walks by the power of two of their step, for each
    object."""

    tried: dict[str, float] = field(default_factory=dict)
    taken: dict[str, float] = field(default_factory=dict)
    steps: dict[int, Array] = field(default_factory=dict)

    def note(self, kind: str, tried: int, taken: int) -> None:
        self.tried[kind] = self.tried.get(kind, 0.0) + tried
        self.taken[kind] = self.taken.get(kind, 0.0) + taken

    def rate(self, kind: str) -> float | None:
        tried = self.tried.get(kind, 0.0)
        return self.taken[kind] / tried if tried else None
