"""The job of drawing processes: a scene's pictures as files, or as pixels; and a process that draws beside a program.

pybullet is imported with the first scene, in the worker: it writes its banner to standard output from C code, which
workers keep apart from their results.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw, ImageFont

from scenegen.looks.camera import Camera, Floats
from scenegen.looks.look import Look
from scenegen.looks.stage import PictureSetup, places_of, stage_of
from scenegen.looks.textures import Textures
from scenegen.needs import need
from scenegen.pictures.render.files import FIRST_ID, Model, Picture, PictureOptions, RenderedView, check_request, encode
from scenegen.processes.pool import Pool
from scenegen.scenes.data import SceneFile

if TYPE_CHECKING:
    from scenegen.pictures.render.painter import Painter


INK, PAPER = (38, 40, 44), (255, 255, 255)
LEAST, SHARE = 10, 32  # minimum font size in pixels, and the height of a picture in lines


def write_names(color: Picture, stage: PictureSetup, camera: Camera, places: Floats) -> Picture:
    """A picture (h, w, 3 or 4) with the label of every object that has one, above it; places are (objects, 4)."""
    labels = [(thing, place) for thing, place in zip(stage.things, places, strict=True) if thing.label]
    if not labels:
        return color
    image = Image.fromarray(color)
    draw = ImageDraw.Draw(image)
    size = max(LEAST, camera.size[1] // SHARE)
    font = ImageFont.load_default(size=size)
    for thing, (x, y, _, z) in labels:
        if np.isnan(x):  # it is not there
            continue
        top = (x, y, z + thing.shape.height)
        reach = max(thing.shape.footprint.extent) / 2.0
        at, beyond = camera.project([top, (x, y + reach, top[2])])
        if not _is_inside([at, beyond], camera.size):
            continue
        spot = float(at[0]), float(min(at[1], beyond[1])) - 0.25 * size
        draw.text(spot, thing.label, INK, font, anchor="ms", stroke_width=max(1, size // 6), stroke_fill=PAPER)
    return np.asarray(image)


def _is_inside(points: Sequence[Floats], size: tuple[int, int]) -> bool:
    return all(bool((point >= 0.0).all() and (point < size).all()) for point in points)


Places = npt.NDArray[np.float64]  # (objects, 4): x, y, theta, height


class RenderJob:
    """A scene's `places` and its look, if it has one -> (view, ending) -> file, as `options` lists them."""

    def __init__(
        self,
        stage: PictureSetup,
        options: PictureOptions,
        models: Sequence[Model | None] = (),
        textures: Textures | None = None,
    ) -> None:
        self.stage, self.options, self.models, self.textures = stage, options, tuple(models), textures
        self._painter: Painter | None = None  # of the drawing process

    def __call__(self, item: tuple[Places, Look | None]) -> dict[tuple[str, str], bytes]:
        shots = self._shots(*item)
        files: dict[tuple[str, str], bytes] = {}
        for view in self.options.views:
            made = encode(shots[view], self.options, FIRST_ID + len(self.stage.things))
            files |= {(view, ending): data for ending, data in zip(self.options.endings, made, strict=True)}
        return files

    def _ready(self, look: Look | None = None) -> Painter:
        if self._painter is None:
            from scenegen.pictures.render.painter import Painter

            self._painter = Painter(self.stage, self.options, look, self.models, self.textures)
            self._painter.__enter__()  # until the process ends
        elif look is not None:
            self._painter.dress(look)
        return self._painter

    def _shots(self, places: Places, look: Look | None = None) -> dict[str, RenderedView]:
        painter = self._ready(look)
        shots = painter.paint(places)
        if self.options.names:
            for view in self.options.views:
                color = write_names(shots[view].color, self.stage, painter.camera(view), places)
                shots[view] = replace(shots[view], color=color)
        return shots


class DrawPixels(RenderJob):
    """A scene's `places` -> its one view as (height, width, 3) bytes."""

    def __call__(self, places: Places) -> npt.NDArray[np.uint8]:  # type: ignore[override]  # pixels
        (view,) = self.options.views
        return np.ascontiguousarray(self._shots(places)[view].color[..., :3], dtype=np.uint8)


__all__ = ["LiveRenderer", "RenderJob", "check_request"]


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
