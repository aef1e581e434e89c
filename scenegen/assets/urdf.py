"""The outline of a URDF file: what the robot description's shapes cover of the table, all joints at zero; and that of
a mesh file alone.

Collision shapes count, and the visual ones of links that have none. The format: http://wiki.ros.org/urdf/XML.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import PurePosixPath

import numpy as np

from scenegen.assets.elements import Element, ElementsError, elements
from scenegen.assets.gltf import surfaces
from scenegen.assets.mesh import Floats
from scenegen.assets.meshfile import MeshError, vertices
from scenegen.assets.outline import OutlineError, Shadow
from scenegen.primitives import Box, Circle, Footprint

LARGEST, SMALLEST = 1e3, 1e-6  # metres: sizes of objects, as in the language
FARTHEST = 1e6  # of any number in the file
MOST_VERTICES = 4_000_000  # of all meshes together, counted as often as they are placed
MOST_BYTES = 128_000_000  # of all mesh files together
PLAIN = (".obj", ".stl")
GLTF = (".glb", ".gltf")
KINDS = ("box", "cylinder", "sphere", "mesh")


class UrdfError(Exception):
    """The file is of no use; the text says why."""


@dataclass(frozen=True, slots=True)
class _Pose:
    """A frame: `turn` (3, 3) its axes, `at` (3,) its origin, in the frame of the root link."""

    turn: Floats
    at: Floats

    def then(self, inner: _Pose) -> _Pose:
        return _Pose(self.turn @ inner.turn, self.turn @ inner.at + self.at)


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
                self.known[name] = vertices(name, data)
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
    try:
        return _outline(elements(data), _Meshes(read_mesh))
    except (ElementsError, OutlineError) as error:
        raise UrdfError(str(error)) from None


def mesh_outline(name: str, data: bytes, read: Callable[[str], bytes]) -> tuple[Footprint, float]:
    """Footprint and height (metres) of a mesh file, .obj, .stl, .glb or .gltf by the ending of `name`, whose unit is
    the metre; z points up in the first two, y in glTF files. As in `outline`, the footprint is the convex hull of what
    it covers, and the object stands with its lowest point on the table. `read` gives the bytes of a file that a glTF
    file names; what that raises passes through. Raises UrdfError."""
    shadow = Shadow()
    for points in mesh_points(name, data, read):
        shadow.points(np.eye(3), np.zeros(3), points)
    try:
        footprint = shadow.footprint()
    except OutlineError as error:
        raise UrdfError(str(error)) from None
    height = round(shadow.top - shadow.bottom, 9)
    _check_sizes(footprint, height, "for a mesh in millimetres write a URDF with scale")
    return footprint, height


def mesh_points(name: str, data: bytes, read: Callable[[str], bytes]) -> list[Floats]:
    """The vertices (V, 3) of a mesh file's parts, in its unit, z upwards, as `mesh_outline` reads it. Raises
    UrdfError."""
    ending = PurePosixPath(name.replace("\\", "/")).suffix.lower()
    if ending not in (*PLAIN, *GLTF):
        kind = f"{ending} files" if ending else "a file without an ending"
        known = "convert it to .glb, .gltf, .obj or .stl, or give the outline beside it"
        raise UrdfError(f"{kind} cannot be read here: {known}")
    try:
        if ending in GLTF:
            return [one.vertices[np.unique(one.faces)] for one in surfaces(name, data, read)]
        return [vertices(name, data)]
    except MeshError as error:
        raise UrdfError(str(error)) from None


def _outline(robot: Element, meshes: _Meshes) -> tuple[Footprint, float]:
    if robot.tag != "robot":
        raise UrdfError(f"its outermost element is <{robot.tag}>, a URDF's is <robot>")
    shadow = Shadow()
    for link, pose in _links(robot):
        for shape in link.all("collision") or link.all("visual"):
            _add(shadow, shape, pose.then(_origin(shape)), meshes)
    if shadow.top < shadow.bottom:
        raise UrdfError("no link of it has a shape")
    footprint = shadow.footprint()
    height = round(shadow.top - shadow.bottom, 9)
    _check_sizes(footprint, height, "for meshes in millimetres write scale")
    return footprint, height


def _check_sizes(footprint: Footprint, height: float, hint: str) -> None:
    if max(*footprint.extent, height) > LARGEST:
        help_ = f'{hint}="0.001 0.001 0.001"'
        raise UrdfError(f"it is larger than {LARGEST:,.0f} m; {help_}")
    least = min(footprint.extent) if isinstance(footprint, Box | Circle) else SMALLEST
    if min(least, height) < SMALLEST:
        raise UrdfError("it covers no area of the table" if least < SMALLEST else "it has no height")


def _links(robot: Element) -> list[tuple[Element, _Pose]]:
    """Every link with its pose, all joints at zero."""
    links: dict[str, Element] = {}
    for link in robot.all("link"):
        name = link.get("name")
        if name in links:
            raise UrdfError(f"{link.place}: a second link `{name}`")
        links[name] = link
    if not links:
        raise UrdfError("it has no link")
    below: dict[str, list[tuple[str, _Pose]]] = {}
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
        below.setdefault(parent, []).append((child, _origin(joint)))
    roots = [name for name in links if name not in parents]
    if len(roots) > 1:
        raise UrdfError(f"its links do not hang together: no joint moves `{roots[0]}` and none `{roots[1]}`")
    found = [(name, _Pose(np.eye(3), np.zeros(3))) for name in roots]
    for name, pose in found:  # grows while it is walked
        found += [(child, pose.then(origin)) for child, origin in below.get(name, [])]
    if len(found) < len(links):
        lost = next(name for name in links if name not in dict(found))
        raise UrdfError(f"its joints run in a circle through link `{lost}`")
    return [(links[name], pose) for name, pose in found]


def _origin(element: Element) -> _Pose:
    """The pose that an element's <origin> gives: `rpy` are turns about the fixed x, y and z axes, in that order."""
    origins = element.all("origin")
    if not origins:
        return _Pose(np.eye(3), np.zeros(3))
    roll, pitch, yaw = _numbers(origins[0], "rpy", 3, "0 0 0")
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(angle), math.sin(angle)) for angle in (roll, pitch, yaw))
    turn = np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
    return _Pose(turn, np.array(_numbers(origins[0], "xyz", 3, "0 0 0")))


def _add(shadow: Shadow, shape: Element, pose: _Pose, meshes: _Meshes) -> None:
    geometry = shape.one("geometry")
    if len(geometry.children) != 1 or geometry.children[0].tag not in KINDS:
        found = " and ".join(f"<{child.tag}>" for child in geometry.children[:3]) or "nothing"
        raise UrdfError(f"{geometry.place}: a shape is one box, cylinder, sphere or mesh; here is {found}")
    solid = geometry.children[0]
    match solid.tag:
        case "box":
            shadow.box(pose.turn, pose.at, _sizes(solid, "size", 3))
        case "cylinder":
            (radius,), (length,) = _sizes(solid, "radius", 1), _sizes(solid, "length", 1)
            shadow.cylinder(pose.turn, pose.at, radius, length)
        case "sphere":
            shadow.sphere(pose.at, _sizes(solid, "radius", 1)[0])
        case _:
            scale = np.array(_numbers(solid, "scale", 3, "1 1 1"))
            shadow.points(pose.turn, pose.at, meshes.get(solid.get("filename")) * scale)


def _numbers(element: Element, name: str, count: int, default: str = "") -> list[float]:
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


def _sizes(element: Element, name: str, count: int) -> list[float]:
    values = _numbers(element, name, count)
    if min(values) < 0.0:
        raise UrdfError(f'{element.place}: {name}="{element.get(name)[:40]}" is negative')
    return values
