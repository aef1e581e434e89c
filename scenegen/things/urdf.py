"""URDF files: what the robot description's shapes cover of the table, and how they are drawn, all joints at zero; and
the outline of a mesh file alone.

Of outlines collision shapes count, and the visual ones of links that have none. The format:
http://wiki.ros.org/urdf/XML.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from xml.parsers import expat

import numpy as np

from scenegen.geometry import Box, Circle, Footprint
from scenegen.things.colored_mesh import WHITE, ColoredMesh, MeshBudget, refuse_layers
from scenegen.things.library import RGB
from scenegen.things.mesh import Mesh, box, disc, revolve
from scenegen.things.meshfile import MESH_FILES, Read, ending_of, mesh_points, mesh_surfaces, sibling_name
from scenegen.things.outline import Floats, MeshError, Shadow

# XML from strangers: elements with their attributes, lines and short texts, nothing else.
# Document types are refused, and with them entities; size, depth and number of elements are limited.
MAX_XML_BYTES = 8_000_000
MAX_ELEMENTS = 20_000
MAX_XML_DEPTH = 50
MAX_ELEMENT_TEXT = 200  # characters of text that are kept of an element


@dataclass(slots=True)
class Element:
    """`<tag name="value">` with its children in order; `line` counts from 1."""

    tag: str
    attributes: dict[str, str]
    line: int
    children: list[Element] = field(default_factory=list)
    text: str = ""  # before its first child, the first characters of it

    @property
    def place(self) -> str:
        return f"line {self.line}, <{self.tag}>"

    def findall(self, tag: str) -> list[Element]:
        """The children of that tag."""
        return [child for child in self.children if child.tag == tag]

    def find(self, tag: str) -> Element:
        """The first child of that tag. Raises MeshError where there is none."""
        found = self.findall(tag)
        if not found:
            raise MeshError(f"{self.place}: there is no <{tag}> in it")
        return found[0]

    def get(self, name: str, default: str = "") -> str:
        """An attribute. Raises MeshError where it is missing and has no default."""
        value = self.attributes.get(name, default)
        if not value:
            raise MeshError(f"{self.place}: it has no {name}")
        return value


def elements(data: bytes) -> Element:
    """The outermost element of an XML document. Raises MeshError."""
    if len(data) > MAX_XML_BYTES:
        raise MeshError(f"it is larger than {MAX_XML_BYTES:,} bytes")
    parser = expat.ParserCreate()
    document = Element("", {}, 0)
    path = [document]
    count = 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal count
        line = parser.CurrentLineNumber
        count += 1
        if tag.startswith("xacro:"):
            raise MeshError(f"line {line}: it is a xacro file; expand it first: xacro in.xacro > out.urdf")
        if count > MAX_ELEMENTS:
            raise MeshError(f"it has more than {MAX_ELEMENTS:,} elements")
        if len(path) > MAX_XML_DEPTH:
            raise MeshError(f"line {line}: it is nested more than {MAX_XML_DEPTH} deep")
        element = Element(tag, attributes, line)
        path[-1].children.append(element)
        path.append(element)

    def end(tag: str) -> None:
        path.pop()

    def doctype(*_: object) -> None:
        raise MeshError(f"line {parser.CurrentLineNumber}: it has a document type, which is not read; remove it")

    def characters(text: str) -> None:
        here = path[-1]
        if not here.children and len(here.text) < MAX_ELEMENT_TEXT:
            here.text += text[:MAX_ELEMENT_TEXT]

    parser.buffer_text = True
    parser.CharacterDataHandler = characters
    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.StartDoctypeDeclHandler = doctype
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        raise MeshError(f"it is not well-formed XML at line {error.lineno}: {expat.ErrorString(error.code)}") from None
    except (LookupError, ValueError):  # of the codecs, for an encoding that expat does not know itself
        raise MeshError("it is not well-formed XML: its encoding is unknown") from None
    return document.children[0]


MAX_URDF_NUMBER = 1e6  # of any number in the file
SOLIDS = ("box", "cylinder", "sphere", "mesh")


@dataclass(frozen=True, slots=True)
class LinkFrame:
    """A frame: `turn` (3, 3) its axes, `at` (3,) its origin, in the frame of the root link."""

    turn: Floats
    at: Floats

    def then(self, inner: LinkFrame) -> LinkFrame:
        return LinkFrame(self.turn @ inner.turn, self.turn @ inner.at + self.at)


def links_of(robot: Element) -> list[tuple[Element, LinkFrame]]:
    """Every link with its pose, all joints at zero. Raises MeshError."""
    if robot.tag != "robot":
        raise MeshError(f"its outermost element is <{robot.tag}>, a URDF's is <robot>")
    links: dict[str, Element] = {}
    for link in robot.findall("link"):
        name = link.get("name")
        if name in links:
            raise MeshError(f"{link.place}: a second link `{name}`")
        links[name] = link
    if not links:
        raise MeshError("it has no link")
    below: dict[str, list[tuple[str, LinkFrame]]] = {}
    parents: dict[str, str] = {}
    for joint in robot.findall("joint"):
        ends = []
        for role in ("parent", "child"):
            end = joint.find(role)
            name = end.get("link")
            if name not in links:
                raise MeshError(f"{end.place}: there is no link `{name}`")
            ends.append(name)
        parent, child = ends
        if child in parents:
            raise MeshError(f"{joint.place}: link `{child}` has two parents, `{parents[child]}` and `{parent}`")
        parents[child] = parent
        below.setdefault(parent, []).append((child, origin_of(joint)))
    roots = [name for name in links if name not in parents]
    if len(roots) > 1:
        raise MeshError(f"its links do not hang together: no joint moves `{roots[0]}` and none `{roots[1]}`")
    found = [(name, LinkFrame(np.eye(3), np.zeros(3))) for name in roots]
    for name, pose in found:  # grows while it is walked
        found += [(child, pose.then(origin)) for child, origin in below.get(name, [])]
    if len(found) < len(links):
        lost = next(name for name in links if name not in dict(found))
        raise MeshError(f"its joints run in a circle through link `{lost}`")
    return [(links[name], pose) for name, pose in found]


def origin_of(element: Element) -> LinkFrame:
    """The pose that an element's <origin> gives: `rpy` are turns about the fixed x, y and z axes, in that order."""
    origins = element.findall("origin")
    if not origins:
        return LinkFrame(np.eye(3), np.zeros(3))
    roll, pitch, yaw = numbers_of(origins[0], "rpy", 3, "0 0 0")
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(angle), math.sin(angle)) for angle in (roll, pitch, yaw))
    turn = np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
    return LinkFrame(turn, np.array(numbers_of(origins[0], "xyz", 3, "0 0 0")))


def solid_of(shape: Element) -> Element:
    """The box, cylinder, sphere or mesh of a <visual> or <collision>. Raises MeshError."""
    geometry = shape.find("geometry")
    if len(geometry.children) != 1 or geometry.children[0].tag not in SOLIDS:
        found = " and ".join(f"<{child.tag}>" for child in geometry.children[:3]) or "nothing"
        raise MeshError(f"{geometry.place}: a shape is one box, cylinder, sphere or mesh; here is {found}")
    return geometry.children[0]


def numbers_of(element: Element, name: str, count: int, default: str = "") -> list[float]:
    text = element.get(name, default)
    try:
        values = [float(word) for word in text.split() if "_" not in word]
    except ValueError:
        values = []
    if len(values) != count or len(text.split()) != count:
        wanted = "a number" if count == 1 else f"{count} numbers"
        raise MeshError(f'{element.place}: {name}="{text[:40]}" is not {wanted}')
    if not all(abs(value) <= MAX_URDF_NUMBER for value in values):  # nor nan
        raise MeshError(f'{element.place}: {name}="{text[:40]}" is beyond all measure')
    return values


def sizes_of(element: Element, name: str, count: int) -> list[float]:
    values = numbers_of(element, name, count)
    if min(values) < 0.0:
        raise MeshError(f'{element.place}: {name}="{element.get(name)[:40]}" is negative')
    return values


@contextmanager
def placed_error(element: Element) -> Iterator[None]:
    """Errors of the block name the element."""
    with named_error(element.place):
        yield


@contextmanager
def named_error(what: str) -> Iterator[None]:
    """Errors of the block begin with `what`."""
    try:
        yield
    except MeshError as error:
        raise MeshError(f"{what}: {error}") from None


def solid_mesh(solid: Element, sides: int, around: int, rings: int) -> Mesh:
    """The mesh of a box, of a cylinder with so many sides, or of a sphere with so many around and from pole to pole."""
    match solid.tag:
        case "box":
            x, y, z = sizes_of(solid, "size", 3)
            return box(x, y, z).shift(z=-z / 2.0)
        case "cylinder":
            (radius,), (length,) = sizes_of(solid, "radius", 1), sizes_of(solid, "length", 1)
            return disc(radius, -length / 2.0, length / 2.0, sides)
        case _:
            (radius,) = sizes_of(solid, "radius", 1)
            turns = np.linspace(-np.pi / 2.0, np.pi / 2.0, rings + 1)[1:-1]
            arc = [(radius * float(np.cos(turn)), radius * float(np.sin(turn))) for turn in turns]
            return revolve([(0.0, -radius), *arc, (0.0, radius)], around)


@dataclass(slots=True)
class MeshFiles:
    """The mesh files that shapes name, in their own frames: each is read once, and counted as often as it is placed.
    `painted` as in `mesh_surfaces`."""

    read: Read
    painted: bool = True
    budget: MeshBudget = field(default_factory=MeshBudget)
    known: dict[str, tuple[ColoredMesh, ...]] = field(default_factory=dict)
    outlines: dict[str, list[Floats]] = field(default_factory=dict)

    def surfaces(self, name: str) -> tuple[ColoredMesh, ...]:
        """Raises MeshError."""
        if name in self.known:
            for one in self.known[name]:
                self.budget.add_vertices(len(one.vertices))
                self.budget.add_triangles(len(one.faces))
            return self.known[name]
        data = self._data(name)
        with named_error(f"mesh {name[:60]}"):
            self.known[name] = mesh_surfaces(name, data, self._reader_beside(name), self.budget, painted=self.painted)
        return self.known[name]

    def points(self, name: str) -> list[Floats]:
        """The vertices (V, 3) of its triangles."""
        if name not in self.outlines:
            data = self._data(name)
            with named_error(f"mesh {name[:60]}"):
                self.outlines[name] = mesh_points(name, data, self._reader_beside(name))
        self.budget.add_vertices(sum(map(len, self.outlines[name])))
        return self.outlines[name]

    def _data(self, name: str) -> bytes:
        if ending_of(name) not in MESH_FILES:
            why = "only .obj and .stl meshes are read in a URDF file: convert it, or give the outline beside it"
            raise MeshError(f"mesh {name[:60]}: {why}")
        data = self.read(name)
        self.budget.add_file(data)
        return data

    def _reader_beside(self, name: str) -> Read:
        return lambda other: self.read(sibling_name(name, other))


MAX_URDF_SIZE, MIN_URDF_SIZE = 1e3, 1e-6  # metres: sizes of objects, as in the language
USUAL_URDF_SIZE = 20.0  # metres: a file of something larger is in another unit
URDF_ENDING = ".urdf"


def outline(data: bytes, read_mesh: Read) -> tuple[Footprint, float]:
    """Footprint and height (metres) of a URDF file, in the frame of its root link.

    The footprint is the convex hull of what all shapes cover, as `Shadow.footprint` says: circle or box where it is
    that and stands round the origin, else a polygon. The height is from the lowest to the highest point: the object
    stands with its lowest point on the table, wherever its origin is. `read_mesh` gives the bytes of a mesh file (.obj
    or .stl) as the file names it; what it raises passes through. Raises MeshError.
    """
    return footprint_and_height(robot_shadow(data, read_mesh), 'write scale="0.001 0.001 0.001" in its <mesh>')


def mesh_outline(name: str, data: bytes, read: Read) -> tuple[Footprint, float]:
    """Footprint and height (metres) of a mesh file, .obj, .stl, .glb or .gltf by the ending of `name`, whose unit is
    the metre; z points up in the first two, y in glTF files. As in `outline`, the footprint is the convex hull of what
    it covers, and the object stands with its lowest point on the table. `read` gives the bytes of a file that a glTF
    file names; what that raises passes through. Raises MeshError."""
    return footprint_and_height(
        mesh_shadow(name, data, read), 'give it an entry in assets.toml with scale = 0.001, and write asset("NAME")'
    )


@dataclass(frozen=True, slots=True, eq=False)
class RobotPlacement:
    """Where and how large a robot is: `turn` (3, 3) a rotation of its root frame, then `scale`, then the origin at `at`
    (3,), metres."""

    turn: Floats = field(default_factory=lambda: np.eye(3))
    scale: float = 1.0
    at: Floats = field(default_factory=lambda: np.zeros(3))

    def then(self, inner: LinkFrame) -> LinkFrame:
        """The frame of a shape, whose sizes are still the file's."""
        return LinkFrame(self.turn @ inner.turn, self.scale * (self.turn @ inner.at) + self.at)


def robot_shadow(data: bytes, read_mesh: Read, placed: RobotPlacement | None = None) -> Shadow:
    """The shadow of what `outline` measures, of the robot placed as said. Raises MeshError."""
    placed = placed or RobotPlacement()
    shadow, files = Shadow(), MeshFiles(read_mesh, painted=False)
    for link, pose in links_of(elements(data)):
        for shape in link.findall("collision") or link.findall("visual"):
            add_shape(shadow, shape, placed.then(pose.then(origin_of(shape))), placed.scale, files)
    if shadow.top < shadow.bottom:
        raise MeshError("no link of it has a shape")
    return shadow


def mesh_shadow(name: str, data: bytes, read: Read) -> Shadow:
    """The shadow of what `mesh_outline` measures. Raises MeshError."""
    shadow = Shadow()
    for points in mesh_points(name, data, read):
        shadow.points(np.eye(3), np.zeros(3), points)
    return shadow


def footprint_and_height(shadow: Shadow, hint: str = "") -> tuple[Footprint, float]:
    """Footprint and height of a shadow, in metres. Raises MeshError. With a `hint`, which says what to do about a
    file in millimetres, what is larger than things on tables is refused."""
    footprint = shadow.footprint()
    height = round(shadow.top - shadow.bottom, 9)
    size = max(*footprint.extent, height)
    if hint and size > USUAL_URDF_SIZE:
        raise MeshError(f"it would measure {size:,.4g} m; if its numbers are millimetres, {hint}")
    if size > MAX_URDF_SIZE:
        raise MeshError(f"it is larger than {MAX_URDF_SIZE:,.0f} m")
    least = min(footprint.extent) if isinstance(footprint, Box | Circle) else MIN_URDF_SIZE
    if min(least, height) < MIN_URDF_SIZE:
        raise MeshError("it covers no area of the table" if least < MIN_URDF_SIZE else "it has no height")
    return footprint, height


def add_shape(shadow: Shadow, shape: Element, pose: LinkFrame, by: float, files: MeshFiles) -> None:
    """Add a <visual> or <collision> in its frame; `by` is what sizes are multiplied with."""
    solid = solid_of(shape)
    match solid.tag:
        case "box":
            shadow.box(pose.turn, pose.at, [by * size for size in sizes_of(solid, "size", 3)])
        case "cylinder":
            (radius,), (length,) = sizes_of(solid, "radius", 1), sizes_of(solid, "length", 1)
            shadow.cylinder(pose.turn, pose.at, by * radius, by * length)
        case "sphere":
            shadow.sphere(pose.at, by * sizes_of(solid, "radius", 1)[0])
        case _:
            scale = by * np.array(numbers_of(solid, "scale", 3, "1 1 1"))
            for points in files.points(solid.get("filename")):
                shadow.points(pose.turn, pose.at, points * scale)


SOLID_SIDES = 40, 32, 16  # sides of a cylinder; of a sphere round and from pole to pole


def robot_surfaces(data: bytes, read: Read) -> tuple[ColoredMesh, ...]:
    """The visual shapes of a URDF file in the frame of its root link, all joints at zero; the collision shapes of one
    that has no visual shape at all.

    A mesh's own colours and textures count; what has none gets those of the shape's <material>. `read` as in
    `mesh_surfaces`, by names as the file has them. Raises MeshError, with line and element.
    """
    robot = elements(data)
    links = links_of(robot)
    shapes = [(one, pose) for link, pose in links for one in link.findall("visual")]
    shapes = shapes or [(one, pose) for link, pose in links for one in link.findall("collision")]
    if not shapes:
        raise MeshError("no link of it has a shape")
    inside = [one for shape, _ in shapes for one in shape.findall("material")]
    named: dict[str, Element] = {}
    for material in (*robot.findall("material"), *inside):
        if material.children:
            named.setdefault(material.attributes.get("name", ""), material)
    files = MeshFiles(read)
    textures: dict[str, bytes] = {}
    found: list[ColoredMesh] = []
    for shape, pose in shapes:
        solid, place = solid_of(shape), pose.then(origin_of(shape))
        color, texture = _material(shape, named, files, textures)
        for one in _solid_surfaces(solid, files):
            if one.color is None:
                if texture and one.uv is None:
                    why = "it has a texture and no places in it: only .obj meshes have them"
                    raise MeshError(f"{solid.place}: {why}")
                one = replace(one, color=color, texture=texture)
            found.append(replace(one, vertices=one.vertices @ place.turn.T + place.at))
    refuse_layers(found)
    return tuple(found)


def _solid_surfaces(solid: Element, files: MeshFiles) -> tuple[ColoredMesh, ...]:
    """A shape in its own frame."""
    if solid.tag != "mesh":
        mesh = solid_mesh(solid, *SOLID_SIDES)
        with placed_error(solid):
            files.budget.add_vertices(len(mesh.vertices))
            files.budget.add_triangles(len(mesh.faces))
        return (ColoredMesh(mesh.vertices, mesh.faces, None),)
    scale = np.array(numbers_of(solid, "scale", 3, "1 1 1"))
    flipped = float(np.prod(scale)) < 0.0
    name = solid.get("filename")
    with placed_error(solid):
        found = files.surfaces(name)
    return tuple(
        replace(one, vertices=one.vertices * scale, faces=one.faces[:, ::-1].copy() if flipped else one.faces)
        for one in found
    )


def _material(
    shape: Element, named: Mapping[str, Element], files: MeshFiles, textures: dict[str, bytes]
) -> tuple[RGB | None, bytes]:
    """Colour and texture of a visual shape's <material>; `textures` keeps files that were read."""
    if not (given := shape.findall("material")):
        return None, b""
    material, name = given[0], given[0].attributes.get("name", "")
    if not material.children and name:
        if name not in named:
            raise MeshError(f"{material.place}: there is no material `{name[:60]}`")
        material = named[name]
    color: RGB | None = None
    if colors := material.findall("color"):
        red, green, blue, _ = np.clip(numbers_of(colors[0], "rgba", 4), 0.0, 1.0).tolist()
        color = red, green, blue
    if not (pictures := material.findall("texture")):
        return color, b""
    file = pictures[0].get("filename")
    if file not in textures:
        with placed_error(pictures[0]):
            data = files.read(file)
            files.budget.add_file(data)
            files.budget.add_texture(data, file)
        textures[file] = data
    return color or WHITE, textures[file]
