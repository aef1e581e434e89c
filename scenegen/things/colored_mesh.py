"""Surfaces of mesh files: triangles with a colour or a texture, and what all files of one object may hold together."""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from scenegen.things.library import RGB
from scenegen.things.outline import Floats, Indices, MeshError

if TYPE_CHECKING:
    from PIL import Image

MAX_MESH_COORDINATE = 1e9  # of a coordinate, in the file's own unit
MAX_VERTICES = 4_000_000  # of all meshes together, counted as often as they are placed
MAX_TRIANGLES = 4_000_000
MAX_PIXELS = 2**26  # of all textures together: four of 4,096 by 4,096
MAX_MESH_BYTES = 128_000_000  # of all files together
MAX_LAYERS = 200  # of surface over surface: each is drawn, and only one is seen
WHITE: RGB = (1.0, 1.0, 1.0)


@dataclass(frozen=True, slots=True, eq=False)
class ColoredMesh:
    """Triangles of one material: `vertices` (V, 3) in metres, z upwards; `faces` (F, 3); a colour from 0 to 1, by which
    the `texture` (the bytes of a PNG or JPEG file, or none) is multiplied at `uv` (V, 2), v = 0 its upper edge. No
    colour: the file names none, and the object's own is meant."""

    vertices: Floats
    faces: Indices
    color: RGB | None
    uv: Floats | None = None
    texture: bytes = b""


def tidy(surface: ColoredMesh) -> ColoredMesh:
    """The surface without vertices that no triangle uses, or only one whose corners coincide."""
    kept = used(surface.vertices, surface.faces)
    if len(kept) == len(surface.vertices):
        return surface
    order = np.full(len(surface.vertices), -1, dtype=np.int64)
    order[kept] = np.arange(len(kept))
    faces = order[surface.faces]
    uv = None if surface.uv is None else surface.uv[kept]
    return replace(surface, vertices=surface.vertices[kept], faces=faces[(faces >= 0).all(axis=1)], uv=uv)


@dataclass(slots=True)
class MeshBudget:
    """What has been read so far. Every method raises MeshError where it is too much."""

    vertices: int = 0
    triangles: int = 0
    pixels: int = 0
    size: int = 0

    def add_vertices(self, count: int) -> None:
        self.vertices += count
        if self.vertices > MAX_VERTICES:
            raise MeshError(f"its meshes have more than {MAX_VERTICES:,} vertices together")

    def add_triangles(self, count: int) -> None:
        self.triangles += count
        if self.triangles > MAX_TRIANGLES:
            raise MeshError(f"its meshes have more than {MAX_TRIANGLES:,} triangles together")

    def add_texture(self, data: bytes, what: str) -> None:
        self.pixels += pixels_of(data, what)
        if self.pixels > MAX_PIXELS:
            raise MeshError(f"its textures have more than {MAX_PIXELS:,} pixels together")
        check_texture(data, what, quick=True)

    def add_file(self, data: bytes) -> None:
        self.size += len(data)
        if self.size > MAX_MESH_BYTES:
            raise MeshError(f"its files are larger than {MAX_MESH_BYTES:,} bytes together")


def refuse_layers(surfaces: Sequence[ColoredMesh]) -> None:
    """Raises MeshError where surfaces have hundreds of times the area of the box round them: thousands of parts in one
    place, which take minutes to draw."""
    surfaces = [one for one in surfaces if len(one.faces)]
    if not surfaces:
        return
    low = np.min([one.vertices.min(axis=0) for one in surfaces], axis=0)
    high = np.max([one.vertices.max(axis=0) for one in surfaces], axis=0)
    x, y, z = np.maximum(high - low, 0.0)
    area = 0.0
    for one in surfaces:
        a, b, c = one.vertices[one.faces].transpose(1, 0, 2)
        area += 0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
    box = 2.0 * float(x * y + y * z + z * x)
    if area > MAX_LAYERS * box:
        raise MeshError(
            f"its surfaces have more than {MAX_LAYERS} times the area of the box round them: leave out what is hidden"
        )


def used(points: Floats, faces: Indices) -> Indices:
    """Which of some points (P, 3) triangles (F, 3) use, in their order, but for triangles whose corners coincide; all
    corners, where each is one."""
    a, b, c = points[faces].transpose(1, 0, 2)
    open_ = faces[~((a == b).all(axis=1) | (b == c).all(axis=1) | (c == a).all(axis=1))]
    found = np.zeros(len(points), dtype=np.bool_)
    found[open_ if len(open_) else faces] = True
    return np.flatnonzero(found)


def pixels_of(data: bytes, what: str) -> int:
    """How many pixels a PNG or JPEG file announces; they are not read. Raises MeshError."""
    with _open_texture(data, f"{what} is neither PNG nor JPEG") as image:
        return image.width * image.height


def check_texture(data: bytes, what: str, *, quick: bool = False) -> None:
    """Raises MeshError for a picture that ends early or is damaged; what it announces has been checked. `quick`: by the
    checksums of a PNG file, or an eighth of the pixels of a JPEG file."""
    with _open_texture(data, f"{what} is damaged or cut short") as image:
        if quick and image.format == "PNG":
            image.verify()
            return
        if quick:
            image.draft("RGB", (image.width // 8, image.height // 8))
        image.convert("RGB")


@contextmanager
def _open_texture(data: bytes, otherwise: str) -> Iterator[Image.Image]:
    """A PNG or JPEG file. Raises MeshError, also where the block finds damage."""
    from PIL import Image  # only objects with textures need it

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            with Image.open(io.BytesIO(data), formats=("PNG", "JPEG")) as image:
                yield image
    except Image.DecompressionBombError:
        raise MeshError(f"its textures have more than {MAX_PIXELS:,} pixels together") from None
    except (OSError, ValueError, SyntaxError):
        raise MeshError(otherwise) from None
