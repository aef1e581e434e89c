"""Pictures while a program runs: the process that draws stays, and gets a scene at a time."""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt

from scenegen.needs import need
from scenegen.render.camera import VIEWS
from scenegen.render.live_worker import REQUEST
from scenegen.render.process import Process
from scenegen.render.request import check_request
from scenegen.render.stage import places_of, stage_of
from scenegen.scene.data import SceneFile

__all__ = ["VIEWS", "Live", "check_request"]

Picture = npt.NDArray[np.uint8]


class Live:
    """Draws scenes of the objects and in the workspace of `file`, whose scenes the camera makes room for. The process
    starts with the first picture and runs until `close`. Raises RequestError where pybullet is not installed."""

    def __init__(self, file: SceneFile, view: str, size: tuple[int, int]) -> None:
        need("pybullet", "to draw pictures")
        self._stage, self._view, self._size = stage_of(file), view, size
        self._process: Process | None = None

    def draw(self, poses: npt.NDArray[np.float64]) -> Picture:
        """A scene (objects, 3) as (height, width, 3). Raises ScenegenError where the process fails."""
        if self._process is None:
            job = {"stage": dataclasses.asdict(self._stage), "view": self._view, "size": self._size}
            self._process = Process("scenegen.render.live_worker", job, "draws", "a smaller size")
        places = places_of(self._stage, poses[None])[0]
        self._process.send(REQUEST.pack(len(places)) + places.tobytes())
        width, height = self._size
        data = self._process.read(3 * width * height)
        return np.frombuffer(data, dtype=np.uint8).reshape(height, width, 3).copy()

    def close(self) -> None:
        """End the process."""
        if self._process is not None:
            self._process.end()
            self._process = None
