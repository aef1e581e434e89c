"""Interval arithmetic over numpy arrays of boxes: bounds of results, and what wanted results leave of arguments.

Rules take and return pairs of arrays that broadcast together. Sums, differences, products, square roots, minima and
maxima are monotone, rounded or not, so evaluating them at the ends bounds every value between; the other rules widen
their result by a few units in the last place. Footprints have rules of their own: footprint_rules.py.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import wraps
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from scenegen.arrays import Array
from scenegen.pose import TWO_PI


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


# Contraction: the remaining intervals of a primitive's arguments, given a target interval for its result.
#
# One rule for each primitive, as in HC4-revise (Benhamou et al. 1999, "Revising hull and box consistency"). A rule gets
# the target interval of the result, then the current intervals of the arguments: arrays that broadcast together, one
# element per box. It returns an interval for each argument that lies within the current one and contains every value
# that is part of a solution: arguments within their intervals whose *computed* result (in float64, by any namespace)
# lies within the target. An empty interval has lo > hi and is not an error; for empty input the result is undefined. An
# end that cannot be computed (infinity minus infinity) is NaN, and NaN narrows nothing.


EPS = 8 * 2.0**-53  # a few roundings, relative
MIN_NORMAL = 2.0**-1022  # what underflow can lose

Intervals = tuple[Interval, ...]
Rule = Callable[..., Intervals]


def quiet(rule: Rule) -> Rule:
    """Infinite ends are normal here: suppress warnings about overflow and NaN."""

    @wraps(rule)
    def silent(*args: object) -> Intervals:
        with np.errstate(over="ignore", under="ignore", invalid="ignore", divide="ignore"):
            return rule(*args)

    return silent


def size(*parts: Interval) -> Array:
    """The sum of the magnitudes of all finite ends: what the rounding error is relative to."""
    whole: Array = np.zeros(())
    for part in parts:
        whole = whole + np.abs(part.lo)
        whole = whole + np.abs(part.hi)
    if np.isfinite(whole).all():  # nearly always, and half the work
        return whole
    magnitude: Array = np.zeros(())
    for part in parts:
        for end in part:
            magnitude = magnitude + np.where(np.isfinite(end), np.abs(end), 0.0)
    return magnitude


def meet(a: Interval, other: Interval) -> Interval:
    """The intersection; NaN ends of `other` are ignored."""
    return Interval(np.fmax(a.lo, other.lo), np.fmin(a.hi, other.hi))


def hull(a: Interval, b: Interval) -> Interval:
    """The smallest interval around both, where an empty one adds nothing."""
    no_a, no_b = a.lo > a.hi, b.lo > b.hi
    return Interval(
        np.where(no_a, b.lo, np.where(no_b, a.lo, np.minimum(a.lo, b.lo))),
        np.where(no_a, b.hi, np.where(no_b, a.hi, np.maximum(a.hi, b.hi))),
    )


@quiet
def back_add(result: Interval, a: Interval, b: Interval) -> Intervals:
    wanted = loosen(result, EPS * size(result, a, b) + MIN_NORMAL)
    return meet(a, sub(wanted, b)), meet(b, sub(wanted, a))


@quiet
def back_sub(result: Interval, a: Interval, b: Interval) -> Intervals:
    wanted = loosen(result, EPS * size(result, a, b) + MIN_NORMAL)
    return meet(a, add(wanted, b)), meet(b, sub(a, wanted))


def back_neg(result: Interval, a: Interval) -> Intervals:
    return (meet(a, neg(result)),)


@quiet
def back_mul(result: Interval, a: Interval, b: Interval) -> Intervals:
    wanted = loosen(result, EPS * size(result) + MIN_NORMAL)
    return _factor(wanted, a, b), _factor(wanted, b, a)


@quiet
def back_div(result: Interval, a: Interval, b: Interval) -> Intervals:
    """The divisor is a constant other than 0 (guaranteed by the checker)."""
    wanted = loosen(result, EPS * size(result) + MIN_NORMAL)
    product = mul(wanted, b)
    return meet(a, loosen(product, EPS * size(product) + MIN_NORMAL)), b


@quiet
def back_dist(result: Interval, ax: Interval, ay: Interval, bx: Interval, by: Interval) -> Intervals:
    dx, dy = sub(ax, bx), sub(ay, by)
    new_ax, new_bx = back_sub(_leg(result, dx, dy), ax, bx)
    new_ay, new_by = back_sub(_leg(result, dy, dx), ay, by)
    return new_ax, new_ay, new_bx, new_by


def back_absolute(result: Interval, a: Interval) -> Intervals:
    return (_either_sign(result, a),)


def back_minimum(result: Interval, *parts: Interval) -> Intervals:
    """Every part is at least the result; if only one can be that small, it equals the result."""
    can = [part.lo <= result.hi for part in parts]
    count = np.sum(np.broadcast_arrays(*can), axis=0)
    return tuple(
        meet(part, Interval(result.lo, np.where(count == own, result.hi, np.inf)))
        for part, own in zip(parts, can, strict=True)
    )


def back_maximum(result: Interval, *parts: Interval) -> Intervals:
    return tuple(neg(part) for part in back_minimum(neg(result), *(neg(part) for part in parts)))


@quiet
def back_total(result: Interval, *parts: Interval) -> Intervals:
    """Of a sum of any length: each part is the result less all others."""
    wanted = loosen(result, len(parts) * EPS * size(result, *parts) + MIN_NORMAL)
    every = total(*parts)
    return tuple(
        meet(part, Interval(wanted.lo - (every.hi - part.hi), wanted.hi - (every.lo - part.lo))) for part in parts
    )


@quiet
def back_mean(result: Interval, *parts: Interval) -> Intervals:
    count = float(len(parts))
    return back_total(
        loosen(Interval(count * result.lo, count * result.hi), EPS * count * size(result) + MIN_NORMAL), *parts
    )


def back_pick(result: Interval, switch: Interval, end: Interval, before: Interval, after: Interval) -> Intervals:
    """A side that the result rules out takes its part of the switch with it; the side that is left is the result."""
    early = (switch.lo < end.hi) & (before.lo <= result.hi) & (before.hi >= result.lo)
    late = (switch.hi >= end.lo) & (after.lo <= result.hi) & (after.hi >= result.lo)
    every = Interval(np.full((), -np.inf), np.full((), np.inf))

    def side(part: Interval, other: npt.NDArray[np.bool_]) -> Interval:
        met = meet(part, result)
        return Interval(np.where(other, part.lo, met.lo), np.where(other, part.hi, met.hi))

    left = Interval(np.where(early, every.lo, end.lo), np.where(late, every.hi, end.hi))
    none = ~(early | late)
    switch = meet(switch, Interval(np.where(none, np.inf, left.lo), np.where(none, -np.inf, left.hi)))
    return switch, end, side(before, late), side(after, early)


@quiet
def back_wrap(result: Interval, a: Interval) -> Intervals:
    """a is the result plus any number of full turns: the first and the last that a's interval contains are its new
    ends."""
    slack, half = 2 * EPS * (size(a) + TWO_PI), np.full((), math.pi)
    wanted = meet(loosen(result, slack), loosen(Interval(-half, half), slack))
    first, last = np.ceil((a.lo - wanted.hi) / TWO_PI), np.floor((a.hi - wanted.lo) / TWO_PI)
    return (meet(a, loosen(Interval(wanted.lo + TWO_PI * first, wanted.hi + TWO_PI * last), slack)),)


def _factor(wanted: Interval, a: Interval, b: Interval) -> Interval:
    """The remaining interval of `a` if a * b lies in `wanted`: a quotient for each sign that b can have."""
    # Adding 0.0 turns -0.0, whose quotients have the wrong sign, into 0.0.
    positive = Interval(np.maximum(b.lo, 0.0) + 0.0, b.hi + 0.0)
    negative = Interval(np.maximum(-b.hi, 0.0) + 0.0, -b.lo + 0.0)
    found = hull(
        meet(a, _quotient(wanted, positive)),
        meet(a, _quotient(neg(wanted), negative)),
    )
    free = (b.lo <= 0.0) & (b.hi >= 0.0) & (wanted.lo <= 0.0) & (wanted.hi >= 0.0)
    return Interval(np.where(free, a.lo, found.lo), np.where(free, a.hi, found.hi))


def _quotient(wanted: Interval, b: Interval) -> Interval:
    """wanted / b for b >= 0, empty where b is empty; where b holds 0, `wanted` does not."""
    lo = np.where(wanted.lo >= 0.0, wanted.lo / b.hi, wanted.lo / b.lo)
    hi = np.where(wanted.hi >= 0.0, wanted.hi / b.lo, wanted.hi / b.hi)
    slack = EPS * size(Interval(lo, lo)) + MIN_NORMAL, EPS * size(Interval(hi, hi)) + MIN_NORMAL
    nothing = b.lo > b.hi
    return Interval(np.where(nothing, np.inf, lo - slack[0]), np.where(nothing, -np.inf, hi + slack[1]))


def _either_sign(result: Interval, a: Interval) -> Interval:
    """The remaining interval of `a` if abs(a) lies in `result`."""
    least = np.maximum(result.lo, 0.0)
    return hull(meet(a, Interval(least, result.hi)), meet(a, Interval(-result.hi, -least)))


def _leg(result: Interval, leg: Interval, other: Interval) -> Interval:
    """The remaining interval of one leg of a right-angled triangle whose hypotenuse lies in `result`."""
    across = absolute(other)
    least, most = np.maximum(result.lo, 0.0), result.hi
    # The slack is on the squares: their difference cancels, and its root can be far larger than its rounding error.
    low = least * least - across.hi * across.hi
    low = low - EPS * (least * least + across.hi * across.hi) - MIN_NORMAL
    high = most * most - across.lo * across.lo
    high = high + EPS * (most * most + across.lo * across.lo) + MIN_NORMAL
    none = (most < 0.0) | (high < 0.0)
    near = np.sqrt(np.maximum(low, 0.0)) * (1.0 - EPS)
    far = np.where(none, -np.inf, np.sqrt(np.maximum(high, 0.0)) * (1.0 + EPS))
    return _either_sign(Interval(np.where(np.isnan(near), 0.0, near), np.where(np.isnan(far), np.inf, far)), leg)
