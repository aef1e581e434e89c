"""What a file of one's own shows, to be drawn as it is: glTF, .obj, .stl, and the visual shapes of a URDF file."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from scenegen.things import gltf
from scenegen.things.colored_mesh import WHITE, ColoredMesh, MeshBudget, refuse_layers, tidy
from scenegen.things.mesh import Floats, Mesh, box, disc, revolve
from scenegen.things.meshfile import FARTHEST, MeshError, beside, ending_of, vertices
from scenegen.things.palette import RGB
from scenegen.things.urdf import (
    GLTF,
    Element,
    ElementsError,
    LinkFrame,
    UrdfError,
    elements,
    links_of,
    numbers_of,
    origin_of,
    sizes_of,
    solid_of,
)

# --------------------------------------------------------------------------------------------------------------------
# The surfaces of Wavefront .obj files, with the colours and textures of their .mtl files.
#
# The format: http://www.martinreddy.net/gfx/3d/OBJ.spec and http://paulbourke.net/dataformats/mtl/.


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
class _ObjReader:
    """One .obj file, line by line."""

    read: Read
    budget: MeshBudget
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

    def surfaces(self, points: Floats) -> tuple[ColoredMesh, ...]:
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
            made.append(ColoredMesh(points[corners[:, 0]], faces, material.color, uv, texture))
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


def surfaces(
    name: str, data: bytes, read: Read, budget: MeshBudget, *, painted: bool = True
) -> tuple[ColoredMesh, ...]:
    """What an .obj file shows, in its own unit and axes: a surface for each material, coloured by its Kd and map_Kd.

    A material without a colour, and faces without a material, get none. Polygons are cut from their first corner. A
    surface has `uv` where all its corners name places in a texture. Not `painted`, .mtl files are not read. `read`
    gives the bytes of a file that it names, relative to it; what that raises passes through. Raises MeshError, with the
    line.
    """
    points = vertices(name, data)
    reader = _ObjReader(read, budget, painted)
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


RINGS = 16  # of a sphere, from pole to pole


def mesh_surfaces(
    name: str, data: bytes, read: Read, budget: MeshBudget | None = None, *, painted: bool = True
) -> tuple[ColoredMesh, ...]:
    """The surfaces of a .glb, .gltf, .obj or .stl file, in its own unit, z upwards (as `gltf.surfaces` turns them).

    `read` gives the bytes of a file that it names, relative to it; what that raises passes through. Not
    `painted`, the colours of .obj files are left out. Raises MeshError.
    """
    found = _surfaces(name, data, read, budget or MeshBudget(), painted=painted)
    refuse_layers(found)
    return found


def _surfaces(name: str, data: bytes, read: Read, budget: MeshBudget, *, painted: bool) -> tuple[ColoredMesh, ...]:
    ending = ending_of(name)
    if ending in GLTF:
        return gltf.surfaces(name, data, read)
    if ending == ".obj":
        return tuple(map(tidy, surfaces(name, data, read, budget, painted=painted)))
    corners = vertices(name, data)
    if len(corners) % 3:
        raise MeshError("it is cut short: a triangle in it has fewer than three corners")
    budget.add_vertices(len(corners))
    budget.add_triangles(len(corners) // 3)
    return (tidy(ColoredMesh(corners, np.arange(len(corners)).reshape(-1, 3), None)),)


def robot_surfaces(data: bytes, read: Read) -> tuple[ColoredMesh, ...]:
    """The visual shapes of a URDF file in the frame of its root link, all joints at zero; the collision shapes of one
    that has no visual shape at all.

    A mesh's own colours and textures count; what has none gets those of the shape's <material>. `read` as in
    `mesh_surfaces`, by names as the file has them. Raises UrdfError, with line and element.
    """
    try:
        robot = elements(data)
        links = links_of(robot)
        shapes = [(one, pose) for link, pose in links for one in link.all("visual")]
        shapes = shapes or [(one, pose) for link, pose in links for one in link.all("collision")]
        if not shapes:
            raise UrdfError("no link of it has a shape")
        inside = [one for shape, _ in shapes for one in shape.all("material")]
        named: dict[str, Element] = {}
        for material in (*robot.all("material"), *inside):
            if material.children:
                named.setdefault(material.attributes.get("name", ""), material)
        reader = _DrawnFileReader(read, named)
        found = tuple(made for shape, pose in shapes for made in reader.surfaces(shape, pose.then(origin_of(shape))))
        try:
            refuse_layers(found)
        except MeshError as error:
            raise UrdfError(str(error)) from None
        return found
    except ElementsError as error:
        raise UrdfError(str(error)) from None


@dataclass(slots=True)
class _DrawnFileReader:
    read: Read
    named: dict[str, Element]
    budget: MeshBudget = field(default_factory=MeshBudget)
    meshes: dict[str, tuple[ColoredMesh, ...]] = field(default_factory=dict)
    textures: dict[str, bytes] = field(default_factory=dict)

    def surfaces(self, shape: Element, pose: LinkFrame) -> list[ColoredMesh]:
        """Raises UrdfError, ElementsError."""
        solid = solid_of(shape)
        color, texture = self._material(shape)
        try:
            found = self._solid(solid)
        except MeshError as error:
            raise UrdfError(f"{solid.place}: {error}") from None
        made = []
        for one in found:
            if one.color is None:
                if texture and one.uv is None:
                    raise UrdfError(f"{solid.place}: it has a texture and no places in it: only .obj meshes have them")
                one = replace(one, color=color, texture=texture)
            made.append(replace(one, vertices=one.vertices @ pose.turn.T + pose.at))
        return made

    def _solid(self, solid: Element) -> tuple[ColoredMesh, ...]:
        """A shape in its own frame."""
        match solid.tag:
            case "box":
                x, y, z = sizes_of(solid, "size", 3)
                return self._counted(box(x, y, z).moved(z=-z / 2.0))
            case "cylinder":
                (radius,), (length,) = sizes_of(solid, "radius", 1), sizes_of(solid, "length", 1)
                return self._counted(disc(radius, -length / 2.0, length / 2.0))
            case "sphere":
                (radius,) = sizes_of(solid, "radius", 1)
                turns = np.linspace(-np.pi / 2.0, np.pi / 2.0, RINGS + 1)[1:-1]
                arc = [(radius * float(np.cos(turn)), radius * float(np.sin(turn))) for turn in turns]
                return self._counted(revolve([(0.0, -radius), *arc, (0.0, radius)], 2 * RINGS))
            case _:
                scale = np.array(numbers_of(solid, "scale", 3, "1 1 1"))
                return tuple(_scaled(one, scale) for one in self._mesh(solid.get("filename")))

    def _counted(self, mesh: Mesh) -> tuple[ColoredMesh, ...]:
        self.budget.add_vertices(len(mesh.vertices))
        self.budget.add_triangles(len(mesh.faces))
        return (ColoredMesh(mesh.vertices, mesh.faces, None),)

    def _mesh(self, name: str) -> tuple[ColoredMesh, ...]:
        """A mesh file in its own frame, read once and counted as often as it is placed."""
        if name in self.meshes:
            for one in self.meshes[name]:
                self.budget.add_vertices(len(one.vertices))
                self.budget.add_triangles(len(one.faces))
        else:
            if ending_of(name) in GLTF:  # which collision shapes cannot have either
                raise MeshError(f"mesh {name[:60]}: only .obj and .stl meshes are read in a URDF file: convert it")
            data = self.read(name)
            self.budget.add_file(data)
            try:
                self.meshes[name] = mesh_surfaces(name, data, lambda other: self.read(beside(name, other)), self.budget)
            except MeshError as error:
                raise MeshError(f"mesh {name[:60]}: {error}") from None
        return self.meshes[name]

    def _material(self, shape: Element) -> tuple[RGB | None, bytes]:
        """Colour and texture of a visual shape's <material>."""
        if not (given := shape.all("material")):
            return None, b""
        material, name = given[0], given[0].attributes.get("name", "")
        if not material.children and name:
            if name not in self.named:
                raise UrdfError(f"{material.place}: there is no material `{name[:60]}`")
            material = self.named[name]
        color: RGB | None = None
        if colors := material.all("color"):
            red, green, blue, _ = np.clip(numbers_of(colors[0], "rgba", 4), 0.0, 1.0).tolist()
            color = red, green, blue
        if not (textures := material.all("texture")):
            return color, b""
        file = textures[0].get("filename")
        if file not in self.textures:
            try:
                data = self.read(file)
                self.budget.add_file(data)
                self.budget.add_texture(data, file)
            except MeshError as error:
                raise UrdfError(f"{textures[0].place}: {error}") from None
            self.textures[file] = data
        return color or WHITE, self.textures[file]


def _scaled(surface: ColoredMesh, scale: Floats) -> ColoredMesh:
    flipped = float(np.prod(scale)) < 0.0
    faces = surface.faces[:, ::-1].copy() if flipped else surface.faces
    return replace(surface, vertices=surface.vertices * scale, faces=faces)
