"""Pictures of scenes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from scenegen.api.scenes import SceneSet

if TYPE_CHECKING:
    from scenegen.render import Rendered


def render(
    scenes: SceneSet,
    out: str | Path,
    *,
    views: tuple[str, ...] = ("top", "perspective"),
    size: tuple[int, int] = (640, 480),
    workers: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Rendered:
    """Draw every scene from every view into the folder `out`, and a contact sheet of all.

    The result's `pictures` are the paths in scene order, `sheet` is the contact sheet's. Needs no display and no GPU.
    Raises RequestError, DataError, OutputError.
    """
    from scenegen.render import render_scenes

    return render_scenes(scenes.file(), Path(out), views=views, size=size, workers=workers, progress=progress)
