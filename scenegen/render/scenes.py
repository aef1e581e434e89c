"""Scene files -> PNG pictures and a contact sheet, without a display."""

from __future__ import annotations

import contextlib
import io
import shutil
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from PIL import Image

from scenegen.errors import DataError, Diagnostic, OutputError, RequestError, quoted, suggest
from scenegen.formats.files import ensure_folder, output_error, write_whole
from scenegen.render.camera import VIEWS
from scenegen.render.pool import draw
from scenegen.render.process import cores
from scenegen.render.sheet import SHOWN, contact_sheet, thumbnail_size
from scenegen.render.stage import poses_of, stage_of
from scenegen.scene.data import SceneFile

SHEET = "contact_sheet.png"
SMALLEST, LARGEST = 16, 4096  # pixels along a side of a picture


@dataclass(frozen=True, slots=True)
class Rendered:
    """What was written: the pictures in scene order (all views of the first scene first), and the contact sheet."""

    pictures: tuple[Path, ...]
    sheet: Path


def render_scenes(
    file: SceneFile,
    out: Path,
    *,
    views: tuple[str, ...] = VIEWS,
    size: tuple[int, int] = (640, 480),
    workers: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Rendered:
    """Draw every scene of a file into the folder `out` (made if its parent is there).

    Files are scene_0001_top.png, scene_0001_perspective.png, ..., contact_sheet.png. `views` are of "top" (straight
    down, x to the right, y up) and "perspective" (from the viewer's side, -y, looking towards +y); `size` is (width,
    height) in pixels; `workers` processes draw, by default one per core; the bytes do not depend on it. `progress` is
    called with scenes done and scenes in all. Files appear whole, and those of this call are removed if it fails.

    Raises RequestError for a wrong view, size or number of workers, DataError for a file without scenes, OutputError
    where something cannot be written.
    """
    views = tuple(dict.fromkeys(views))
    _check_request(views, size, workers)
    if not file.scenes:
        raise DataError(Diagnostic("there are no scenes to draw", help="the file's list `scenes` is empty"))
    stage, poses = stage_of(file), poses_of(file)
    total = len(file.scenes)
    digits = max(4, len(str(total)))
    shown_view = "perspective" if "perspective" in views else views[0]
    small = thumbnail_size(size, total)
    thumbnails: list[Image.Image] = []
    names: list[str] = []
    made = not out.exists()
    ensure_folder(out)
    # Pictures wait in a folder of their own until all are there: a run that fails leaves earlier pictures alone.
    waiting = Path(tempfile.mkdtemp(dir=out, prefix=".pictures.", suffix=".part"))
    try:
        with contextlib.closing(draw(stage, poses, views, size, min(workers or cores(), total))) as scenes:
            for number, pictures in enumerate(scenes, start=1):
                for view in views:
                    name = f"scene_{number:0{digits}d}_{view}.png"
                    _write(waiting / name, pictures[view], out / name)
                    names.append(name)
                if number <= SHOWN:
                    with Image.open(io.BytesIO(pictures[shown_view])) as picture:
                        thumbnails.append(picture.resize(small, Image.Resampling.LANCZOS))
                if progress is not None:
                    progress(number, total)
        _write(waiting / SHEET, contact_sheet(file, thumbnails), out / SHEET)
        for name in (*names, SHEET):
            _move(waiting / name, out / name)
    except BaseException:
        shutil.rmtree(waiting, ignore_errors=True)
        if made:
            with contextlib.suppress(OSError):
                out.rmdir()
        raise
    waiting.rmdir()
    return Rendered(tuple(out / name for name in names), out / SHEET)


def _write(path: Path, data: bytes, destination: Path) -> None:
    """Write a picture that waits; if that fails, what cannot be written is its destination."""
    try:
        write_whole(path, data)
    except OutputError as error:
        if isinstance(error.__cause__, OSError):
            raise output_error(destination, error.__cause__) from error
        raise


def _move(path: Path, destination: Path) -> None:
    try:
        path.replace(destination)
    except OSError as error:
        raise output_error(destination, error) from error


def _check_request(views: tuple[str, ...], size: tuple[int, int], workers: int | None) -> None:
    if not views:
        raise RequestError(Diagnostic("no view was asked for", help=f"the views are {quoted(VIEWS)}"))
    for view in views:
        if view not in VIEWS:
            help_line = suggest(view, VIEWS, f"the views are {quoted(VIEWS)}")
            raise RequestError(Diagnostic(f"unknown view `{view}`", help=help_line))
    if not all(SMALLEST <= side <= LARGEST for side in size):
        help_line = f"width and height are from {SMALLEST} to {LARGEST} pixels each"
        raise RequestError(Diagnostic(f"a picture cannot be {size[0]} x {size[1]} pixels", help=help_line))
    if workers is not None and workers < 1:
        raise RequestError(Diagnostic(f"{workers} workers cannot draw", help="ask for 1 or more"))
