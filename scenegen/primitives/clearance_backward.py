"""Backward rules of gap and room (see scenegen.primitives.backward): they narrow positions; headings stay as they are.

They invert bounds that hold in one direction, along x or y, or for the discs around and inside the footprints.
"""

from __future__ import annotations

import math

import numpy as np

from scenegen.primitives import backward
from scenegen.primitives import clearance_bounds as bounds
from scenegen.primitives import interval as iv
from scenegen.primitives.backward import Intervals, quiet
from scenegen.primitives.footprint import Footprint
from scenegen.primitives.interval import Array, Interval
from scenegen.primitives.outline import measures


@quiet
def gap(a: Footprint, b: Footprint, result: Interval, *pose: Interval) -> Intervals:
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
    limit = result.hi + slack - bounds.apart(zero, zero, at, bt, a, b, angles)
    return _translate(far, limit, pose, from_b=False)


@quiet
def room(a: Footprint, b: Footprint, result: Interval, *pose: Interval) -> Intervals:
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
    limit = bounds.within(zero, zero, at, bt, a, b, angles) - needed + slack
    return _translate(far, limit, pose, from_b=True)


def _axes(like: Array) -> Array:
    """The directions +x, +y, -x, -y, along a new first axis."""
    return np.array([0.0, 0.5 * math.pi, math.pi, 1.5 * math.pi]).reshape(-1, *(1 for _ in np.shape(like)))


def _slack(a: Footprint, b: Footprint, result: Interval, pose: tuple[Interval, ...]) -> Array:
    ax, ay, at, bx, by, bt = pose
    return bounds.rounding(measures(a), measures(b), ax, ay, at, bx, by, bt) + bounds.ERROR * backward.size(result)


def _translate(far: Interval, limit: Array, pose: tuple[Interval, ...], *, from_b: bool) -> Intervals:
    """Positions whose distance lies within `far` and whose difference along +x, +y, -x, -y stays below `limit`."""
    ax, ay, at, bx, by, bt = pose
    ax, ay, bx, by = backward.dist(far, ax, ay, bx, by)
    dx, dy = Interval(-limit[2], limit[0]), Interval(-limit[3], limit[1])
    if from_b:
        ax, bx = backward.sub(dx, ax, bx)
        ay, by = backward.sub(dy, ay, by)
    else:
        bx, ax = backward.sub(dx, bx, ax)
        by, ay = backward.sub(dy, by, ay)
    return ax, ay, at, bx, by, bt
