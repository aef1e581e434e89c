"""Clearance, room, reach and bearing of footprints on the table.

Poses are numbers of the namespace, floats or arrays that broadcast; footprints are constants. All values are exact up
to rounding: plain floats and numpy differ only by the effect of the last bits of sin, cos and atan2.

With h the support function of a convex set, the signed clearance of A and B is the maximum over all directions n of
-h_A(n) - h_B(-n): the signed distance of the origin from their Minkowski difference (Cameron and Culley 1986). For
polygons that overlap the maximum lies at a normal of an edge of either (the separating-axis theorem); for polygons that
do not, it is the distance of some corner of either to the other.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from scenegen.geometry.footprint import Box, Circle, Footprint, PlacedBox, Polygon, corners, edges
from scenegen.geometry.namespace import Namespace

# Clearance of two oriented boxes: the signed distance of b's centre from the octagon that a's shape sweeps round b's.
#
# The Minkowski sum of two boxes is an octagon with its middle in a's centre. Its edges come in four opposite pairs:
# two across the axes of either box. The edges across an axis of one box are as long as its side is, lie as far out as
# both boxes reach along that axis, and the turn of the other shifts them sideways. By symmetry one edge of each pair
# is enough. Inside, the distance to the nearest edge is minus the depth of the overlap, which is the highest of the
# four heights above the lines through the edges; outside, it is the gap.


Turn = tuple[Any, Any]  # cosine and sine


def box_gap(ns: Namespace, a: Box, b: Box, dx: Any, dy: Any, a_turn: Turn, b_turn: Turn) -> Any:
    """The signed clearance in metres, of b at (dx, dy) from a's centre."""
    (a_cos, a_sin), (b_cos, b_sin) = a_turn, b_turn
    cos, sin = a_cos * b_cos + a_sin * b_sin, a_cos * b_sin - a_sin * b_cos
    lean = cos * sin  # its sign: which way b leans, as a sees it; a leans the other way, as b sees it
    cos, sin = ns.absolute(cos), ns.absolute(sin)
    of_b = _reach(b, cos, sin)
    of_a = of_b if a == b else _reach(a, cos, sin)
    height, square = _outline(ns, a, of_b, a_cos * dx + a_sin * dy, a_cos * dy - a_sin * dx, lean)
    other, its = _outline(ns, b, of_a, b_cos * dx + b_sin * dy, b_cos * dy - b_sin * dx, -lean)
    return ns.signed_root(ns.minimum(square, its), ns.maximum(height, other))


def _reach(box: Box, cos: Any, sin: Any) -> tuple[Any, Any, Any, Any]:
    """How far a box reaches along both axes of a frame to which it is turned by the angle of these, without signs, and
    how far the corners that do so lie off these axes."""
    half_length, half_width = box.length / 2.0, box.width / 2.0
    along_x, along_y = half_length * cos, half_length * sin
    across_x, across_y = half_width * sin, half_width * cos
    return along_x + across_x, along_y + across_y, along_y - across_y, along_x - across_x


def _outline(ns: Namespace, box: Box, other: tuple[Any, Any, Any, Any], x: Any, y: Any, lean: Any) -> tuple[Any, Any]:
    """(x, y) in the frame of the box, above the octagon's four edges across its axes: the greatest height, and the
    square of the smallest distance. `other` is the reach of the other box; the sign of `lean` is the way it leans."""
    reach_x, reach_y, off_x, off_y = other
    half_length, half_width = box.length / 2.0, box.width / 2.0
    side = x * y * lean  # which of the two mirror images of the octagon it is, once (x, y) is in the first quadrant
    x, y = ns.absolute(x), ns.absolute(y)
    across_x, across_y = x - (reach_x + half_length), y - (reach_y + half_width)
    along_x, along_y = ns.copysign(y, side) - off_x, ns.copysign(x, side) - off_y
    past_x, past_y = ns.excess(along_x, half_width), ns.excess(along_y, half_length)
    square = ns.minimum(across_x * across_x + past_x * past_x, across_y * across_y + past_y * past_y)
    return ns.maximum(across_x, across_y), square


Pairs = list[tuple[Any, Any]]


def gap(
    ns: Namespace, a: Footprint, b: Footprint, ax: Any, ay: Any, a_theta: Any, bx: Any, by: Any, b_theta: Any
) -> Any:
    """The distance of two footprints; if they overlap, minus the smallest translation that separates them; in
    metres."""
    dx, dy = bx - ax, by - ay
    if isinstance(a, PlacedBox) and isinstance(b, Circle | Box):
        return _offset_box_gap(ns, a.box, (a.offset, a.turn), b, dx, dy, ns.turn(a_theta), b_theta)
    if isinstance(a, Circle):
        if isinstance(b, Circle):
            return ns.hypot(dx, dy) - (a.radius + b.radius)
        return _facing(ns, b, [_into_frame(*ns.turn(b_theta), -dx, -dy)]) - a.radius
    if isinstance(b, Circle):
        return _facing(ns, a, [_into_frame(*ns.turn(a_theta), dx, dy)]) - b.radius
    (a_cos, a_sin), (b_cos, b_sin) = ns.turn(a_theta), ns.turn(b_theta)
    if isinstance(a, Box) and isinstance(b, Box):
        return box_gap(ns, a, b, dx, dy, (a_cos, a_sin), (b_cos, b_sin))
    cos, sin = a_cos * b_cos + a_sin * b_sin, a_cos * b_sin - a_sin * b_cos
    one = _separation(ns, a, _corners(b, *_into_frame(a_cos, a_sin, dx, dy), cos, sin))
    other = _separation(ns, b, _corners(a, *_into_frame(b_cos, b_sin, -dx, -dy), cos, -sin))
    apart = ns.maximum(one[0], other[0])
    return ns.where(apart > 0.0, ns.sqrt(ns.minimum(one[1], other[1])), apart)


def placed_gaps(
    ns: Namespace,
    boxes: Sequence[PlacedBox],
    b: Circle | Box,
    ax: Any,
    ay: Any,
    a_theta: Any,
    bx: Any,
    by: Any,
    b_theta: Any,
) -> Any:
    """`gap` for K boxes of one size, placed in the same frame, and arrays (n,) of numpy, all at once: (K, n)."""
    numbers = np.array([(*one.offset, *one.turn) for one in boxes]).T[:, :, None]
    frame = (numbers[0], numbers[1]), (numbers[2], numbers[3])
    return _offset_box_gap(ns, boxes[0].box, frame, b, bx - ax, by - ay, ns.turn(a_theta), b_theta)


def _offset_box_gap(
    ns: Namespace, box: Box, frame: tuple[Turn, Turn], b: Circle | Box, dx: Any, dy: Any, turn: Turn, b_theta: Any
) -> Any:
    """Of a box whose centre is at an offset in the frame of its thing, and turned there: `frame` is both."""
    (cos, sin), ((x, y), (own_cos, own_sin)) = turn, frame
    dx, dy = dx - (cos * x - sin * y), dy - (sin * x + cos * y)
    cos, sin = cos * own_cos - sin * own_sin, sin * own_cos + cos * own_sin
    if isinstance(b, Circle):
        return _facing(ns, box, [_into_frame(cos, sin, dx, dy)]) - b.radius
    return box_gap(ns, box, b, dx, dy, (cos, sin), ns.turn(b_theta))


def room(
    ns: Namespace, a: Footprint, b: Footprint, ax: Any, ay: Any, a_theta: Any, bx: Any, by: Any, b_theta: Any
) -> Any:
    """How far a's footprint stays inside b's: the smallest slack to b's boundary (if b is a polygon, to the lines
    through its edges); if a extends beyond b, minus the distance by which it does; in metres. At least 0 if and only if
    a lies in b."""
    dx, dy = ax - bx, ay - by
    if isinstance(b, Circle):
        if isinstance(a, Circle):
            return b.radius - a.radius - ns.hypot(dx, dy)
        x, y = _into_frame(*ns.turn(a_theta), -dx, -dy)  # b's centre, as a sees it
        return b.radius - _farthest(ns, a, x, y)
    b_cos, b_sin = ns.turn(b_theta)
    x, y = _into_frame(b_cos, b_sin, dx, dy)
    if isinstance(a, Circle):
        return _inside(ns, b, [(x, y)]) - a.radius
    a_cos, a_sin = ns.turn(a_theta)
    cos, sin = b_cos * a_cos + b_sin * a_sin, b_cos * a_sin - b_sin * a_cos
    return _inside(ns, b, _corners(a, x, y, cos, sin))


def path_gap(ns: Namespace, a: Footprint, ax: Any, ay: Any, a_theta: Any, px: Any, py: Any, qx: Any, qy: Any) -> Any:
    """The distance of a footprint from the segment between two places; if they meet, minus the smallest translation
    that separates them; in metres."""
    ends = [(px - ax, py - ay), (qx - ax, qy - ay)]
    if not isinstance(a, Circle):
        cos, sin = ns.turn(a_theta)
        ends = [_into_frame(cos, sin, *end) for end in ends]
    (x, y), (u, v) = ends[0], (ends[1][0] - ends[0][0], ends[1][1] - ends[0][1])
    square = u * u + v * v
    some = ns.where(square > 0.0, square, 1.0)  # both ends may be one place

    def segment_square(cx: Any, cy: Any) -> Any:
        share = ns.clip(((cx - x) * u + (cy - y) * v) / some, 0.0, 1.0)
        dx, dy = cx - (x + share * u), cy - (y + share * v)
        return dx * dx + dy * dy

    if isinstance(a, Circle):
        return ns.sqrt(segment_square(0.0, 0.0)) - a.radius
    outline = a if isinstance(a, Polygon) else Polygon(corners(a))
    apart, nearest = _separation(ns, outline, ends)
    sides = [((cy - y) * u - (cx - x) * v) / ns.sqrt(some) for cx, cy in outline.vertices]
    across = ns.maximum(_fold(ns.minimum, sides), -_fold(ns.maximum, sides))
    apart = ns.where(square > 0.0, ns.maximum(apart, across), apart)
    nearest = ns.minimum(nearest, _fold(ns.minimum, [segment_square(cx, cy) for cx, cy in outline.vertices]))
    return ns.where(apart > 0.0, ns.sqrt(nearest), apart)


def reach(ns: Namespace, a: Footprint, ax: Any, ay: Any, a_theta: Any, heading: Any) -> Any:
    """The support function: how far the footprint reaches from the origin of its frame towards `heading`, in metres."""
    if isinstance(a, Circle):
        return 0.0 * heading + a.radius
    cos, sin = ns.turn(heading - a_theta)
    if isinstance(a, Box):
        return a.length / 2.0 * ns.absolute(cos) + a.width / 2.0 * ns.absolute(sin)
    return _fold(ns.maximum, [x * cos + y * sin for x, y in a.vertices])


def bearing(ns: Namespace, ax: Any, ay: Any, bx: Any, by: Any) -> Any:
    """The direction of b seen from a, in (-pi, pi]; 0 where they coincide."""
    # x - y is -0.0 for the zeros -0.0 and 0.0, and atan2 distinguishes them.
    return ns.atan2(by - ay + 0.0, bx - ax + 0.0)


def _into_frame(cos: Any, sin: Any, x: Any, y: Any) -> tuple[Any, Any]:
    """The vector (x, y) in a frame that is turned by the angle of this cosine and sine."""
    return cos * x + sin * y, cos * y - sin * x


def _corners(footprint: Box | Polygon, x: Any, y: Any, cos: Any, sin: Any) -> Pairs:
    """The corners of a footprint at (x, y), turned by the angle of this cosine and sine."""
    if isinstance(footprint, Polygon):
        return [(x + (cos * u - sin * v), y + (sin * u + cos * v)) for u, v in footprint.vertices]
    (px, py), (qx, qy) = _half_diagonals(footprint, cos, sin)
    return [(x + px, y + py), (x - qx, y - qy), (x - px, y - py), (x + qx, y + qy)]


def _half_diagonals(box: Box, cos: Any, sin: Any) -> Pairs:
    """From the centre to the corners front left and front right; the others lie opposite."""
    half_length, half_width = box.length / 2.0, box.width / 2.0
    ux, uy, vx, vy = half_length * cos, half_length * sin, half_width * sin, half_width * cos
    return [(ux - vx, uy + vy), (ux + vx, uy - vy)]


def _square(ns: Namespace, box: Box, x: Any, y: Any) -> Any:
    """The squared distance of a point from a box, in the box's frame."""
    x, y = ns.excess(x, box.length / 2.0), ns.excess(y, box.width / 2.0)
    return x * x + y * y


def _facing(ns: Namespace, footprint: Box | Polygon, points: Pairs) -> Any:
    """The signed distance of a single point, in the footprint's frame."""
    apart, square = _separation(ns, footprint, points)
    return ns.where(apart > 0.0, ns.sqrt(square), apart)


def _separation(ns: Namespace, footprint: Box | Polygon, points: Pairs) -> tuple[Any, Any]:
    """How far the points' hull lies beyond one of the footprint's edges, at best, and the square of the smallest
    distance of a point from the footprint (from its boundary, if the point is inside a polygon)."""
    if isinstance(footprint, Box):
        beyond = []
        for axis, half in ((0, footprint.length / 2.0), (1, footprint.width / 2.0)):
            if len(points) == 1:
                beyond.append(ns.absolute(points[0][axis]) - half)
                continue
            least = _fold(ns.minimum, [point[axis] for point in points])
            most = _fold(ns.maximum, [point[axis] for point in points])
            beyond.append(ns.maximum(least, -most) - half)
        return ns.maximum(*beyond), _fold(ns.minimum, [_square(ns, footprint, x, y) for x, y in points])
    best: Any = None
    nearest: Any = None
    for (nx, ny), offset, (tx, ty), start, length in edges(footprint):
        heights = []
        for x, y in points:
            height, along = nx * x + ny * y - offset, tx * x + ty * y - start
            past = along - ns.clip(along, 0.0, length)
            square = height * height + past * past
            nearest = square if nearest is None else ns.minimum(nearest, square)
            heights.append(height)
        lowest = _fold(ns.minimum, heights)
        best = lowest if best is None else ns.maximum(best, lowest)
    return best, nearest


def _inside(ns: Namespace, footprint: Box | Polygon, points: Pairs) -> Any:
    """The smallest slack of all points to the lines through the footprint's edges."""
    if isinstance(footprint, Box):
        x = _fold(ns.maximum, [ns.absolute(point[0]) for point in points])
        y = _fold(ns.maximum, [ns.absolute(point[1]) for point in points])
        return ns.minimum(footprint.length / 2.0 - x, footprint.width / 2.0 - y)
    slacks = []
    for (nx, ny), offset, *_ in edges(footprint):
        slacks.append(offset - _fold(ns.maximum, [nx * x + ny * y for x, y in points]))
    return _fold(ns.minimum, slacks)


def _farthest(ns: Namespace, footprint: Box | Polygon, x: Any, y: Any) -> Any:
    """The largest distance of (x, y) from a point of the footprint, in its frame."""
    if isinstance(footprint, Box):
        return ns.hypot(ns.absolute(x) + footprint.length / 2.0, ns.absolute(y) + footprint.width / 2.0)
    squares = [(x - u) * (x - u) + (y - v) * (y - v) for u, v in footprint.vertices]
    return ns.sqrt(_fold(ns.maximum, squares))


def _fold(step: Any, values: list[Any]) -> Any:
    result = values[0]
    for value in values[1:]:
        result = step(result, value)
    return result
