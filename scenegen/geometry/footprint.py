"""Footprints: what objects and regions cover of the table, convex, in the frame of their own pose (x, y, heading)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import NamedTuple


@dataclass(frozen=True, slots=True)
class Circle:
    """A round footprint; `radius` in metres, 0 for a point. A handle counts: the circle is the one that it sweeps."""

    radius: float

    @property
    def extent(self) -> tuple[float, float]:
        """Size along and across the heading, in metres."""
        return 2.0 * self.radius, 2.0 * self.radius


@dataclass(frozen=True, slots=True)
class Box:
    """A rectangular footprint: `length` along the heading, `width` across it, in metres."""

    length: float
    width: float

    @property
    def extent(self) -> tuple[float, float]:
        """Size along and across the heading, in metres."""
        return self.length, self.width


@dataclass(frozen=True, slots=True)
class Polygon:
    """A convex polygon: corners (x, y) in metres, counter-clockwise, x along the heading."""

    vertices: tuple[tuple[float, float], ...]

    @property
    def extent(self) -> tuple[float, float]:
        """Size along and across the heading, in metres."""
        x, y = zip(*self.vertices, strict=True)
        return max(x) - min(x), max(y) - min(y)


@dataclass(frozen=True, slots=True)
class PlacedBox(Polygon):
    """A box elsewhere in the frame than in its middle: its centre is at `offset`, and it is turned by the angle of the
    cosine and sine `turn`. A polygon whose clearance from boxes and circles is that of a box, at a quarter of the
    work."""

    box: Box
    offset: tuple[float, float]
    turn: tuple[float, float]


@dataclass(frozen=True, slots=True)
class Stack(Polygon):
    """A body as cameras see it, which is no prism over its footprint: upright prisms, each with the heights of its ends
    above the body's lowest point, in metres. All else takes it for the polygon around them."""

    pieces: tuple[tuple[Footprint, float, float], ...]


Footprint = Circle | Box | Polygon

POINT = Circle(0.0)


Point = tuple[float, float]
Rectangle = tuple[float, float, float, float]  # x lowest, y lowest, x highest, y highest


def place_box(box: Box, offset: Point, angle: float) -> PlacedBox:
    """A box whose centre is at `offset` and that is turned by an angle in radians."""
    (x, y), cos, sin = offset, math.cos(angle), math.sin(angle)
    vertices = tuple((x + (cos * u - sin * v), y + (sin * u + cos * v)) for u, v in corners(box))
    return PlacedBox(vertices, box, offset, (cos, sin))


def convex_hull(points: Iterable[Point]) -> Polygon:
    """The smallest convex polygon around points in metres, counter-clockwise from the lowest of the leftmost, without
    corners that lie on a straight edge (monotone chain, Andrew 1979).

    Raises ValueError if fewer than three points are distinct or all lie on one line.
    """
    ordered = sorted(set(points))
    lower, upper = _chain(ordered), _chain(ordered[::-1])
    corners = (*lower[:-1], *upper[:-1])
    if len(corners) < 3:
        raise ValueError("a polygon needs three points that are not on one line")
    return Polygon(corners)


def is_convex(points: Sequence[Point]) -> bool:
    """Whether points, in this order, walk once around a convex polygon of some area, either way round.

    Points on a straight edge are allowed, points in the same place are not. A corner may turn the wrong way by 1e-9
    rad: coordinates that are written in decimals are seldom exactly on a line.
    """
    steps = [(b[0] - a[0], b[1] - a[1]) for a, b in pairwise((*points, *points[:1]))]
    if len(steps) < 3 or (0.0, 0.0) in steps:
        return False
    turns = [math.atan2(a[0] * b[1] - a[1] * b[0], a[0] * b[0] + a[1] * b[1]) for a, b in pairwise((*steps, steps[0]))]
    total = sum(turns)
    sign = math.copysign(1.0, total)
    return abs(abs(total) - 2.0 * math.pi) < 1e-6 and all(-1e-9 <= sign * turn < math.pi - 1e-9 for turn in turns)


def signed_area(points: Sequence[Point]) -> float:
    """Area in square metres, positive where the points run counter-clockwise (the shoelace formula)."""
    x, y = points[0]  # from a corner, not from the origin: far from it the products would cancel
    return sum((a[0] - x) * (b[1] - y) - (b[0] - x) * (a[1] - y) for a, b in pairwise((*points, points[0]))) / 2.0


def area(polygon: Polygon) -> float:
    """Area in square metres."""
    return abs(signed_area(polygon.vertices))


def centroid(polygon: Polygon) -> Point:
    """The centre of area, in metres. Raises ValueError for a polygon without area."""
    x, y = polygon.vertices[0]
    sum_x = sum_y = twice = 0.0
    for a, b in pairwise((*polygon.vertices, polygon.vertices[0])):
        piece = (a[0] - x) * (b[1] - y) - (b[0] - x) * (a[1] - y)
        sum_x += (a[0] - x + b[0] - x) * piece
        sum_y += (a[1] - y + b[1] - y) * piece
        twice += piece
    if twice == 0.0:
        raise ValueError("a polygon without area has no centroid")
    return x + sum_x / (3.0 * twice), y + sum_y / (3.0 * twice)


def clip(points: Sequence[Point], within: Rectangle) -> tuple[Point, ...]:
    """The corners of the intersection of a convex polygon and a rectangle, none if it is empty (Sutherland and Hodgman
    1974)."""
    ring = list(points)
    for axis, sign, edge in ((0, 1.0, within[0]), (1, 1.0, within[1]), (0, -1.0, within[2]), (1, -1.0, within[3])):
        ring = cut_at_line(ring, [sign * (point[axis] - edge) for point in ring])
    return tuple(dict.fromkeys(ring))


def cut_at_line(ring: Sequence[Point], depths: Sequence[float]) -> list[Point]:
    """What is left of a ring on one side of a line, from which each of its points lies so deep inside."""
    kept: list[Point] = []
    for (a, depth), (b, after) in pairwise((*zip(ring, depths, strict=True), *zip(ring[:1], depths[:1], strict=True))):
        if depth >= 0.0:
            kept.append(a)
        if depth * after < 0.0:
            share = depth / (depth - after)
            kept.append((a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])))
    return kept


def _chain(points: Sequence[Point]) -> list[Point]:
    """The part of the hull to the right of the walk from the first point to the last."""
    chain: list[Point] = []
    for point in points:
        while len(chain) >= 2 and _cross(chain[-2], chain[-1], point) <= 0.0:
            chain.pop()
        chain.append(point)
    return chain


def _cross(a: Point, b: Point, c: Point) -> float:
    """Twice the area of the triangle a, b, c: positive where it turns left."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


class Edge(NamedTuple):
    """A polygon's edge: p is outside where normal . p > offset, and level with it for along . p from start to start +
    length."""

    normal: tuple[float, float]
    offset: float
    along: tuple[float, float]
    start: float
    length: float


class Measures(NamedTuple):
    """How far a footprint is from a disc around the origin of its frame, in metres.

    The footprint lies in the disc of radius `outer` and holds the one of radius `inner`; where the origin is outside
    the footprint, `inner` is minus its distance. Turning the footprint by d changes its support function nowhere by
    more than `turn * abs(d)`. Moving every edge outwards by d moves no corner by more than `mitre * d`.
    """

    outer: float
    inner: float
    turn: float
    mitre: float


def corners(footprint: Box | Polygon) -> tuple[tuple[float, float], ...]:
    """Counter-clockwise, in the footprint's frame."""
    if isinstance(footprint, Polygon):
        return footprint.vertices
    x, y = footprint.length / 2.0, footprint.width / 2.0
    return (-x, -y), (x, -y), (x, y), (-x, y)


@cache
def edges(polygon: Polygon) -> tuple[Edge, ...]:
    """Of a polygon whose corners run counter-clockwise; edges without length are left out."""
    found = []
    for (ax, ay), (bx, by) in pairwise((*polygon.vertices, polygon.vertices[0])):
        length = math.hypot(bx - ax, by - ay)
        if length > 0.0:
            tx, ty = (bx - ax) / length, (by - ay) / length
            found.append(Edge((ty, -tx), ty * ax - tx * ay, (tx, ty), tx * ax + ty * ay, length))
    return tuple(found)


@cache
def measures(footprint: Footprint) -> Measures:
    if isinstance(footprint, Circle):
        return Measures(footprint.radius, footprint.radius, 0.0, 1.0)
    polygon = footprint if isinstance(footprint, Polygon) else Polygon(corners(footprint))
    outer = max(math.hypot(x, y) for x, y in polygon.vertices)
    if isinstance(footprint, Box):
        return Measures(outer, min(footprint.extent) / 2.0, max(footprint.extent) / 2.0, math.sqrt(2.0))
    sides = edges(polygon)
    inner = min(side.offset for side in sides)
    if inner < 0.0:
        # How far the origin is past the end of an edge counts only where it is past one.
        past = [-side.start - min(max(-side.start, 0.0), side.length) for side in sides]
        away = min(math.hypot(side.offset, beyond) for side, beyond in zip(sides, past, strict=True))
        return Measures(outer, -away, outer, _mitre(sides))
    # The support function changes with the angle by the supporting corner's coordinate across the direction. While the
    # origin is inside, that falls steadily from the normal of one edge to the normal of the next: the normals decide.
    turn = max(max(abs(side.start), abs(side.start + side.length)) for side in sides)
    return Measures(outer, inner, turn, _mitre(sides))


@cache
def half_width(footprint: Footprint) -> float:
    """Half of the smallest width: no disc in the footprint is larger."""
    if isinstance(footprint, Circle):
        return footprint.radius
    if isinstance(footprint, Box):
        return min(footprint.extent) / 2.0
    sides = edges(footprint)
    return (
        min(side.offset - min(side.normal[0] * x + side.normal[1] * y for x, y in footprint.vertices) for side in sides)
        / 2.0
    )


def _mitre(sides: tuple[Edge, ...]) -> float:
    """The longest way of a corner where both of its edges move out by 1: one over the cosine of half the turn."""
    cosines = [
        math.sqrt(max((1.0 + a.normal[0] * b.normal[0] + a.normal[1] * b.normal[1]) / 2.0, 0.0))
        for a, b in pairwise((*sides, sides[0]))
    ]
    smallest = min(cosines)
    return 1.0 / smallest if smallest > 0.0 else math.inf


AVERAGED_HEADINGS = 720  # over which the area is averaged; its error is then below one in 10,000
RAYS = 4096  # of the area that is left in a circle


@cache
def standing_area(upper: Footprint, outline: Footprint) -> float:
    """The mean over all headings of the area on which the centre of `upper` can be so that all of it lies in `outline`,
    in square metres; 0 where it does not fit. Exact for circles in circles and in boxes."""
    if isinstance(outline, Circle):
        return _in_circle(upper, outline.radius)
    if isinstance(upper, Circle) and isinstance(outline, Box):
        length, width = (max(0.0, size - 2.0 * upper.radius) for size in outline.extent)
        return length * width
    polygon = outline if isinstance(outline, Polygon) else Polygon(corners(outline))
    if isinstance(upper, Circle):
        return _area_inside(polygon, [edge.offset - upper.radius for edge in edges(polygon)])
    points = corners(upper)
    total = 0.0
    for step in range(AVERAGED_HEADINGS):
        turn = math.tau * (step + 0.5) / AVERAGED_HEADINGS
        cos, sin = math.cos(turn), math.sin(turn)
        turned = [(cos * x - sin * y, sin * x + cos * y) for x, y in points]
        total += _area_inside(polygon, [edge.offset - _support(turned, edge) for edge in edges(polygon)])
    return total / AVERAGED_HEADINGS


def _support(points: list[Point], edge: Edge) -> float:
    return max(edge.normal[0] * x + edge.normal[1] * y for x, y in points)


def _area_inside(polygon: Polygon, offsets: list[float]) -> float:
    """The area of a polygon whose edges have moved to other offsets, inwards."""
    ring = list(polygon.vertices)
    for edge, offset in zip(edges(polygon), offsets, strict=True):
        ring = cut_at_line(ring, [offset - edge.normal[0] * x - edge.normal[1] * y for x, y in ring])
    return abs(sum(ax * by - bx * ay for (ax, ay), (bx, by) in pairwise((*ring, *ring[:1])))) / 2.0


def _in_circle(upper: Footprint, radius: float) -> float:
    """The area of the intersection of discs, one around minus each corner, by rays from the middle."""
    if isinstance(upper, Circle):
        return math.pi * max(0.0, radius - upper.radius) ** 2
    points = corners(upper)
    if max(math.hypot(x, y) for x, y in points) > radius:
        return 0.0  # as `fits` has it, the middle is always free where anything is
    total = 0.0
    for step in range(RAYS):
        turn = math.tau * (step + 0.5) / RAYS
        cos, sin = math.cos(turn), math.sin(turn)
        along = [cos * x + sin * y for x, y in points]
        far = min(
            math.sqrt(radius * radius - x * x - y * y + way * way) - way
            for way, (x, y) in zip(along, points, strict=True)
        )
        total += far * far
    return math.pi * total / RAYS
