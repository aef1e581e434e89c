"""Processes that draw, and their pictures in scene order."""

from __future__ import annotations

import dataclasses
from collections.abc import Generator

import numpy as np
import numpy.typing as npt

from scenegen.render.process import Process
from scenegen.render.stage import Stage
from scenegen.render.worker import LENGTH


def draw(
    stage: Stage, poses: npt.NDArray[np.float64], views: tuple[str, ...], size: tuple[int, int], workers: int
) -> Generator[dict[str, bytes], None, None]:
    """View -> PNG file of every scene, in order; `poses` is (scenes, objects, 3). The same bytes for any `workers`.

    Close the generator to end the processes early. Raises ScenegenError where one of them fails.
    """
    common = {"stage": dataclasses.asdict(stage), "views": views, "size": size}
    crew: list[Process] = []
    try:
        for number in range(workers):
            job = {**common, "poses": poses[number::workers].tolist()}
            crew.append(Process("scenegen.render.worker", job, "draws", "a smaller size or fewer workers"))
        for scene in range(len(poses)):
            worker = crew[scene % workers]
            yield {view: worker.read(LENGTH.unpack(worker.read(LENGTH.size))[0]) for view in views}
    finally:
        for worker in crew:
            worker.end()
