"""Pictures while a program runs: one process draws them all, a scene at a time."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scenegen.needs import need
from scenegen.processes.pool import Pool
from scenegen.scenes.data import SceneFile
from scenegen.scenes.stage import places_of, stage_of
from scenegen.show.looks.camera import VIEWS
from scenegen.show.render.files import PictureOptions, check_request
from scenegen.show.render.worker import DrawPixels, Places

__all__ = ["VIEWS", "LiveRenderer", "check_request"]

Picture = npt.NDArray[np.uint8]


class LiveRenderer:
    """Draws scenes of the objects and in the workspace of `file`; its scenes determine what the camera frames. The
    process starts with the first picture and runs until `close`. Raises RequestError if pybullet is not installed."""

    def __init__(self, file: SceneFile, view: str, size: tuple[int, int]) -> None:
        need("pybullet", "to draw pictures")
        self._stage = stage_of(file)
        self._job = DrawPixels(self._stage, PictureOptions((view,), size))
        self._pool: Pool[Places, Picture] | None = None

    def draw(self, poses: npt.NDArray[np.float64]) -> Picture:
        """A scene (objects, 3) as (height, width, 3). Raises ScenegenError if the process fails."""
        if self._pool is None:
            self._pool = Pool(self._job, 1, what="a process that draws", unit="scene", spare="a smaller size")
        (picture,) = self._pool.map(list(places_of(self._stage, poses[None])))
        return picture

    def close(self) -> None:
        """End the process."""
        if self._pool is not None:
            self._pool.close()
            self._pool = None
