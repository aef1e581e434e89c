"""The meshes of a scene file's objects, read again from their files, to be drawn as they are."""

from __future__ import annotations

import stat
from dataclasses import replace
from pathlib import Path, PurePosixPath

import numpy as np

from scenegen.assets.gltf import Surface, surfaces
from scenegen.assets.meshfile import MeshError
from scenegen.assets.urdf import GLTF, UrdfError, mesh_outline
from scenegen.errors import DataError
from scenegen.errors.files import NO_MODEL, UNUSABLE_MODEL
from scenegen.primitives import Box, Circle, Footprint, Polygon
from scenegen.scene.data import SceneFile, ShapeData, footprint_of

MOST_BYTES = 64_000_000  # of a file, as specs read it
SAME = 1e-6  # metres by which an outline may differ from the one that the scenes were made with

Model = tuple[Surface, ...]


def is_drawn(shape: ShapeData) -> bool:
    """Whether its file is one that is drawn as it is."""
    return shape.asset == "mesh" and PurePosixPath(shape.path.replace("\\", "/")).suffix.lower() in GLTF


def still_outlines(file: SceneFile) -> tuple[str, ...]:
    """The names of objects from files that are not drawn as they are."""
    return tuple(one.name for one in file.objects if one.shape.path and not is_drawn(one.shape))


def models_of(file: SceneFile, folder: Path) -> tuple[Model | None, ...]:
    """The surfaces of every object whose shape is `mesh` of a glTF file, in the object's frame (z = 0 its lowest
    point); None for other objects. `folder` is where the spec lay; a file outside it is not read.

    Raises DataError where a file cannot be read or drawn, where it has another outline than the scenes were made
    with, and where no object has such a file.
    """
    known: dict[tuple[str, Footprint, float], Model] = {}
    models: list[Model | None] = []
    for item in file.objects:
        if not is_drawn(item.shape):
            models.append(None)
            continue
        footprint, height = footprint_of(item.shape.footprint), item.shape.height
        key = item.shape.path, footprint, height
        try:
            if key not in known:
                known[key] = _model(folder, *key)
        except (MeshError, UrdfError) as error:
            raise DataError(UNUSABLE_MODEL(path=item.shape.path, name=item.name, reason=str(error))) from None
        models.append(known[key])
    if not known:
        raise DataError(NO_MODEL())
    return tuple(models)


def _model(folder: Path, path: str, footprint: Footprint, height: float) -> Model:
    data = _read(folder, folder / path)

    def beside(other: str) -> bytes:
        return _read(folder, (folder / path).parent / other)

    found, tall = mesh_outline(path, data, beside)
    if not _same(found, footprint) or abs(tall - height) > SAME:
        raise MeshError("its outline is not that of the scenes: the file has changed, or it is another one")
    made = surfaces(path, data, beside)
    low = min(float(one.vertices[np.unique(one.faces), 2].min()) for one in made)
    return tuple(replace(one, vertices=one.vertices - (0.0, 0.0, low)) for one in made)


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
