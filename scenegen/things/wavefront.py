"""The surfaces of Wavefront .obj files, with the colours and textures of their .mtl files.

The format: http://www.martinreddy.net/gfx/3d/OBJ.spec and http://paulbourke.net/dataformats/mtl/.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from scenegen.things.colored_mesh import WHITE, Budget, Surface
from scenegen.things.mesh import Floats
from scenegen.things.meshfile import FARTHEST, MeshError, vertices
from scenegen.things.palette import RGB

MOST_MATERIALS = 10_000
WITHOUT = ("", "None", "(null)")  # names of exporters for no material
# Options of a texture: how many numbers or words follow at most. Those with a place in `MOVES` shift or stretch it.
OPTIONS = {
    "-blendu": 1,
    "-blendv": 1,
    "-boost": 1,
    "-bm": 1,
    "-clamp": 1,
    "-imfchan": 1,
    "-texres": 1,
    "-o": 3,
    "-s": 3,
}
MOVES = ("-o", "-s")

Read = Callable[[str], bytes]


@dataclass(slots=True)
class _Material:
    place: str
    color: RGB | None = None
    image: str = ""
    scale: tuple[float, float] = (1.0, 1.0)
    offset: tuple[float, float] = (0.0, 0.0)


@dataclass(slots=True)
class _Group:
    """The faces of one material: each different corner as (vertex, place in the texture or -1), its line, and three
    numbers of corners for each triangle."""

    known: dict[bytes, int] = field(default_factory=dict)
    corners: list[tuple[int, int]] = field(default_factory=list)
    lines: list[int] = field(default_factory=list)
    triangles: list[tuple[int, int, int]] = field(default_factory=list)


@dataclass(slots=True)
class _Reader:
    """One .obj file, line by line."""

    read: Read
    budget: Budget
    painted: bool
    vertices: int = 0
    places: list[tuple[float, float]] = field(default_factory=list)
    groups: dict[str, _Group] = field(default_factory=dict)
    libraries: list[str] = field(default_factory=list)
    materials: dict[str, _Material] = field(default_factory=dict)
    used: dict[str, int] = field(default_factory=dict)  # the line that names a material first

    def lines(self, data: bytes) -> None:
        group = None
        name = ""
        for number, line in _lines(data):
            words = line.split()
            match words[0]:
                case b"v":
                    self.vertices += 1
                case b"vt":
                    self.places.append(_place(words[1:], number))
                case b"f":
                    if group is None:
                        group = self.groups.setdefault(name, _Group())
                    self._face(group, words[1:], number)
                case b"usemtl":
                    name = _text(line, words[0])
                    group = None
                    self.used.setdefault(name, number)
                case b"mtllib" if self.painted:
                    self._library(_text(line, words[0]), number)
                case _:  # points, lines, curves, names, normals, smoothing
                    pass

    def _face(self, group: _Group, words: list[bytes], number: int) -> None:
        if len(words) < 3:
            raise MeshError(f"line {number}: a face has at least 3 corners; here are {len(words)}")
        self.budget.add_triangles(len(words) - 2)
        found = []
        for word in words:
            corner = group.known.get(word)
            if corner is None:
                corner = len(group.corners)
                group.corners.append(self._corner(word, number))
                group.lines.append(number)
                if b"-" not in word:  # which counts back from here
                    group.known[word] = corner
            found.append(corner)
        group.triangles += [(found[0], found[k], found[k + 1]) for k in range(1, len(found) - 1)]

    def _corner(self, word: bytes, number: int) -> tuple[int, int]:
        vertex, _, rest = word.partition(b"/")
        place = rest.partition(b"/")[0]
        one = self._index(vertex, self.vertices, number)
        return one, self._index(place, len(self.places), number) if place else -1

    def _index(self, word: bytes, count: int, number: int) -> int:
        digits = word.removeprefix(b"-")
        if not digits.isdigit() or len(digits) > 10 or not int(digits):
            shown = word[:20].decode("ascii", "replace")
            raise MeshError(f"line {number}: `{shown}` is not the number of a vertex, which count from 1")
        if word != digits:
            if int(digits) > count:
                raise MeshError(f"line {number}: {-int(digits)} counts back past the first of {count}")
            return count - int(digits)
        return int(digits) - 1

    def _library(self, names: str, number: int) -> None:
        """The materials of .mtl files: a name with spaces, or several names."""
        try:
            found = [(names, self._beside(names, f"line {number}"))]
        except MeshError:
            parts = names.split()
            if len(parts) < 2:
                raise
            found = [(part, self._beside(part, f"line {number}")) for part in parts]
        for name, data in found:
            self.libraries.append(name)
            for title, material in _materials(name, data):
                self.materials.setdefault(title, material)
            if len(self.materials) > MOST_MATERIALS:
                raise MeshError(f"line {number}: its files have more than {MOST_MATERIALS:,} materials together")

    def _beside(self, name: str, place: str) -> bytes:
        try:
            data = self.read(name.replace("\\", "/"))
        except MeshError as error:
            raise MeshError(f"{place}: {error}") from None
        self.budget.add_file(data)
        return data

    def surfaces(self, points: Floats) -> tuple[Surface, ...]:
        """Raises MeshError."""
        if self.vertices != len(points):
            raise MeshError("a line in it starts as a vertex and is none")
        places = np.array(self.places, dtype=np.float64).reshape(-1, 2)
        images: dict[str, bytes] = {}
        made = []
        for name, group in self.groups.items():
            corners = np.array(group.corners, dtype=np.int64)
            for column, count, what in ((0, len(points), "vertex"), (1, len(places), "place in a texture")):
                past = np.flatnonzero(corners[:, column] >= count)
                if past.size:
                    line, wrong = group.lines[past[0]], int(corners[past[0], column]) + 1
                    raise MeshError(f"line {line}: a face names {what} {wrong} of {count}")
            self.budget.add_vertices(len(corners))
            material = self._material(name)
            uv, texture = None, b""
            if material.image:
                if (corners[:, 1] < 0).any():
                    line = group.lines[int(np.argmax(corners[:, 1] < 0))]
                    raise MeshError(f"line {line}: a face has a texture, but no places in it (1/2 names the second vt)")
                if material.image not in images:
                    images[material.image] = self._image(material)
                texture = images[material.image]
            if len(places) and (corners[:, 1] >= 0).all():
                uv = places[corners[:, 1]] * material.scale + material.offset
                uv = uv * (1.0, -1.0) + (0.0, 1.0)  # v = 0 is the lower edge here
            faces = np.array(group.triangles, dtype=np.int64)
            made.append(Surface(points[corners[:, 0]], faces, material.color, uv, texture))
        if not made:
            raise MeshError("it has no faces")
        return tuple(made)

    def _material(self, name: str) -> _Material:
        """That of a `usemtl`; one without a colour where there is none to look it up in. Raises MeshError."""
        if name in self.materials:
            return self.materials[name]
        if self.libraries and name not in WITHOUT:
            raise MeshError(
                f"line {self.used[name]}: material `{name[:60]}` is not in {', '.join(self.libraries)[:100]}"
            )
        return _Material("")

    def _image(self, material: _Material) -> bytes:
        data = self._beside(material.image, material.place)
        self.budget.add_texture(data, f"{material.place}: {material.image}")
        return data


def surfaces(name: str, data: bytes, read: Read, budget: Budget, *, painted: bool = True) -> tuple[Surface, ...]:
    """What an .obj file shows, in its own unit and axes: a surface for each material, coloured by its Kd and map_Kd.

    A material without a colour, and faces without a material, get none. Polygons are cut from their first corner. A
    surface has `uv` where all its corners name places in a texture. Not `painted`, .mtl files are not read. `read`
    gives the bytes of a file that it names, relative to it; what that raises passes through. Raises MeshError, with the
    line.
    """
    points = vertices(name, data)
    reader = _Reader(read, budget, painted)
    reader.lines(data.removeprefix(b"\xef\xbb\xbf"))
    return reader.surfaces(points)


def _lines(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Lines that say something, with the number of the first where one goes on."""
    before, start = b"", 0
    for number, line in enumerate(data.split(b"\n"), 1):
        text = line.rstrip(b"\r")
        if text.endswith(b"\\"):
            before, start = before + text[:-1] + b" ", start or number
            continue
        whole = (before + text).partition(b"#")[0].strip() if b"#" in text or before else text.strip()
        if whole:
            yield start or number, whole
        before, start = b"", 0
    if before.strip():
        yield start, before.strip()


def _text(line: bytes, word: bytes) -> str:
    """What follows the first word of a line."""
    return line[len(word) :].strip().decode("utf-8", "replace")


def _place(words: list[bytes], number: int) -> tuple[float, float]:
    values = _floats(words[:2], f"line {number}")
    return values[0], values[1] if len(values) > 1 else 0.0


def _floats(words: list[bytes], place: str) -> list[float]:
    try:
        if any(b"_" in word for word in words) or not words:
            raise ValueError
        values = [float(word) for word in words]
    except ValueError:
        raise MeshError(f"{place}: here must be numbers") from None
    if not all(abs(value) <= FARTHEST for value in values):  # nor nan
        raise MeshError(f"{place}: a number is none, or beyond all measure")
    return values


def _materials(name: str, data: bytes) -> Iterator[tuple[str, _Material]]:
    """The materials of an .mtl file, in order."""
    title, current = "", None
    for number, line in _lines(data.removeprefix(b"\xef\xbb\xbf")):
        word, place = line.split(None, 1)[0].lower(), f"{name}, line {number}"
        if word == b"newmtl":
            if current is not None:
                yield title, current
            title, current = _text(line, word), _Material(place)
        elif current is None:
            continue
        elif word == b"kd":
            values = np.clip(_floats(line.split()[1:4], place), 0.0, 1.0).tolist()
            red, green, blue = values if len(values) == 3 else values[:1] * 3
            current.color = red, green, blue
        elif word == b"map_kd":
            _texture(current, _text(line, word), place)
    if current is not None:
        yield title, current


def _texture(material: _Material, text: str, place: str) -> None:
    """The options and file of a `map_Kd`."""
    words = text.split()
    at = 0
    while at < len(words) and words[at] in OPTIONS:
        option, most = words[at], OPTIONS[words[at]]
        at += 1
        given = 0
        while given < most and at + given < len(words) - 1 and (option not in MOVES or _is_number(words[at + given])):
            given += 1
        if option in MOVES:
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
