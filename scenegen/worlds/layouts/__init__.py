"""Start layouts for simulators that run many environments at once: tensors (B, N, 7), and files of layouts.

from scenegen.layouts import Layouts
layouts = Layouts(spec, (0, None), quaternion="wxyz", device="cuda")
poses, phi = layouts.take(len(env_ids))
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

# name -> the module that defines it
_PUBLIC = {
    "Layouts": "scenegen.worlds.layouts.tensors",
    "Taken": "scenegen.worlds.layouts.tensors",
    "write_arena_pool": "scenegen.worlds.layouts.tensors",
}

__all__ = ["Layouts", "Taken", "write_arena_pool"]

if TYPE_CHECKING:
    from scenegen.worlds.layouts.tensors import Layouts, Taken, write_arena_pool


def __getattr__(name: str) -> Any:
    if name not in _PUBLIC:
        raise AttributeError(f"module 'scenegen.layouts' has no attribute {name!r}")
    value = getattr(importlib.import_module(_PUBLIC[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
