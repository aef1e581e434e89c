"""Changes in which two objects exchange their ways.

Who comes from where, and who goes where, is a matter of order: small changes would have to lead objects past one
another. An exchange is its own reverse and preserves volume, because all base variables are alike.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from scenegen.motions.paths import ways
from scenegen.motions.problem import Array, Index, MotionProblem
from scenegen.motions.variables import Flags, Variables, at_home

Part = Literal["before", "after", "whole"]


def exchange_ways(
    problem: MotionProblem, now: Variables, rng: np.random.Generator, *, part: Part
) -> tuple[Variables, Flags]:
    """Two objects exchange what they do until a moment, at which they stand where they did (`before`), or from a moment
    on (`after`), or everything, first poses included (`whole`)."""
    steps, count = now.mover.shape
    motion, slots = np.arange(count), len(problem.movable)
    one: Index = rng.integers(slots, size=(count,))
    two: Index = (one + rng.integers(1, slots, size=(count,))) % slots
    moment = rng.integers(steps + 1, size=count)
    early: Flags = np.asarray(np.arange(steps)[:, None] < moment)
    window = {"before": early, "after": ~early, "whole": np.ones_like(early)}[part]
    if problem.moves == "one":
        mover = np.where(window & (now.mover == one), two, np.where(window & (now.mover == two), one, now.mover))
        unit = now.unit
    else:
        mover, unit = now.mover, _exchanged(now, window, one, two)
    first, good = now.first, np.ones(count, dtype=bool)
    if part == "before":
        first = first + (ways(problem, now.mover, now.unit, early) - ways(problem, mover, unit, early))
        good = at_home(problem, first)
    elif part == "whole":
        a, b = problem.movable[one], problem.movable[two]
        first = first.copy()
        first[a, :, motion], first[b, :, motion] = now.first[b, :, motion], now.first[a, :, motion]
        for ends in (problem.lowest, problem.highest):
            good &= (ends[a] == ends[b]).all(axis=1)
    return Variables(first, mover, unit), good


def _exchanged(now: Variables, window: Flags, one: Index, two: Index) -> Array:
    """The steps, in which objects `one` and `two` (P,) have exchanged those in a window (T, P)."""
    order = np.broadcast_to(np.arange(now.unit.shape[1])[:, None], (now.unit.shape[1], now.count)).copy()
    motion = np.arange(now.count)
    order[one, motion], order[two, motion] = two, one
    exchanged = np.take_along_axis(now.unit, order[None, :, None], axis=1)
    return np.where(window[:, None, None], exchanged, now.unit)
