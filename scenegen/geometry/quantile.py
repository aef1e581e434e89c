"""Coordinates that are not uniform, as functions of numbers that are: quantiles.

A `Quantile` takes one coordinate of a thing from its distribution. Its arguments are the number that chooses one of its
options, the number that says where in it, both in the range of the coordinate itself and uniform there, and what the
options are relative to. It grows with the second and, where it is relative, with that: so bounds are its values at the
ends, and what is wanted of it narrows its arguments. (Rosenblatt 1952: such functions of uniform numbers, one
coordinate after another, have any joint distribution.)

Options come in runs of one kind: a normal, uniform ranges, one coordinate of a point in a convex region.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple, Protocol

import numpy as np

from scenegen.arrays import Array, Bool, Index
from scenegen.geometry.footprint import Point
from scenegen.geometry.interval import Interval, Intervals, meet, quiet

QUANTILE = "quantile"  # the primitive
UNIT_SLACK = 1e-12  # of the size of coordinates: by how much bounds are wider
MAX_COMPARED_OPTIONS = 8  # options up to which each is looked at
MAX_COMPARED = 1 << 17  # options times boxes up to which each option is looked at to narrow the choice
NEAR_OPTIONS = 3  # options that a box can choose from, up to which each is looked at

Spans = tuple[Array, Array]


class Run(Protocol):
    """Options of one kind, `count` of them. u and shares are in 0..1; `given` are the arguments that options may be
    relative to. Bounds are pairs of arrays, the least and the largest value; with an axis of options they have that
    first."""

    @property
    def count(self) -> int: ...

    def value(self, which: Index, u: Array, given: Sequence[Array]) -> Array:
        """The coordinate: option `which` at u, arrays that broadcast together."""
        ...

    def span(self, u: Spans, given: Sequence[Spans]) -> Spans:
        """Bounds of the coordinate of every option, (count, ...), for u (count or 1, ...) and given (...)."""
        ...

    def shares(self, wanted: Spans, given: Sequence[Spans]) -> Spans:
        """Bounds of the u, (count, ...), at which the coordinate of an option is within what is wanted, (...)."""
        ...


NO_SHARE_BEYOND = 8.3  # deviations from the middle beyond which float64 sees no share of a normal distribution


@dataclass(frozen=True, slots=True)
class CutNormal:
    """The standard normal distribution cut off at `low` and `high`; `below` and `beyond` are the shares that are cut
    off, `whole` is what is left. Shares are those of the nearer tail, so that they are not differences of numbers near
    1. Arrays of one shape, or numbers."""

    low: Any
    high: Any
    below: Any
    beyond: Any
    whole: Any

    @classmethod
    def make(cls, low: Any, high: Any) -> CutNormal:
        """The distribution cut off there."""
        from scipy.special import ndtr

        below, beyond = ndtr(low), ndtr(-high)
        whole = 1.0 - below - beyond
        if np.any(low > 0.0) or np.any(high < 0.0):
            whole = np.where(high < 0.0, ndtr(high) - below, np.where(low > 0.0, ndtr(-low) - beyond, whole))
        return cls(low, high, below, beyond, whole)

    def quantile(self, u: Array) -> Array:
        """Where the share u lies below; where there is no share, so far out are the ends: at the nearer one."""
        from scipy.special import ndtri

        if np.all(self.low < -NO_SHARE_BEYOND) and np.all(self.high > NO_SHARE_BEYOND):
            return np.asarray(np.minimum(np.maximum(ndtri(u), self.low), self.high))
        above = ((u > 0.5) | (self.low > 0.0)) & (self.high >= 0.0)
        z = ndtri(np.where(above, self.beyond, self.below) + np.where(above, 1.0 - u, u) * self.whole)
        z = np.minimum(np.maximum(np.where(above, -z, z), self.low), self.high)
        if not np.all(self.whole):
            z = np.where(self.whole > 0.0, z, np.where(self.low > 0.0, self.low, self.high))
        return np.asarray(z)

    def share(self, z: Any) -> Array:
        """The share below z; not a number where there is none at all."""
        from scipy.special import ndtr

        z = np.minimum(np.maximum(z, self.low), self.high)
        above = z > 0.0
        with np.errstate(invalid="ignore", divide="ignore"):
            share = (ndtr(np.where(above, -z, z)) - np.where(above, self.beyond, self.below)) / self.whole
        return np.asarray(np.where(above, 1.0 - share, share))


@dataclass(frozen=True, eq=False)
class NormalRun:
    """A normal distribution round a number, or round argument `middle` where that is an index; what lies outside of
    low..high, or further than `far` from the middle, is cut off. An `offset` is how far it is from its middle."""

    middle: float | int
    deviation: float
    low: float
    high: float
    far: float = math.inf
    offset: bool = False

    @property
    def count(self) -> int:
        return 1

    def value(self, which: Index, u: Array, given: Sequence[Any]) -> Array:
        middle = self._middle(given)
        offset = self.deviation * self._cut(middle).quantile(u)
        if self.offset:
            return offset
        found = np.maximum(middle + offset, np.maximum(self.low, middle - self.far))
        return np.asarray(np.minimum(found, self.high))

    def span(self, u: Spans, given: Sequence[Spans]) -> Spans:
        # the further up the middle, the further up the coordinate, but the less it is above its middle
        least, most = ([one[end] for one in given] for end in ((1, 0) if self.offset else (0, 1)))
        which = np.zeros((), np.intp)
        return self.value(which, u[0], least), self.value(which, u[1], most)

    def shares(self, wanted: Spans, given: Sequence[Spans]) -> Spans:
        least, most = ([one[end] for one in given] for end in ((1, 0) if self.offset else (0, 1)))
        return self._share(wanted[0], most)[None], self._share(wanted[1], least)[None]

    def _middle(self, given: Sequence[Any]) -> Any:
        return given[self.middle] if isinstance(self.middle, int) else self.middle

    def _cut(self, middle: Any) -> CutNormal:
        return self._cut_at(middle) if isinstance(self.middle, int) else self._always

    @cached_property
    def _always(self) -> CutNormal:
        return self._cut_at(self.middle)

    def _cut_at(self, middle: Any) -> CutNormal:
        low, high = np.maximum(self.low, middle - self.far), np.minimum(self.high, middle + self.far)
        return CutNormal.make((low - middle) / self.deviation, (high - middle) / self.deviation)

    def _share(self, value: Array, given: Sequence[Any]) -> Array:
        middle = self._middle(given)
        return self._cut(middle).share((value if self.offset else value - middle) / self.deviation)


@dataclass(frozen=True, eq=False)
class UniformRun:
    """Uniform from low to high, (K,) each: one option for each."""

    low: Array
    high: Array

    @property
    def count(self) -> int:
        return len(self.low)

    @cached_property
    def least_and_most(self) -> Spans:
        """(levels, K) each: the least low and the largest high of option k and those after it, 2^level in all."""
        lows, highs, step = [self.low], [self.high], 1
        while 2 * step <= self.count:
            lows.append(np.minimum(lows[-1], np.roll(lows[-1], -step)))
            highs.append(np.maximum(highs[-1], np.roll(highs[-1], -step)))
            step *= 2
        return np.stack(lows), np.stack(highs)

    def value(self, which: Index, u: Array, given: Sequence[Array]) -> Array:
        low = self.low[which]
        return np.asarray(low + u * (self.high[which] - low))

    def span(self, u: Spans, given: Sequence[Spans]) -> Spans:
        low, width = self._columns(u[0].ndim - 1)
        return low + u[0] * width, low + u[1] * width

    def shares(self, wanted: Spans, given: Sequence[Spans]) -> Spans:
        low, width = self._columns(wanted[0].ndim)
        return (wanted[0] - low) / width, (wanted[1] - low) / width

    def _columns(self, axes: int) -> tuple[Array, Array]:
        shape = (-1, *(1,) * axes)
        return self.low.reshape(shape), (self.high - self.low).reshape(shape)


@dataclass(frozen=True, slots=True, eq=False)
class RegionRun:
    """x of a point that is uniform over a convex polygon; or y, given x as argument `x`. The polygon reaches from
    `lower` to `upper` (V,) at `across` (V,), which rises; between these it is a trapezium. `area` (V,) is the share of
    it to the left, from 0 to 1."""

    across: Array
    lower: Array
    upper: Array
    area: Array
    x: int | None = None

    @property
    def count(self) -> int:
        return 1

    def value(self, which: Index, u: Array, given: Sequence[Array]) -> Array:
        return self._x(u) if self.x is None else self._y(u, given[self.x])

    def span(self, u: Spans, given: Sequence[Spans]) -> Spans:
        if self.x is None:
            return self._x(u[0]), self._x(u[1])
        return -self._most(u[0], given[self.x], -1.0), self._most(u[1], given[self.x], 1.0)

    def shares(self, wanted: Spans, given: Sequence[Spans]) -> Spans:
        if self.x is None:
            return self._left_of(wanted[0])[None], self._left_of(wanted[1])[None]
        return np.zeros((1, *wanted[0].shape)), np.ones((1, *wanted[0].shape))

    def _x(self, u: Array) -> Array:
        """Where the share u of the area lies to the left: in a trapezium the chord grows linearly, and the area is a
        quadratic polynomial, solved in the form that does not cancel."""
        slab = np.clip(np.searchsorted(self.area, u, side="right") - 1, 0, len(self.area) - 2)
        chord = self.upper - self.lower
        left, right, width = chord[slab], chord[slab + 1], self.across[slab + 1] - self.across[slab]
        share = (u - self.area[slab]) / (self.area[slab + 1] - self.area[slab])
        root = np.sqrt(np.maximum(left * left + share * (right * right - left * left), 0.0))
        part = share * (left + right) / np.maximum(left + root, 1e-300)
        return np.asarray(np.clip(self.across[slab] + part * width, self.across[0], self.across[-1]))

    def _y(self, u: Array, x: Array) -> Array:
        low = np.interp(x, self.across, self.lower)
        return np.asarray(low + u * (np.interp(x, self.across, self.upper) - low))

    def _most(self, u: Array, x: Spans, sign: float) -> Array:
        """The largest y, or the largest -y (sign -1), at u for x between two ends: at one of these, or at a corner."""
        best = np.maximum(sign * self._y(u, x[0]), sign * self._y(u, x[1]))
        at, low, high = (one.reshape(-1, *(1,) * best.ndim) for one in (self.across, self.lower, self.upper))
        corners = np.where((x[0] < at) & (at < x[1]), sign * (low + u * (high - low)), -np.inf)
        return np.asarray(np.maximum(best, corners.max(axis=0)))

    def _left_of(self, x: Array) -> Array:
        slab = np.clip(np.searchsorted(self.across, x, side="right") - 1, 0, len(self.area) - 2)
        chord, start = self.upper - self.lower, self.across[slab]
        part = np.clip((x - start) / (self.across[slab + 1] - start), 0.0, 1.0)
        left, right = chord[slab], chord[slab + 1]
        covered = part * (2.0 * left + part * (right - left)) / (left + right)
        return np.asarray(self.area[slab] + covered * (self.area[slab + 1] - self.area[slab]))


@dataclass(frozen=True, eq=False)
class Quantile:
    """One coordinate of a thing; see above. `choosing` and `saying` are the ranges of the first two arguments, which
    are the same number where it is `alone`: then each option has a part of it. `ends` (K,) are the shares of the
    options, added up, the last 1; `runs` are the options in their order."""

    choosing: tuple[float, float]
    saying: tuple[float, float]
    ends: Array
    runs: tuple[Run, ...]
    alone: bool

    @cached_property
    def starts(self) -> Array:
        """(K,): where the options begin."""
        return np.concatenate([[0.0], self.ends[:-1]])

    @cached_property
    def slack(self) -> float:
        """By how much bounds are wider: quantiles are rounded."""
        return UNIT_SLACK * (1.0 + abs(self.saying[0]) + abs(self.saying[1]))


def region_runs(corners: Sequence[Point], x: int) -> tuple[RegionRun, RegionRun]:
    """x, and y given x as argument `x`, of a point that is uniform over a convex polygon with an area."""
    across = np.array(sorted({one for one, _ in corners}))
    low, high = (np.array([_edge_at(corners, at, side) for at in across]) for side in (min, max))
    area = np.concatenate([[0.0], np.cumsum(np.diff(across) * ((high - low)[1:] + (high - low)[:-1]))])
    shared = across, low, high, area / area[-1]
    return RegionRun(*shared), RegionRun(*shared, x)


def _edge_at(corners: Sequence[Point], x: float, side: Callable[[Iterable[float]], float]) -> float:
    """The lowest or highest y of a convex polygon at x."""
    found = []
    for (ax, ay), (bx, by) in pairwise((*corners, corners[0])):
        if min(ax, bx) <= x <= max(ax, bx):
            found += [ay, by] if ax == bx else [ay + (x - ax) / (bx - ax) * (by - ay)]
    return side(found)


def quantile(ns: Any, of: Quantile, chooser: Any, number: Any, *given: Any) -> Any:
    """The coordinate, for numbers and arrays of numpy that broadcast together."""
    u = _unit(number, of.saying)
    if len(of.ends) == 1:
        return of.runs[0].value(np.zeros((), np.intp), u, given)
    mark = _unit(chooser, of.choosing)
    option = np.minimum(np.searchsorted(of.ends, mark, side="right"), len(of.ends) - 1)
    if of.alone:
        u = _in_option(mark, of.starts[option], of.ends[option])
    if len(of.runs) == 1:
        return of.runs[0].value(option, u, given)
    option, u, *given_ = np.broadcast_arrays(option, u, *given)
    out, first = np.empty(option.shape), 0
    for run in of.runs:
        mine = (option >= first) & (option < first + run.count)
        out[mine] = run.value(option[mine] - first, u[mine], [one[mine] for one in given_])
        first += run.count
    return out


def quantile_bounds(of: Quantile, chooser: Spans, number: Spans, *given: Spans) -> Interval:
    """Bounds of the coordinate from bounds of its arguments."""
    if len(of.ends) > MAX_COMPARED_OPTIONS and isinstance(of.runs[0], UniformRun) and len(of.runs) == 1:
        return _range_of_many(of, of.runs[0], chooser, number)
    if len(of.ends) == 1:
        u = _unit(number[0], of.saying), _unit(number[1], of.saying)
        low, high = of.runs[0].span((u[0][None], u[1][None]), given)
        return Interval(low[0] - of.slack, high[0] + of.slack)
    found = _by_option(of, chooser, number, given)
    lo = np.where(found.possible, found.low, np.inf).min(axis=0)
    hi = np.where(found.possible, found.high, -np.inf).max(axis=0)
    return Interval(lo - of.slack, hi + of.slack)


def narrow_quantile(of: Quantile, wanted: Spans, chooser: Spans, number: Spans, *given: Spans) -> tuple[Spans, Spans]:
    """What a wanted range of the coordinate leaves of the two uniform numbers."""
    shape = np.broadcast_shapes(*(np.shape(one[0]) for one in (wanted, chooser, number, *given)))
    if len(of.ends) * math.prod(shape) > MAX_COMPARED:
        return chooser, number
    if len(of.ends) == 1:
        least, most = of.runs[0].shares((wanted[0] - of.slack, wanted[1] + of.slack), given)
        own = _back((np.fmax(least[0], 0.0) - UNIT_SLACK, np.fmin(most[0], 1.0) + UNIT_SLACK), of.saying)
        return own if of.alone else chooser, own
    found = _by_option(of, chooser, number, given)
    low, high = (np.broadcast_to(one, shape) for one in (wanted[0] - of.slack, wanted[1] + of.slack))
    possible = found.possible & (found.low <= high) & (found.high >= low)
    shares = [run.shares((low, high), given) for run in of.runs]
    least, most = (
        np.concatenate(
            [np.broadcast_to(one[end], (run.count, *shape)) for one, run in zip(shares, of.runs, strict=True)]
        )
        for end in (0, 1)
    )
    # of the two, the one that is a number; that, too, may lose its last digit on the way back
    least = np.fmax(least, found.u[0]) - UNIT_SLACK
    most = np.fmin(most, found.u[1]) + UNIT_SLACK
    column = (-1, *(1,) * len(shape))
    starts, ends = of.starts.reshape(column), of.ends.reshape(column)
    first, last = (starts + least * (ends - starts), starts + most * (ends - starts)) if of.alone else (starts, ends)
    none = ~possible
    choice = (
        np.where(none, np.inf, first - UNIT_SLACK).min(axis=0),
        np.where(none, -np.inf, last + UNIT_SLACK).max(axis=0),
    )
    if of.alone:
        return _back(choice, of.choosing), number
    own = np.where(none, np.inf, least).min(axis=0), np.where(none, -np.inf, most).max(axis=0)
    return _back(choice, of.choosing), _back(own, of.saying)


@quiet
def back_quantile(of: Quantile, result: Interval, chooser: Interval, number: Interval, *given: Interval) -> Intervals:
    """The backward rule: what options are relative to stays as it is."""
    choice, own = narrow_quantile(of, result, chooser, number, *given)
    return meet(chooser, Interval(*choice)), meet(number, Interval(*own)), *given


class _ByOption(NamedTuple):
    """Of each option, (K, ...): bounds of its u, bounds of the coordinate, and whether it can be chosen."""

    u: Spans
    low: Array
    high: Array
    possible: Bool


def _by_option(of: Quantile, chooser: Spans, number: Spans, given: Sequence[Spans]) -> _ByOption:
    shape = np.broadcast_shapes(*(np.shape(one[0]) for one in (chooser, number, *given)))
    column = (-1, *(1,) * len(shape))
    starts, ends = of.starts.reshape(column), of.ends.reshape(column)
    mark = _unit(chooser[0], of.choosing), _unit(chooser[1], of.choosing)
    u = _unit(number[0], of.saying)[None], _unit(number[1], of.saying)[None]
    possible = (mark[0] <= ends + UNIT_SLACK) & (mark[1] >= starts - UNIT_SLACK)
    if of.alone:
        u = _in_option(mark[0], starts, ends), _in_option(mark[1], starts, ends)
    low_u, high_u = (np.broadcast_to(one, (len(of.ends), *shape)) for one in u)
    first, spans = 0, []
    for run in of.runs:
        part = slice(first, first + run.count)
        spans.append(run.span((low_u[part], high_u[part]), given))
        first += run.count
    low, high = (np.concatenate([one[end] for one in spans]) for end in (0, 1))
    return _ByOption((low_u, high_u), low, high, np.broadcast_to(possible, low_u.shape))


def _range_of_many(of: Quantile, run: UniformRun, chooser: Spans, number: Spans) -> Interval:
    """Bounds where there are many options, which are uniform ranges: all of those that can be chosen, from a table of
    the least and the largest of 1, 2, 4 ... in a row; where these are few, each at its u."""
    mark = _unit(chooser[0], of.choosing), _unit(chooser[1], of.choosing)
    u = _unit(number[0], of.saying), _unit(number[1], of.saying)
    low_mark, high_mark, low_u, high_u = np.broadcast_arrays(*mark, *u)
    most = len(of.ends) - 1
    first = np.minimum(np.searchsorted(of.ends, low_mark - UNIT_SLACK), most)
    last = np.clip(np.searchsorted(of.starts, high_mark + UNIT_SLACK, side="right") - 1, first, most)
    level = np.frexp((last - first + 1).astype(np.float64))[1] - 1
    table, before = run.least_and_most, last + 1 - (1 << level)
    lo = np.minimum(table[0][level, first], table[0][level, before])
    hi = np.maximum(table[1][level, first], table[1][level, before])
    near = np.flatnonzero((last - first).ravel() < NEAR_OPTIONS)
    if len(near):
        which = np.minimum(first.ravel()[near] + np.arange(NEAR_OPTIONS)[:, None], last.ravel()[near])
        if of.alone:
            starts, ends = of.starts[which], of.ends[which]
            u = (
                _in_option(low_mark.ravel()[near], starts, ends),
                _in_option(high_mark.ravel()[near], starts, ends),
            )
        else:
            u = low_u.ravel()[near], high_u.ravel()[near]
        lo, hi = np.array(lo), np.array(hi)
        lo.reshape(-1)[near] = run.value(which, u[0], ()).min(axis=0)
        hi.reshape(-1)[near] = run.value(which, u[1], ()).max(axis=0)
    return Interval(lo - of.slack, hi + of.slack)


def _in_option(mark: Array, starts: Array, ends: Array) -> Array:
    """Where in an option a mark is, 0..1."""
    return np.asarray(np.clip((mark - starts) / (ends - starts), 0.0, 1.0))


def _unit(value: Any, ends: tuple[float, float]) -> Array:
    """A uniform number as a share of its range, 0..1, which rounding could leave."""
    share = (np.asarray(value, dtype=np.float64) - ends[0]) / (ends[1] - ends[0])
    return np.asarray(np.minimum(np.maximum(share, 0.0), 1.0))


def _back(unit: Spans, ends: tuple[float, float]) -> Spans:
    return ends[0] + unit[0] * (ends[1] - ends[0]), ends[0] + unit[1] * (ends[1] - ends[0])
