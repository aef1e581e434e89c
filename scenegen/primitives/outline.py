"""Constants of one footprint for computing clearance, computed once."""

from __future__ import annotations

import math
from functools import cache
from itertools import pairwise
from typing import NamedTuple

from scenegen.primitives.footprint import Box, Circle, Footprint, Polygon


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
