"""The base variables of motions: what is drawn, and the poses that follow from it.

All are independent and uniform: the first scene over its box, the mover of each step, its displacement over the unit
disc and its turn over -1 to 1, both in units of the mover's reach. So every change that keeps these variables within
their sets, and is as probable as its reverse, leaves the base distribution as it is.

The motions stand along the last axis of every array: whatever is done to all of them works on contiguous memory.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.motions.problem import Array, Index, MotionProblem
from scenegen.pose import ANGLES, THETA, TWO_PI

Flags = npt.NDArray[np.bool_]


@dataclass(slots=True)
class Variables:
    """P motions: `first` (N, 3, P); `mover` (T, P), indices of the problem's `movable`, all 0 if all move; `unit`
    (T, M, 3, P), M = 1 if one object moves in each step, else as many as can move."""

    first: Array
    mover: Index
    unit: Array

    @property
    def count(self) -> int:
        return int(self.mover.shape[1])

    def take(self, index: Index | Flags) -> Variables:
        index = np.flatnonzero(index) if index.dtype == np.bool_ else index
        first, mover, unit = self.first.take(index, -1), self.mover.take(index, -1), self.unit.take(index, -1)
        return Variables(first, mover, unit)

    def copy(self) -> Variables:
        return Variables(self.first.copy(), self.mover.copy(), self.unit.copy())

    def put(self, other: Variables, where: Flags) -> None:
        """Replace the motions where a flag is set by those of `other`; arrays that both share are left alone."""
        for mine, new in ((self.first, other.first), (self.mover, other.mover), (self.unit, other.unit)):
            if mine is not new:
                np.copyto(mine, new, where=where)


def unit_steps(rng: np.random.Generator, *shape: int) -> Array:
    """Displacements uniform over the unit disc, turns over -1 to 1: `shape` with an axis of 3 before its last."""
    angle, far = TWO_PI * rng.random(shape), np.sqrt(rng.random(shape))
    return np.stack([far * np.cos(angle), far * np.sin(angle), 2.0 * rng.random(shape) - 1.0], axis=-2)


def legal(unit: Array) -> Flags:
    """Which steps (..., 3, P) lie in the unit disc and turn by at most 1."""
    flags: Flags = (unit[..., 0, :] ** 2 + unit[..., 1, :] ** 2 <= 1.0) & (np.abs(unit[..., 2, :]) <= 1.0)
    return flags


def chosen(flags: Flags, rng: np.random.Generator) -> tuple[Index, Flags]:
    """One of the steps that are flagged (T, P), for each motion, all equally likely; and whether there is any."""
    step: Index = np.where(flags, rng.random(flags.shape), -1.0).argmax(axis=0)
    found: Flags = np.asarray(flags.any(axis=0))
    return step, found


def at_home(problem: MotionProblem, first: Array) -> Flags:
    """Whether first poses (N, 3, P) are within their boxes; headings that are free wrap in place."""
    for thing in np.flatnonzero(problem.wide).tolist():
        low, heading = problem.lowest[thing, THETA], first[thing, THETA]
        heading[:] = low + np.remainder(heading - low, TWO_PI)
    inside = (first >= problem.lowest[..., None]) & (first <= problem.highest[..., None])
    home: Flags = np.asarray(inside.all(axis=(0, 1)))
    return home


def draw(problem: MotionProblem, count: int, rng: np.random.Generator) -> Variables:
    """`count` draws of the base distribution, limits and requirement aside."""
    objects = len(problem.movable)
    first = rng.random((len(problem.names), 3, count))
    first *= (problem.highest - problem.lowest)[..., None]
    first += problem.lowest[..., None]
    one = problem.moves == "one"
    shape = (problem.steps, count)
    mover = rng.integers(max(1, objects), size=shape) if one else np.zeros(shape, dtype=np.intp)
    return Variables(first, mover, unit_steps(rng, problem.steps, 1 if one else objects, count))


def poses_of(problem: MotionProblem, variables: Variables) -> Array:
    """The poses at every moment, (N, 3, steps + 1, P). Headings are not brought to one turn: see `within_a_turn`."""
    reach, slot_of = problem.reach, {thing: slot for slot, thing in enumerate(problem.movable.tolist())}
    steps, count = variables.mover.shape
    out = np.empty((len(problem.names), 3, steps + 1, count))
    out[:, :, 0] = variables.first
    for thing, ways in enumerate(out):
        slot = slot_of.get(thing)
        own = variables.mover == slot if slot is not None and problem.moves == "one" else None
        for axis, way in enumerate(ways):
            if slot is None or not reach[thing, axis]:
                way[1:] = 0.0
            elif own is None:
                np.multiply(variables.unit[:, slot, axis], reach[thing, axis], out=way[1:])
            else:
                np.multiply(variables.unit[:, 0, axis], own, out=way[1:])
                way[1:] *= reach[thing, axis]
    turning = bool(reach[:, THETA].any())
    if not turning:
        out[:, THETA] = out[:, THETA, :1]
    some = out if turning else out[:, :THETA]
    for moment in range(steps):
        some[:, :, moment + 1] += some[:, :, moment]
    return out


def within_a_turn(poses: Array) -> Array:
    """The same poses, headings brought to [0, 2 pi) in place."""
    for axis in ANGLES:
        turning = poses[:, axis]
        turning -= TWO_PI * np.floor(turning / TWO_PI)
        np.copyto(turning, 0.0, where=(turning >= TWO_PI) | (turning < 0.0))  # rounding
    return poses
