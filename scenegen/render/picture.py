"""A camera's picture, and the types of its arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Image = npt.NDArray[np.float32]
Picture = npt.NDArray[np.uint8]
Mask = npt.NDArray[np.uint16]
Rows = npt.NDArray[np.intp] | slice  # indices of pixels of a picture, row by row

GROUND, TABLE, FIRST = 0, 1, 2  # in masks: the ground, the table, the first object


@dataclass(frozen=True, slots=True)
class Shot:
    """One picture. `color` is RGB (h, w, 3), or RGBA (h, w, 4); `depth` (h, w) is the distance along the view direction
    at the centre of a pixel, in metres; `mask` (h, w) has the number of the visible object."""

    color: Picture
    depth: Image
    mask: Mask
