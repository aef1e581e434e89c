"""Ambient light from the sky: corners and the table beside objects get less of it, so that objects look placed on the
table.

Seen from above, the scene is a height map. Blurred over a distance `r`, it gives the height of a point's surroundings;
if these are `h` higher than the point, they hide the share h^2 / (h^2 + r^2) of the sky from it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scenegen.looks.camera import Camera, Floats, downwards
from scenegen.render.picture import Image, Rows
from scenegen.scene.stage import Stage

MAP = 512  # pixels along a side of the height map
SCALES = ((0.008, 0.40), (0.025, 0.35), (0.065, 0.25))  # distances in metres, and their weights
STEEPEST = 3.0  # surroundings higher than so many distances hide no more
BIAS = 0.001  # metres; lower steps hide nothing


def landscape_camera(stage: Stage) -> Camera:
    """The view from above, of the table and a little more."""
    x0, y0, x1, y1 = stage.table
    room = 0.02 * stage.side
    return downwards([x0 - room, y0 - room], [x1 + room, y1 + room], (MAP, MAP), (0.0, 0.0))


class Ambient:
    """How much of the sky is hidden from the points that a camera sees; the rays of its pixels are given as (h, w, 3)
    origins and directions."""

    def __init__(self, stage: Stage, origin: Floats, direction: Floats) -> None:
        self.camera = landscape_camera(stage)
        matrix = self.camera.projection @ self.camera.view
        pixels = np.array([MAP / 2.0, -MAP / 2.0])
        start = (origin @ matrix[:2, :3].T + matrix[:2, 3] + (1.0, -1.0)) * pixels
        step = (direction @ matrix[:2, :3].T) * pixels
        self._start, self._step = (part.reshape(-1, 2).astype(np.float32) for part in (start, step))
        self._z, self._dz = (part[..., 2].ravel().astype(np.float32) for part in (origin, direction))
        self._texel = 2.0 / float(matrix[1, 1]) / MAP, 2.0 / float(matrix[0, 0]) / MAP  # metres, by rows and columns

    def landscape(self, buffer: Image) -> Sequence[Image]:
        """The surroundings' height, blurred over every scale, from the height map's depth buffer."""
        heights = np.maximum(np.float32(-self.camera.view[2, 3]) - self.camera.depth(buffer), np.float32(0.0))
        blurred = []
        for reach, _ in SCALES:
            around = np.minimum(heights, np.float32(STEEPEST * reach))
            for axis in (0, 1, 0, 1):
                around = _blurred(around, max(1, round(reach / self._texel[axis] / 2.0)), axis)
            blurred.append(around.ravel())
        return blurred

    def hidden(self, landscape: Sequence[Image], depth: Image, where: Rows) -> Image:
        """(P,): the hidden share of the sky at depths (P,) of the pixels `where`, counted row by row."""
        at = np.clip(self._start[where] + depth[:, None] * self._step[where], 0, MAP - 1).astype(np.int32)
        index = at[:, 1] * MAP + at[:, 0]
        hidden = np.zeros(len(index), dtype=np.float32)
        z = self._z[where] + depth * self._dz[where] + np.float32(BIAS)
        for around, (reach, weight) in zip(landscape, SCALES, strict=True):
            rise = np.maximum(around.take(index) - z, np.float32(0.0))
            rise *= rise
            hidden += np.float32(weight) * rise / (rise + np.float32(reach * reach))
        return hidden


def _blurred(image: Image, half: int, axis: int) -> Image:
    """The mean of 2 half + 1 pixels along an axis; beyond the edges there is nothing."""
    size = image.shape[axis]
    room = [(half + 1, half) if k == axis else (0, 0) for k in (0, 1)]
    total = np.cumsum(np.pad(image, room), axis=axis, dtype=np.float64)
    ahead, behind = (slice(2 * half + 1, 2 * half + 1 + size), slice(0, size))
    moved = total[ahead] - total[behind] if axis == 0 else total[:, ahead] - total[:, behind]
    return (moved / (2 * half + 1)).astype(np.float32)
