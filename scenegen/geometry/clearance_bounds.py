"""Interval rules of gap, room, reach and bearing.

With the headings held, gap is the maximum and room the minimum of functions that are affine in the translation between
the two footprints. So over a box of translations the corners give gap's largest and room's smallest value, exactly, and
every direction gives a bound from the other side. Turning a footprint changes either by at most `turn` of its Measures
per radian. Each bound alone grows with the box, so boxes within boxes get bounds within bounds; together they shrink to
a point with the box.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from scenegen.arrays import Array
from scenegen.geometry import clearance
from scenegen.geometry import interval as iv
from scenegen.geometry.footprint import Circle, Footprint, Measures, half_width, measures
from scenegen.geometry.interval import Interval, Intervals, quiet
from scenegen.geometry.namespace import NUMPY

ERROR = 2.0**-46  # 128 roundings: more than in a value and its bound together, relative to all lengths involved
DIRECTIONS = 8
ANGLES = tuple(k * (2.0 * math.pi / DIRECTIONS) for k in range(DIRECTIONS))


def gap(
    a: Footprint, b: Footprint, ax: Interval, ay: Interval, at: Interval, bx: Interval, by: Interval, bt: Interval
) -> Interval:
    dx, dy = iv.sub(bx, ax), iv.sub(by, ay)
    one, other = measures(a), measures(b)
    dist = iv.hypot(dx, dy)
    bound = Interval(dist.lo - (one.outer + other.outer), dist.hi - (one.inner + other.inner))
    if isinstance(a, Circle) and isinstance(b, Circle):
        return bound  # the same operations as the value's: monotone, rounded or not
    (a_mid, a_half), (b_mid, b_half) = split(at), split(bt)
    turn = one.turn * a_half + other.turn * b_half
    ends, middle = _at_corners(clearance.gap, a, b, dx, dy, a_mid, b_mid, flip=False)
    bound = narrow(bound, middle - spread(dx, dy) - turn, ends.max(0) + turn)
    slack = apart(dx, dy, at, bt, a, b, directions(bound.lo)).max(0)
    return iv.loosen(narrow(bound, slack, math.inf), rounding(one, other, ax, ay, at, bx, by, bt))


def room(
    a: Footprint, b: Footprint, ax: Interval, ay: Interval, at: Interval, bx: Interval, by: Interval, bt: Interval
) -> Interval:
    dx, dy = iv.sub(ax, bx), iv.sub(ay, by)
    one, other = measures(a), measures(b)
    dist = iv.hypot(dx, dy)
    lo, hi = other.inner - one.outer - dist.hi, mitred(other, other.outer - one.inner - dist.lo)
    if isinstance(a, Circle) and isinstance(b, Circle):
        return Interval(b.radius - a.radius - dist.hi, b.radius - a.radius - dist.lo)
    bound = Interval(lo, hi)
    (a_mid, a_half), (b_mid, b_half) = split(at), split(bt)
    turn = one.turn * a_half
    if not isinstance(b, Circle):  # when b turns, a both turns and goes round, as b sees it
        turn = turn + (one.turn + dist.hi) * b_half
    ends, middle = _at_corners(clearance.room, a, b, dx, dy, a_mid, b_mid, flip=True)
    bound = narrow(bound, ends.min(0) - turn, middle + spread(dx, dy) + turn)
    slack = mitred(other, within(dx, dy, at, bt, a, b, directions(bound.lo)).min(0))
    # For all poses: b, shrunk by the room, still contains the disc in a, so it is that wide.
    slack = np.minimum(slack, half_width(b) - max(one.inner, 0.0))
    return iv.loosen(narrow(bound, -math.inf, slack), rounding(one, other, ax, ay, at, bx, by, bt))


def reach(a: Footprint, ax: Interval, ay: Interval, at: Interval, heading: Interval) -> Interval:
    if isinstance(a, Circle):
        return Interval(0.0 * heading.lo + a.radius, 0.0 * heading.hi + a.radius)
    size = measures(a)
    error = ERROR * size.outer * (1.0 + magnitude(at, heading))
    return iv.loosen(support(a, iv.sub(heading, at)), error)


def bearing(ax: Interval, ay: Interval, bx: Interval, by: Interval) -> Interval:
    """The arc between the corners of the box of differences; the whole circle if that box contains the origin or
    crosses the jump at pi."""
    dx, dy = iv.sub(bx, ax), iv.sub(by, ay)
    dx, dy = (Interval(side.lo + 0.0, side.hi + 0.0) for side in (dx, dy))  # no -0.0, see clearance.bearing
    corners = np.stack(np.broadcast_arrays(*(np.arctan2(y, x) for y in dy for x in dx)))
    lo, hi = iv.widen(corners.min(0), corners.max(0))
    jump = (dx.lo < 0.0) & (dy.lo < 0.0) & (dy.hi >= 0.0)
    point = (dx.lo == dx.hi) & (dy.lo == dy.hi)
    origin = (dx.lo <= 0.0) & (dx.hi >= 0.0) & (dy.lo <= 0.0) & (dy.hi >= 0.0) & ~point
    whole = jump | origin
    edge = math.pi * (1.0 + 2.0**-50)
    return Interval(np.where(whole, -edge, lo), np.where(whole, edge, hi))


def support(a: Footprint, angle: Interval) -> Interval:
    """The support function over an arc, in the footprint's own frame, up to rounding."""
    size = measures(a)
    middle, half = split(angle)
    value = clearance.reach(NUMPY, a, 0.0, 0.0, 0.0, middle)
    if isinstance(a, Circle):
        return Interval(value, value)
    return narrow(Interval(value - size.turn * half, value + size.turn * half), size.inner, size.outer)


def directions(like: Array) -> Array:
    """Angles all around, along a new first axis before those of `like`."""
    return np.array(ANGLES).reshape(DIRECTIONS, *(1,) * np.ndim(like))


def apart(dx: Interval, dy: Interval, at: Interval, bt: Interval, a: Footprint, b: Footprint, angles: Array) -> Array:
    """For each direction, a lower bound of how far b lies beyond a, and so of the gap, up to rounding."""
    along = _least_along(dx, dy, angles)
    return along - support(a, iv.sub(_points(angles), at)).hi - support(b, iv.sub(_points(angles + math.pi), bt)).hi


def within(dx: Interval, dy: Interval, at: Interval, bt: Interval, a: Footprint, b: Footprint, angles: Array) -> Array:
    """For each direction, an upper bound of how much farther b extends than a, for a at (dx, dy) from b, up to
    rounding."""
    along = _least_along(dx, dy, angles)
    return support(b, iv.sub(_points(angles), bt)).hi - support(a, iv.sub(_points(angles), at)).lo - along


def mitred(b: Measures, slack: Array) -> Array:
    """An upper bound of room if b extends `slack` farther than a in some direction.

    Edges alone make room, and between the normals of two edges a negative slack is up to `mitre` times theirs.
    """
    return np.where(slack >= 0.0, slack, slack / b.mitre)


def split(a: Interval) -> tuple[Array, Array]:
    """Midpoint and half width."""
    return 0.5 * a.lo + 0.5 * a.hi, 0.5 * (a.hi - a.lo)


def spread(dx: Interval, dy: Interval) -> Array:
    """How far the midpoint of a box is from its corners, in the 1-norm: with the Euclidean norm, the bounds of a box
    within a box could lie outside that box's."""
    return split(dx)[1] + split(dy)[1]


def magnitude(*parts: Interval) -> Array:
    """The sum of the largest absolute values."""
    return np.asarray(sum(np.maximum(np.abs(part.lo), np.abs(part.hi)) for part in parts))


def rounding(
    one: Measures, other: Measures, ax: Interval, ay: Interval, at: Interval, bx: Interval, by: Interval, bt: Interval
) -> Array:
    """More than the rounding errors of a clearance and of its bounds."""
    lengths = magnitude(ax, ay, bx, by) + (one.outer + other.outer)
    return ERROR * lengths * (1.0 + magnitude(at, bt))


def narrow(a: Interval, lo: Array | float, hi: Array | float) -> Interval:
    """`a` cut to [lo, hi]; NaN ends are ignored."""
    return Interval(np.fmax(a.lo, lo), np.fmin(a.hi, hi))


def _points(values: Array) -> Interval:
    return Interval(values, values)


def _least_along(dx: Interval, dy: Interval, angles: Array) -> Array:
    x, y = np.cos(angles), np.sin(angles)
    return np.minimum(x * dx.lo, x * dx.hi) + np.minimum(y * dy.lo, y * dy.hi)


def _at_corners(
    function: Callable[..., Any],
    a: Footprint,
    b: Footprint,
    dx: Interval,
    dy: Interval,
    at: Array,
    bt: Array,
    *,
    flip: bool,
) -> tuple[Array, Array]:
    """Values at the four corners of the box of translations, (4, ...), and at its midpoint, for given headings."""
    shape = np.broadcast_shapes(np.shape(dx.lo), np.shape(dy.lo), np.shape(at), np.shape(bt))
    x, y = np.empty((5, *shape)), np.empty((5, *shape))
    x[:2], x[2:4], x[4] = dx.lo, dx.hi, split(dx)[0]
    y[:3:2], y[1:4:2], y[4] = dy.lo, dy.hi, split(dy)[0]
    here, there = ((x, y), (0.0, 0.0)) if flip else ((0.0, 0.0), (x, y))
    values = function(NUMPY, a, b, *here, at, *there, bt)
    return values[:4], values[4]


# --------------------------------------------------------------------------------------------------------------------
# Backward rules of gap and room (see scenegen.geometry.interval): they narrow positions; headings stay as they are.
#
# They invert bounds that hold in one direction, along x or y, or for the discs around and inside the footprints.


@quiet
def back_gap(a: Footprint, b: Footprint, result: Interval, *pose: Interval) -> Intervals:
    one, other = measures(a), measures(b)
    _, _, at, _, _, bt = pose
    slack = _slack(a, b, result, pose)
    far = Interval(
        result.lo + (one.inner + other.inner) - slack,
        result.hi + (one.outer + other.outer) + slack,
    )
    # In no direction does b lie farther beyond a than the gap is wide.
    zero = iv.point(0.0)
    angles = _axes(slack)
    limit = result.hi + slack - apart(zero, zero, at, bt, a, b, angles)
    return _translate(far, limit, pose, from_b=False)


@quiet
def back_room(a: Footprint, b: Footprint, result: Interval, *pose: Interval) -> Intervals:
    one, other = measures(a), measures(b)
    _, _, at, _, _, bt = pose
    slack = _slack(a, b, result, pose)
    least = result.lo - slack
    needed = np.where(least >= 0.0, least, least * other.mitre)  # see clearance_bounds.mitred
    far = Interval(
        other.inner - one.outer - result.hi - slack,
        other.outer - one.inner - needed + slack,
    )
    # In every direction b reaches at least so much farther than a.
    zero = iv.point(0.0)
    angles = _axes(slack)
    limit = within(zero, zero, at, bt, a, b, angles) - needed + slack
    return _translate(far, limit, pose, from_b=True)


def _axes(like: Array) -> Array:
    """The directions +x, +y, -x, -y, along a new first axis."""
    return np.array([0.0, 0.5 * math.pi, math.pi, 1.5 * math.pi]).reshape(-1, *(1 for _ in np.shape(like)))


def _slack(a: Footprint, b: Footprint, result: Interval, pose: tuple[Interval, ...]) -> Array:
    ax, ay, at, bx, by, bt = pose
    return rounding(measures(a), measures(b), ax, ay, at, bx, by, bt) + ERROR * iv.size(result)


def _translate(far: Interval, limit: Array, pose: tuple[Interval, ...], *, from_b: bool) -> Intervals:
    """Positions whose distance lies within `far` and whose difference along +x, +y, -x, -y stays below `limit`."""
    ax, ay, at, bx, by, bt = pose
    ax, ay, bx, by = iv.back_dist(far, ax, ay, bx, by)
    dx, dy = Interval(-limit[2], limit[0]), Interval(-limit[3], limit[1])
    if from_b:
        ax, bx = iv.back_sub(dx, ax, bx)
        ay, by = iv.back_sub(dy, ay, by)
    else:
        bx, ax = iv.back_sub(dx, bx, ax)
        by, ay = iv.back_sub(dy, by, ay)
    return ax, ay, at, bx, by, bt
