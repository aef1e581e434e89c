"""Whether two footprints are a distance apart: cheaper than how far, and the same answer.

Growth and its moves hold poses against their neighbours; few need to know how far away these are. By the
separating-axis theorem two convex polygons overlap unless one lies beyond the line through an edge of the other, and
how far it lies beyond is never more than the distance. So the distance itself is computed only where that leaves the
matter open.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scenegen.primitives import NUMPY, PRIMITIVES, Footprint
from scenegen.primitives.footprint import Box, Circle, Polygon
from scenegen.primitives.outline import corners, edges

Array = npt.NDArray[np.float64]
Bool = npt.NDArray[np.bool_]
Pose = tuple[Array, ...]

ROUNDING = 1e-12  # metres: nearer than that to what is asked, the distance itself is computed


def apart(a: Footprint, b: Footprint, at: Pose, other: Pose, least: Array | float) -> Bool:
    """Whether the clearance of a at a pose, x, y and heading (B,) each, and b at another is at least `least`, (B,)."""
    if isinstance(a, Circle) or isinstance(b, Circle):
        gap: Array = PRIMITIVES["gap"].evaluate(NUMPY, a, b, *at, *other)
        return np.asarray(gap >= least)
    beyond = _beyond(a, b, at, other)
    clear: Bool = beyond >= np.maximum(least, 0.0) + ROUNDING
    open_ = np.flatnonzero(~clear & (beyond >= np.minimum(least, 0.0) - ROUNDING))
    if len(open_):
        ends = [np.broadcast_to(value, beyond.shape)[open_] for value in (*at, *other)]
        limit = least if np.ndim(least) == 0 else np.asarray(least)[open_]
        clear[open_] = PRIMITIVES["gap"].evaluate(NUMPY, a, b, *ends) >= limit
    return clear


def _beyond(a: Box | Polygon, b: Box | Polygon, at: Pose, other: Pose) -> Array:
    """How far one lies beyond an edge of the other, at best, (B,): at most the clearance, and equal to it where they
    overlap."""
    dx, dy = other[0] - at[0], other[1] - at[1]
    a_cos, a_sin, b_cos, b_sin = np.cos(at[2]), np.sin(at[2]), np.cos(other[2]), np.sin(other[2])
    cos, sin = a_cos * b_cos + a_sin * b_sin, a_cos * b_sin - a_sin * b_cos
    one = _over(a, b, a_cos * dx + a_sin * dy, a_cos * dy - a_sin * dx, cos, sin)
    two = _over(b, a, -b_cos * dx - b_sin * dy, b_sin * dx - b_cos * dy, cos, -sin)
    out: Array = np.maximum(one, two)
    return out


def _over(a: Box | Polygon, b: Box | Polygon, x: Array, y: Array, cos: Array, sin: Array) -> Array:
    """How far b lies beyond an edge of a, at best. In a's frame it stands at (x, y), turned by the angle of these."""
    if isinstance(a, Box):
        least_x, most_x, least_y, most_y = _span(b, cos, sin)
        across = np.maximum(x + least_x, -x - most_x) - a.length / 2.0
        out: Array = np.maximum(across, np.maximum(y + least_y, -y - most_y) - a.width / 2.0)
        return out
    best: Array | None = None
    points = _turned(b, cos, sin)
    for (nx, ny), offset, *_ in edges(a):
        height = _lowest([nx * u + ny * v for u, v in points]) + (nx * x + ny * y - offset)
        best = height if best is None else np.maximum(best, height)
    assert best is not None
    return best


def _span(footprint: Box | Polygon, cos: Array, sin: Array) -> tuple[Array, Array, Array, Array]:
    """From where to where a footprint reaches along x and along y, when turned."""
    if isinstance(footprint, Box):
        half_length, half_width = footprint.length / 2.0, footprint.width / 2.0
        cos, sin = np.abs(cos), np.abs(sin)
        x, y = half_length * cos + half_width * sin, half_length * sin + half_width * cos
        return -x, x, -y, y
    points = _turned(footprint, cos, sin)
    along, across = [u for u, _ in points], [v for _, v in points]
    return _lowest(along), -_lowest([-u for u in along]), _lowest(across), -_lowest([-v for v in across])


def _turned(footprint: Box | Polygon, cos: Array, sin: Array) -> list[tuple[Array, Array]]:
    return [(cos * u - sin * v, sin * u + cos * v) for u, v in corners(footprint)]


def _lowest(values: list[Array]) -> Array:
    lowest = values[0]
    for value in values[1:]:
        lowest = np.minimum(lowest, value)
    return lowest
