"""The two libraries that figures need, loaded when one is drawn, and how a figure becomes a small PNG file.

matplotlib's object interface only: no pyplot, no state shared with the caller's own plots.
"""

from __future__ import annotations

import importlib
import io
from typing import TYPE_CHECKING, Any

from PIL import Image

from experiments.errors import needs
from scenegen.errors import RequestError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LIBRARIES = {"matplotlib": "matplotlib", "sklearn": "scikit-learn"}
INK, QUIET, GRID, RED = "#26282c", "#70747c", "#e2e3e5", "#c2332b"
LINES = ("#2b609e", "#c9772f", "#3f8f5b", "#8556a8")
COLORS = 256
DPI = 110


def needed(module: str) -> Any:
    """A module of a library that comes with an extra only. Raises RequestError that says how to get it."""
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        library = LIBRARIES.get((error.name or "").partition(".")[0])
        if library is None:
            raise
        raise RequestError(needs(library, "for the figures")) from error


def check_libraries() -> None:
    """Refuse, before hours of training, to go on without them. Raises RequestError."""
    for library in LIBRARIES:
        needed(library)


def figure(width: float, height: float) -> Figure:
    """An empty figure, sizes in inches, that lays itself out."""
    found: Figure = needed("matplotlib.figure").Figure(figsize=(width, height), dpi=DPI, layout="constrained")
    return found


def plain(axes: Axes) -> None:
    """Axes in the house's colours: a quiet frame, no box."""
    for side, spine in axes.spines.items():
        spine.set_visible(side in ("left", "bottom"))
        spine.set_color(QUIET)
    axes.tick_params(colors=QUIET, labelsize=8)
    axes.grid(color=GRID, linewidth=0.6)
    axes.set_axisbelow(True)


def bare(axes: Axes) -> None:
    """Axes without ticks, for pictures."""
    axes.set_xticks([])
    axes.set_yticks([])
    for spine in axes.spines.values():
        spine.set_color(GRID)


def png(drawn: Figure) -> bytes:
    """The figure as a PNG file."""
    out, small = io.BytesIO(), io.BytesIO()
    drawn.savefig(out, format="png", facecolor="white")
    Image.open(out).convert("RGB").save(small, format="PNG", optimize=True)
    return small.getvalue()


def small_png(picture: Image.Image) -> bytes:
    """A rendered picture as a PNG file of 256 colours, a third of the size. Curves and dots need every shade."""
    out = io.BytesIO()
    picture.convert("RGB").quantize(COLORS).save(out, format="PNG", optimize=True)
    return out.getvalue()
