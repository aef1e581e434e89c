"""The outline of a URDF file: what the robot description's shapes cover of the table, all joints at zero; and that of
a mesh file alone.

Collision shapes count, and the visual ones of links that have none. The format: http://wiki.ros.org/urdf/XML.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from xml.parsers import expat

import numpy as np

from scenegen.geometry import Box, Circle, Footprint
from scenegen.things.gltf import surfaces
from scenegen.things.mesh import Floats
from scenegen.things.meshfile import MeshError, corners, ending_of
from scenegen.things.outline import OutlineError, Shadow

# --------------------------------------------------------------------------------------------------------------------
# XML from strangers: elements with their attributes, lines and short texts, nothing else.
#
# Document types are refused, and with them entities; size, depth and number of elements are limited.


MOST_XML_BYTES = 8_000_000
MOST_ELEMENTS = 20_000
DEEPEST = 50
LONGEST = 200  # characters of text that are kept of an element


class ElementsError(Exception):
    """The text is not read; the message says why."""


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

    def all(self, tag: str) -> list[Element]:
        """The children of that tag."""
        return [child for child in self.children if child.tag == tag]

    def one(self, tag: str) -> Element:
        """The first child of that tag. Raises ElementsError where there is none."""
        found = self.all(tag)
        if not found:
            raise ElementsError(f"{self.place}: there is no <{tag}> in it")
        return found[0]

    def get(self, name: str, default: str = "") -> str:
        """An attribute. Raises ElementsError where it is missing and has no default."""
        value = self.attributes.get(name, default)
        if not value:
            raise ElementsError(f"{self.place}: it has no {name}")
        return value


def elements(data: bytes) -> Element:
    """The outermost element of an XML document. Raises ElementsError."""
    if len(data) > MOST_XML_BYTES:
        raise ElementsError(f"it is larger than {MOST_XML_BYTES:,} bytes")
    parser = expat.ParserCreate()
    document = Element("", {}, 0)
    path = [document]
    count = 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal count
        line = parser.CurrentLineNumber
        count += 1
        if tag.startswith("xacro:"):
            raise ElementsError(f"line {line}: it is a xacro file; expand it first: xacro in.xacro > out.urdf")
        if count > MOST_ELEMENTS:
            raise ElementsError(f"it has more than {MOST_ELEMENTS:,} elements")
        if len(path) > DEEPEST:
            raise ElementsError(f"line {line}: it is nested more than {DEEPEST} deep")
        element = Element(tag, attributes, line)
        path[-1].children.append(element)
        path.append(element)

    def end(tag: str) -> None:
        path.pop()

    def doctype(*_: object) -> None:
        raise ElementsError(f"line {parser.CurrentLineNumber}: it has a document type, which is not read; remove it")

    def characters(text: str) -> None:
        here = path[-1]
        if not here.children and len(here.text) < LONGEST:
            here.text += text[:LONGEST]

    parser.buffer_text = True
    parser.CharacterDataHandler = characters
    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.StartDoctypeDeclHandler = doctype
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        raise ElementsError(
            f"it is not well-formed XML at line {error.lineno}: {expat.ErrorString(error.code)}"
        ) from None
    except (LookupError, ValueError):  # of the codecs, for an encoding that expat does not know itself
        raise ElementsError("it is not well-formed XML: its encoding is unknown") from None
    return document.children[0]


# --------------------------------------------------------------------------------------------------------------------
# The links of a URDF file with their poses, all joints at zero, and the numbers of its elements.
#
# The format: http://wiki.ros.org/urdf/XML.


FARTHEST = 1e6  # of any number in the file
KINDS = ("box", "cylinder", "sphere", "mesh")


class UrdfError(Exception):
    """The file is of no use; the text says why."""


@dataclass(frozen=True, slots=True)
class LinkFrame:
    """A frame: `turn` (3, 3) its axes, `at` (3,) its origin, in the frame of the root link."""

    turn: Floats
    at: Floats

    def then(self, inner: LinkFrame) -> LinkFrame:
        return LinkFrame(self.turn @ inner.turn, self.turn @ inner.at + self.at)


def links_of(robot: Element) -> list[tuple[Element, LinkFrame]]:
    """Every link with its pose, all joints at zero. Raises UrdfError."""
    if robot.tag != "robot":
        raise UrdfError(f"its outermost element is <{robot.tag}>, a URDF's is <robot>")
    links: dict[str, Element] = {}
    for link in robot.all("link"):
        name = link.get("name")
        if name in links:
            raise UrdfError(f"{link.place}: a second link `{name}`")
        links[name] = link
    if not links:
        raise UrdfError("it has no link")
    below: dict[str, list[tuple[str, LinkFrame]]] = {}
    parents: dict[str, str] = {}
    for joint in robot.all("joint"):
        ends = []
        for role in ("parent", "child"):
            end = joint.one(role)
            name = end.get("link")
            if name not in links:
                raise UrdfError(f"{end.place}: there is no link `{name}`")
            ends.append(name)
        parent, child = ends
        if child in parents:
            raise UrdfError(f"{joint.place}: link `{child}` has two parents, `{parents[child]}` and `{parent}`")
        parents[child] = parent
        below.setdefault(parent, []).append((child, origin_of(joint)))
    roots = [name for name in links if name not in parents]
    if len(roots) > 1:
        raise UrdfError(f"its links do not hang together: no joint moves `{roots[0]}` and none `{roots[1]}`")
    found = [(name, LinkFrame(np.eye(3), np.zeros(3))) for name in roots]
    for name, pose in found:  # grows while it is walked
        found += [(child, pose.then(origin)) for child, origin in below.get(name, [])]
    if len(found) < len(links):
        lost = next(name for name in links if name not in dict(found))
        raise UrdfError(f"its joints run in a circle through link `{lost}`")
    return [(links[name], pose) for name, pose in found]


def origin_of(element: Element) -> LinkFrame:
    """The pose that an element's <origin> gives: `rpy` are turns about the fixed x, y and z axes, in that order."""
    origins = element.all("origin")
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
    """The box, cylinder, sphere or mesh of a <visual> or <collision>. Raises UrdfError."""
    geometry = shape.one("geometry")
    if len(geometry.children) != 1 or geometry.children[0].tag not in KINDS:
        found = " and ".join(f"<{child.tag}>" for child in geometry.children[:3]) or "nothing"
        raise UrdfError(f"{geometry.place}: a shape is one box, cylinder, sphere or mesh; here is {found}")
    return geometry.children[0]


def numbers_of(element: Element, name: str, count: int, default: str = "") -> list[float]:
    text = element.get(name, default)
    try:
        values = [float(word) for word in text.split() if "_" not in word]
    except ValueError:
        values = []
    if len(values) != count or len(text.split()) != count:
        wanted = "a number" if count == 1 else f"{count} numbers"
        raise UrdfError(f'{element.place}: {name}="{text[:40]}" is not {wanted}')
    if not all(abs(value) <= FARTHEST for value in values):  # nor nan
        raise UrdfError(f'{element.place}: {name}="{text[:40]}" is beyond all measure')
    return values


def sizes_of(element: Element, name: str, count: int) -> list[float]:
    values = numbers_of(element, name, count)
    if min(values) < 0.0:
        raise UrdfError(f'{element.place}: {name}="{element.get(name)[:40]}" is negative')
    return values


LARGEST, SMALLEST = 1e3, 1e-6  # metres: sizes of objects, as in the language
USUAL = 20.0  # metres: a file of something larger is in another unit
MOST_VERTICES = 4_000_000  # of all meshes together, counted as often as they are placed
MOST_BYTES = 128_000_000  # of all mesh files together
PLAIN = (".obj", ".stl")
GLTF = (".glb", ".gltf")
ROBOT = ".urdf"


@dataclass(slots=True)
class _Meshes:
    """Mesh files, each read once."""

    read: Callable[[str], bytes]
    known: dict[str, Floats] = field(default_factory=dict)
    size: int = 0
    placed: int = 0

    def get(self, name: str) -> Floats:
        if name not in self.known:
            data = self.read(name)
            self.size += len(data)
            if self.size > MOST_BYTES:
                raise UrdfError(f"its meshes are larger than {MOST_BYTES:,} bytes together")
            try:
                self.known[name] = corners(name, data)
            except MeshError as error:
                raise UrdfError(f"mesh {name}: {error}") from None
        self.placed += len(self.known[name])
        if self.placed > MOST_VERTICES:
            raise UrdfError(f"its meshes have more than {MOST_VERTICES:,} vertices together")
        return self.known[name]


def outline(data: bytes, read_mesh: Callable[[str], bytes]) -> tuple[Footprint, float]:
    """Footprint and height (metres) of a URDF file, in the frame of its root link.

    The footprint is the convex hull of what all shapes cover, as `Shadow.footprint` says: circle or box where it is
    that and stands round the origin, else a polygon. The height is from the lowest to the highest point: the object
    stands with its lowest point on the table, wherever its origin is. `read_mesh` gives the bytes of a mesh file (.obj
    or .stl) as the file names it; what it raises passes through. Raises UrdfError.
    """
    return measured(robot_shadow(data, read_mesh), 'write scale="0.001 0.001 0.001" in its <mesh>')


def mesh_outline(name: str, data: bytes, read: Callable[[str], bytes]) -> tuple[Footprint, float]:
    """Footprint and height (metres) of a mesh file, .obj, .stl, .glb or .gltf by the ending of `name`, whose unit is
    the metre; z points up in the first two, y in glTF files. As in `outline`, the footprint is the convex hull of what
    it covers, and the object stands with its lowest point on the table. `read` gives the bytes of a file that a glTF
    file names; what that raises passes through. Raises UrdfError."""
    return measured(
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


def robot_shadow(data: bytes, read_mesh: Callable[[str], bytes], placed: RobotPlacement | None = None) -> Shadow:
    """The shadow of what `outline` measures, of the robot placed as said. Raises UrdfError."""
    placed = placed or RobotPlacement()
    try:
        shadow = Shadow()
        meshes = _Meshes(read_mesh)
        for link, pose in links_of(elements(data)):
            for shape in link.all("collision") or link.all("visual"):
                _add(shadow, shape, placed.then(pose.then(origin_of(shape))), placed.scale, meshes)
    except ElementsError as error:
        raise UrdfError(str(error)) from None
    if shadow.top < shadow.bottom:
        raise UrdfError("no link of it has a shape")
    return shadow


def mesh_shadow(name: str, data: bytes, read: Callable[[str], bytes]) -> Shadow:
    """The shadow of what `mesh_outline` measures. Raises UrdfError."""
    shadow = Shadow()
    for points in mesh_points(name, data, read):
        shadow.points(np.eye(3), np.zeros(3), points)
    return shadow


def mesh_points(name: str, data: bytes, read: Callable[[str], bytes]) -> list[Floats]:
    """The vertices (V, 3) of the triangles of a mesh file's parts, in its unit, z upwards, as `mesh_outline` reads it.
    Raises UrdfError."""
    ending = ending_of(name)
    if ending not in (*PLAIN, *GLTF):
        kind = f"{ending} files" if ending else "a file without an ending"
        known = "convert it to .glb, .gltf, .obj or .stl, or give the outline beside it"
        raise UrdfError(f"{kind} cannot be read here: {known}")
    try:
        if ending in GLTF:
            return [one.vertices for one in surfaces(name, data, read)]
        return [corners(name, data)]
    except MeshError as error:
        raise UrdfError(str(error)) from None


def measured(shadow: Shadow, hint: str = "") -> tuple[Footprint, float]:
    """Footprint and height of a shadow, in metres. Raises UrdfError. With a `hint`, which says what to do about a
    file in millimetres, what is larger than things on tables is refused."""
    try:
        footprint = shadow.footprint()
    except OutlineError as error:
        raise UrdfError(str(error)) from None
    height = round(shadow.top - shadow.bottom, 9)
    _check_sizes(footprint, height, hint)
    return footprint, height


def _check_sizes(footprint: Footprint, height: float, hint: str) -> None:
    size = max(*footprint.extent, height)
    if hint and size > USUAL:
        raise UrdfError(f"it would measure {size:,.4g} m; if its numbers are millimetres, {hint}")
    if size > LARGEST:
        raise UrdfError(f"it is larger than {LARGEST:,.0f} m")
    least = min(footprint.extent) if isinstance(footprint, Box | Circle) else SMALLEST
    if min(least, height) < SMALLEST:
        raise UrdfError("it covers no area of the table" if least < SMALLEST else "it has no height")


def _add(shadow: Shadow, shape: Element, pose: LinkFrame, by: float, meshes: _Meshes) -> None:
    """`by` is what sizes are multiplied with."""
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
            shadow.points(pose.turn, pose.at, meshes.get(solid.get("filename")) * scale)
