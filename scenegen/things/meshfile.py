"""The vertices of mesh files: Wavefront .obj, and .stl as text or binary."""

from __future__ import annotations

import contextlib
import re
import struct
from pathlib import Path, PurePosixPath

import numpy as np
import numpy.typing as npt

from scenegen.things.mesh import Floats, Indices

# --------------------------------------------------------------------------------------------------------------------
# Names of files, as descriptions write them.


def ending_of(name: str) -> str:
    """`.obj` of `Meshes\\Vase.OBJ`."""
    return PurePosixPath(name.replace("\\", "/")).suffix.lower()


def beside(name: str, other: str) -> str:
    """The name of a file that the file `name` names, as `name` is written."""
    folder = name.replace("\\", "/").rpartition("/")[0]
    return f"{folder}/{other}" if folder else other


def local_name(name: str, folder: Path, root: Path) -> str:
    """The path, relative to `folder`, that a description in that folder means by a file's name.

    `package://name/meshes/a.stl` is looked for in the folder's ancestors, itself included, but not beyond `root`: in
    one that is called as the package is, in a package that lies in one, and in the ancestor itself. `model://` is read
    alike. Where there is no such file, it is the path below `folder`.
    """
    scheme, found, path = name.replace("\\", "/").partition("://")
    if not found or scheme not in ("package", "model"):
        return path if scheme == "file" else name.replace("\\", "/")
    package, *parts = [part for part in path.split("/") if part] or [""]
    inner = "/".join(parts)
    above = [one for one in (folder, *folder.parents) if one.is_relative_to(root)]
    ups = ["../" * steps for steps in range(len(above))]
    named = [up for up, one in zip(ups, above, strict=True) if one.name == package]
    for path in [f"{up}{inner}" for up in named] + [
        f"{up}{within}" for up in ups for within in (f"{package}/{inner}", inner)
    ]:
        with contextlib.suppress(OSError, ValueError):  # a name that no file can have
            if (folder / path).is_file():
                return path
    return inner


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
    """(V, 3): the vertices that triangles use, in the unit of the file, but for triangles whose corners coincide; all,
    where an .obj file has no faces. Raises MeshError."""
    points = vertices(name, data)
    if ending_of(name) != ".obj":
        whole = points[: len(points) // 3 * 3].reshape(-1, 3, 3)
        kept = whole[_open(whole)].reshape(-1, 3)
        return kept if len(kept) else points
    faces = _obj_faces(data, len(points))
    return points[used(points, faces)] if len(faces) else points


def used(points: Floats, faces: Indices) -> Indices:
    """Which of some points (P, 3) triangles (F, 3) use, in their order, but for triangles whose corners coincide; all
    corners, where each is one."""
    open_ = faces[_open(points[faces])]
    found = np.zeros(len(points), dtype=np.bool_)
    found[open_ if len(open_) else faces] = True
    return np.flatnonzero(found)


def _open(triangles: Floats) -> npt.NDArray[np.bool_]:
    """Whether no two corners of triangles (F, 3, 3) coincide."""
    a, b, c = triangles.transpose(1, 0, 2)
    same = (a == b).all(axis=1) | (b == c).all(axis=1) | (c == a).all(axis=1)
    return np.asarray(~same, dtype=np.bool_)


def _obj_faces(data: bytes, count: int) -> Indices:
    """The triangles (F, 3) of an .obj file of `count` vertices; polygons are cut from their first corner. Raises
    MeshError."""
    data = _plain(data)
    rows = re.findall(rb"^[ \t]*f[ \t]+([^\r\n#]*)", data, re.MULTILINE)
    if not rows:
        return np.empty((0, 3), dtype=np.int64)
    sizes = np.array([len(row.split()) for row in rows], dtype=np.int64)
    text = re.sub(rb"/\S*", b"", b" ".join(rows))
    try:
        if b"_" in text:
            raise ValueError  # as in `_numbers`
        flat = np.array(text.split(), dtype=np.int64)
    except (ValueError, OverflowError):
        raise MeshError("a face in it names no vertex by its number") from None
    if len(flat) != sizes.sum():
        raise MeshError("a face in it names no vertex by its number")
    if sizes.min() < 3:
        raise MeshError("a face in it has fewer than 3 corners")
    if (flat < 0).any():  # which counts back from the face
        before = np.cumsum([kind == b"v" for kind in re.findall(rb"^[ \t]*([vf])[ \t]", data, re.MULTILINE)])
        kinds = np.array([kind == b"f" for kind in re.findall(rb"^[ \t]*([vf])[ \t]", data, re.MULTILINE)])
        flat = np.where(flat < 0, flat + np.repeat(before[kinds], sizes) + 1, flat)
    flat -= 1
    if flat.min() < 0 or flat.max() >= count:
        raise MeshError(f"a face in it names a vertex beyond its {count:,}")
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


# --------------------------------------------------------------------------------------------------------------------
# What files of one's own may say of an object's body.


LEAST_MASS, MOST_MASS = 1e-6, 1e6  # kg
MOST_FRICTION = 100.0  # coefficient of sliding friction
