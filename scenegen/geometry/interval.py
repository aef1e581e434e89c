"""Interval arithmetic over numpy arrays of boxes.

Rules take and return pairs of arrays that broadcast together. Sums, differences, products, square roots, minima and
maxima are monotone, rounded or not, so evaluating them at the ends bounds every value between; the other rules widen
their result by a few units in the last place.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from scenegen.pose import TWO_PI

Array = npt.NDArray[np.float64]


class Interval(NamedTuple):
    """Lowest and highest value, elementwise."""

    lo: Array
    hi: Array


def point(value: float) -> Interval:
    return Interval(np.float64(value) * np.ones(()), np.float64(value) * np.ones(()))


def widen(lo: Array, hi: Array, ulps: int = 4) -> Interval:
    """Push both ends outwards by `ulps` units in the last place."""
    return Interval(lo - ulps * np.spacing(np.abs(lo)), hi + ulps * np.spacing(np.abs(hi)))


def loosen(a: Interval, slack: Array) -> Interval:
    """Push both ends outwards by `slack`."""
    return Interval(a.lo - slack, a.hi + slack)


def add(a: Interval, b: Interval) -> Interval:
    return Interval(a.lo + b.lo, a.hi + b.hi)


def sub(a: Interval, b: Interval) -> Interval:
    return Interval(a.lo - b.hi, a.hi - b.lo)


def neg(a: Interval) -> Interval:
    return Interval(-a.hi, -a.lo)


def mul(a: Interval, b: Interval) -> Interval:
    ends = (a.lo * b.lo, a.lo * b.hi, a.hi * b.lo, a.hi * b.hi)
    return Interval(np.minimum.reduce(np.broadcast_arrays(*ends)), np.maximum.reduce(np.broadcast_arrays(*ends)))


def div(a: Interval, b: Interval) -> Interval:
    """a / b for a divisor that is a constant other than 0 (guaranteed by the checker)."""
    ends = (a.lo / b.lo, a.hi / b.lo)
    return Interval(np.minimum(*ends), np.maximum(*ends))


def absolute(a: Interval) -> Interval:
    straddles = (a.lo <= 0.0) & (a.hi >= 0.0)
    low, high = np.abs(a.lo), np.abs(a.hi)
    return Interval(np.where(straddles, 0.0, np.minimum(low, high)), np.maximum(low, high))


def minimum(*parts: Interval) -> Interval:
    return Interval(
        np.minimum.reduce(np.broadcast_arrays(*(part.lo for part in parts))),
        np.minimum.reduce(np.broadcast_arrays(*(part.hi for part in parts))),
    )


def maximum(*parts: Interval) -> Interval:
    return neg(minimum(*(neg(part) for part in parts)))


def total(first: Interval, *rest: Interval) -> Interval:
    for part in rest:
        first = add(first, part)
    return first


def mean(*parts: Interval) -> Interval:
    return div(total(*parts), point(len(parts)))


def pick(switch: Interval, end: Interval, before: Interval, after: Interval) -> Interval:
    """`before` where the switch is below the end, and `after` elsewhere."""
    early, late = switch.lo < end.hi, switch.hi >= end.lo
    return Interval(
        np.where(early & late, np.minimum(before.lo, after.lo), np.where(late, after.lo, before.lo)),
        np.where(early & late, np.maximum(before.hi, after.hi), np.where(late, after.hi, before.hi)),
    )


def hypot(a: Interval, b: Interval) -> Interval:
    a, b = absolute(a), absolute(b)
    return Interval(np.sqrt(a.lo * a.lo + b.lo * b.lo), np.sqrt(a.hi * a.hi + b.hi * b.hi))


def wrap(a: Interval) -> Interval:
    """To (-pi, pi]: exact where the interval does not cross an odd multiple of pi, the whole circle where it does."""
    turns_lo, turns_hi = np.ceil((a.lo - math.pi) / TWO_PI), np.ceil((a.hi - math.pi) / TWO_PI)
    # Rounding may move a value across the jump: keep a distance from it.
    room = 8 * np.spacing(np.maximum(np.maximum(np.abs(a.lo), np.abs(a.hi)), math.pi))
    lo, hi = a.lo - TWO_PI * turns_lo - room, a.hi - TWO_PI * turns_hi + room
    whole = (turns_lo != turns_hi) | (lo <= -math.pi) | (hi >= math.pi)
    edge = math.pi + room  # the rounded result can pass pi by as much as the argument's own rounding
    return Interval(np.where(whole, -edge, lo), np.where(whole, edge, hi))


def cos(a: Interval) -> Interval:
    """Ends of the arc, and 1 or -1 where it crosses an even or odd multiple of pi."""
    ends = np.cos(a.lo), np.cos(a.hi)
    slack = 4 * np.spacing(np.maximum(np.abs(a.lo), np.abs(a.hi)))
    peak = np.floor((a.hi + slack) / TWO_PI) >= np.ceil((a.lo - slack) / TWO_PI)
    trough = np.floor((a.hi + slack - math.pi) / TWO_PI) >= np.ceil((a.lo - slack - math.pi) / TWO_PI)
    lo, hi = widen(np.minimum(*ends), np.maximum(*ends))
    return Interval(np.where(trough, -1.0, np.maximum(lo, -1.0)), np.where(peak, 1.0, np.minimum(hi, 1.0)))


def sin(a: Interval) -> Interval:
    shift = math.pi / 2.0
    lo, hi = cos(Interval(a.lo - shift, a.hi - shift))
    room = 4 * np.spacing(np.maximum(np.abs(a.lo), np.abs(a.hi)) + shift)  # the shift is rounded
    return Interval(np.maximum(lo - room, -1.0), np.minimum(hi + room, 1.0))
