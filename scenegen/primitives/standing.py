"""How much room one footprint has in another: the area on which its centre can be, over all headings."""

from __future__ import annotations

import math
from functools import cache
from itertools import pairwise

from scenegen.primitives.footprint import Box, Circle, Footprint, Polygon
from scenegen.primitives.hull import Point
from scenegen.primitives.outline import Edge, corners, edges

HEADINGS = 720  # over which the area is averaged; its error is then below one in 10,000
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
        return _left(polygon, [edge.offset - upper.radius for edge in edges(polygon)])
    points = corners(upper)
    total = 0.0
    for step in range(HEADINGS):
        turn = math.tau * (step + 0.5) / HEADINGS
        cos, sin = math.cos(turn), math.sin(turn)
        turned = [(cos * x - sin * y, sin * x + cos * y) for x, y in points]
        total += _left(polygon, [edge.offset - _support(turned, edge) for edge in edges(polygon)])
    return total / HEADINGS


def _support(points: list[Point], edge: Edge) -> float:
    return max(edge.normal[0] * x + edge.normal[1] * y for x, y in points)


def _left(polygon: Polygon, offsets: list[float]) -> float:
    """The area of a polygon whose edges have moved to other offsets, inwards."""
    ring = list(polygon.vertices)
    for edge, offset in zip(edges(polygon), offsets, strict=True):
        kept: list[Point] = []
        for a, b in pairwise((*ring, *ring[:1])):
            depth, after = (offset - edge.normal[0] * x - edge.normal[1] * y for x, y in (a, b))
            if depth >= 0.0:
                kept.append(a)
            if depth * after < 0.0:
                share = depth / (depth - after)
                kept.append((a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])))
        ring = kept
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
