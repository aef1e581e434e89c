"""The outline of a URDF file: what the robot description's shapes cover of the table, all joints at zero; and that of
a mesh file alone.

Collision shapes count, and the visual ones of links that have none. The format: http://wiki.ros.org/urdf/XML.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from scenegen.assets.elements import Element, ElementsError, elements
from scenegen.assets.filenames import ending_of
from scenegen.assets.gltf import surfaces
from scenegen.assets.mesh import Floats
from scenegen.assets.meshfile import MeshError, corners
from scenegen.assets.outline import OutlineError, Shadow
from scenegen.assets.urdf_tree import Pose, UrdfError, links_of, numbers_of, origin_of, sizes_of, solid_of
from scenegen.primitives import Box, Circle, Footprint

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
class Placed:
    """Where and how large a robot is: `turn` (3, 3) a rotation of its root frame, then `scale`, then the origin at `at`
    (3,), metres."""

    turn: Floats = field(default_factory=lambda: np.eye(3))
    scale: float = 1.0
    at: Floats = field(default_factory=lambda: np.zeros(3))

    def then(self, inner: Pose) -> Pose:
        """The frame of a shape, whose sizes are still the file's."""
        return Pose(self.turn @ inner.turn, self.scale * (self.turn @ inner.at) + self.at)


def robot_shadow(data: bytes, read_mesh: Callable[[str], bytes], placed: Placed | None = None) -> Shadow:
    """The shadow of what `outline` measures, of the robot placed as said. Raises UrdfError."""
    placed = placed or Placed()
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


def _add(shadow: Shadow, shape: Element, pose: Pose, by: float, meshes: _Meshes) -> None:
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
