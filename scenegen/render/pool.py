"""Processes that draw, and their pictures in scene order."""

from __future__ import annotations

import dataclasses
from collections.abc import Generator

import numpy as np
import numpy.typing as npt

from scenegen.needs import need
from scenegen.render.files import Wanted
from scenegen.render.process import Process
from scenegen.render.stage import Stage, places_of
from scenegen.render.worker import LENGTH


def draw(
    stage: Stage, poses: npt.NDArray[np.float64], wanted: Wanted, workers: int
) -> Generator[dict[tuple[str, str], bytes], None, None]:
    """(view, ending) -> file of every scene, in order; `poses` is (scenes, objects, 3). The same bytes for any
    `workers`.

    Close the generator to end the processes early. Raises ScenegenError where one of them fails, RequestError where
    pybullet is not installed.
    """
    need("pybullet", "to draw pictures")
    places = places_of(stage, poses)
    stage, origin = stage.near()
    places[..., :2] -= origin
    common = {"stage": dataclasses.asdict(stage), "wanted": dataclasses.asdict(wanted)}
    names = [(view, ending) for view in wanted.views for ending in wanted.endings]
    crew: list[Process] = []
    try:
        for number in range(workers):
            job = {**common, "places": places[number::workers].tolist()}
            crew.append(Process("scenegen.render.worker", job, "draws", "a smaller size or fewer workers"))
        for scene in range(len(places)):
            worker = crew[scene % workers]
            yield {name: worker.read(LENGTH.unpack(worker.read(LENGTH.size))[0]) for name in names}
    finally:
        for worker in crew:
            worker.end()
