"""Changes that turn or mirror ways, like the pivot moves of chain molecules (Madras and Sokal 1988).

What a spec wants at one moment, such as a meeting, leaves open where objects come from. Small changes walk around a
meeting slowly; a turn of the whole way there about the meeting does it at once. Turns and mirrors preserve volume, a
turn is as probable as the one back, and a mirror is its own reverse. They leave all distances within the group, and of
others from its seed, as they were at the moment by which it was found: the same group is found afterwards.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from scenegen.motions.paths import ways
from scenegen.motions.problem import Array, MotionProblem
from scenegen.motions.relocate import find_group
from scenegen.motions.variables import Flags, Variables, at_home
from scenegen.pose import THETA, TWO_PI, X, Y

Side = Literal["before", "after", "both"]

RANGE = 2.5  # decades of the sizes of small turns
ANY, SMALL, QUARTERS = 0.3, 0.3, 0.15  # shares of turns by any angle, small ones, quarter turns; the others mirror


@dataclass(frozen=True, slots=True)
class _Turns:
    """Of each of P motions, a turn by `angle` (P,) or, where `mirrors`, the mirror image in the line at half of it."""

    angle: Array
    mirrors: Flags

    def places(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Vectors, (..., P) each, turned or mirrored."""
        cos, sin = np.cos(self.angle), np.sin(self.angle)
        sign = np.where(self.mirrors, -1.0, 1.0)
        return cos * x - sign * sin * y, sin * x + sign * cos * y

    def headings(self, theta: Array) -> Array:
        """Headings (..., P), turned or mirrored."""
        out: Array = self.angle + np.where(self.mirrors, -theta, theta)
        return out


def _turns(rng: np.random.Generator, count: int) -> _Turns:
    kind, mirrors = rng.random(count), rng.random(count)
    angle = TWO_PI * rng.random(count)
    small = 0.5 * TWO_PI * 10.0 ** (-RANGE * rng.random(count)) * rng.standard_normal(count)
    quarter = 0.25 * TWO_PI * rng.integers(4, size=count)
    turn = np.where(kind < ANY, angle, np.where(kind < ANY + SMALL, small, quarter))
    mirrored = kind >= ANY + SMALL + QUARTERS
    line = np.where(mirrors < 0.5, np.where(mirrors < 0.25, 0.0, 0.5 * TWO_PI), angle)  # most specs know the axes
    return _Turns(np.where(mirrored, line, turn), mirrored)


def swing(problem: MotionProblem, now: Variables, rng: np.random.Generator, *, side: Side) -> tuple[Variables, Flags]:
    """An object, or some that stand together at a moment, come from elsewhere (`before`) or go elsewhere (`after`):
    the way of each is turned or mirrored about its place at the moment. `both`: their whole ways, about the place of
    one of them; half of the time their headings, too."""
    group, turns = find_group(problem, now, rng), _turns(rng, now.count)
    first, unit = now.first.copy(), now.unit.copy()
    step, motion = np.arange(problem.steps)[:, None], np.arange(now.count)
    early: Flags = np.asarray(step < group.moment)
    window = {"before": early, "after": ~early, "both": np.ones_like(early)}[side]
    if problem.moves == "one":
        mine = (window & group.members[problem.movable[now.mover], motion])[:, None]
    else:
        mine = window[:, None] & group.members[problem.movable]
    for axis, turned in zip((X, Y), turns.places(unit[:, :, X], unit[:, :, Y]), strict=True):
        np.copyto(unit[:, :, axis], turned, where=mine)
    if side == "before":
        first += ways(problem, now.mover, now.unit, early) - ways(problem, now.mover, unit, early)
    elif side == "both":
        gone = ways(problem, now.mover, now.unit, early)[group.seed, : Y + 1, motion].T
        seed = now.first[group.seed, : Y + 1, motion].T + gone
        places = turns.places(first[:, X] - seed[X], first[:, Y] - seed[Y])
        for axis, turned in zip((X, Y), places, strict=True):
            np.copyto(first[:, axis], seed[axis] + turned, where=group.members)
        heads: Flags = np.asarray(group.members & problem.wide[:, None] & (rng.random(now.count) < 0.5))
        np.copyto(first[:, THETA], turns.headings(first[:, THETA]), where=heads)
        movers: Flags = np.asarray(heads[problem.movable])
        if problem.moves == "one":
            movers = np.asarray(movers[now.mover, motion])[:, None]
        turning = mine & turns.mirrors & movers
        np.negative(unit[:, :, THETA], out=unit[:, :, THETA], where=turning)
    fixed: Flags = np.asarray((problem.highest <= problem.lowest)[:, : Y + 1].any(axis=1))
    good: Flags = np.asarray(~(group.members & fixed[:, None]).any(axis=0))
    good &= at_home(problem, first)
    return Variables(first, now.mover, unit), good
