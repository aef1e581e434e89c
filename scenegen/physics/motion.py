"""How far an object may move and still count as settled."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

FARTHEST = 0.01  # metres, of the centre of mass
LARGEST_TURN = 5.0  # degrees, about any axis


def within(shift: Floats, turn: Floats) -> npt.NDArray[np.bool_]:
    """Which motions, in metres and degrees, are within both limits; NaN never is."""
    return np.asarray((shift <= FARTHEST) & (turn <= LARGEST_TURN))
