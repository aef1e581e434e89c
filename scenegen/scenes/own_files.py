"""The files that objects of a scene file were made from, read again: meshes, assets of an index and URDF files."""

from __future__ import annotations

import stat
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import TypeVar

import numpy as np

from scenegen.errors import DataError
from scenegen.errors.files import NO_MODEL, UNUSABLE_MODEL
from scenegen.geometry import Box, Circle, Footprint, Polygon
from scenegen.resources import note_input
from scenegen.scenes.data import SceneFile, ShapeData, footprint_of
from scenegen.things.indexed import AssetEntry, IndexFileError, fit_asset, read_index
from scenegen.things.library import INDEX
from scenegen.things.meshfile import GLTF, MESH_FILES, ending_of, local_name
from scenegen.things.outline import Floats, MeshError
from scenegen.things.urdf import footprint_and_height, mesh_shadow, robot_shadow

T = TypeVar("T")
MAX_OWN_FILE_BYTES = 64_000_000  # of a file, as specs read it
OUTLINE_TOLERANCE = 1e-6  # metres by which an outline may differ from the one that the scenes were made with


@dataclass(frozen=True, slots=True, eq=False)
class OwnFile:
    """A file's bytes; `beside` gives those of a file that it names, and raises MeshError. `matrix` (3, 3)
    and `offset` (3,), metres, take its points to the object's frame: matrix @ point + offset. Mass (kg) and friction
    are those that an index gives an asset."""

    path: str
    is_robot: bool
    data: bytes
    beside: Callable[[str], bytes]
    matrix: Floats
    offset: Floats
    mass: float | None = None
    friction: float | None = None


def is_read(shape: ShapeData, folder: Path) -> bool:
    """Whether an object's shape is of a file that can be read again; the index that names an asset's lies in `folder`,
    where the spec lay. Raises MeshError."""
    if shape.asset == "asset":
        return _entry(folder, shape.path)[1].is_read
    if shape.asset == "mesh":
        return ending_of(shape.path) in (*GLTF, *MESH_FILES)
    return shape.asset == "urdf" and bool(shape.path)


def read_files(file: SceneFile, folder: Path, read: Callable[[ShapeData], T], *, body: bool = False) -> list[T | None]:
    """What `read` makes of the shape of every object that is of a file in `folder`, each shape once; None for other
    objects. Raises DataError where `read` raises MeshError, and where no object has such a file; `body`: it is about
    what collides."""
    known: dict[str, T | None] = {}
    for item in file.objects:
        key = item.shape.model_dump_json()
        try:
            if key not in known:
                known[key] = read(item.shape) if is_read(item.shape, folder) else None
        except MeshError as error:
            # on one line that a terminal can show: names in files may hold anything
            reason = "".join(one if one.isprintable() else "?" for one in str(error))
            facts = {"body": True} if body else {}
            raise DataError(UNUSABLE_MODEL(path=item.shape.path, name=item.name, reason=reason, **facts)) from None
    if not any(known.values()):
        raise DataError(NO_MODEL())
    return [known[item.shape.model_dump_json()] for item in file.objects]


def own_file(folder: Path, shape: ShapeData) -> OwnFile:
    """The file of a shape. `folder` is where the spec lay; a file outside it is not read.

    Raises MeshError where it cannot be read, or has another outline than the scenes were made with.
    """
    name, entry = _entry(folder, shape.path) if shape.asset == "asset" else (shape.path.replace("\\", "/"), None)
    path = folder / name
    data = _read(folder, path)

    def read_beside(other: str) -> bytes:
        return _read(folder, path.parent / local_name(other, path.resolve().parent, folder.resolve()))

    is_robot, matrix = shape.asset == "urdf", np.eye(3)
    if entry is not None:
        fit = fit_asset(entry, data, read_beside)
        is_robot = entry.is_robot
        footprint, height, matrix, offset = fit.footprint, fit.height, entry.matrix, fit.offset
    else:
        shadow = robot_shadow(data, read_beside) if is_robot else mesh_shadow(name, data, read_beside)
        footprint, height = footprint_and_height(shadow)
        offset = np.array([0.0, 0.0, -shadow.bottom])
    if not _same(footprint, footprint_of(shape.footprint)) or abs(height - shape.height) > OUTLINE_TOLERANCE:
        raise MeshError("its outline is not that of the scenes: the file has changed, or it is another one")
    if entry is None:
        return OwnFile(name, is_robot, data, read_beside, matrix, offset)
    return OwnFile(name, is_robot, data, read_beside, matrix, offset, entry.mass, entry.friction)


def _entry(folder: Path, path: str) -> tuple[str, AssetEntry]:
    """The file of an asset, relative to the folder that the spec was in, and its entry in the index. Raises
    MeshError."""
    below, _, name = path.replace("\\", "/").rpartition("/")
    where = PurePosixPath(below) / INDEX
    try:
        entries = read_index(_read(folder, folder / where))
    except IndexFileError as error:
        raise MeshError(f"{where}: {error}") from None
    if name not in entries:
        raise MeshError(f"{where} has no asset `{name}`")
    return str(where.parent / entries[name].file.replace("\\", "/")), entries[name]


def _same(first: Footprint, second: Footprint) -> bool:
    match first, second:
        case (Circle(), Circle()) | (Box(), Box()):
            return max(abs(a - b) for a, b in zip(first.extent, second.extent, strict=True)) <= OUTLINE_TOLERANCE
        case Polygon(), Polygon():
            pairs = zip(first.vertices, second.vertices, strict=False)
            alike = all(abs(a - c) <= OUTLINE_TOLERANCE and abs(b - d) <= OUTLINE_TOLERANCE for (a, b), (c, d) in pairs)
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
        note_input(wanted)
        with wanted.open("rb") as file:
            data = file.read(MAX_OWN_FILE_BYTES + 1)
    except (OSError, RuntimeError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "it cannot be read"
        raise MeshError(f"{path.name}: {reason.lower()}") from None
    if len(data) > MAX_OWN_FILE_BYTES:
        raise MeshError(f"{path.name} is larger than {MAX_OWN_FILE_BYTES:,} bytes")
    return data
