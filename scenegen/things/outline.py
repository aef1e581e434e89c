"""Solids -> what they cover of the table: their shadow when the light falls straight down."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from scenegen.geometry.footprint import Box, Circle, Footprint, Point, Polygon, convex_hull, signed_area

Floats = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

MAX_DRAWN_CORNERS = 64  # corners of a prism at most; one with more is drawn as one round it
MAX_OUTLINE_CORNERS = 32  # of an outline at most: clearances are worked out corner by corner
SAME_SIZE = 1e-5  # sizes, relative: 1.5708 is a right angle. Outlines are a circle or a box where they are to this
STRAIGHT = 1e-6  # relative: a corner that stands out less is none
MIN_THICKNESS = 1e-6  # metres
OUTLINE_DIGITS = 9  # of metres: a nanometre, so that outlines read back as they were written
OUTLINE_SIDES = 32  # of the polygons that stand for round things


class MeshError(Exception):
    """A file of one's own is of no use; the text says why."""


@dataclass(slots=True)
class Shadow:
    """What has been added so far, in metres: round shadows (x, y, radius), corners of others (P, 2), and heights.

    Every method takes the solid's pose: `turn` (3, 3), a rotation, and `at` (3,).
    """

    discs: list[tuple[float, float, float]] = field(default_factory=list)
    corners: list[Floats] = field(default_factory=list)
    bottom: float = math.inf
    top: float = -math.inf

    def box(self, turn: Floats, at: Floats, size: Sequence[float]) -> None:
        """A box of these sizes, centred on its frame."""
        signs = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
        self.points(turn, at, signs * np.array(size))

    def points(self, turn: Floats, at: Floats, points: Floats) -> None:
        """The convex hull of (P, 3) points."""
        placed = points @ turn.T + at
        self._heights(float(placed[:, 2].min()), float(placed[:, 2].max()))
        self.corners.append(_outermost(placed[:, :2]))

    def sphere(self, at: Floats, radius: float) -> None:
        self._heights(float(at[2]) - radius, float(at[2]) + radius)
        self.discs.append((float(at[0]), float(at[1]), radius))

    def cylinder(self, turn: Floats, at: Floats, radius: float, length: float) -> None:
        """A cylinder along the z axis of its frame, centred on it."""
        axis = turn[:, 2]
        tilt = math.hypot(axis[0], axis[1])
        rise = abs(float(axis[2])) * length / 2.0 + radius * tilt
        self._heights(float(at[2]) - rise, float(at[2]) + rise)
        if tilt < SAME_SIZE:
            self.discs.append((float(at[0]), float(at[1]), radius))
            return
        ring = np.array(_circle_corners(0.0, 0.0, radius))
        rims = np.concatenate([np.column_stack([ring, np.full(len(ring), z)]) for z in (-length / 2, length / 2)])
        self.corners.append((rims @ turn.T + at)[:, :2])

    @property
    def spread(self) -> tuple[Floats, Floats]:
        """The lowest and the highest x, y and z (3,) of what has been added."""
        parts = [*self.corners, *(np.array([[x - r, y - r], [x + r, y + r]]) for x, y, r in self.discs)]
        points = np.concatenate(parts)
        return np.array([*points.min(axis=0), self.bottom]), np.array([*points.max(axis=0), self.top])

    def _heights(self, bottom: float, top: float) -> None:
        self.bottom, self.top = min(self.bottom, bottom), max(self.top, top)

    def footprint(self) -> Footprint:
        """The convex hull of all shadows: a circle or an axis-aligned box round the origin where it is that, else a
        polygon of at most `MAX_OUTLINE_CORNERS` corners.

        Round shadows count as polygons drawn round them, which reach 0.5 % of the radius further, and an outline with
        too many corners is replaced by one drawn round it: a polygon holds all that was added, but for a millionth of
        its size.
        Raises MeshError where it covers no area.
        """
        points = np.concatenate([*self.corners, np.empty((0, 2))])
        center = max((r for x, y, r in self.discs if math.hypot(x, y) <= SAME_SIZE * r), default=0.0)
        reach = [math.hypot(x, y) + r for x, y, r in self.discs]
        reach += [float(np.hypot(points[:, 0], points[:, 1]).max())] if len(points) else []
        if center and max(reach) <= center * (1.0 + SAME_SIZE):
            return Circle(round(center, OUTLINE_DIGITS))
        rings = [corner for disc in self.discs for corner in _circle_corners(*disc)]
        corners = tuple((float(x), float(y)) for x, y in [*points.tolist(), *rings])
        hull = _hull(corners)
        diameter = max((math.dist(hull[0], corner) for corner in hull), default=0.0)
        if not hull or signed_area(hull) < MIN_THICKNESS * max(diameter, MIN_THICKNESS):
            raise MeshError("it covers no area of the table")
        x, y = (max(abs(corner[axis]) for corner in hull) for axis in (0, 1))
        outline = simplify(hull, MAX_OUTLINE_CORNERS)
        slack = SAME_SIZE * max(x, y)
        if len(outline) == 4 and all(abs(abs(u) - x) <= slack and abs(abs(v) - y) <= slack for u, v in outline):
            return Box(round(2.0 * x, OUTLINE_DIGITS), round(2.0 * y, OUTLINE_DIGITS))
        rounded = _hull([(round(u, OUTLINE_DIGITS) + 0.0, round(v, OUTLINE_DIGITS) + 0.0) for u, v in outline])
        if not rounded:
            raise MeshError("it covers no area of the table")
        return Polygon(rounded)


def _circle_corners(x: float, y: float, radius: float) -> list[Point]:
    """Corners of a regular polygon drawn round a circle; it touches the circle at the ends of both axes."""
    far = radius / math.cos(math.pi / OUTLINE_SIDES)
    turns = [(k + 0.5) * math.tau / OUTLINE_SIDES for k in range(OUTLINE_SIDES)]
    return [(x + far * math.cos(turn), y + far * math.sin(turn)) for turn in turns]


def _hull(points: Sequence[Point]) -> tuple[Point, ...]:
    """Corners of the convex hull; none where it has no area."""
    try:
        return convex_hull(points).vertices
    except ValueError:
        return ()


def _outermost(points: Floats) -> Floats:
    """The points (P, 2) less those well inside the hull of all: a mesh has many that cannot be corners of it (the
    idea of Akl and Toussaint 1978)."""
    if len(points) < 64:
        return points
    turns = np.arange(16) * (math.tau / 16)
    far = [points[np.argmax(points @ np.array([math.cos(turn), math.sin(turn)]))] for turn in turns]
    inner = _hull([(float(x), float(y)) for x, y in far])
    if not inner:
        return points
    inside = np.ones(len(points), dtype=np.bool_)
    for (ax, ay), (bx, by) in zip(inner, (*inner[1:], inner[0]), strict=True):
        inside &= (bx - ax) * (points[:, 1] - ay) - (by - ay) * (points[:, 0] - ax) > 0.0
    return np.unique(points[~inside], axis=0)


def corners_of(footprint: Footprint, sides: int, most: int | None = None) -> Sequence[Point]:
    """The corners of a footprint, counter-clockwise; of a circle those of a regular polygon in it. A polygon with more
    than `most` is replaced by one round it."""
    match footprint:
        case Circle(radius):
            turns = [math.tau * k / sides for k in range(sides)]
            return [(radius * math.cos(turn), radius * math.sin(turn)) for turn in turns]
        case Box(length, width):
            x, y = length / 2.0, width / 2.0
            return [(-x, -y), (x, -y), (x, y), (-x, y)]
        case Polygon(vertices):
            return vertices if most is None else simplify(vertices, most)


def simplify(corners: Sequence[Point], most: int) -> tuple[Point, ...]:
    """A convex polygon with at most `most` >= 4 corners round one with more, both counter-clockwise.

    Corners that do not stand out go first. Then, as long as there are too many, the edge goes whose neighbours, drawn
    on until they meet, add the least area.
    """
    ring = _corners_that_turn(corners)
    costs = [_cost(ring, k) for k in range(len(ring))]
    while len(ring) > most:
        k = min(range(len(ring)), key=costs.__getitem__)
        meeting = _meeting(ring, k)
        if meeting is None:
            break
        after = (k + 1) % len(ring)
        ring[k] = meeting
        del ring[after], costs[k]
        for edge in (k - 1, k) if after else (-2, -1):
            costs[edge % len(ring)] = _cost(ring, edge % len(ring))
    return tuple(ring)


def _corners_that_turn(corners: Sequence[Point]) -> list[Point]:
    size = max(Polygon(tuple(corners)).extent)
    ring: list[Point] = []
    for k, corner in enumerate(corners):
        before = ring[-1] if ring else corners[-1]
        (ax, ay), (bx, by) = before, corners[(k + 1) % len(corners)]
        across = (bx - ax) * (corner[1] - ay) - (by - ay) * (corner[0] - ax)
        if abs(across) > STRAIGHT * size * math.hypot(bx - ax, by - ay):
            ring.append(corner)
    return ring if len(ring) >= 3 else list(corners)


def _meeting(ring: Sequence[Point], k: int) -> Point | None:
    """Where the neighbours of the edge from corner k to the next meet beyond it; None where they do not."""
    count = len(ring)
    (ax, ay), (bx, by), (cx, cy), (dx, dy) = (ring[(k + step) % count] for step in (-1, 0, 1, 2))
    ux, uy, vx, vy = bx - ax, by - ay, dx - cx, dy - cy
    turn = ux * vy - uy * vx
    if turn <= 1e-9 * math.hypot(ux, uy) * math.hypot(vx, vy):
        return None
    along = ((cx - bx) * vy - (cy - by) * vx) / turn
    return bx + along * ux, by + along * uy


def _cost(ring: Sequence[Point], k: int) -> float:
    meeting = _meeting(ring, k)
    if meeting is None:
        return math.inf
    return signed_area((ring[k], meeting, ring[(k + 1) % len(ring)]))
