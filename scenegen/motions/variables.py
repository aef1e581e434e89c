"""The base variables of motions: what is drawn, and the poses that follow from it.

All are independent and uniform: the first scene over its box, the mover of each step, its displacement over the unit
disc and its turn over -1 to 1, both in units of the mover's reach. So every change that keeps these variables within
their sets, and is as probable as its reverse, leaves the base distribution as it is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.motions.problem import Array, Index, MotionProblem
from scenegen.pose import TWO_PI

Flags = npt.NDArray[np.bool_]


@dataclass(slots=True)
class Variables:
    """P motions: `first` (P, N, 3); `mover` (P, T), indices of the problem's `movable`, all 0 if all move; `unit`
    (P, T, M, 3), M = 1 if one object moves in each step, else as many as can move."""

    first: Array
    mover: Index
    unit: Array

    def take(self, index: Index) -> Variables:
        return Variables(self.first[index], self.mover[index], self.unit[index])

    def copy(self) -> Variables:
        return Variables(self.first.copy(), self.mover.copy(), self.unit.copy())

    def put(self, index: Index, other: Variables, source: Index) -> None:
        """Replace the motions `index` by motions `source` of others."""
        self.first[index], self.mover[index], self.unit[index] = (
            other.first[source],
            other.mover[source],
            other.unit[source],
        )


def unit_steps(rng: np.random.Generator, *shape: int) -> Array:
    """Displacements uniform over the unit disc, turns over -1 to 1: (*shape, 3)."""
    angle, far = TWO_PI * rng.random(shape), np.sqrt(rng.random(shape))
    return np.stack([far * np.cos(angle), far * np.sin(angle), 2.0 * rng.random(shape) - 1.0], axis=-1)


def legal(unit: Array) -> Flags:
    """Which steps (..., 3) lie in the unit disc and turn by at most 1."""
    flags: Flags = (unit[..., 0] ** 2 + unit[..., 1] ** 2 <= 1.0) & (np.abs(unit[..., 2]) <= 1.0)
    return flags


def draw(problem: MotionProblem, count: int, rng: np.random.Generator) -> Variables:
    """`count` draws of the base distribution, limits and requirement aside."""
    objects = len(problem.movable)
    first = rng.random((count, len(problem.names), 3))
    first = problem.lowest + first * (problem.highest - problem.lowest)
    one = problem.moves == "one"
    shape = (count, problem.steps)
    mover = rng.integers(max(1, objects), size=shape) if one else np.zeros(shape, dtype=np.intp)
    return Variables(first, mover, unit_steps(rng, *shape, 1 if one else objects))


def poses_of(problem: MotionProblem, variables: Variables) -> Array:
    """The poses at every moment, (P, steps + 1, N, 3), headings in [0, 2 pi)."""
    movable, reach = problem.movable, problem.reach
    count, steps = variables.mover.shape
    out = np.zeros((count, steps + 1, len(problem.names), 3))
    out[:, 0] = variables.first
    if len(movable) and problem.moves == "one":
        who = movable[variables.mover]
        out[np.arange(count)[:, None], np.arange(1, steps + 1), who] = variables.unit[:, :, 0] * reach[who]
    elif len(movable):
        out[:, 1:, movable] = variables.unit * reach[movable]
    out = np.cumsum(out, axis=1)
    turning = out[..., 2]
    outside = (turning < 0.0) | (turning >= TWO_PI)
    wrapped = np.remainder(turning[outside], TWO_PI)
    turning[outside] = np.where(wrapped >= TWO_PI, 0.0, wrapped)
    return out
