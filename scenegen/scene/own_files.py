"""The files that objects of a scene file were made from, read again: meshes and URDF files."""

from __future__ import annotations

import stat
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from scenegen.assets.filenames import ending_of, local_name
from scenegen.assets.meshfile import MeshError
from scenegen.assets.urdf import GLTF, PLAIN, measured, mesh_shadow, robot_shadow
from scenegen.primitives import Box, Circle, Footprint, Polygon
from scenegen.scene.data import ShapeData, footprint_of

MOST_BYTES = 64_000_000  # of a file, as specs read it
SAME = 1e-6  # metres by which an outline may differ from the one that the scenes were made with


@dataclass(frozen=True, slots=True)
class OwnFile:
    """A file's bytes; `beside` gives those of a file by its path relative to it, and raises MeshError. `bottom` is the
    height of the outline's lowest point in the file's own frame, in metres."""

    path: str
    is_robot: bool
    data: bytes
    beside: Callable[[str], bytes]
    bottom: float


def is_read(shape: ShapeData) -> bool:
    """Whether an object's shape is of a file that can be read again."""
    if shape.asset == "mesh":
        return ending_of(shape.path) in (*GLTF, *PLAIN)
    return shape.asset == "urdf" and bool(shape.path)


def reason_of(error: Exception) -> str:
    """Why a file is of no use, on one line that a terminal can show: names in files may hold anything."""
    return "".join(one if one.isprintable() else "?" for one in str(error))


def own_file(folder: Path, shape: ShapeData) -> OwnFile:
    """The file of a shape. `folder` is where the spec lay; a file outside it is not read.

    Raises MeshError and UrdfError where it cannot be read, or has another outline than the scenes were made with.
    """
    path = folder / shape.path
    data = _read(folder, path)

    def beside(other: str) -> bytes:
        return _read(folder, path.parent / other)

    is_robot = shape.asset == "urdf"
    if is_robot:
        shadow = robot_shadow(data, lambda other: beside(local_name(other)))
    else:
        shadow = mesh_shadow(shape.path, data, beside)
    footprint, height = measured(shadow)
    if not _same(footprint, footprint_of(shape.footprint)) or abs(height - shape.height) > SAME:
        raise MeshError("its outline is not that of the scenes: the file has changed, or it is another one")
    return OwnFile(shape.path, is_robot, data, beside, shadow.bottom)


def _same(first: Footprint, second: Footprint) -> bool:
    match first, second:
        case (Circle(), Circle()) | (Box(), Box()):
            return max(abs(a - b) for a, b in zip(first.extent, second.extent, strict=True)) <= SAME
        case Polygon(), Polygon():
            pairs = zip(first.vertices, second.vertices, strict=False)
            alike = all(abs(a - c) <= SAME and abs(b - d) <= SAME for (a, b), (c, d) in pairs)
            return len(first.vertices) == len(second.vertices) and alike
    return False


def _read(folder: Path, path: Path) -> bytes:
    """Raises MeshError."""
    try:
        wanted = path.resolve()
        if not wanted.is_relative_to(folder.resolve()):
            raise MeshError(f"{path.name} is outside the folder {folder}")
        if not stat.S_ISREG(wanted.stat().st_mode):
            raise MeshError(f"{path.name} is not a file")
        with wanted.open("rb") as file:
            data = file.read(MOST_BYTES + 1)
    except (OSError, RuntimeError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "it cannot be read"
        raise MeshError(f"{path.name}: {reason.lower()}") from None
    if len(data) > MOST_BYTES:
        raise MeshError(f"{path.name} is larger than {MOST_BYTES:,} bytes")
    return data
