"""The rewards."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np
import numpy.typing as npt

from scenegen.curriculum.errors import one_of

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
Kind = Literal["sparse", "dense"]

SATISFIED, OFF = 10.0, -10.0  # the paper's, section V


class Reward:
    """`sparse`: 10 if the goal is satisfied, -10 if an object left the table, 0 otherwise, as in the paper. `dense`
    adds the increase of the goal's phi, in steps. Without discount these increases sum up to phi of the last scene
    minus that of the first. (This is a potential in the sense of Ng, Harada and Russell, 1999, except that the last
    scene's phi is rewarded too: an end well inside the goal earns more than one at its edge.) Raises
    gymnasium.error.Error for another kind."""

    def __init__(self, kind: str, step: float) -> None:
        one_of("reward", kind, get_args(Kind))
        self._scale = 1.0 / step if kind == "dense" else 0.0

    def __call__(self, before: Array, after: Array, success: Mask, off: Mask) -> Array:
        """(B,) phi of the goal before and after a step, and how it ended -> (B,)."""
        paid = SATISFIED * success + OFF * off
        return paid + self._scale * (after - before) if self._scale else paid
