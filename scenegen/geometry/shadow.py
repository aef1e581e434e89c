"""The clearance of a footprint and a shadow: of what an upright body hides from an eye, all of it down to some height.

A body hides what lies behind it, enlarged from the eye: with the eye above the table at e, the hull of two copies
e + s (F - e) of its footprint F, one `first` times as large as it and one `last` times. With h the support function of
F around q, that of the shadow is n . e + max over both s of s (n . (q - e) + h(n)), and the signed clearance is, as
that of any two convex sets (see scenegen.geometry.clearance), the maximum over all directions n of
n . (a - e) - h_a(-n) - max(first X(n), last X(n)), where X(n) = n . (q - e) + h(n).

The maximum lies at a normal of an edge of either footprint, at a right angle to a ray from the eye that touches the
body, or in the direction from a corner (or the centre of a disc) of the shadow to one of the other footprint.
"""

from __future__ import annotations

from functools import reduce
from typing import Any

from scenegen.geometry.footprint import Box, Circle, Footprint, corners, edges
from scenegen.geometry.namespace import Namespace

Vector = tuple[Any, Any]
Turn = tuple[Any, Any]  # cosine and sine
NO_WAY = 1e-9  # metres: two points that are not further apart have no direction from one to the other


def shadow_gap(
    ns: Namespace,
    a: Footprint,
    b: Footprint,
    ax: Any,
    ay: Any,
    a_theta: Any,
    bx: Any,
    by: Any,
    b_theta: Any,
    eye_x: Any,
    eye_y: Any,
    first: Any,
    last: Any,
) -> Any:
    """The distance of a from the shadow of b; if they overlap, minus the smallest shift that parts them; in metres."""
    from_eye, body = (ax - eye_x, ay - eye_y), (bx - eye_x, by - eye_y)
    a_turn, b_turn = _turn(ns, a, a_theta), _turn(ns, b, b_theta)

    def clearance(nx: Any, ny: Any) -> Any:
        """How far a is beyond the shadow in a direction."""
        shadow = nx * body[0] + ny * body[1] + _reach(ns, b, b_turn, nx, ny)
        back = _reach(ns, a, a_turn, -nx, -ny)
        return nx * from_eye[0] + ny * from_eye[1] - back - ns.maximum(first * shadow, last * shadow)

    directions = [*_normals(a, a_turn, -1.0), *_normals(b, b_turn, 1.0), *_rims(ns, b, b_turn, body)]
    ends, casting = _points(a, a_turn, from_eye), _points(b, b_turn, body)
    ways = [(x - s * u, y - s * v) for x, y in ends for s in (first, last) for u, v in casting]
    if isinstance(b, Circle):  # the nearest of two discs need not be the one whose centre is
        directions += [_unit(ns, *way) for way in ways]
    else:
        directions.append(_unit(ns, *_shortest(ns, ways)))
    return reduce(ns.maximum, [clearance(*direction) for direction in directions])


def _turn(ns: Namespace, shape: Footprint, theta: Any) -> Turn:
    return (1.0, 0.0) if isinstance(shape, Circle) else ns.turn(theta)


def _reach(ns: Namespace, shape: Footprint, turn: Turn, nx: Any, ny: Any) -> Any:
    """The support function of a turned footprint in a direction of length 1."""
    if isinstance(shape, Circle):
        return shape.radius
    cos, sin = turn
    along, across = cos * nx + sin * ny, cos * ny - sin * nx
    if isinstance(shape, Box):
        return shape.length / 2.0 * ns.absolute(along) + shape.width / 2.0 * ns.absolute(across)
    return reduce(ns.maximum, [x * along + y * across for x, y in shape.vertices])


def _normals(shape: Footprint, turn: Turn, sign: float) -> list[Vector]:
    """The normals of the edges, outwards, or inwards with a sign of -1."""
    if isinstance(shape, Circle):
        return []
    cos, sin = turn
    if isinstance(shape, Box):
        return [(cos, sin), (-cos, -sin), (-sin, cos), (sin, -cos)]
    found = [edge.normal for edge in edges(shape)]
    return [(sign * (cos * x - sin * y), sign * (sin * x + cos * y)) for x, y in found]


def _points(shape: Footprint, turn: Turn, place: Vector) -> list[Vector]:
    """The corners of a footprint, or the centre of a disc."""
    x, y = place
    if isinstance(shape, Circle):
        return [place]
    cos, sin = turn
    return [(x + (cos * u - sin * v), y + (sin * u + cos * v)) for u, v in corners(shape)]


def _rims(ns: Namespace, b: Footprint, turn: Turn, body: Vector) -> list[Vector]:
    """The directions at a right angle to the rays from the eye that touch the body, among others."""
    if not isinstance(b, Circle):
        rays = [_unit(ns, *point) for point in _points(b, turn, body)]
        return [side for x, y in rays for side in ((-y, x), (y, -x))]
    x, y = _unit(ns, *body)
    away = ns.hypot(*body)
    sin = b.radius / ns.maximum(away, 0.0 * away + b.radius + NO_WAY)
    cos = ns.sqrt(ns.maximum(1.0 - sin * sin, 0.0 * away))
    return [(-sin * x - cos * y, -sin * y + cos * x), (-sin * x + cos * y, -sin * y - cos * x)]


def _unit(ns: Namespace, x: Any, y: Any) -> Vector:
    """The direction of a vector; any direction for one without length."""
    length = ns.hypot(x, y)
    some = length > NO_WAY
    size = ns.where(some, length, 0.0 * length + 1.0)
    return ns.where(some, x / size, 0.0 * length + 1.0), ns.where(some, y / size, 0.0 * length)


def _shortest(ns: Namespace, ways: list[Vector]) -> Vector:
    (x, y), *rest = ways
    square = x * x + y * y
    for u, v in rest:
        other = u * u + v * v
        nearer = other < square
        x, y, square = ns.where(nearer, u, x), ns.where(nearer, v, y), ns.where(nearer, other, square)
    return x, y
