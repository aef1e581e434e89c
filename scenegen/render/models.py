"""The meshes of a scene file's objects, read again from their files, to be drawn as they are."""

from __future__ import annotations

import io
import stat
import warnings
from dataclasses import replace
from pathlib import Path

from PIL import Image

from scenegen.assets.drawn import mesh_surfaces, robot_surfaces
from scenegen.assets.filenames import ending_of, local_name
from scenegen.assets.meshfile import MeshError
from scenegen.assets.surface import Surface
from scenegen.assets.urdf import GLTF, PLAIN, measured, mesh_shadow, robot_shadow
from scenegen.assets.urdf_tree import UrdfError
from scenegen.errors import DataError
from scenegen.errors.files import NO_MODEL, UNUSABLE_MODEL
from scenegen.primitives import Box, Circle, Footprint, Polygon
from scenegen.scene.data import SceneFile, ShapeData, footprint_of

MOST_BYTES = 64_000_000  # of a file, as specs read it
SAME = 1e-6  # metres by which an outline may differ from the one that the scenes were made with

Model = tuple[Surface, ...]


def is_drawn(shape: ShapeData) -> bool:
    """Whether its file is one that is drawn as it is."""
    if shape.asset == "mesh":
        return ending_of(shape.path) in (*GLTF, *PLAIN)
    return shape.asset == "urdf" and bool(shape.path)


def still_outlines(file: SceneFile) -> tuple[str, ...]:
    """The names of objects from files that are not drawn as they are."""
    return tuple(one.name for one in file.objects if one.shape.path and not is_drawn(one.shape))


def models_of(file: SceneFile, folder: Path) -> tuple[Model | None, ...]:
    """The surfaces of every object whose shape is `mesh` of a glTF, .obj or .stl file, or `urdf`, in the object's frame
    (z = 0 the lowest point of its outline); None for other objects. `folder` is where the spec lay; a file outside it
    is not read.

    Raises DataError where a file cannot be read or drawn, where it has another outline than the scenes were made
    with, and where no object has such a file.
    """
    known: dict[tuple[str, str, Footprint, float], Model] = {}
    models: list[Model | None] = []
    for item in file.objects:
        if not is_drawn(item.shape):
            models.append(None)
            continue
        footprint, height = footprint_of(item.shape.footprint), item.shape.height
        key = item.shape.asset, item.shape.path, footprint, height
        try:
            if key not in known:
                known[key] = _model(folder, *key)
        except (MeshError, UrdfError) as error:
            raise DataError(UNUSABLE_MODEL(path=item.shape.path, name=item.name, reason=str(error))) from None
        models.append(known[key])
    if not known:
        raise DataError(NO_MODEL())
    return tuple(models)


def _model(folder: Path, asset: str, path: str, footprint: Footprint, height: float) -> Model:
    data = _read(folder, folder / path)

    def beside(other: str) -> bytes:
        return _read(folder, (folder / path).parent / other)

    def mesh(other: str) -> bytes:
        return beside(local_name(other))

    shadow = robot_shadow(data, mesh) if asset == "urdf" else mesh_shadow(path, data, beside)
    found, tall = measured(shadow)
    if not _same(found, footprint) or abs(tall - height) > SAME:
        raise MeshError("its outline is not that of the scenes: the file has changed, or it is another one")
    made = robot_surfaces(data, beside) if asset == "urdf" else mesh_surfaces(path, data, beside)
    for texture in {one.texture for one in made if one.texture}:
        _check_texture(texture)
    return tuple(replace(one, vertices=one.vertices - (0.0, 0.0, shadow.bottom)) for one in made)


def _check_texture(data: bytes) -> None:
    """Raises MeshError for a picture that ends early or is damaged; what it announces has been checked."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            with Image.open(io.BytesIO(data), formats=("PNG", "JPEG")) as image:
                image.convert("RGB")
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError):
        raise MeshError("a texture of it is damaged or cut short") from None


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
