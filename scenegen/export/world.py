"""Scenes for simulators: bodies with mass, friction and convex pieces, on a table with legs.

One world is used for all scenes of a file: they share the objects and differ in the poses. Metres, kilograms, radians;
the table's top is z = 0, as in pictures.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from scenegen.assets.mesh import Floats, Mesh, prism
from scenegen.assets.palette import RGB
from scenegen.export.dressing import Dressed, Dressing
from scenegen.export.inertia import Inertia

THICK, LEG, TALL = 0.03, 0.05, 0.72  # metres: the table top, its legs' width, its height above the floor
LEAST_MASS, LEAST_MOMENT = 1e-6, 1e-12  # kg and kg m^2: MuJoCo treats less as zero
LEAST_SHARE = 1e-6  # minimum ratio of the smallest moment to the largest: less would be lost to rounding
WOOD: RGB = (0.80, 0.68, 0.53)


@dataclass(frozen=True, slots=True)
class Piece:
    """A convex collision piece; `box` is (middle, sizes) of one that is a box along its object's axes."""

    mesh: Mesh
    box: tuple[list[float], list[float]] | None


@dataclass(frozen=True, slots=True, eq=False)
class Paint:
    """A picture on a part, which its colour is multiplied with: the bytes of a `png` file, and where in it each vertex
    is, `places` (V, 2), v = 0 the lower edge."""

    png: bytes
    places: Floats


@dataclass(frozen=True, slots=True)
class Form:
    """The data that objects of one shape share. `name` is part of file names; `parts` are drawn, the convex `pieces`
    collide. In the object's frame: the middle of its footprint at the origin, z = 0 its lowest point, heading along
    x. `paints` are those of the parts, by their numbers from 1; `shells` says that parts need not enclose a volume."""

    name: str
    parts: tuple[Mesh, ...]
    pieces: tuple[Piece, ...]
    inertia: Inertia
    paints: dict[int, Paint] = field(default_factory=dict)
    shells: bool = False


@dataclass(frozen=True, slots=True)
class Body:
    """An object: `colors` has one entry for each part of its form; a fixed one never moves."""

    name: str
    form: Form
    colors: tuple[RGB, ...]
    mass: float
    friction: float
    fixed: bool

    @property
    def moments(self) -> Floats:
        """(3, 3): moments of inertia about the centre of mass, in kg m^2; for specks and needles the least that
        simulators can handle."""
        moments = self.mass * self.form.inertia.moments
        least, _, most = np.linalg.eigvalsh(moments).tolist()
        lacking: float = max(LEAST_MOMENT, LEAST_SHARE * most) - least
        return np.asarray(moments + max(lacking, 0.0) * np.eye(3))


@dataclass(frozen=True, slots=True)
class Patch:
    """A region of the spec: its corners (x, y) on the table. It is a thin, purely visual sheet, whose thickness in
    metres differs between regions, so that overlapping ones can be distinguished; at a height, the `top`, a solid
    board."""

    corners: tuple[tuple[float, float], ...]
    color: RGB
    thickness: float
    top: float = 0.0

    @property
    def solid(self) -> bool:
        return self.top > 0.0

    def mesh(self) -> Mesh:
        """The sheet or board, in the world's frame."""
        return prism(self.corners, *((self.top - self.thickness, self.top) if self.solid else (0.0, self.thickness)))


@dataclass(frozen=True, slots=True, eq=False)
class Record:
    """What a scene file says of a world's scenes beside poses: the text of their `spec`, `phi` (scenes,) by label, the
    numbers of things and the assets of categories, which all its scenes share, and the names of `everything` that its
    scenes can have."""

    spec: str
    phi: dict[str, Floats]
    counts: dict[str, int]
    assets: dict[str, str]
    everything: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False)
class World:
    """`table` is (x lowest, y lowest, x highest, y highest); `poses` (scenes, bodies, 4) are x, y, z and theta of the
    bodies' frames, z from the objects below them; `rest` (scenes, bodies, 7) are places and quaternions, w first, of
    scenes that came to rest in a simulator. `numbers` are the scenes' in their file, where not all of it is here.
    `record` is for formats that hold it; `dressing` has the looks of all scenes of the file.
    """

    title: str
    bodies: tuple[Body, ...]
    patches: tuple[Patch, ...]
    table: tuple[float, float, float, float]
    poses: Floats
    numbers: tuple[int, ...] = ()
    rest: Floats | None = None
    record: Record | None = None
    dressing: Dressing | None = None

    def colored(self, dressed: Dressed | None) -> tuple[Body, ...]:
        """The bodies in the colours of a look."""
        tints = {} if dressed is None else {tint.name: tint for tint in dressed.look.tints}
        return tuple(
            replace(body, colors=tuple(map(tints[body.name], body.colors))) if body.name in tints else body
            for body in self.bodies
        )

    @property
    def scenes(self) -> tuple[int, ...]:
        """The number of each scene, from 1."""
        return self.numbers or tuple(range(1, len(self.poses) + 1))

    def places(self, index: int) -> list[tuple[float, ...]]:
        """x, y, z, qw, qx, qy, qz of each body in a scene, counted from 0."""
        if self.rest is not None:
            return [tuple(place) for place in self.rest[index].tolist()]
        return [
            (x, y, z, math.cos(theta / 2.0), 0.0, 0.0, math.sin(theta / 2.0))
            for x, y, z, theta in self.poses[index].tolist()
        ]

    @property
    def forms(self) -> tuple[Form, ...]:
        """Every form once, in the order of the bodies."""
        return tuple({body.form.name: body.form for body in self.bodies}.values())

    @property
    def boards(self) -> tuple[Patch, ...]:
        """The regions at heights, on which bodies stand."""
        return tuple(patch for patch in self.patches if patch.solid)

    def free_name(self, wish: str) -> str:
        """A name that no object has: `wish`, if necessary with underscores."""
        taken = {body.name for body in self.bodies}
        while wish in taken:
            wish += "_"
        return wish

    def slabs(self) -> tuple[tuple[tuple[float, float, float], tuple[float, float, float]], ...]:
        """The table as boxes (middle, sizes): the top, then the legs."""
        x0, y0, x1, y1 = self.table
        top = ((x0 + x1) / 2, (y0 + y1) / 2, -THICK / 2), (x1 - x0, y1 - y0, THICK)
        inset, long = LEG, TALL - THICK
        legs = [
            ((x, y, -THICK - long / 2), (LEG, LEG, long))
            for x in (x0 + inset, x1 - inset)
            for y in (y0 + inset, y1 - inset)
        ]
        return top, *legs


def piece_of(mesh: Mesh) -> Piece:
    """The collision piece of a convex mesh: a box if the mesh fills its bounding box."""
    least, most = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    full = float(np.prod(most - least))
    box = ((least + most) / 2).tolist(), (most - least).tolist()
    return Piece(mesh, None if mesh.volume < full * (1.0 - 1e-6) else box)
