"""The outline of a URDF file."""

from __future__ import annotations

from collections.abc import Callable

from scenegen.primitives import Footprint


class UrdfError(Exception):
    """The file is of no use; the text says why."""


def outline(data: bytes, read_mesh: Callable[[str], bytes]) -> tuple[Footprint, float]:
    raise UrdfError("not built yet")
