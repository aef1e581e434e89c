"""The job of drawing processes: a scene's pictures as files, or as pixels.

pybullet is imported with the first scene, in the worker: it writes its banner to standard output from C code, which
workers keep apart from their results.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from scenegen.looks.look import Look
from scenegen.looks.textures import Textures
from scenegen.render.files import PictureOptions, encode
from scenegen.render.models import Model
from scenegen.render.names import write_names
from scenegen.render.picture import FIRST, Shot
from scenegen.scene.stage import Stage

if TYPE_CHECKING:
    from scenegen.render.painter import Painter

Places = npt.NDArray[np.float64]  # (objects, 4): x, y, theta, height


class Draw:
    """A scene's `places` and its look, if it has one -> (view, ending) -> file, as `options` lists them."""

    def __init__(
        self,
        stage: Stage,
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
            made = encode(shots[view], self.options, FIRST + len(self.stage.things))
            files |= {(view, ending): data for ending, data in zip(self.options.endings, made, strict=True)}
        return files

    def _ready(self, look: Look | None = None) -> Painter:
        if self._painter is None:
            from scenegen.render.painter import Painter

            options = self.options
            self._painter = Painter(
                self.stage,
                options.views,
                options.size,
                transparent=options.transparent,
                renderer=options.renderer,
                look=look,
                models=self.models,
                textures=self.textures,
            )
            self._painter.__enter__()  # until the process ends
        elif look is not None:
            self._painter.dress(look)
        return self._painter

    def _shots(self, places: Places, look: Look | None = None) -> dict[str, Shot]:
        painter = self._ready(look)
        shots = painter.paint(places)
        if self.options.names:
            for view in self.options.views:
                color = write_names(shots[view].color, self.stage, painter.camera(view), places)
                shots[view] = replace(shots[view], color=color)
        return shots


class DrawPixels(Draw):
    """A scene's `places` -> its one view as (height, width, 3) bytes."""

    def __call__(self, places: Places) -> npt.NDArray[np.uint8]:  # type: ignore[override]  # pixels
        (view,) = self.options.views
        return np.ascontiguousarray(self._shots(places)[view].color[..., :3], dtype=np.uint8)
