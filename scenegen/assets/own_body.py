"""What simulators need to know of an object from a file of one's own: convex pieces, mass and friction."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from scenegen.assets.convex import convex_pieces
from scenegen.assets.drawn import mesh_surfaces, robot_surfaces
from scenegen.assets.elements import Element, ElementsError, elements
from scenegen.assets.filenames import beside
from scenegen.assets.limits import LEAST_MASS, MOST_FRICTION, MOST_MASS
from scenegen.assets.mesh import Floats, Mesh, box, disc, joined, revolve
from scenegen.assets.meshfile import MeshError
from scenegen.assets.surface import Budget, Surface
from scenegen.assets.urdf_tree import UrdfError, links_of, numbers_of, origin_of, sizes_of, solid_of

SIDES, RINGS = 24, 8  # of round shapes
MOST_PIECES = 1_000

Read = Callable[[str], bytes]


@dataclass(frozen=True, slots=True, eq=False)
class OwnBody:
    """Convex closed meshes in metres, z upwards, in the file's own frame; kilograms and the coefficient of sliding
    friction, where the file says them. `skins` are drawn, in the same frame: none where they were not asked for."""

    pieces: tuple[Mesh, ...]
    mass: float | None = None
    friction: float | None = None
    skins: tuple[Surface, ...] = ()

    def moved(self, offset: Floats) -> OwnBody:
        """By an offset (3,) in metres."""
        pieces = tuple(one.moved(*offset.tolist()) for one in self.pieces)
        skins = tuple(replace(one, vertices=one.vertices + offset) for one in self.skins)
        return replace(self, pieces=pieces, skins=skins)

    def turned(self, matrix: Floats) -> OwnBody:
        """Turned and scaled by a matrix (3, 3) that does not mirror; the mass stays."""
        pieces = tuple(Mesh(one.vertices @ matrix.T, one.faces) for one in self.pieces)
        skins = tuple(replace(one, vertices=one.vertices @ matrix.T) for one in self.skins)
        return replace(self, pieces=pieces, skins=skins)


def mesh_body(name: str, data: bytes, read: Read, matrix: Floats | None = None, *, painted: bool = False) -> OwnBody:
    """The body of a .glb, .gltf, .obj or .stl file: convex pieces; no mass or friction, which such files do not have.
    `matrix` (3, 3) turns and scales it, without mirroring, to metres; without it, the file is in metres.
    `read` as in `drawn.mesh_surfaces`; `skins` and colours of .obj files are only read if `painted`. Raises MeshError,
    and RequestError as `convex_pieces`."""
    place = np.eye(3) if matrix is None else matrix
    found = mesh_surfaces(name, data, read, Budget(), painted=painted)
    mesh = joined([Mesh(one.vertices, one.faces) for one in found])
    pieces = convex_pieces(mesh if matrix is None else Mesh(mesh.vertices @ place.T, mesh.faces))
    skins = tuple(replace(one, vertices=one.vertices @ place.T) for one in found) if painted else ()
    return OwnBody(pieces, skins=skins)


def robot_body(data: bytes, read: Read, *, painted: bool = False) -> OwnBody:
    """The body of a URDF file in the frame of its root link, all joints at zero: its collision shapes, and the visual
    ones of links that have none; boxes, cylinders and spheres as they are, meshes in convex pieces.

    The mass is the sum of the links' <inertial> masses, none where that is 0. The friction is the largest of those that
    <contact><lateral_friction> and <gazebo><mu1> say. `skins` are the visual shapes, if
    `painted`. `read` gives the bytes of a file by its name in this one.
    Raises UrdfError, with line and element, and RequestError as `convex_pieces`.
    """
    try:
        robot = elements(data)
        links = links_of(robot)
        reader = _Reader(read)
        pieces = [
            Mesh(piece.vertices @ place.turn.T + place.at, piece.faces)
            for link, pose in links
            for shape in link.all("collision") or link.all("visual")
            for place in (pose.then(origin_of(shape)),)
            for piece in reader.pieces(solid_of(shape))
        ]
        bare = [link for link, _ in links]
        skins = robot_surfaces(data, read) if painted else ()
        return OwnBody(tuple(pieces), _mass(bare), _friction(robot, bare), skins)
    except ElementsError as error:
        raise UrdfError(str(error)) from None


@dataclass(slots=True)
class _Reader:
    read: Read
    budget: Budget = field(default_factory=Budget)
    meshes: dict[tuple[str, tuple[float, ...]], tuple[Mesh, ...]] = field(default_factory=dict)
    count: int = 0

    def pieces(self, solid: Element) -> tuple[Mesh, ...]:
        """Of a shape, in its own frame. Raises UrdfError, ElementsError."""
        try:
            found = self._pieces(solid)
        except MeshError as error:
            raise UrdfError(f"{solid.place}: {error}") from None
        self.count += len(found)
        if self.count > MOST_PIECES:
            raise UrdfError(f"{solid.place}: it has more than {MOST_PIECES:,} convex pieces")
        return found

    def _pieces(self, solid: Element) -> tuple[Mesh, ...]:
        match solid.tag:
            case "box":
                x, y, z = sizes_of(solid, "size", 3)
                return (box(x, y, z).moved(z=-z / 2.0),)
            case "cylinder":
                (radius,), (length,) = sizes_of(solid, "radius", 1), sizes_of(solid, "length", 1)
                return (disc(radius, -length / 2.0, length / 2.0, SIDES),)
            case "sphere":
                (radius,) = sizes_of(solid, "radius", 1)
                turns = np.linspace(-np.pi / 2.0, np.pi / 2.0, RINGS + 1)[1:-1]
                arc = [(radius * float(np.cos(turn)), radius * float(np.sin(turn))) for turn in turns]
                return (revolve([(0.0, -radius), *arc, (0.0, radius)], SIDES),)
            case _:
                name, scale = solid.get("filename"), tuple(numbers_of(solid, "scale", 3, "1 1 1"))
                if (name, scale) not in self.meshes:
                    self.meshes[name, scale] = self._mesh(name, np.array(scale))
                return self.meshes[name, scale]

    def _mesh(self, name: str, scale: Floats) -> tuple[Mesh, ...]:
        data = self.read(name)
        self.budget.add_file(data)
        try:
            mesh = _solid_mesh(name, data, lambda other: self.read(beside(name, other)), self.budget)
            flipped = float(np.prod(scale)) < 0.0
            return convex_pieces(Mesh(mesh.vertices * scale, mesh.faces[:, ::-1].copy() if flipped else mesh.faces))
        except MeshError as error:
            raise MeshError(f"mesh {name[:60]}: {error}") from None


def _solid_mesh(name: str, data: bytes, read: Read, budget: Budget) -> Mesh:
    return joined([Mesh(one.vertices, one.faces) for one in mesh_surfaces(name, data, read, budget, painted=False)])


def _mass(links: list[Element]) -> float | None:
    total = 0.0
    for link in links:
        for inertial in link.all("inertial")[:1]:
            (mass,) = sizes_of(inertial.one("mass"), "value", 1)
            total += mass
    if total and not LEAST_MASS <= total <= MOST_MASS:
        raise UrdfError(f"its mass of {total:g} kg is beyond {LEAST_MASS:g} to {MOST_MASS:g} kg")
    return total or None


def _friction(robot: Element, links: list[Element]) -> float | None:
    said = [
        sizes_of(one, "value", 1)[0]
        for link in links
        for contact in link.all("contact")
        for one in contact.all("lateral_friction")
    ]
    for gazebo in robot.all("gazebo"):
        for one in gazebo.all("mu1"):
            # Both <mu1>0.8</mu1> and <mu1 value="0.8"/> are written.
            given = one if "value" in one.attributes else Element(one.tag, {"value": one.text.strip()}, one.line)
            said += sizes_of(given, "value", 1)
    if any(one > MOST_FRICTION for one in said):
        raise UrdfError(f"its friction of {max(said):g} is beyond {MOST_FRICTION:g}")
    return max(said) if said else None
