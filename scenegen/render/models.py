"""The meshes of a scene file's objects, read again from their files, to be drawn as they are."""

from __future__ import annotations

import stat
from dataclasses import replace
from pathlib import Path, PurePosixPath

import numpy as np

from scenegen.assets.gltf import Surface, surfaces
from scenegen.assets.indexed import Entry, IndexFileError, fitted, read_index
from scenegen.assets.library import INDEX
from scenegen.assets.meshfile import MeshError
from scenegen.assets.urdf import GLTF, UrdfError, mesh_outline
from scenegen.errors import DataError
from scenegen.errors.files import NO_MODEL, UNUSABLE_MODEL
from scenegen.primitives import Box, Circle, Footprint, Polygon
from scenegen.scene.data import SceneFile, ShapeData, footprint_of

MOST_BYTES = 64_000_000  # of a file, as specs read it
SAME = 1e-6  # metres by which an outline may differ from the one that the scenes were made with

Model = tuple[Surface, ...]


def is_drawn(shape: ShapeData, folder: Path) -> bool:
    """Whether its file is one that is drawn as it is; the index that names an asset's lies in `folder`. Raises
    MeshError."""
    if shape.asset == "asset":
        return entry_of(folder, shape.path)[1].is_gltf
    return shape.asset == "mesh" and PurePosixPath(shape.path.replace("\\", "/")).suffix.lower() in GLTF


def still_outlines(file: SceneFile, folder: Path) -> tuple[str, ...]:
    """The names of objects from files that are not drawn as they are, of scenes that `models_of` has read."""
    return tuple(one.name for one in file.objects if one.shape.path and not is_drawn(one.shape, folder))


def entry_of(folder: Path, path: str) -> tuple[str, Entry]:
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


def models_of(file: SceneFile, folder: Path) -> tuple[Model | None, ...]:
    """The surfaces of every object whose shape is `mesh` of a glTF file, or an `asset` that has one, in the object's
    frame (z = 0 its lowest point); None for other objects. `folder` is where the spec lay; a file outside it is not
    read.

    Raises DataError where a file cannot be read or drawn, where it has another outline than the scenes were made
    with, and where no object has such a file.
    """
    known: dict[tuple[str, str, Footprint, float], Model] = {}
    models: list[Model | None] = []
    for item in file.objects:
        footprint, height = footprint_of(item.shape.footprint), item.shape.height
        key = item.shape.asset, item.shape.path, footprint, height
        try:
            if not is_drawn(item.shape, folder):
                models.append(None)
                continue
            if key not in known:
                known[key] = _model(folder, *key)
        except (MeshError, UrdfError) as error:
            raise DataError(UNUSABLE_MODEL(path=item.shape.path, name=item.name, reason=str(error))) from None
        models.append(known[key])
    if not known:
        raise DataError(NO_MODEL())
    return tuple(models)


def _model(folder: Path, kind: str, path: str, footprint: Footprint, height: float) -> Model:
    entry = None
    if kind == "asset":
        path, entry = entry_of(folder, path)
    data = _read(folder, folder / path)

    def beside(other: str) -> bytes:
        return _read(folder, (folder / path).parent / other)

    if entry is not None:
        fit = fitted(entry, data, beside)
        _check(fit.footprint, fit.height, footprint, height)
        turn, offset = entry.matrix, fit.offset
        made = surfaces(path, data, beside)
        return tuple(replace(one, vertices=one.vertices @ turn.T + offset) for one in made)
    found, tall = mesh_outline(path, data, beside)
    _check(found, tall, footprint, height)
    made = surfaces(path, data, beside)
    low = min(float(one.vertices[np.unique(one.faces), 2].min()) for one in made)
    return tuple(replace(one, vertices=one.vertices - (0.0, 0.0, low)) for one in made)


def _check(found: Footprint, tall: float, footprint: Footprint, height: float) -> None:
    if not _same(found, footprint) or abs(tall - height) > SAME:
        raise MeshError("its outline is not that of the scenes: the file has changed, or it is another one")


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
