"""The vertices of mesh files: Wavefront .obj, and .stl as text or binary."""

from __future__ import annotations

import re
import struct

import numpy as np

from scenegen.assets.filenames import ending_of
from scenegen.assets.mesh import Floats, Indices

MARK = b"\xef\xbb\xbf"  # of the order of bytes, which editors write before a text
FARTHEST = 1e9  # of a coordinate, in the file's own unit
_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_HEADER = 80  # bytes of a binary STL before the number of triangles


class MeshError(Exception):
    """The file is of no use; the text says why."""


def vertices(name: str, data: bytes) -> Floats:
    """(V, 3): all vertices of a mesh file, V >= 1, whether a face uses them or not; the ending of `name` says which
    format it is. In the unit of the file. Raises MeshError."""
    match ending_of(name):
        case ".obj":
            found = _obj(data)
        case ".stl":
            found = _stl(data)
        case other:
            kind = f"{other} files" if other else "a file without an ending"
            raise MeshError(f"{kind} cannot be read here, .obj and .stl can: convert it, or give the outline beside it")
    if not len(found):
        raise MeshError("it has no vertices")
    if not np.isfinite(found).all() or np.abs(found).max() > FARTHEST:
        raise MeshError("a coordinate in it is no number, or beyond all measure")
    return found


def corners(name: str, data: bytes) -> Floats:
    """(V, 3): the vertices that a triangle with an area has, in the unit of the file; all, where an .obj file has no
    faces. Raises MeshError."""
    points = vertices(name, data)
    faces = (
        _obj_faces(data, len(points)) if ending_of(name) == ".obj" else np.arange(len(points) // 3 * 3).reshape(-1, 3)
    )
    return points if not len(faces) else points[used(points, faces)]


def used(points: Floats, faces: Indices) -> Indices:
    """Which of some points (P, 3) are corners of triangles (F, 3) with an area, in their order; all corners, where
    none has."""
    a, b, c = points[faces].transpose(1, 0, 2)
    solid = faces[np.cross(b - a, c - a).any(axis=1)]
    return np.unique(solid if len(solid) else faces)


def _obj_faces(data: bytes, count: int) -> Indices:
    """The triangles (F, 3) of an .obj file of `count` vertices; polygons are cut from their first corner. Raises
    MeshError."""
    data = _plain(data)
    rows = [row.split() for row in re.findall(rb"^[ \t]*f[ \t]+([^\r\n#]*)", data, re.MULTILINE)]
    words = [word.partition(b"/")[0] for row in rows for word in row]
    sizes = np.array([len(row) for row in rows], dtype=np.int64)
    try:
        flat = np.array(words, dtype=np.bytes_).astype(np.int64)
    except (ValueError, OverflowError):
        raise MeshError("a face in it names no vertex by its number") from None
    if not len(rows):
        return np.empty((0, 3), dtype=np.int64)
    if sizes.min() < 3:
        raise MeshError("a face in it has fewer than 3 corners")
    if (flat < 0).any():  # which counts back from the face
        before = np.cumsum([kind == b"v" for kind in re.findall(rb"^[ \t]*([vf])[ \t]", data, re.MULTILINE)])
        kinds = np.array([kind == b"f" for kind in re.findall(rb"^[ \t]*([vf])[ \t]", data, re.MULTILINE)])
        flat = np.where(flat < 0, flat + np.repeat(before[kinds], sizes) + 1, flat)
    flat -= 1
    if flat.min() < 0 or flat.max() >= count:
        raise MeshError(f"a face in it names a vertex that is none of its {count:,}")
    triangles = sizes - 2
    first = np.repeat(np.cumsum(sizes) - sizes, triangles)
    step = np.arange(triangles.sum()) - np.repeat(np.cumsum(triangles) - triangles, triangles)
    faces: Indices = flat[np.column_stack([first, first + step + 1, first + step + 2])]
    return faces


def _numbers(rows: list[bytes]) -> Floats:
    words = [row.split()[:3] for row in rows]
    try:
        if any(b"_" in row for row in rows) and any(b"_" in word for three in words for word in three):
            raise ValueError  # Python reads 1_0 as 10, nobody else does
        return np.array(words, dtype=np.float64).reshape(-1, 3)
    except ValueError:
        raise MeshError("a vertex in it is not three numbers") from None


def _plain(data: bytes) -> bytes:
    """An .obj file without lines that go on, and without a byte order mark."""
    return re.sub(rb"\\\r?\n", b" ", data.removeprefix(MARK))


def _obj(data: bytes) -> Floats:
    return _numbers(re.findall(rb"^[ \t]*v[ \t]+([^\r\n#]*)", _plain(data), re.MULTILINE))


def _stl(data: bytes) -> Floats:
    start = _HEADER + 4
    count = struct.unpack_from("<I", data, _HEADER)[0] if len(data) >= start else -1
    size = start + _TRIANGLE.itemsize * count
    # A binary file may open with the word `solid` too: its length decides.
    if len(data) != size and data.removeprefix(MARK).lstrip()[:5].lower() == b"solid":
        return _numbers(re.findall(rb"^[ \t]*vertex[ \t]+([^\r\n]*)", data, re.MULTILINE | re.IGNORECASE))
    if count < 0 or len(data) < size:
        raise MeshError("it is cut short" if count >= 0 else "it is no STL file")
    triangles = np.frombuffer(data, dtype=_TRIANGLE, count=count, offset=start)
    return np.asarray(triangles["corners"], dtype=np.float64).reshape(-1, 3)
