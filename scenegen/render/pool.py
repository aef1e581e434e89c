"""Draws pictures on several processes, in scene order."""

from __future__ import annotations

from collections.abc import Generator, Sequence

import numpy as np
import numpy.typing as npt

from scenegen.looks.look import Look
from scenegen.looks.textures import Textures
from scenegen.needs import need
from scenegen.processes.pool import Pool
from scenegen.render.files import PictureOptions
from scenegen.render.models import Model
from scenegen.render.worker import Draw
from scenegen.scene.stage import Stage, places_of


def draw(
    stage: Stage,
    poses: npt.NDArray[np.float64],
    options: PictureOptions,
    workers: int,
    looks: Sequence[Look] | None = None,
    models: Sequence[Model | None] = (),
    textures: Textures | None = None,
) -> Generator[dict[tuple[str, str], bytes], None, None]:
    """(view, ending) -> file of every scene, in order; `poses` is (scenes, objects, 3), `looks` has one for each scene,
    with their `textures`, `models` what is drawn of each object instead of its shape, if anything.
    The same bytes for any `workers`.

    Close the generator to end the processes early. Raises ScenegenError if one of them fails, RequestError if pybullet
    is not installed.
    """
    need("pybullet", "to draw pictures")
    places = places_of(stage, poses)
    stage, origin = stage.near()
    places[..., :2] -= origin
    given = [None] * len(places) if looks is None else [look.moved(*origin) for look in looks]
    job = Draw(stage, options, models, textures)
    with Pool(job, workers, what="a process that draws", unit="scene", spare="a smaller size or fewer workers") as pool:
        yield from pool.map(list(zip(places, given, strict=True)))
