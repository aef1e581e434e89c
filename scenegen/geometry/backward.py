"""Contraction: the remaining intervals of a primitive's arguments, given a target interval for its result.

One rule for each primitive, as in HC4-revise (Benhamou et al. 1999, "Revising hull and box consistency"). A rule gets
the target interval of the result, then the current intervals of the arguments: arrays that broadcast together, one
element per box. It returns an interval for each argument that lies within the current one and contains every value that
is part of a solution: arguments within their intervals whose *computed* result (in float64, by any namespace) lies
within the target. An empty interval has lo > hi and is not an error; for empty input the result is undefined. An end
that cannot be computed (infinity minus infinity) is NaN, and NaN narrows nothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import wraps

import numpy as np
import numpy.typing as npt

from scenegen.geometry import interval as iv
from scenegen.geometry.interval import Array, Interval
from scenegen.pose import TWO_PI

EPS = 8 * 2.0**-53  # a few roundings, relative
TINY = 2.0**-1022  # what underflow can lose

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
def add(result: Interval, a: Interval, b: Interval) -> Intervals:
    wanted = iv.loosen(result, EPS * size(result, a, b) + TINY)
    return meet(a, iv.sub(wanted, b)), meet(b, iv.sub(wanted, a))


@quiet
def sub(result: Interval, a: Interval, b: Interval) -> Intervals:
    wanted = iv.loosen(result, EPS * size(result, a, b) + TINY)
    return meet(a, iv.add(wanted, b)), meet(b, iv.sub(a, wanted))


def neg(result: Interval, a: Interval) -> Intervals:
    return (meet(a, iv.neg(result)),)


@quiet
def mul(result: Interval, a: Interval, b: Interval) -> Intervals:
    wanted = iv.loosen(result, EPS * size(result) + TINY)
    return _factor(wanted, a, b), _factor(wanted, b, a)


@quiet
def div(result: Interval, a: Interval, b: Interval) -> Intervals:
    """The divisor is a constant other than 0 (guaranteed by the checker)."""
    wanted = iv.loosen(result, EPS * size(result) + TINY)
    product = iv.mul(wanted, b)
    return meet(a, iv.loosen(product, EPS * size(product) + TINY)), b


@quiet
def dist(result: Interval, ax: Interval, ay: Interval, bx: Interval, by: Interval) -> Intervals:
    dx, dy = iv.sub(ax, bx), iv.sub(ay, by)
    new_ax, new_bx = sub(_leg(result, dx, dy), ax, bx)
    new_ay, new_by = sub(_leg(result, dy, dx), ay, by)
    return new_ax, new_ay, new_bx, new_by


def absolute(result: Interval, a: Interval) -> Intervals:
    return (_either_sign(result, a),)


def minimum(result: Interval, *parts: Interval) -> Intervals:
    """Every part is at least the result; if only one can be that small, it equals the result."""
    can = [part.lo <= result.hi for part in parts]
    count = np.sum(np.broadcast_arrays(*can), axis=0)
    return tuple(
        meet(part, Interval(result.lo, np.where(count == own, result.hi, np.inf)))
        for part, own in zip(parts, can, strict=True)
    )


def maximum(result: Interval, *parts: Interval) -> Intervals:
    return tuple(iv.neg(part) for part in minimum(iv.neg(result), *(iv.neg(part) for part in parts)))


@quiet
def total(result: Interval, *parts: Interval) -> Intervals:
    """Of a sum of any length: each part is the result less all others."""
    wanted = iv.loosen(result, len(parts) * EPS * size(result, *parts) + TINY)
    every = iv.total(*parts)
    return tuple(
        meet(part, Interval(wanted.lo - (every.hi - part.hi), wanted.hi - (every.lo - part.lo))) for part in parts
    )


@quiet
def mean(result: Interval, *parts: Interval) -> Intervals:
    count = float(len(parts))
    return total(iv.loosen(Interval(count * result.lo, count * result.hi), EPS * count * size(result) + TINY), *parts)


def pick(result: Interval, switch: Interval, end: Interval, before: Interval, after: Interval) -> Intervals:
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
def wrap(result: Interval, a: Interval) -> Intervals:
    """a is the result plus any number of full turns: the first and the last that a's interval contains are its new
    ends."""
    slack, half = 2 * EPS * (size(a) + TWO_PI), np.full((), math.pi)
    wanted = meet(iv.loosen(result, slack), iv.loosen(Interval(-half, half), slack))
    first, last = np.ceil((a.lo - wanted.hi) / TWO_PI), np.floor((a.hi - wanted.lo) / TWO_PI)
    return (meet(a, iv.loosen(Interval(wanted.lo + TWO_PI * first, wanted.hi + TWO_PI * last), slack)),)


def _factor(wanted: Interval, a: Interval, b: Interval) -> Interval:
    """The remaining interval of `a` if a * b lies in `wanted`: a quotient for each sign that b can have."""
    # Adding 0.0 turns -0.0, whose quotients have the wrong sign, into 0.0.
    positive = Interval(np.maximum(b.lo, 0.0) + 0.0, b.hi + 0.0)
    negative = Interval(np.maximum(-b.hi, 0.0) + 0.0, -b.lo + 0.0)
    found = hull(
        meet(a, _quotient(wanted, positive)),
        meet(a, _quotient(iv.neg(wanted), negative)),
    )
    free = (b.lo <= 0.0) & (b.hi >= 0.0) & (wanted.lo <= 0.0) & (wanted.hi >= 0.0)
    return Interval(np.where(free, a.lo, found.lo), np.where(free, a.hi, found.hi))


def _quotient(wanted: Interval, b: Interval) -> Interval:
    """wanted / b for b >= 0, empty where b is empty; where b holds 0, `wanted` does not."""
    lo = np.where(wanted.lo >= 0.0, wanted.lo / b.hi, wanted.lo / b.lo)
    hi = np.where(wanted.hi >= 0.0, wanted.hi / b.lo, wanted.hi / b.hi)
    slack = EPS * size(Interval(lo, lo)) + TINY, EPS * size(Interval(hi, hi)) + TINY
    nothing = b.lo > b.hi
    return Interval(np.where(nothing, np.inf, lo - slack[0]), np.where(nothing, -np.inf, hi + slack[1]))


def _either_sign(result: Interval, a: Interval) -> Interval:
    """The remaining interval of `a` if abs(a) lies in `result`."""
    least = np.maximum(result.lo, 0.0)
    return hull(meet(a, Interval(least, result.hi)), meet(a, Interval(-result.hi, -least)))


def _leg(result: Interval, leg: Interval, other: Interval) -> Interval:
    """The remaining interval of one leg of a right-angled triangle whose hypotenuse lies in `result`."""
    across = iv.absolute(other)
    least, most = np.maximum(result.lo, 0.0), result.hi
    # The slack is on the squares: their difference cancels, and its root can be far larger than its rounding error.
    low = least * least - across.hi * across.hi
    low = low - EPS * (least * least + across.hi * across.hi) - TINY
    high = most * most - across.lo * across.lo
    high = high + EPS * (most * most + across.lo * across.lo) + TINY
    none = (most < 0.0) | (high < 0.0)
    near = np.sqrt(np.maximum(low, 0.0)) * (1.0 - EPS)
    far = np.where(none, -np.inf, np.sqrt(np.maximum(high, 0.0)) * (1.0 + EPS))
    return _either_sign(Interval(np.where(np.isnan(near), 0.0, near), np.where(np.isnan(far), np.inf, far)), leg)
