"""What a part is, and the few details that several objects share."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from scenegen.geometry.footprint import Box, Circle, Footprint, Point, Polygon, centroid
from scenegen.things.mesh import Floats, Mesh, box, loft, prism, revolve, tube
from scenegen.things.outline import simplified
from scenegen.things.palette import RGB, mix

CREAM: RGB = (0.96, 0.93, 0.84)
WHITE: RGB = (0.97, 0.97, 0.96)
STEEL: RGB = (0.70, 0.72, 0.75)
DARK: RGB = (0.20, 0.18, 0.18)
COFFEE: RGB = (0.28, 0.17, 0.11)


@dataclass(frozen=True, slots=True)
class Part:
    """A closed mesh in the object's frame (metres; z = 0 the table, heading along +x) and its colour."""

    mesh: Mesh
    color: RGB


def handle(inner: float, reach: float, low: float, high: float) -> Mesh:
    """The ear of a mug: from the wall at x = `inner` out to x = `reach`, between two heights."""
    thick = 0.0042
    middle, half = (low + high) / 2, (high - low) / 2
    bow = [0.5 * math.pi - math.pi * step / 14 for step in range(15)]
    path = [(inner + (reach - thick - inner) * math.cos(a) ** 0.7, middle + half * math.sin(a)) for a in bow[1:-1]]
    return tube([(inner - 0.003, middle + half), *path, (inner - 0.003, middle - half)], 0.0065, thick)


def patch(radius: float, depth: float, low: float, high: float, sweep: float) -> Mesh:
    """A label on a round wall: `sweep` radians of it, centred on the heading, its outside at `radius`."""
    inner = radius - depth
    ring = [(inner, low), (radius, low), (radius, high), (inner, high)]
    return revolve(ring, max(4, round(sweep / 0.13)), start=-sweep / 2, sweep=sweep)


def lining(inside: list[tuple[float, float]], thickness: float = 0.0008) -> Mesh:
    """A thin coat on the inside of a vessel; `inside` runs from the axis to the rim as (radius, z)."""
    coat = [(max(r - thickness, 0.0), z + thickness) for r, z in inside[:-1]]
    rim, height = inside[-1]
    coat.append((rim - thickness, height))
    below = [(r + thickness / 2 if r else 0.0, z - thickness / 2) for r, z in inside]
    return revolve([*coat, *reversed(below)])


def crescent(profile: Sequence[tuple[float, float]], sweep: float, thickness: float = 0.0006) -> Mesh:
    """A brush stroke of glaze on the inside of a vessel: it shows the heading of what is round.

    `profile` runs as (radius, z) from the rim inwards. The stroke covers all of it at the heading, and ever less of it
    to either side, over `sweep` radians in all.
    """
    points = np.array(profile)
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    sections = []
    for angle in np.linspace(-sweep / 2, sweep / 2, max(8, round(sweep / 0.1))):
        share = max(math.cos(math.pi * angle / sweep), 0.02)
        places = np.linspace(0.0, share * along[-1], 6)
        line = np.column_stack([np.interp(places, along, points[:, 0]), np.interp(places, along, points[:, 1])])
        tangent = np.gradient(line, axis=0)
        normal = np.column_stack([tangent[:, 1], -tangent[:, 0]])  # towards the axis and up
        normal *= thickness / np.linalg.norm(normal, axis=1, keepdims=True)
        radius, z = np.concatenate([line - normal, (line + normal)[::-1]]).T
        sections.append(np.column_stack([radius * math.cos(angle), radius * math.sin(angle), z]))
    return loft(sections)


def pip(length: float, width: float, bottom: float, top: float) -> Mesh:
    """An arrow head in the plane that points along the heading: the mark of blocks and plain shapes."""
    x, y, tip = length / 2, width / 2, width * 0.06
    return prism([(-x, -y), (x, -tip), (x, tip), (-x, y)], bottom, top)


# --------------------------------------------------------------------------------------------------------------------
# Plain shapes with sizes of their own: boxes, cylinders and prisms, with an arrow head on top for their heading.


BEVEL = 0.05  # of the smallest size: what edges lose
RAISED = 0.02  # of the smallest size: how far the mark stands out
LARGEST_MARK = 0.06  # metres
DRAWN = 64  # corners of a prism at most; one with more is drawn as one round it


def plain(footprint: Footprint, height: float, color: RGB) -> tuple[Part, ...]:
    """Footprint x height as closed meshes: the body in its colour, and the mark. Sizes in metres."""
    light = sum(color) / 3 > 0.55
    ink = mix(color, DARK, 0.55) if light else mix(color, WHITE, 0.65)
    match footprint:
        case Circle(radius):
            smallest = min(2.0 * radius, height)
            body = _round(radius, height - RAISED * smallest, BEVEL * smallest)
            long = wide = min(radius, LARGEST_MARK)
            x, y = 0.0, 0.0
        case Box(length, width):
            smallest = min(length, width, height)
            corners = [(-length, -width), (length, -width), (length, width), (-length, width)]
            half = np.array(corners) / 2.0
            body = _upright(half, 1.0 - 2.0 * BEVEL * smallest / np.array([length, width]), height, smallest)
            # In the middle of a cube, at the front of what is longer or larger.
            long = wide = min(0.5 * min(length, width), LARGEST_MARK)
            x, y = length / 2.0 - 0.25 * min(length, width) - long / 2.0, 0.0
        case Polygon(vertices):
            outline = simplified(vertices, DRAWN)
            x, y, room = _middle(outline)
            smallest = min(2.0 * room, height)
            centred = np.array(outline) - (x, y)
            body = _upright(centred, np.full(2, 1.0 - BEVEL * smallest / room), height, smallest).moved(x, y)
            long = wide = min(room, LARGEST_MARK)
    raised = RAISED * smallest
    mark = pip(long, wide, height - 2.0 * raised, height).moved(x, y)
    return Part(body, color), Part(mark, ink)


def _round(radius: float, height: float, bevel: float) -> Mesh:
    return revolve(
        [
            (0.0, 0.0),
            (radius - bevel, 0.0),
            (radius, bevel),
            (radius, height - bevel),
            (radius - bevel, height),
            (0.0, height),
        ]
    )


def _upright(outline: Floats, inset: Floats, height: float, smallest: float) -> Mesh:
    """A convex outline (K, 2) round the origin, extruded; `inset` scales it at its bevelled ends."""
    bevel, top = BEVEL * smallest, height - RAISED * smallest
    levels = [(0.0, inset), (bevel, np.ones(2)), (top - bevel, np.ones(2)), (top, inset)]
    return loft(np.stack([np.column_stack([outline * scale, np.full(len(outline), z)]) for z, scale in levels]))


def _middle(outline: Sequence[Point]) -> tuple[float, float, float]:
    """The centroid of a convex polygon, counter-clockwise, and its distance from the nearest edge."""
    x, y = centroid(Polygon(tuple(outline)))
    edges = zip(outline, (*outline[1:], outline[0]), strict=True)
    room = min(
        ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / math.hypot(bx - ax, by - ay) for (ax, ay), (bx, by) in edges
    )
    return x, y, room


# --------------------------------------------------------------------------------------------------------------------
# What furniture is made of: upright pieces, and surfaces. In the object's frame, with its front along +x; metres.


@dataclass(frozen=True, slots=True)
class DrawerPull:
    """How far a drawer is open: the share of its length `full`, and how much of that can be reached from above; what
    juts out above it hides the rest. `reach` is negative where more is hidden than is open."""

    share: float
    reach: float
    full: float
    width: float

    def least(self, need: float) -> float:
        """The share from which on `need` metres can be reached, whatever else stays as it is; may be above 1."""
        return self.share + (need - self.reach) / self.full


@dataclass(frozen=True, slots=True)
class SupportSurface:
    """A flat part that other things can stand on.

    `height` is above the object's lowest point and `clear` the free height above the surface. On a `walled` surface
    things stand with all of their footprint, elsewhere with their centre: they may reach over the edge. `pull` says of
    a cabinet's drawer how far it is open, and `far` how far from the origin a thing's centre can be, where the surface
    was made for this thing (`surfaces.py`).
    """

    name: str
    outline: Footprint
    height: float
    clear: float = math.inf
    walled: bool = False
    pull: DrawerPull | None = None
    far: float | None = None


@dataclass(frozen=True, slots=True)
class Slab:
    """An upright piece: a rectangle of the object's frame, (x lowest, y lowest, x highest, y highest), and the heights
    of its bottom and its top."""

    box: tuple[float, float, float, float]
    low: float
    high: float

    @property
    def footprint(self) -> Polygon:
        x0, y0, x1, y1 = self.box
        return Polygon(((x0, y0), (x1, y0), (x1, y1), (x0, y1)))


@dataclass(frozen=True, slots=True)
class ShelfUnit:
    """Boards between two sides and a back, open in front; sizes in metres. `levels` are the tops of the boards, of
    which the last is the lid."""

    depth: float
    width: float
    levels: tuple[float, ...]
    side: float = 0.018
    back: float = 0.008
    board: float = 0.018

    def slabs(self) -> tuple[Slab, ...]:
        x, y, top = self.depth / 2.0, self.width / 2.0, self.levels[-1]
        sides = [Slab((-x, low, x, low + self.side), 0.0, top) for low in (-y, y - self.side)]
        inner = (-x, self.side - y, x, y - self.side)
        back = Slab((-x, self.side - y, self.back - x, y - self.side), 0.0, top)
        return (*sides, back, *(Slab(inner, level - self.board, level) for level in self.levels))


UNITS = {"shelfunit": ShelfUnit(0.260, 0.640, (0.018, 0.240, 0.450, 0.640))}


# --------------------------------------------------------------------------------------------------------------------
# Things with room inside: vessels of revolution and crates, as convex pieces and as the rooms that they leave.


Rooms = tuple[tuple[Circle | Box, float], ...]

SIDES = 16  # of a vessel's wall
STEP = 0.004  # metres between the heights at which a sloping wall is looked at


@dataclass(frozen=True, slots=True)
class Vessel:
    """A surface of revolution with an inside: rows (z, outer radius, inner radius) from the bottom up, in metres; the
    inner radius is 0 as long as it is solid."""

    rows: tuple[tuple[float, float, float], ...]

    def pieces(self) -> tuple[Mesh, ...]:
        """Convex closed meshes: the solid bottom, and the wall cut into `SIDES` sectors."""
        out = []
        for (z0, outer0, inner0), (z1, outer1, inner1) in pairwise(self.rows):
            if z1 == z0:
                continue
            if inner0 == inner1 == 0.0:
                out.append(loft([_ring(outer0, z0), _ring(outer1, z1)]))
                continue
            for k in range(SIDES):
                a, b = (math.tau * turn / SIDES for turn in (k, k + 1))
                out.append(loft([_sector(inner0, outer0, a, b, z0), _sector(inner1, outer1, a, b, z1)]))
        return tuple(out)

    def rooms(self) -> Rooms:
        """What fits inside, and how high it then stands: the deepest first. A wall of flat pieces takes a little."""
        found: dict[float, float] = {}
        for (z0, _, inner0), (z1, _, inner1) in pairwise(self.rows):
            if inner0 == 0.0 and inner1 > 0.0:
                found.setdefault(z1, inner1)
                continue
            if inner1 > inner0:
                for share in np.linspace(0.0, 1.0, 1 + math.ceil((z1 - z0) / STEP)):
                    found.setdefault(z0 + float(share) * (z1 - z0), inner0 + float(share) * (inner1 - inner0))
        flat = math.cos(math.pi / SIDES)
        return tuple((Circle(radius * flat), z) for z, radius in sorted(found.items()))


@dataclass(frozen=True, slots=True)
class Crate:
    """A box without a lid: sizes of its outside, and how thick its walls and its floor are, in metres."""

    length: float
    width: float
    height: float
    wall: float
    floor: float

    def pieces(self) -> tuple[Mesh, ...]:
        """The floor and the four walls, as boxes."""
        long, wide, tall = self.length, self.width, self.height - self.floor
        side, end = box(long, self.wall, tall), box(self.wall, wide - 2.0 * self.wall, tall)
        y, x = (wide - self.wall) / 2.0, (long - self.wall) / 2.0
        walls = [side.moved(y=s * y, z=self.floor) for s in (-1.0, 1.0)]
        walls += [end.moved(x=s * x, z=self.floor) for s in (-1.0, 1.0)]
        return box(long, wide, self.floor), *walls

    def rooms(self) -> Rooms:
        return ((Box(self.length - 2.0 * self.wall, self.width - 2.0 * self.wall), self.floor),)


Hollow = Vessel | Crate


def _ring(radius: float, z: float) -> list[list[float]]:
    turns = [math.tau * k / SIDES for k in range(SIDES)]
    return [[radius * math.cos(turn), radius * math.sin(turn), z] for turn in turns]


def _sector(inner: float, outer: float, a: float, b: float, z: float) -> list[list[float]]:
    return [[r * math.cos(turn), r * math.sin(turn), z] for r, turn in ((inner, a), (outer, a), (outer, b), (inner, b))]
