"""Checks of the renderer's arguments."""

from __future__ import annotations

import importlib.util
import math

from scenegen.errors import RequestError, quoted
from scenegen.errors.program import NO_EGL
from scenegen.errors.requests import OUT_OF_RANGE, UNKNOWN_CHOICE, WRONG_VALUE
from scenegen.looks.camera import PLACES, VIEWS
from scenegen.looks.look import SEEDS, VIEW
from scenegen.render.files import RENDERERS
from scenegen.scene.data import SceneFile
from scenegen.scene.stage import MARGIN, TALLEST
from scenegen.validation import as_int, as_words

SMALLEST, LARGEST = 16, 4096  # pixels along a side of a picture
USUAL = 640  # pixels: default width of the picture of a square workspace
SHAPES = (0.75, 3.0)  # limits of a default picture's aspect ratio, width over height
FILLED = 0.87  # share of the height of a 4:3 picture that a square table fills
STEP = 16  # pixels: sides of such pictures are multiples of it


def usual_size(file: SceneFile, width: int = USUAL) -> tuple[int, int]:
    """The default size in pixels for the table of a file's workspace: 4:3 for a square one, wider for a wide one.

    It depends on the workspace and the objects' heights alone, so that all scenes of a spec get one size. All pictures
    have about as many pixels as one of 4:3 that is `width` wide.
    """
    long, deep = (high - low for low, high in (file.workspace.x, file.workspace.y))
    side = max(long, deep)
    margin = MARGIN * side
    if not (long > 0.0 and deep > 0.0 and math.isfinite(side + 2.0 * margin)):
        return width, 3 * width // 4  # drawing reports the error of such a workspace
    # Objects at the far edge rise above the table. A 4:3 picture has some space for this.
    tallest = min(max((item.shape.height for item in file.objects), default=0.0), TALLEST * side)
    above = max(tallest / math.tan(math.radians(PLACES["perspective"][1])) - margin, 0.0)
    high = max(deep + 2.0 * margin, FILLED * (deep + 2.0 * margin + above))
    shape = min(max(4.0 / 3.0 * (long + 2.0 * margin) / high, SHAPES[0]), SHAPES[1])
    mean = width * math.sqrt(0.75)
    return STEP * round(mean * math.sqrt(shape) / STEP), STEP * round(mean / math.sqrt(shape) / STEP)


def check_request(views: tuple[str, ...], size: tuple[int, int], workers: int | None, *, looks: bool = False) -> None:
    """Raises RequestError for invalid views, an invalid size in pixels, or an invalid number of processes."""
    known = (*VIEWS, VIEW) if looks else VIEWS
    views = as_words("views", views, '("top",)')
    if not views:
        wanted = f"at least one view; there are {quoted(known)}"
        raise RequestError(WRONG_VALUE(argument="views", value="empty", wanted=wanted))
    for view in views:
        if view not in known:
            raise RequestError(UNKNOWN_CHOICE(what="view", name=view, known=known))
    if not isinstance(size, tuple | list) or len(size) != 2:
        wanted = "width and height in pixels, as (640, 480)"
        raise RequestError(WRONG_VALUE(argument="size", value=repr(size), wanted=wanted))
    size = as_int("width", size[0]), as_int("height", size[1])
    if not all(SMALLEST <= side <= LARGEST for side in size):
        wanted = f"from {SMALLEST} to {LARGEST} pixels wide and high"
        raise RequestError(OUT_OF_RANGE(argument="size", value=f"{size[0]} x {size[1]}", wanted=wanted))
    if workers is not None and as_int("workers", workers) < 1:
        raise RequestError(OUT_OF_RANGE(argument="workers", value=workers, wanted="1 or more"))


def check_seed(seed: int) -> int:
    """Raises RequestError for a seed of looks that is no whole number from 0 to 2^63 - 1."""
    if not 0 <= as_int("seed", seed) < SEEDS:
        raise RequestError(OUT_OF_RANGE(argument="seed", value=seed, wanted="from 0 to 2^63 - 1"))
    return seed


def check_renderer(renderer: str) -> None:
    """Raises RequestError for a renderer that is unknown or not available."""
    if renderer not in RENDERERS:
        raise RequestError(UNKNOWN_CHOICE(what="renderer", name=renderer, known=RENDERERS))
    if renderer == "egl" and importlib.util.find_spec("eglRenderer") is None:
        raise RequestError(NO_EGL())
