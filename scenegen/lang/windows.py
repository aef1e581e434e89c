"""Minima, maxima and untils over windows of moments, for numpy and torch alike: time is the last axis.

A window of w moments is put together from windows of 1, 2, 4, ... of them, so a formula takes time proportional to
T log w, without a loop over moments. For minima: Bentley's decomposition by doubling. For `until`: a step from a moment
to the one before is x -> max(p, min(q, x)), and two such steps make one of the same form.
"""

from __future__ import annotations

import math
from typing import Any, Protocol


class Arrays(Protocol):
    """What is done to values; `shift(x, k, fill)` is x at the moments k later, with `fill` beyond the last;
    `first(x, everywhere)` is x at the first moment and minus infinity at all others."""

    def minimum(self, a: Any, b: Any) -> Any: ...
    def maximum(self, a: Any, b: Any) -> Any: ...
    def shift(self, a: Any, by: int, fill: float) -> Any: ...
    def first(self, value: float, everywhere: Any) -> Any: ...


def extreme(of: Arrays, kind: str, values: Any, lowest: int, highest: int) -> Any:
    """The least ("min") or largest value at the moments t + lowest to t + highest, for every t: (..., T + 1)."""
    fill = math.inf if kind == "min" else -math.inf
    step = of.minimum if kind == "min" else of.maximum
    if lowest:
        values = of.shift(values, lowest, fill)
    width, done = highest - lowest + 1, 1
    while 2 * done <= width:
        values = step(values, of.shift(values, done, fill))
        done *= 2
    return values if done == width else step(values, of.shift(values, width - done, fill))


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
    while True:
        if count & 1:
            if done_p is None:
                done_p, done_q = p, q
            else:
                then_p, then_q = of.shift(p, passed, -math.inf), of.shift(q, passed, math.inf)
                done_p, done_q = _after(of, done_p, done_q, then_p, then_q)
            passed += width
        count >>= 1
        if not count:
            return done_p
        p, q = _after(of, p, q, of.shift(p, width, -math.inf), of.shift(q, width, math.inf))
        width *= 2


def _after(of: Arrays, p: Any, q: Any, then_p: Any, then_q: Any) -> tuple[Any, Any]:
    """max(p, min(q, max(then_p, min(then_q, x)))) as one such step."""
    return of.maximum(p, of.minimum(q, then_p)), of.minimum(q, then_q)
