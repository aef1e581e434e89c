"""What a learner is paid."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np
import numpy.typing as npt

from scenegen.curriculum.faults import one_of

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
Kind = Literal["sparse", "dense"]

SATISFIED, OFF = 10.0, -10.0  # the paper's, section V


class Reward:
    """`sparse`: 10 where the goal is satisfied, -10 where an object left the table, 0 otherwise, as in the paper.
    `dense` adds what phi of the goal gained, in steps. Without discount these gains sum up to phi of the last scene
    less that of the first (a potential in the sense of Ng, Harada and Russell, 1999, but for the last scene, whose
    phi is paid, too: ending well inside the goal earns more than at its edge). Raises gymnasium.error.Error for
    another kind."""

    def __init__(self, kind: str, step: float) -> None:
        one_of("reward", kind, get_args(Kind))
        self._scale = 1.0 / step if kind == "dense" else 0.0

    def __call__(self, before: Array, after: Array, success: Mask, off: Mask) -> Array:
        """(B,) phi of the goal before and after a step, and how it ended -> (B,)."""
        paid = SATISFIED * success + OFF * off
        return paid + self._scale * (after - before) if self._scale else paid
