"""What can be asked of the renderer."""

from __future__ import annotations

import importlib.util
import math

from scenegen.errors import Diagnostic, RequestError, quoted, suggest
from scenegen.given import whole, words
from scenegen.render.camera import PLACES, VIEWS
from scenegen.render.files import RENDERERS
from scenegen.render.stage import MARGIN, TALLEST
from scenegen.scene.data import SceneFile

SMALLEST, LARGEST = 16, 4096  # pixels along a side of a picture
USUAL = 640  # pixels: how wide the picture of a square workspace is, unless another size is given
SHAPES = (0.75, 3.0)  # the narrowest and the widest picture, as width over height, that a workspace gets
FILLED = 0.87  # of the height of a picture of 4:3: what a square table fills
STEP = 16  # pixels: sides of such pictures are multiples of it


def usual_size(file: SceneFile, width: int = USUAL) -> tuple[int, int]:
    """The size in pixels that the table of a file's workspace fills: 4:3 where it is square, wider for a wide one.

    It depends on the workspace and the objects' heights alone, so that all scenes of a spec get one size. All pictures
    have about as many pixels as one of 4:3 that is `width` wide.
    """
    long, deep = (high - low for low, high in (file.workspace.x, file.workspace.y))
    side = max(long, deep)
    margin = MARGIN * side
    if not (long > 0.0 and deep > 0.0 and math.isfinite(side + 2.0 * margin)):
        return width, 3 * width // 4  # what is wrong with such a workspace is said where it is drawn
    # What stands at the far edge rises above the table. A picture of 4:3 has some space left for it.
    tallest = min(max((item.shape.height for item in file.objects), default=0.0), TALLEST * side)
    above = max(tallest / math.tan(math.radians(PLACES["perspective"][1])) - margin, 0.0)
    high = max(deep + 2.0 * margin, FILLED * (deep + 2.0 * margin + above))
    shape = min(max(4.0 / 3.0 * (long + 2.0 * margin) / high, SHAPES[0]), SHAPES[1])
    mean = width * math.sqrt(0.75)
    return STEP * round(mean * math.sqrt(shape) / STEP), STEP * round(mean / math.sqrt(shape) / STEP)


def check_request(views: tuple[str, ...], size: tuple[int, int], workers: int | None) -> None:
    """Raises RequestError for views, a size in pixels, or a number of processes that cannot be."""
    views = words("views", views, '("top",)')
    if not views:
        raise RequestError(Diagnostic("no view was asked for", help=f"the views are {quoted(VIEWS)}"))
    for view in views:
        if view not in VIEWS:
            help_line = suggest(view, VIEWS, f"the views are {quoted(VIEWS)}")
            raise RequestError(Diagnostic(f"unknown view `{view}`", help=help_line))
    if not isinstance(size, tuple | list) or len(size) != 2:
        raise RequestError(Diagnostic(f"`size` is {size!r}", help="give it width and height in pixels, as (640, 480)"))
    size = whole("width", size[0]), whole("height", size[1])
    if not all(SMALLEST <= side <= LARGEST for side in size):
        help_line = f"width and height are from {SMALLEST} to {LARGEST} pixels each"
        raise RequestError(Diagnostic(f"a picture cannot be {size[0]} x {size[1]} pixels", help=help_line))
    if workers is not None and whole("workers", workers) < 1:
        raise RequestError(Diagnostic(f"{workers} workers cannot draw", help="ask for 1 or more"))


def check_renderer(renderer: str) -> None:
    """Raises RequestError for a renderer that is not known, or not there."""
    if renderer not in RENDERERS:
        help_line = suggest(renderer, RENDERERS, f"the renderers are {quoted(RENDERERS)}")
        raise RequestError(Diagnostic(f"unknown renderer `{renderer}`", help=help_line))
    if renderer == "egl" and importlib.util.find_spec("eglRenderer") is None:
        raise RequestError(Diagnostic("this pybullet has no EGL renderer", help="leave `--renderer egl` out"))
