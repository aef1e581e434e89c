"""Where a clearance is measured: the two points whose distance is gap(a, b) or room(a, b), for drawings.

One scene at a time, in plain floats; the values themselves come from scenegen.primitives.clearance, and a test compares
the lengths with them. A circle is treated as its centre, expanded by its radius.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

from scenegen.primitives import Box, Circle, Footprint, Polygon
from scenegen.primitives.outline import corners

Point = tuple[float, float]
Pose = tuple[float, float, float]
Segment = tuple[Point, Point]


def placed(footprint: Box | Polygon, pose: Pose) -> list[Point]:
    """The corners of a footprint at a pose, counter-clockwise, in metres."""
    x, y, theta = pose
    cos, sin = math.cos(theta), math.sin(theta)
    return [(x + cos * u - sin * v, y + sin * u + cos * v) for u, v in corners(footprint)]


def gap_segment(a: Footprint, a_pose: Pose, b: Footprint, b_pose: Pose) -> Segment:
    """From the outline of a to that of b, where they are nearest; if they overlap, along the penetration depth."""
    (a_bones, a_radius), (b_bones, b_radius) = _bones(a, a_pose), _bones(b, b_pose)
    (ax, ay), (bx, by), (nx, ny) = _nearest(a_bones, b_bones)
    return (ax + a_radius * nx, ay + a_radius * ny), (bx - b_radius * nx, by - b_radius * ny)


def room_segment(a: Footprint, a_pose: Pose, b: Footprint, b_pose: Pose) -> Segment:
    """From the point of a with the least clearance inside b to the border of b (to the line through its side)."""
    bones, radius = _bones(a, a_pose)
    if isinstance(b, Circle):
        x, y, _ = b_pose
        far = max(bones, key=lambda point: math.hypot(point[0] - x, point[1] - y))
        nx, ny = _unit((far[0] - x, far[1] - y))
        return (far[0] + radius * nx, far[1] + radius * ny), (x + b.radius * nx, y + b.radius * ny)
    least, found = math.inf, ((0.0, 0.0), (0.0, 0.0))
    for (px, py), (nx, ny) in _sides(placed(b, b_pose)):
        far = max(bones, key=lambda point: nx * point[0] + ny * point[1])
        slack = nx * (px - far[0]) + ny * (py - far[1]) - radius
        if slack < least:
            start = far[0] + radius * nx, far[1] + radius * ny
            least, found = slack, (start, (start[0] + slack * nx, start[1] + slack * ny))
    return found


def _bones(footprint: Footprint, pose: Pose) -> tuple[list[Point], float]:
    if isinstance(footprint, Circle):
        return [pose[:2]], footprint.radius
    return placed(footprint, pose), 0.0


def _unit(vector: Point) -> Point:
    length = math.hypot(*vector)
    return (vector[0] / length, vector[1] / length) if length > 0.0 else (1.0, 0.0)


def _sides(polygon: Sequence[Point]) -> list[tuple[Point, Point]]:
    """A point and the outward normal of each side of positive length; none for a single point."""
    if len(polygon) == 1:
        return []
    return [
        (start, _unit((end[1] - start[1], start[0] - end[0])))
        for start, end in pairwise((*polygon, polygon[0]))
        if start != end
    ]


def _nearest(a: Sequence[Point], b: Sequence[Point]) -> tuple[Point, Point, Point]:
    """A point of a, a point of b, and the direction in which b has to move away from a to separate them."""
    best, deepest = -math.inf, None
    for first, second, sign in ((a, b, 1.0), (b, a, -1.0)):
        for (px, py), (nx, ny) in _sides(first):
            low = min(second, key=lambda point: nx * point[0] + ny * point[1])
            height = nx * (low[0] - px) + ny * (low[1] - py)
            if height > best:
                foot = low[0] - height * nx, low[1] - height * ny
                pair = (foot, low) if sign > 0.0 else (low, foot)
                best, deepest = height, (*pair, (sign * nx, sign * ny))
    if deepest is not None and best <= 0.0:
        return deepest
    candidates = [(_onto(point, b), point, True) for point in a] + [(_onto(point, a), point, False) for point in b]
    foot, point, of_a = min(candidates, key=lambda one: math.dist(one[0], one[1]))
    start, end = (point, foot) if of_a else (foot, point)
    return start, end, _unit((end[0] - start[0], end[1] - start[1]))


def _onto(point: Point, polygon: Sequence[Point]) -> Point:
    """The nearest point of a polygon's outline."""
    best = polygon[0]
    for start, end in pairwise((*polygon, polygon[0])):
        dx, dy = end[0] - start[0], end[1] - start[1]
        square = dx * dx + dy * dy
        share = ((point[0] - start[0]) * dx + (point[1] - start[1]) * dy) / square if square > 0.0 else 0.0
        share = min(max(share, 0.0), 1.0)
        foot = start[0] + share * dx, start[1] + share * dy
        if math.dist(foot, point) < math.dist(best, point):
            best = foot
    return best
