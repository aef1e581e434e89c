"""Contraction: what the arguments of a primitive can still be, given what its result is wanted to be.

One rule for each primitive, as in HC4-revise (Benhamou et al. 1999, "Revising hull and box consistency"). A rule gets
the wanted interval of the result, then the current intervals of the arguments: arrays that broadcast together, one
element per box. It returns an interval for each argument that lies within the current one and holds every value that
takes part in a solution: arguments within their intervals whose *computed* result (in float64, by any namespace) lies
within the wanted one. An empty interval has lo > hi and is not raised; a rule promises nothing for empty input. An end
that cannot be computed (infinity minus infinity) is NaN, and NaN narrows nothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import wraps

import numpy as np

from scenegen.primitives import interval as iv
from scenegen.primitives.interval import TWO_PI, Array, Interval

EPS = 8 * 2.0**-53  # a few roundings, relative
TINY = 2.0**-1022  # what underflow can lose

Intervals = tuple[Interval, ...]
Rule = Callable[..., Intervals]


def quiet(rule: Rule) -> Rule:
    """Infinite ends are ordinary here: their overflow and NaN are not worth a warning."""

    @wraps(rule)
    def silent(*args: object) -> Intervals:
        with np.errstate(over="ignore", under="ignore", invalid="ignore", divide="ignore"):
            return rule(*args)

    return silent


def size(*parts: Interval) -> Array:
    """The sum of the magnitudes of all finite ends: what the rounding error is relative to."""
    magnitude: Array = np.zeros(())
    for part in parts:
        for end in part:
            magnitude = magnitude + np.where(np.isfinite(end), np.abs(end), 0.0)
    return magnitude


def meet(a: Interval, other: Interval) -> Interval:
    """The intersection; an end of `other` that is NaN says nothing."""
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
    """The divisor is a constant other than 0 (the checker sees to that)."""
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
    """Every part is at least the result; where one alone can be that small, it is the result."""
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


@quiet
def wrap(result: Interval, a: Interval) -> Intervals:
    """a is the result and any number of turns: the first and the last that a's interval meets are its new ends."""
    slack, half = 2 * EPS * (size(a) + TWO_PI), np.full((), math.pi)
    wanted = meet(iv.loosen(result, slack), iv.loosen(Interval(-half, half), slack))
    first, last = np.ceil((a.lo - wanted.hi) / TWO_PI), np.floor((a.hi - wanted.lo) / TWO_PI)
    return (meet(a, iv.loosen(Interval(wanted.lo + TWO_PI * first, wanted.hi + TWO_PI * last), slack)),)


def _factor(wanted: Interval, a: Interval, b: Interval) -> Interval:
    """What is left of `a` where a * b lies in `wanted`: a quotient for each sign that b can have."""
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
    """What is left of `a` where abs(a) lies in `result`."""
    least = np.maximum(result.lo, 0.0)
    return hull(meet(a, Interval(least, result.hi)), meet(a, Interval(-result.hi, -least)))


def _leg(result: Interval, leg: Interval, other: Interval) -> Interval:
    """What is left of one leg of a right-angled triangle whose hypotenuse lies in `result`."""
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
