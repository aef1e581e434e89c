"""Rigid bodies for PyBullet: prisms over footprints, and the convex pieces that other simulators get.

Where heights are read from poses, the body of an object is the upright prism over its footprint, the solid that such
specs describe; handles, hollows and round undersides are not modelled. All prisms have the same density, so its value
cancels in contacts. Where a spec declares what stands on what, things stand in hollows, and bodies are those of
`export.world`.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import numpy.typing as npt

from scenegen.geometry import Polygon
from scenegen.geometry.footprint import Point, centroid, signed_area
from scenegen.things import Shape
from scenegen.things.bodies import DENSITY
from scenegen.things.mesh import Mesh
from scenegen.things.outline import Floats, corners_of
from scenegen.things.urdf import URDF_ENDING
from scenegen.worlds.export import world
from scenegen.worlds.export.meshes import stl

Triple = tuple[float, float, float]
Brick = tuple[list[float], list[float]]  # middle and sizes of a box along the axes of its body

PRISM_SIDES = 32  # number of sides of prisms for round objects
BULLET_STEP = 1.0 / 240.0  # seconds: PyBullet's usual one
MAX_ARRAY_PIECES = 16  # that `createCollisionShapeArray` takes: it drops all others without a word
MAX_PRISM_CORNERS = 64  # maximum corners of an outline; one with more is replaced by an enclosing one
PRISM_FRICTION = 0.5  # between any two prisms; pybullet multiplies the two bodies' coefficients


@dataclass(frozen=True, slots=True, eq=False)
class InertialBody:
    """A body in its frame of inertia: the origin at the centre of mass, z upwards, x and y along the principal axes.

    `center` (x, y, z) in metres and `turn`, about z, in radians place this frame in the object's; `mass` in kg,
    `inertia` about x, y and z in kg m^2. A body without mass cannot be moved. It collides with its convex `pieces` in
    this frame: a prism has one, of which only the corners count.
    """

    pieces: tuple[Mesh, ...]
    center: Triple
    turn: float
    mass: float
    inertia: Triple
    friction: float

    @property
    def corners(self) -> Floats:
        """(V, 3): the corners of its only piece."""
        (piece,) = self.pieces
        return piece.vertices


def whole_of(body: world.Body) -> InertialBody:
    """The body with the convex pieces, the mass and the friction that files for simulators have. Its principal axes are
    taken to be the object's, which all assets nearly are."""
    x, y, z = body.form.inertia.center.tolist()
    pieces = tuple(piece.mesh.shift(-x, -y, -z) for piece in body.form.pieces)
    xx, yy, zz = (0.0, 0.0, 0.0) if body.fixed else np.diag(body.moments).tolist()
    return InertialBody(pieces, (x, y, z), 0.0, 0.0 if body.fixed else body.mass, (xx, yy, zz), body.friction)


def board_of(board: world.Patch, friction: float) -> InertialBody:
    """A board, which cannot be moved: its place is the origin of the world."""
    mesh = board.mesh()
    x, y, z = ((mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2.0).tolist()
    return InertialBody((mesh.shift(-x, -y, -z),), (x, y, z), 0.0, 0.0, (0.0, 0.0, 0.0), friction)


@contextmanager
def piece_files(bodies: Sequence[InertialBody]) -> Iterator[tuple[tuple[str | Brick, ...], ...]]:
    """The pieces of bodies, by body: boxes by middle and sizes, others as paths of STL files, which exist as long as
    the block runs. PyBullet reads the convex pieces of one body from files alone. Equal pieces share a file. Of a body
    with more than `MAX_ARRAY_PIECES` there is one path only, of a URDF file with all of them."""
    with tempfile.TemporaryDirectory(prefix="scenegen-") as folder:
        written: dict[bytes, str] = {}

        def path_of(piece: Mesh) -> str | Brick:
            brick = world.piece_of(piece).box
            if brick is not None:
                return brick
            data = stl(piece)
            if data not in written:
                path = Path(folder) / f"{len(written)}.stl"
                path.write_bytes(data)
                written[data] = str(path)
            return written[data]

        found: list[tuple[str | Brick, ...]] = []
        for body in bodies:
            pieces = tuple(map(path_of, body.pieces))
            if len(pieces) > MAX_ARRAY_PIECES:
                path = Path(folder) / f"{len(found)}{URDF_ENDING}"
                path.write_text(_robot(body, pieces))
                pieces = (str(path),)
            found.append(pieces)
        yield tuple(found)


def _robot(body: InertialBody, pieces: Sequence[str | Brick]) -> str:
    """A URDF file of one link in the body's frame."""
    shapes = []
    for piece in pieces:
        if isinstance(piece, str):
            shapes.append(f'<collision><geometry><mesh filename="{Path(piece).name}"/></geometry></collision>')
            continue
        at, size = (" ".join(f"{value:.9g}" for value in triple) for triple in piece)
        shapes.append(f'<collision><origin xyz="{at}"/><geometry><box size="{size}"/></geometry></collision>')
    xx, yy, zz = body.inertia
    inertia = f'<inertia ixx="{xx:.9g}" iyy="{yy:.9g}" izz="{zz:.9g}" ixy="0" ixz="0" iyz="0"/>'
    inertial = f'<inertial><mass value="{body.mass:.9g}"/>{inertia}</inertial>'
    return f'<robot name="body"><link name="body">{inertial}{"".join(shapes)}</link></robot>\n'


def prism_of(shape: Shape, *, fixed: bool = False) -> InertialBody:
    """The homogeneous prism of an object of this shape, without mass if it is fixed."""
    # Round objects that do not overlap are not pushed apart: the polygon is up to 0.5 % of the radius too small.
    corners = corners_of(shape.footprint, PRISM_SIDES, MAX_PRISM_CORNERS)
    x, y = centroid(Polygon(tuple(corners)))
    centred = [(u - x, v - y) for u, v in corners]
    along, across, mixed = _moments(centred)
    turn = math.atan2(2.0 * mixed, along - across) / 2.0 if mixed else 0.0
    cos, sin = math.cos(turn), math.sin(turn)
    outline = [(cos * u + sin * v, cos * v - sin * u) for u, v in centred]
    along, across, _ = _moments(outline)
    mass = 0.0 if fixed else DENSITY * signed_area(corners) * shape.height
    upright = shape.height**2 / 12.0
    inertia = mass * (across + upright), mass * (along + upright), mass * (along + across)
    half = shape.height / 2.0
    ends = np.array([(u, v, z) for z in (-half, half) for u, v in outline])
    piece = Mesh(ends, np.empty((0, 3), dtype=np.int64))
    return InertialBody((piece,), (x, y, half), turn, mass, inertia, math.sqrt(PRISM_FRICTION))


def _moments(corners: Sequence[Point]) -> tuple[float, float, float]:
    """The means of x^2, y^2 and xy over a polygon, in m^2: Green's theorem makes the integrals sums over edges."""
    along = across = mixed = 0.0
    for (ax, ay), (bx, by) in pairwise((*corners, corners[0])):
        twice = ax * by - bx * ay
        along += twice * (ax * ax + ax * bx + bx * bx)
        across += twice * (ay * ay + ay * by + by * by)
        mixed += twice * (ax * by + 2.0 * ax * ay + 2.0 * bx * by + bx * ay)
    area = signed_area(corners)
    return along / (12.0 * area), across / (12.0 * area), mixed / (24.0 * area)


TABLE = -1  # takes the place of an object's index
TOUCH_GAP = 1e-4  # metres: what is closer counts as touching


@dataclass(frozen=True, slots=True)
class Contact:
    """Two objects by their indices, `a` before `b`, or the table and an object; `depth` in metres is how deep they are
    in each other: 0 where they only touch."""

    a: int
    b: int
    depth: float


def contacts(points: Iterable[tuple[int, int, float]]) -> tuple[Contact, ...]:
    """The contacts of some points (a, b, clear distance), in the order of their objects; one for each pair, as deep as
    its deepest point."""
    nearest: dict[tuple[int, int], float] = {}
    for a, b, apart in points:
        pair = min(a, b), max(a, b)
        nearest[pair] = min(nearest.get(pair, TOUCH_GAP), apart)
    return tuple(Contact(*pair, max(0.0, -apart)) for pair, apart in sorted(nearest.items()) if apart < TOUCH_GAP)


MAX_DROP_SHIFT = 0.01  # metres, of the centre of mass
MAX_DROP_TURN = 5.0  # degrees, about any axis


def is_still(shift: Floats, turn: Floats) -> npt.NDArray[np.bool_]:
    """Which motions, in metres and degrees, are within both limits; NaN never is."""
    return np.asarray((shift <= MAX_DROP_SHIFT) & (turn <= MAX_DROP_TURN))
