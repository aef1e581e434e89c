"""Mesh files: what .obj, .stl, .glb and .gltf files show, and what all files of one object may hold together.

Everything is measured before it is read. An error says what is wrong and where; who reads a file adds its name.
(trimesh would not carry this: of our damaged and hostile files it accepts half, names no line of the others, and keeps
no picture as it is.)
"""

from __future__ import annotations

import contextlib
import re
import struct
from bisect import bisect_left
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np

from scenegen.things import gltf
from scenegen.things.colored_mesh import MAX_MESH_COORDINATE, WHITE, ColoredMesh, MeshBudget, refuse_layers, tidy, used
from scenegen.things.library import RGB
from scenegen.things.outline import Floats, Indices, MeshError

MIN_MASS, MAX_MASS = 1e-6, 1e6  # kg
MAX_FRICTION = 100.0  # coefficient of sliding friction
MESH_FILES = (".obj", ".stl")
GLTF = (".glb", ".gltf")

Read = Callable[[str], bytes]  # the bytes of a file by its name, relative to the one that names it; raises MeshError


def ending_of(name: str) -> str:
    """`.obj` of `Meshes\\Vase.OBJ`."""
    return PurePosixPath(name.replace("\\", "/")).suffix.lower()


def sibling_name(name: str, other: str) -> str:
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


def mesh_surfaces(
    name: str, data: bytes, read: Read, budget: MeshBudget | None = None, *, painted: bool = True
) -> tuple[ColoredMesh, ...]:
    """The surfaces of a .glb, .gltf, .obj or .stl file, in its own unit, z upwards (as `gltf.surfaces` turns them).

    `read` gives the bytes of a file that it names; what that raises passes through. Not `painted`, the colours of .obj
    files are left out. Raises MeshError.
    """
    budget = budget or MeshBudget()
    ending = ending_of(name)
    if ending in GLTF:
        found = gltf.surfaces(name, data, read)
    elif ending == ".obj" and painted:
        found = tuple(map(tidy, _material_surfaces(data, read, budget)))
    else:
        points, faces = _geometry(name, data)
        if not len(faces):
            raise MeshError("it has no faces")
        budget.add_vertices(len(points))
        budget.add_triangles(len(faces))
        found = (tidy(ColoredMesh(points, faces, None)),)
    refuse_layers(found)
    return found


def mesh_points(name: str, data: bytes, read: Read) -> list[Floats]:
    """The vertices (V, 3) of the triangles of a mesh file's parts, in its unit, z upwards; all vertices of an .obj file
    without faces. Raises MeshError."""
    if ending_of(name) in GLTF:
        return [one.vertices for one in gltf.surfaces(name, data, read)]
    points, faces = _geometry(name, data)
    return [points[used(points, faces)] if len(faces) else points]


def vertices(name: str, data: bytes) -> Floats:
    """(V, 3): all vertices of an .obj or .stl file, V >= 1, whether a face uses them or not, in the unit of the file.
    Raises MeshError."""
    return _finite(_obj_points(_plain(data)) if ending_of(name) == ".obj" else _stl(data))


def _finite(found: Floats) -> Floats:
    if not len(found):
        raise MeshError("it has no vertices")
    if not np.isfinite(found).all() or np.abs(found).max() > MAX_MESH_COORDINATE:
        raise MeshError("a coordinate in it is no number, or beyond all measure")
    return found


def _geometry(name: str, data: bytes) -> tuple[Floats, Indices]:
    """All vertices and triangles of an .obj or .stl file."""
    if ending_of(name) not in MESH_FILES:
        kind = f"{ending_of(name)} files" if ending_of(name) else "a file without an ending"
        known = "convert it to .glb, .gltf, .obj or .stl, or give the outline beside it"
        raise MeshError(f"{kind} cannot be read here: {known}")
    points = vertices(name, data)
    if ending_of(name) == ".stl":
        return points, np.arange(len(points)).reshape(-1, 3)
    faces = _ObjFaces(_plain(data), len(points))
    order = np.argsort(faces.group, kind="stable")
    return points, _fans(faces.corners, faces.sizes, order)


def _numbers(rows: list[bytes]) -> Floats:
    words = [row.split()[:3] for row in rows]
    try:
        if any(b"_" in row for row in rows) and any(b"_" in word for three in words for word in three):
            raise ValueError  # Python reads 1_0 as 10, nobody else does
        return np.array(words, dtype=np.float64).reshape(-1, 3)
    except ValueError:
        raise MeshError("a vertex in it is not three numbers") from None


_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_HEADER = 80  # bytes of a binary STL before the number of triangles


_FACET = re.compile(
    rb"^[ \t]*facet\b[^\n]*\n\s*(?:outer\s+loop\s+)?"
    + rb"vertex[ \t]+([^\n]*)\n\s*" * 3
    + rb"(?:end[ \t]*loop\s+)?end[ \t]*facet\b",
    re.MULTILINE | re.IGNORECASE,
)


def _stl(data: bytes) -> Floats:
    """The corners (V, 3) of the triangles of an STL file, three of each. Raises MeshError."""
    start = _HEADER + 4
    count = struct.unpack_from("<I", data, _HEADER)[0] if len(data) >= start else -1
    size = start + _TRIANGLE.itemsize * count
    # A binary file may open with the word `solid`, too: its length decides. Four letters as a count mean 7 GB and more.
    if count < 0 or len(data) < size:
        if data.removeprefix(BYTE_ORDER_MARK).lstrip()[:5].lower() == b"solid" and b"\0" not in data:
            return _stl_in_words(_text(data))
        raise MeshError("it is cut short" if count >= 0 else "it is no STL file")
    triangles = np.frombuffer(data, dtype=_TRIANGLE, count=count, offset=start)
    return np.asarray(triangles["corners"], dtype=np.float64).reshape(-1, 3)


def _stl_in_words(text: bytes) -> Floats:
    corners: list[bytes] = []

    def read(facet: re.Match[bytes]) -> bytes:
        corners.extend(facet.groups())
        return b"\n" * facet[0].count(b"\n")

    opened = False
    for number, line in enumerate(_FACET.sub(read, text).split(b"\n"), 1):
        if not line.strip():
            continue
        if not re.match(rb"\s*end[ \t]*solid\b" if opened else rb"\s*solid\b", line, re.IGNORECASE):
            wanted = "a `facet` of three corners, up to its `endfacet`, or `endsolid`" if opened else "`solid`"
            raise MeshError(f"line {number}: here must be {wanted}; it is damaged or cut short")
        opened = not opened
    if opened:
        raise MeshError("it is cut short: it does not end with `endsolid`")
    return _numbers(corners)


# Wavefront .obj files, with the colours and textures of their .mtl files.
# The format: http://www.martinreddy.net/gfx/3d/OBJ.spec and http://paulbourke.net/dataformats/mtl/.
BYTE_ORDER_MARK = b"\xef\xbb\xbf"  # of the order of bytes, which editors write before a text
MAX_MATERIALS = 10_000
NO_MATERIAL = ("", "None", "(null)")  # names of exporters for no material
# Options of a texture: how many numbers or words follow at most. Those in `SHIFTS` shift or stretch it.
MAP_OPTIONS = {f"-{one}": 1 for one in "blendu blendv boost bm clamp imfchan texres".split()} | {"-o": 3, "-s": 3}
SHIFTS = ("-o", "-s")


@dataclass(slots=True)
class _Material:
    place: str
    color: RGB | None = None
    image: str = ""
    scale: tuple[float, float] = (1.0, 1.0)
    offset: tuple[float, float] = (0.0, 0.0)


def _text(data: bytes) -> bytes:
    """A file in words: without a byte order mark, and its lines end with a newline, whatever ended them."""
    text = data.removeprefix(BYTE_ORDER_MARK)
    return text.replace(b"\r\n", b"\n").replace(b"\r", b"\n") if b"\r" in text else text


def _plain(data: bytes) -> bytes:
    """A file without comments, each of which ends with its line. What goes on in the next line stands in its first one,
    and empty lines after it keep the numbers of the others."""

    def whole(found: re.Match[bytes]) -> bytes:
        return found[0].replace(b"\\\n", b" ") + b"\n" * found[0].count(b"\n")

    text = _text(data)
    text = re.sub(rb"#[^\n]*", b"", text) if b"#" in text else text
    return re.sub(rb"^(?:[^\n]*\\\n)+[^\n]*", whole, text, flags=re.MULTILINE) if b"\\" in text else text


def _rows(text: bytes, word: bytes) -> Iterator[tuple[int, bytes]]:
    """What follows a word that opens a line, with the place of this line in the text."""
    pattern = rb"^[ \t]*" + word + rb"(?=\s|\Z)([^\n]*)"
    return ((one.start(), one[1]) for one in re.finditer(pattern, text, re.MULTILINE))


def _obj_points(text: bytes) -> Floats:
    return _numbers([row for _, row in _rows(text, b"v")])


class _ObjFaces:
    """The faces of an .obj file of `count` vertices (`places` in textures): `words` of their corners, one after the
    other, and for each face how many (`sizes`), where its line begins (`starts`) and the number of its material among
    `names`, in the order of their first faces (`group`). `corners` are the numbers of vertices, from 0. Raises
    MeshError, with the line."""

    def __init__(self, text: bytes, count: int) -> None:
        rows = list(_rows(text, b"f"))
        self.text = text
        self.starts = [start for start, _ in rows]
        split = [row.split() for _, row in rows]
        self.sizes = np.array([len(words) for words in split], dtype=np.int64)
        self.words = [word for words in split for word in words]
        for start, words in zip(self.starts, split, strict=True):
            if len(words) < 3:
                raise MeshError(f"{self.line(start)}: a face has at least 3 corners; here are {len(words)}")
        uses = [(start, _words(row)) for start, row in _rows(text, b"usemtl")]
        above = np.searchsorted(np.array([start for start, _ in uses]), self.starts)
        titles = ["", *(name for _, name in uses)]
        self.names = list(dict.fromkeys(titles[place] for place in above.tolist()))
        numbers = {name: number for number, name in enumerate(self.names)}
        self.group = np.array([numbers[titles[place]] for place in above.tolist()], dtype=np.int64)
        self.corners = self.indices([word.partition(b"/")[0] for word in self.words], b"v", count, "vertex")

    def line(self, start: int) -> str:
        return _line(self.text, start)

    def line_of(self, corner: int) -> str:
        """The line of a corner, by its place among `words`."""
        return self.line(self.starts[int(np.searchsorted(np.cumsum(self.sizes), corner, side="right"))])

    def indices(self, words: list[bytes], kind: bytes, count: int, what: str) -> Indices:
        """Numbers from 0 of what lines of a kind have, which corners name from 1, or back from their own line; -1 where
        a word is empty and may be."""
        if not all(map(re.compile(rb"-?0*[1-9]\d{0,9}|" if kind == b"vt" else rb"-?0*[1-9]\d{0,9}").fullmatch, words)):
            wrong = re.compile(rb"-?0*[1-9]\d{0,9}")
            place = next(k for k, word in enumerate(words) if (word or kind == b"v") and not wrong.fullmatch(word))
            shown = words[place][:20].decode("ascii", "replace")
            raise MeshError(f"{self.line_of(place)}: `{shown}` is not the number of a vertex, which count from 1")
        found = np.array([word or b"0" for word in words], dtype=np.int64)
        if (found < 0).any():
            lines = [start for start, _ in _rows(self.text, kind)]
            before = np.repeat([bisect_left(lines, start) for start in self.starts], self.sizes)
            past = np.flatnonzero(-found > before)
            if past.size:
                place = int(past[0])
                raise MeshError(
                    f"{self.line_of(place)}: {found[place]} counts back past the first of {int(before[place])}"
                )
            found = np.where(found < 0, found + before + 1, found)
        past = np.flatnonzero(found > count)
        if past.size:
            raise MeshError(f"{self.line_of(int(past[0]))}: a face names {what} {found[past[0]]} of {count}")
        return np.asarray(found - 1)


def _fans(corners: Indices, sizes: Indices, faces: Indices) -> Indices:
    """The triangles (F, 3) of some faces in this order, polygons cut from their first corner."""
    first, triangles = (np.cumsum(sizes) - sizes)[faces], sizes[faces] - 2
    step = np.arange(triangles.sum()) - np.repeat(np.cumsum(triangles) - triangles, triangles)
    start = np.repeat(first, triangles)
    found: Indices = corners[np.column_stack([start, start + step + 1, start + step + 2])]
    return found


def _material_surfaces(data: bytes, read: Read, budget: MeshBudget) -> list[ColoredMesh]:
    """A surface for each material, coloured by its Kd and map_Kd. A material without a colour, and faces without a
    material, get none. A surface has `uv` where all its corners name places in a texture."""
    text = _plain(data)
    points = _finite(_obj_points(text))
    places = np.array([_place(row.split(), text, start) for start, row in _rows(text, b"vt")]).reshape(-1, 2)
    faces = _ObjFaces(text, len(points))
    if not len(faces.sizes):
        raise MeshError("it has no faces")
    materials, libraries = _libraries(faces, read, budget)
    if faces.names == [""] and len(materials) == 1:  # scanners and YCB name the file of their one material alone
        faces.names = list(materials)
    budget.add_triangles(int((faces.sizes - 2).sum()))
    at = faces.indices(
        [word.split(b"/", 2)[1] if b"/" in word else b"" for word in faces.words],
        b"vt",
        len(places),
        "place in a texture",
    )
    starts = np.cumsum(faces.sizes) - faces.sizes
    images: dict[str, bytes] = {}
    made = []
    for number, name in enumerate(faces.names):
        mine = np.flatnonzero(faces.group == number)
        order = np.concatenate([np.arange(starts[k], starts[k] + faces.sizes[k]) for k in mine])
        known: dict[bytes | int, int] = {}
        firsts: list[int] = []
        corners = np.empty(len(faces.words), dtype=np.int64)
        for place in order.tolist():
            word = faces.words[place]
            key = place if b"-" in word else word  # what counts back means another one in each line
            if key not in known:
                known[key] = len(firsts)
                firsts.append(place)
            corners[place] = known[key]
        budget.add_vertices(len(firsts))
        if name not in materials and libraries and name not in NO_MATERIAL:
            line = faces.line(next(start for start, row in _rows(text, b"usemtl") if _words(row) == name))
            raise MeshError(f"{line}: material `{name[:60]}` is not in {', '.join(libraries)[:100]}")
        material = materials.get(name, _Material(""))
        bare = np.flatnonzero(at[firsts] < 0)
        if material.image and bare.size:
            line = faces.line_of(firsts[bare[0]])
            raise MeshError(f"{line}: a face has a texture, but no places in it (1/2 names the second vt)")
        if material.image and material.image not in images:
            image = _read_sibling(material.image, material.place, read, budget)
            budget.add_texture(image, f"{material.place}: {material.image}")
            images[material.image] = image
        uv = None
        if len(places) and not bare.size:
            uv = places[at[firsts]] * material.scale + material.offset
            uv = uv * (1.0, -1.0) + (0.0, 1.0)  # v = 0 is the lower edge here
        texture = images[material.image] if material.image else b""
        triangles = _fans(corners, faces.sizes, mine)
        made.append(ColoredMesh(points[faces.corners[firsts]], triangles, material.color, uv, texture))
    return made


def _libraries(faces: _ObjFaces, read: Read, budget: MeshBudget) -> tuple[dict[str, _Material], list[str]]:
    """The materials of all .mtl files, and the names of these: a name with spaces, or several names."""
    materials: dict[str, _Material] = {}
    libraries: list[str] = []
    for start, row in _rows(faces.text, b"mtllib"):
        names, line = _words(row), faces.line(start)
        try:
            found = [(names, _read_sibling(names, line, read, budget))]
        except MeshError:
            parts = names.split()
            if len(parts) < 2:
                raise
            found = [(part, _read_sibling(part, line, read, budget)) for part in parts]
        for name, data in found:
            libraries.append(name)
            for title, material in _materials(name, data):
                materials.setdefault(title, material)
            if len(materials) > MAX_MATERIALS:
                raise MeshError(f"{line}: its files have more than {MAX_MATERIALS:,} materials together")
    return materials, libraries


def _read_sibling(name: str, place: str, read: Read, budget: MeshBudget) -> bytes:
    try:
        data = read(name.replace("\\", "/"))
    except MeshError as error:
        raise MeshError(f"{place}: {error}") from None
    budget.add_file(data)
    return data


def _words(row: bytes) -> str:
    return row.strip().decode("utf-8", "replace")


def _line(text: bytes, start: int) -> str:
    number = text.count(b"\n", 0, start) + 1
    return f"line {number}"


def _place(words: list[bytes], text: bytes, start: int) -> tuple[float, float]:
    try:
        values = _floats(words[:2], "")
    except MeshError as error:
        raise MeshError(f"{_line(text, start)}{error}") from None
    return values[0], values[1] if len(values) > 1 else 0.0


def _floats(words: list[bytes], place: str) -> list[float]:
    try:
        if any(b"_" in word for word in words) or not words:
            raise ValueError
        values = [float(word) for word in words]
    except ValueError:
        raise MeshError(f"{place}: here must be numbers") from None
    if not all(abs(value) <= MAX_MESH_COORDINATE for value in values):  # nor nan
        raise MeshError(f"{place}: a number is none, or beyond all measure")
    return values


def _materials(name: str, data: bytes) -> Iterator[tuple[str, _Material]]:
    """The materials of an .mtl file, in order."""
    title, current = "", None
    for number, whole in enumerate(_plain(data).split(b"\n"), 1):
        line, place = whole.strip(), f"{name}, line {number}"
        word = line.partition(b" ")[0].partition(b"\t")[0].lower()
        if word == b"newmtl":
            if current is not None:
                yield title, current
            title, current = _words(line[len(word) :]), _Material(place)
        elif current is None:
            continue
        elif word == b"kd":
            values = np.clip(_floats(line.split()[1:4], place), 0.0, 1.0).tolist()
            red, green, blue = values if len(values) == 3 else values[:1] * 3
            current.color = red, green, blue
        elif word == b"map_kd":
            _texture(current, _words(line[len(word) :]), place)
    if current is not None:
        yield title, current


def _texture(material: _Material, text: str, place: str) -> None:
    """The options and file of a `map_Kd`."""
    words = text.split()
    at = 0
    while at < len(words) and words[at] in MAP_OPTIONS:
        option, most = words[at], MAP_OPTIONS[words[at]]
        at += 1
        given = 0
        while given < most and at + given < len(words) - 1 and (option not in SHIFTS or _is_number(words[at + given])):
            given += 1
        if option in SHIFTS:
            values = _floats([word.encode() for word in words[at : at + given]], place)
            rest = 1.0 if option == "-s" else 0.0
            pair = values[0], values[1] if len(values) > 1 else rest
            if option == "-s":
                material.scale = pair
            else:
                material.offset = pair
        at += given
    if at < len(words) and words[at].startswith("-") and len(words) > at + 1:
        raise MeshError(f"{place}: the option {words[at][:20]} of a texture is not read here: export it without")
    if at == len(words):
        raise MeshError(f"{place}: a texture without a file")
    material.image, material.place = text.split(None, at)[at].strip(), place
    if material.color is None:
        material.color = WHITE


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
