"""The vertices of mesh files: Wavefront .obj, and .stl as text or binary."""

from __future__ import annotations

import re
import struct

import numpy as np

from scenegen.assets.filenames import ending_of
from scenegen.assets.mesh import Floats

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


def _numbers(rows: list[bytes]) -> Floats:
    words = [row.split()[:3] for row in rows]
    try:
        if any(b"_" in row for row in rows) and any(b"_" in word for three in words for word in three):
            raise ValueError  # Python reads 1_0 as 10, nobody else does
        return np.array(words, dtype=np.float64).reshape(-1, 3)
    except ValueError:
        raise MeshError("a vertex in it is not three numbers") from None


def _obj(data: bytes) -> Floats:
    data = re.sub(rb"\\\r?\n", b" ", data.removeprefix(b"\xef\xbb\xbf"))  # lines that go on; a byte order mark
    return _numbers(re.findall(rb"^[ \t]*v[ \t]+([^\r\n#]*)", data, re.MULTILINE))


def _stl(data: bytes) -> Floats:
    start = _HEADER + 4
    count = struct.unpack_from("<I", data, _HEADER)[0] if len(data) >= start else -1
    size = start + _TRIANGLE.itemsize * count
    # A binary file may open with the word `solid` too: its length decides.
    if len(data) != size and data.lstrip()[:5].lower() == b"solid":
        return _numbers(re.findall(rb"^[ \t]*vertex[ \t]+([^\r\n]*)", data, re.MULTILINE | re.IGNORECASE))
    if count < 0 or len(data) < size:
        raise MeshError("it is cut short" if count >= 0 else "it is no STL file")
    triangles = np.frombuffer(data, dtype=_TRIANGLE, count=count, offset=start)
    return np.asarray(triangles["corners"], dtype=np.float64).reshape(-1, 3)
