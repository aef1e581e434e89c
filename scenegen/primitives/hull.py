"""Convex polygons from points: hull, area, centroid."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise

from scenegen.primitives.footprint import Polygon

Point = tuple[float, float]
Rectangle = tuple[float, float, float, float]  # x lowest, y lowest, x highest, y highest


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


def clipped(points: Sequence[Point], within: Rectangle) -> tuple[Point, ...]:
    """The corners of the intersection of a convex polygon and a rectangle, none if it is empty (Sutherland and Hodgman
    1974)."""
    ring = list(points)
    for axis, sign, edge in ((0, 1.0, within[0]), (1, 1.0, within[1]), (0, -1.0, within[2]), (1, -1.0, within[3])):
        kept: list[Point] = []
        for a, b in pairwise((*ring, *ring[:1])):
            depth, after = sign * (a[axis] - edge), sign * (b[axis] - edge)
            if depth >= 0.0:
                kept.append(a)
            if depth * after < 0.0:
                share = depth / (depth - after)
                kept.append((a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])))
        ring = kept
    return tuple(dict.fromkeys(ring))


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
