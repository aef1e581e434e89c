"""What a camera brings home, and the types of its arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Image = npt.NDArray[np.float32]
Picture = npt.NDArray[np.uint8]
Mask = npt.NDArray[np.uint16]
Rows = npt.NDArray[np.intp] | slice  # some of the pixels of a picture, counted row by row

GROUND, TABLE, FIRST = 0, 1, 2  # in masks: nothing but ground, the table, the first object


@dataclass(frozen=True, slots=True)
class Shot:
    """One picture. `color` (h, w, 3) is of RGB, or (h, w, 4) with how much hides the background; `depth` (h, w) is the
    distance along the view direction at the middle of a pixel, in metres; `mask` (h, w) says what is seen there."""

    color: Picture
    depth: Image
    mask: Mask
