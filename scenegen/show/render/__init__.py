"""Headless pictures of scenes. Importing this loads neither pybullet nor Pillow; names are looked up at first use."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

__all__ = ["VIEWS", "Rendered", "render_scenes"]

if TYPE_CHECKING:
    from scenegen.show.looks.camera import VIEWS
    from scenegen.show.render.scenes import Rendered, render_scenes

_HOMES = {
    "VIEWS": "scenegen.show.looks.camera",
    "Rendered": "scenegen.show.render.scenes",
    "render_scenes": "scenegen.show.render.scenes",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'scenegen.show.render' has no attribute {name!r}")
    return getattr(importlib.import_module(_HOMES[name]), name)
