"""Interval rules of the functions of footprints: gap, room, reach and bearing, shadows, shares that are seen."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from scenegen.arrays import Array
from scenegen.geometry import clearance, shadow, share
from scenegen.geometry.footprint import POINT, Box, Circle, Footprint, Measures, PlacedBox, half_width, measures
from scenegen.geometry.interval import (
    EPS,
    Interval,
    Intervals,
    back_dist,
    back_minimum,
    back_sub,
    hypot,
    loosen,
    minimum,
    neg,
    point,
    quiet,
    size,
    sub,
    widen,
)
from scenegen.geometry.namespace import NUMPY

# With the headings held, gap is the maximum and room the minimum of functions that are affine in the translation
# between the two footprints. So over a box of translations the corners give gap's largest and room's smallest value,
# exactly, and every direction gives a bound from the other side. Turning a footprint changes either by at most `turn`
# of its Measures per radian. Each bound alone grows with the box, so boxes within boxes get bounds within bounds;
# together they shrink to a point with the box.


ERROR = 2.0**-46  # 128 roundings: more than in a value and its bound together, relative to all lengths involved
DIRECTIONS = 8
BOUND_ANGLES = tuple(k * (2.0 * math.pi / DIRECTIONS) for k in range(DIRECTIONS))


def gap(
    a: Footprint, b: Footprint, ax: Interval, ay: Interval, at: Interval, bx: Interval, by: Interval, bt: Interval
) -> Interval:
    dx, dy = sub(bx, ax), sub(by, ay)
    one, other = measures(a), measures(b)
    dist = hypot(dx, dy)
    bound = Interval(dist.lo - (one.outer + other.outer), dist.hi - (one.inner + other.inner))
    if isinstance(a, Circle) and isinstance(b, Circle):
        return bound  # the same operations as the value's: monotone, rounded or not
    (a_mid, a_half), (b_mid, b_half) = split(at), split(bt)
    turn = one.turn * a_half + other.turn * b_half
    ends, middle = _at_corners(clearance.gap, a, b, dx, dy, a_mid, b_mid, flip=False)
    bound = narrow(bound, middle - corner_distance(dx, dy) - turn, ends.max(0) + turn)
    if isinstance(a, PlacedBox):  # hundreds of them make one formula: more work for it would hardly pay
        return loosen(bound, rounding(one, other, ax, ay, at, bx, by, bt))
    slack = separations(dx, dy, at, bt, a, b, directions(bound.lo)).max(0)
    return loosen(narrow(bound, slack, math.inf), rounding(one, other, ax, ay, at, bx, by, bt))


def room(
    a: Footprint, b: Footprint, ax: Interval, ay: Interval, at: Interval, bx: Interval, by: Interval, bt: Interval
) -> Interval:
    dx, dy = sub(ax, bx), sub(ay, by)
    one, other = measures(a), measures(b)
    dist = hypot(dx, dy)
    lo, hi = other.inner - one.outer - dist.hi, miter_bound(other, other.outer - one.inner - dist.lo)
    if isinstance(a, Circle) and isinstance(b, Circle):
        return Interval(b.radius - a.radius - dist.hi, b.radius - a.radius - dist.lo)
    bound = Interval(lo, hi)
    (a_mid, a_half), (b_mid, b_half) = split(at), split(bt)
    turn = one.turn * a_half
    if not isinstance(b, Circle):  # when b turns, a both turns and goes round, as b sees it
        turn = turn + (one.turn + dist.hi) * b_half
    ends, middle = _at_corners(clearance.room, a, b, dx, dy, a_mid, b_mid, flip=True)
    bound = narrow(bound, ends.min(0) - turn, middle + corner_distance(dx, dy) + turn)
    slack = miter_bound(other, overhangs(dx, dy, at, bt, a, b, directions(bound.lo)).min(0))
    # For all poses: b, shrunk by the room, still contains the disc in a, so it is that wide.
    slack = np.minimum(slack, half_width(b) - max(one.inner, 0.0))
    return loosen(narrow(bound, -math.inf, slack), rounding(one, other, ax, ay, at, bx, by, bt))


def path_gap(
    a: Footprint, ax: Interval, ay: Interval, at: Interval, px: Interval, py: Interval, qx: Interval, qy: Interval
) -> Interval:
    """The value at the middle, and as much as moving and turning the footprint and moving the ends can change it."""
    size, places = measures(a), (ax, ay, px, py, qx, qy)
    x, y, turn, *ends = (split(part)[0] for part in (ax, ay, at, px, py, qx, qy))
    value = clearance.path_gap(NUMPY, a, x, y, turn, *ends)
    slack = sum((split(part)[1] for part in places), size.turn * split(at)[1])
    error = ERROR * (magnitude(*places) + size.outer) * (1.0 + magnitude(at))
    return loosen(Interval(value, value), slack + error)


def reach(a: Footprint, ax: Interval, ay: Interval, at: Interval, heading: Interval) -> Interval:
    if isinstance(a, Circle):
        return Interval(0.0 * heading.lo + a.radius, 0.0 * heading.hi + a.radius)
    size = measures(a)
    error = ERROR * size.outer * (1.0 + magnitude(at, heading))
    return loosen(support(a, sub(heading, at)), error)


def bearing(ax: Interval, ay: Interval, bx: Interval, by: Interval) -> Interval:
    """The arc between the corners of the box of differences; the whole circle if that box contains the origin or
    crosses the jump at pi."""
    dx, dy = sub(bx, ax), sub(by, ay)
    dx, dy = (Interval(side.lo + 0.0, side.hi + 0.0) for side in (dx, dy))  # no -0.0, see clearance.bearing
    corners = np.stack(np.broadcast_arrays(*(np.arctan2(y, x) for y in dy for x in dx)))
    lo, hi = widen(corners.min(0), corners.max(0))
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
    return np.array(BOUND_ANGLES).reshape(DIRECTIONS, *(1,) * np.ndim(like))


def separations(
    dx: Interval, dy: Interval, at: Interval, bt: Interval, a: Footprint, b: Footprint, angles: Array
) -> Array:
    """For each direction, a lower bound of how far b lies beyond a, and so of the gap, up to rounding."""
    along = _least_along(dx, dy, angles)
    return along - support(a, sub(_points(angles), at)).hi - support(b, sub(_points(angles + math.pi), bt)).hi


def overhangs(
    dx: Interval, dy: Interval, at: Interval, bt: Interval, a: Footprint, b: Footprint, angles: Array
) -> Array:
    """For each direction, an upper bound of how much farther b extends than a, for a at (dx, dy) from b, up to
    rounding."""
    along = _least_along(dx, dy, angles)
    return support(b, sub(_points(angles), bt)).hi - support(a, sub(_points(angles), at)).lo - along


def miter_bound(b: Measures, slack: Array) -> Array:
    """An upper bound of room if b extends `slack` farther than a in some direction.

    Edges alone make room, and between the normals of two edges a negative slack is up to `mitre` times theirs.
    """
    return np.where(slack >= 0.0, slack, slack / b.mitre)


def split(a: Interval) -> tuple[Array, Array]:
    """Midpoint and half width."""
    return 0.5 * a.lo + 0.5 * a.hi, 0.5 * (a.hi - a.lo)


def corner_distance(dx: Interval, dy: Interval) -> Array:
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


# Backward rules of gap and room: they narrow positions; headings stay as they are.
#
# They invert bounds that hold in one direction, along x or y, or for the discs around and inside the footprints.


def narrows_poses(a: Footprint) -> bool:
    """Whether `back_gap` can narrow anything."""
    return not isinstance(a, PlacedBox)  # see `gap`


@quiet
def back_gap(a: Footprint, b: Footprint, result: Interval, *pose: Interval) -> Intervals:
    if not narrows_poses(a):
        return pose
    one, other = measures(a), measures(b)
    _, _, at, _, _, bt = pose
    slack = _slack(a, b, result, pose)
    far = Interval(
        result.lo + (one.inner + other.inner) - slack,
        result.hi + (one.outer + other.outer) + slack,
    )
    # In no direction does b lie farther beyond a than the gap is wide.
    zero = point(0.0)
    angles = _axes(slack)
    limit = result.hi + slack - separations(zero, zero, at, bt, a, b, angles)
    return _translate(far, limit, pose, from_b=False)


@quiet
def back_room(a: Footprint, b: Footprint, result: Interval, *pose: Interval) -> Intervals:
    one, other = measures(a), measures(b)
    _, _, at, _, _, bt = pose
    slack = _slack(a, b, result, pose)
    least = result.lo - slack
    needed = np.where(least >= 0.0, least, least * other.mitre)  # see `mitred`
    far = Interval(
        other.inner - one.outer - result.hi - slack,
        other.outer - one.inner - needed + slack,
    )
    # In every direction b reaches at least so much farther than a.
    zero = point(0.0)
    angles = _axes(slack)
    limit = overhangs(zero, zero, at, bt, a, b, angles) - needed + slack
    return _translate(far, limit, pose, from_b=True)


def _axes(like: Array) -> Array:
    """The directions +x, +y, -x, -y, along a new first axis."""
    return np.array([0.0, 0.5 * math.pi, math.pi, 1.5 * math.pi]).reshape(-1, *(1 for _ in np.shape(like)))


def _slack(a: Footprint, b: Footprint, result: Interval, pose: tuple[Interval, ...]) -> Array:
    ax, ay, at, bx, by, bt = pose
    return rounding(measures(a), measures(b), ax, ay, at, bx, by, bt) + ERROR * size(result)


def _translate(far: Interval, limit: Array, pose: tuple[Interval, ...], *, from_b: bool) -> Intervals:
    """Positions whose distance lies within `far` and whose difference along +x, +y, -x, -y stays below `limit`."""
    ax, ay, at, bx, by, bt = pose
    ax, ay, bx, by = back_dist(far, ax, ay, bx, by)
    dx, dy = Interval(-limit[2], limit[0]), Interval(-limit[3], limit[1])
    if from_b:
        ax, bx = back_sub(dx, ax, bx)
        ay, by = back_sub(dy, ay, by)
    else:
        bx, ax = back_sub(dx, bx, ax)
        by, ay = back_sub(dy, by, ay)
    return ax, ay, at, bx, by, bt


# Shadows (scenegen.geometry.shadow).
#
# The interval rule: over all directions, one bound holds from below for each, and moving or turning anything changes
# the maximum by a multiple of how far it moves; `scale` copies of b move and turn as often as far.


def shadow_gap(a: Footprint, b: Footprint, *numbers: Interval) -> Interval:
    ax, ay, _, bx, by, _, eye_x, eye_y, first, last = numbers
    one, other = measures(a), measures(b)
    scale = np.maximum(magnitude(first), magnitude(last))
    away = hypot(sub(bx, eye_x), sub(by, eye_y))
    halves = [split(part) for part in numbers]
    value = shadow.shadow_gap(NUMPY, a, b, *(middle for middle, _ in halves))
    of_a, of_b, of_eye = (halves[k][1] + halves[k + 1][1] for k in (0, 3, 6))
    slack = of_a + one.turn * halves[2][1] + scale * (of_b + other.turn * halves[5][1]) + (1.0 + scale) * of_eye
    slack = slack + (away.hi + other.outer) * (halves[8][1] + halves[9][1])
    gap = hypot(sub(ax, eye_x), sub(ay, eye_y))
    bound = Interval(
        value - slack, np.minimum(value + slack, gap.hi - one.inner + scale * (away.hi - min(other.inner, 0.0)))
    )
    angles = directions(value)
    bound = narrow(bound, _shadow_bounds(a, b, numbers, angles).max(0), math.inf)
    return loosen(bound, _shadow_rounding(a, b, numbers))


def _shadow_bounds(a: Footprint, b: Footprint, numbers: tuple[Interval, ...], angles: Array) -> Array:
    """For each direction a lower bound of how far a is beyond the shadow, up to rounding."""
    ax, ay, at, bx, by, bt, eye_x, eye_y, first, last = numbers
    dx, dy = sub(bx, eye_x), sub(by, eye_y)
    ray = -_least_along(neg(dx), neg(dy), angles) + support(b, sub(_points(angles), bt)).hi
    furthest = np.maximum.reduce(np.broadcast_arrays(first.lo * ray, first.hi * ray, last.lo * ray, last.hi * ray))
    back = support(a, sub(_points(angles + math.pi), at)).hi
    return np.asarray(_least_along(sub(ax, eye_x), sub(ay, eye_y), angles) - back - furthest)


def _shadow_rounding(a: Footprint, b: Footprint, numbers: tuple[Interval, ...]) -> Array:
    ax, ay, at, bx, by, bt, eye_x, eye_y, first, last = numbers
    lengths = magnitude(ax, ay, bx, by, eye_x, eye_y) + measures(a).outer + measures(b).outer
    return ERROR * lengths * (1.0 + magnitude(at, bt)) * (1.0 + magnitude(first, last))


@quiet
def back_shadow(a: Footprint, b: Footprint, result: Interval, *numbers: Interval) -> Intervals:
    """In no direction is a further beyond the shadow than the clearance: along x and y that narrows both places. Where
    b must reach so far for the shadow to do so, the larger copy says how far."""
    ax, ay, at, bx, by, bt, eye_x, eye_y, first, last = numbers
    slack = _shadow_rounding(a, b, numbers) + ERROR * size(result)
    angles = _axes(slack)
    dx, dy = sub(bx, eye_x), sub(by, eye_y)
    back = support(a, sub(_points(angles + math.pi), at)).hi
    round_b = support(b, sub(_points(angles), bt)).hi
    ray = -_least_along(neg(dx), neg(dy), angles) + round_b
    furthest = np.maximum.reduce(np.broadcast_arrays(first.lo * ray, first.hi * ray, last.lo * ray, last.hi * ray))
    most = result.hi + slack + back + furthest  # of a from the eye, in each direction
    ax, _ = back_sub(Interval(-most[2], most[0]), ax, eye_x)
    ay, _ = back_sub(Interval(-most[3], most[1]), ay, eye_y)
    # max(first X, last X) >= needed: X >= needed / s for the s that gives the least
    needed = _least_along(sub(ax, eye_x), sub(ay, eye_y), angles) - back - result.hi - slack
    scales = (first.lo, first.hi, last.lo, last.hi)
    least = np.minimum.reduce(np.broadcast_arrays(*(needed / scale for scale in scales))) - round_b
    least = least - EPS * (np.abs(needed) + np.abs(round_b)) - slack
    least = np.where(np.minimum(first.lo, last.lo) > 0.0, least, -math.inf)
    bx, _ = back_sub(Interval(least[0], -least[2]), bx, eye_x)
    by, _ = back_sub(Interval(least[1], -least[3]), by, eye_y)
    return ax, ay, at, bx, by, bt, eye_x, eye_y, first, last


# Shares (scenegen.geometry.share).
#
# The interval rule: known exactly of points; else nothing is covered, or something is. The backward rule: what is seen
# says how far the nearest shadow is.


SHARE_ROUNDING = 2e-13
UNDECIDED_SIGN = 1e-9  # metres: clearances nearer to zero may have either sign, computed otherwise


def visible_share(*given: Any) -> Interval:
    shapes, numbers = share.parts_of(given)
    gaps = numbers[share.BODY + share.CAMERA + share.OTHER - 1 :: share.OTHER]
    least = minimum(*gaps)
    lo, hi = (1.0 + np.maximum(end, 0.0) / share.CLEARANCE_OF_ALL for end in least)
    lo = np.where(least.lo < 0.0, -1.0, lo)
    for number, shape in enumerate(shapes[1:]):
        start = share.BODY + share.CAMERA + number * share.OTHER
        hi = np.where((gaps[number].hi < 0.0) & _has_eye(shape, numbers, start), -1.0, hi)
    places = [
        part
        for at, part in enumerate(numbers)
        if (at - share.BODY - share.CAMERA) % share.OTHER != share.BODY or at < share.BODY + share.CAMERA
    ]
    exact = np.logical_and.reduce(np.broadcast_arrays(least.hi < 0.0, *(part.lo == part.hi for part in places)))
    for gap in gaps:  # which bodies take part is known, too
        decided = np.minimum(np.abs(gap.lo), np.abs(gap.hi)) > UNDECIDED_SIGN
        exact = exact & decided & (gap.hi - gap.lo < UNDECIDED_SIGN)
    if exact.any():
        middles = [np.broadcast_to(split(part)[0], exact.shape)[exact] for part in numbers]
        lo, hi = (np.array(np.broadcast_to(end, exact.shape)) for end in (lo, hi))
        lo[exact] = hi[exact] = share.visible_share(NUMPY, *given[: len(given) - len(numbers)], *middles)
    return Interval(lo - SHARE_ROUNDING, hi + SHARE_ROUNDING)


def _has_eye(shape: Footprint, numbers: list[Interval], start: int) -> Any:
    """Whether the eye is inside of another body, whatever the pose: of those whose edges are long."""
    if not isinstance(shape, Circle | Box):
        return False
    (x, y, theta, low, top), (eye_x, eye_y, eye_z) = numbers[start : start + 5], numbers[share.BODY : share.BODY + 3]
    within = gap(shape, POINT, x, y, theta, eye_x, eye_y, Interval(0.0 * x.lo, 0.0 * x.lo)).hi < -share.LEAST_DEPTH
    return within & (low.hi < eye_z.lo) & (top.lo > eye_z.hi)


def back_share(*given: Any) -> Intervals:
    count = (len(given) - 1 - share.BODY - share.CAMERA + share.OTHER) // (share.OTHER + 1)
    wanted, numbers = given[count], given[count + 1 :]
    gaps = numbers[share.BODY + share.CAMERA + share.OTHER - 1 :: share.OTHER]
    lo = np.where(wanted.lo > 1.0, (wanted.lo - 1.0) * share.CLEARANCE_OF_ALL - SHARE_ROUNDING, -np.inf)
    hi = np.maximum(wanted.hi - 1.0, 0.0) * share.CLEARANCE_OF_ALL + SHARE_ROUNDING
    out = list(numbers)
    out[share.BODY + share.CAMERA + share.OTHER - 1 :: share.OTHER] = back_minimum(Interval(lo, hi), *gaps)
    return tuple(out)
