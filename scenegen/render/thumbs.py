"""Pictures in memory, for figures that are composed of them."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Callable, Iterator

from PIL import Image

from scenegen.processes.process import cores
from scenegen.render.files import PictureOptions
from scenegen.render.pool import draw
from scenegen.scene.data import SceneFile
from scenegen.scene.stage import poses_of, stage_of


def pictures(
    file: SceneFile,
    view: str,
    size: tuple[int, int],
    *,
    distinct: bool = False,
    workers: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Iterator[Image.Image]:
    """The pictures of a file's scenes, one after the other, from one view. Raises what `render_scenes` raises."""
    stage, total = stage_of(file, distinct=distinct), len(file.scenes)
    options = PictureOptions((view,), size)
    with contextlib.closing(draw(stage, poses_of(file), options, min(workers or cores(), total))) as scenes:
        for number, files in enumerate(scenes, start=1):
            with Image.open(io.BytesIO(files[view, ".png"])) as picture:
                yield picture.convert("RGB")
            if progress is not None:
                progress(number, total)
