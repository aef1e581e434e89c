"""Minima, maxima and untils over windows of moments, for numpy and torch alike: time is the last axis.

A window of w moments is put together from windows of 1, 2, 4, ... of them, so a formula takes time proportional to
T log w, without a loop over moments. For minima: Bentley's decomposition by doubling; `Arrays` can have another way.
For `until`: a step from a moment to the one before is x -> max(p, min(q, x)), and two such steps make one of the same
form.
"""

from __future__ import annotations

import math
from typing import Any, Protocol


class Arrays(Protocol):
    """What is done to values; a `kind` is "min" or "max". `shift(x, k, fill)` is x at the moments k later, with `fill`
    beyond the last; `first(x, everywhere)` is x at the first moment and minus infinity at all others."""

    def minimum(self, a: Any, b: Any) -> Any: ...
    def maximum(self, a: Any, b: Any) -> Any: ...
    def shift(self, a: Any, by: int, fill: float) -> Any: ...
    def first(self, value: float, everywhere: Any) -> Any: ...

    def onto(self, kind: str, a: Any, b: Any) -> Any:
        """The extreme of a and b, which ends some moments earlier: there it is a."""

    def slide(self, kind: str, a: Any, width: int) -> Any:
        """The extreme over the `width` moments from t on, for every t; fewer where the motion ends. See `doubled`."""


def extreme(of: Arrays, kind: str, values: Any, lowest: int, highest: int) -> Any:
    """The least ("min") or largest value at the moments t + lowest to t + highest, for every t: (..., T + 1)."""
    if lowest:
        values = of.shift(values, lowest, math.inf if kind == "min" else -math.inf)
    width = min(highest - lowest + 1, values.shape[-1])
    return of.slide(kind, values, width) if width > 1 else values


def doubled(of: Arrays, kind: str, values: Any, width: int) -> Any:
    """`slide` in log `width` passes."""
    done = 1
    while 2 * done <= width:
        values = of.onto(kind, values, values[..., done:])
        done *= 2
    return values if done == width else of.onto(kind, values, values[..., width - done :])


def until(of: Arrays, left: Any, right: Any, lowest: int, highest: int, closed: bool) -> Any:
    """The largest value, over the moments t' from t + lowest to t + highest, of the minimum of `right` at t' and of
    `left` from t to before t' (where it is `closed`: to t'); for every t: (..., T + 1)."""
    ends = of.minimum(left, right) if closed else right
    found = _steps(of, ends, left, highest - lowest + 1)
    if not lowest:
        return found
    return of.minimum(of.shift(found, lowest, -math.inf), extreme(of, "min", left, 0, lowest - 1))


def _steps(of: Arrays, p: Any, q: Any, count: int) -> Any:
    """`count` steps x -> max(p, min(q, x)) from t on, the last of them from minus infinity."""
    done_p: Any = None
    done_q: Any = None
    passed = 0  # steps that are in `done`: the first ones
    width = 1
    count = min(count, p.shape[-1])  # further steps find nothing
    while True:
        if count & 1:
            done_p, done_q = (p, q) if done_p is None else _after(of, done_p, done_q, p, q, passed)
            passed += width
        count >>= 1
        if not count:
            return done_p
        p, q = _after(of, p, q, p, q, width)
        width *= 2


def _after(of: Arrays, p: Any, q: Any, then_p: Any, then_q: Any, by: int) -> tuple[Any, Any]:
    """max(p, min(q, max(then_p, min(then_q, x)))) as one such step, where `then` is `by` moments later. Beyond the last
    moment a step changes nothing, and finds nothing."""
    then_p, then_q = then_p[..., by:], then_q[..., by:]
    before = of.minimum(q[..., : then_p.shape[-1]], then_p)
    return of.onto("max", p, before), of.onto("min", q, then_q)
