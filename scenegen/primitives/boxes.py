"""Clearance of two oriented boxes: the signed distance of b's centre from the octagon that a's shape sweeps round b's.

The Minkowski sum of two boxes is an octagon with its middle in a's centre. Its edges come in four opposite pairs: two
across the axes of either box. The edges across an axis of one box are as long as its side is, lie as far out as both
boxes reach along that axis, and the turn of the other shifts them sideways. By symmetry one edge of each pair is
enough. Inside, the distance to the nearest edge is minus the depth of the overlap, which is the highest of the four
heights above the lines through the edges; outside, it is the gap.
"""

from __future__ import annotations

from typing import Any

from scenegen.primitives.footprint import Box
from scenegen.primitives.namespace import Namespace

Turn = tuple[Any, Any]  # cosine and sine


def gap(ns: Namespace, a: Box, b: Box, dx: Any, dy: Any, a_turn: Turn, b_turn: Turn) -> Any:
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
    past_x, past_y = ns.beyond(along_x, half_width), ns.beyond(along_y, half_length)
    square = ns.minimum(across_x * across_x + past_x * past_x, across_y * across_y + past_y * past_y)
    return ns.maximum(across_x, across_y), square
