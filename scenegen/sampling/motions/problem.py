"""A request for motions, made ready for the samplers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar, Literal, Protocol

import numpy as np
import numpy.typing as npt

from scenegen.arrays import Array, Index
from scenegen.errors import Diagnostic
from scenegen.lang.spec import CheckedSpec
from scenegen.pose import ANGLES, LENGTHS, SIZE, THETA, TWO_PI, row_count
from scenegen.sampling.cells import Cells, cut
from scenegen.sampling.rarity import cost as state_cost
from scenegen.sampling.request import FixedPose, SampleRequest
from scenegen.search.effort import NEVER, Stop

if TYPE_CHECKING:
    from scenegen.sampling.prior import BaseDistribution

Flags = npt.NDArray[np.bool_]
Score = Callable[[Array], Array]
Moves = Literal["one", "all"]


class LeanScores(Protocol):
    """Scores in two stages, for motions whose steps are within their bounds."""

    def of_labels(self, poses: Array) -> Array:
        """phi of every label, (N, 3, steps + 1, B) -> (L, B)."""

    def of_requirement(self, poses: Array, signs: bool) -> Array:
        """The requirement's margin, (B,); where it is positive, or with `signs`, only its sign counts."""


MAX_MOTION_NUMBERS = 1 << 22  # of motions at once: 32 MB, and each population has a few such arrays
WORK_BETWEEN_CHECKS = 1 << 26  # of phi between two looks at the time: a fraction of a second

MAX_STATES_AT_ONCE = 1 << 16  # states that chains score at a time, which stay in cache

GATES = ("(require)", "(limits)")  # two more rows of scores, at least 0 in every motion that counts
REQUIRED, ROOM = -2, -1  # the rows of these


@dataclass(frozen=True, slots=True, eq=False)
class MotionProblem:
    """N objects over `steps` steps of `dt` seconds.

    In the first scene each pose is uniform over its box: `lowest` and `highest` (N, 3), metres and radians; equal rows
    hold a coordinate. In each step one object moves (`moves` "one": chosen uniformly among those that can move), or all
    do, by a displacement uniform over the disc of its `radius` (N,), metres, and a turn uniform over -turn to turn,
    `turn` (N,), radians. Objects with neither stay where they are. The whole is conditioned on all centres within
    lowest to highest at every moment, and on the requirement's margin >= 0. Where there are priors, `base` makes first
    scenes of uniform numbers in the same box; nothing else of a motion changes.

    `score` maps poses (N, 3, steps + 1, B) to (L + 1, B): phi of every label, then the requirement's margin, infinity
    where nothing is required. Headings that it gets may lie outside [0, 2 pi). It must be picklable for several
    processes. `scores` has the same rows, then the room (see GATES). `cost` is about how many numbers it computes for a
    motion. `lean`, if there is one, tells chains the same for less. `log_excess` is what to add to the natural
    logarithm of a share of motions for the probability under the base distribution: see `Workspace.log_excess`. `spec`
    is what the problem was made from, if it was made from one, and `warnings` are about the request.
    """

    names: tuple[str, ...]
    labels: tuple[str, ...]
    steps: int
    lowest: Array
    highest: Array
    radius: Array
    turn: Array
    score: Score
    request: SampleRequest
    moves: Moves = "one"
    dt: float = 1.0
    cost: int = 0
    lean: LeanScores | None = None
    log_excess: float = 0.0
    spec: CheckedSpec | None = None
    base: BaseDistribution | None = None
    warnings: tuple[Diagnostic, ...] = ()
    cells: Cells = field(init=False)

    over_time: ClassVar[bool] = True

    def __post_init__(self) -> None:
        cells = cut(self.request, (*self.labels, *GATES))
        cells.low[-len(GATES) :] = 0.0
        object.__setattr__(self, "cells", cells)

    @property
    def reach(self) -> Array:
        """(N, 3): how far a step can take each coordinate."""
        return np.stack([self.radius, self.radius, self.turn], axis=1)

    @property
    def rows(self) -> int:
        """How many numbers a motion is in storage: the poses at all moments, then the mover of each step."""
        return (self.steps + 1) * row_count(len(self.names)) + self.steps

    @property
    def fixed_poses(self) -> dict[str, tuple[float, ...]]:
        """The places of objects that the request fixes."""
        return {name: tuple(pose) for name, pose in self.request.fix.items() if not isinstance(pose, FixedPose)}

    def poses(self, rows: Array) -> Array:
        """The poses of motions in storage, (N, 3, steps + 1, B)."""
        shape = (len(self.names), SIZE, self.steps + 1, rows.shape[1])
        return rows[: len(rows) - self.steps].reshape(shape)

    def scenes(self, rows: Array) -> Array:
        """The scenes in which motions begin, (3N, B)."""
        return self.poses(rows)[:, :, 0].reshape(row_count(len(self.names)), rows.shape[1])

    @property
    def movable(self) -> Index:
        """The objects that can move, (K,)."""
        return np.flatnonzero((self.radius > 0.0) | (self.turn > 0.0))

    @property
    def wide(self) -> npt.NDArray[np.bool_]:
        """(N,): whose first heading is uniform over the whole circle."""
        turned: npt.NDArray[np.bool_] = self.highest[:, 2] - self.lowest[:, 2] >= TWO_PI * (1.0 - 1e-12)
        return turned

    def room(self, poses: Array) -> Array:
        """The least distance of a moving centre from its limits, (N, 3, steps + 1, B) -> (B,), metres; negative
        outside; infinite if nothing moves."""
        least = np.full(poses.shape[-1], np.inf)
        for thing in np.flatnonzero(self.radius > 0.0):
            for axis in LENGTHS:
                place = poses[thing, axis]
                np.minimum(least, place.min(axis=0) - self.lowest[thing, axis], out=least)
                np.minimum(least, self.highest[thing, axis] - place.max(axis=0), out=least)
        return least

    def batch_size(self, wanted: int, fewest: int) -> int:
        """How many motions to work on together: `wanted`, or less of large ones, so that they stay in memory and time
        limits are kept; at least `fewest`."""
        return min(wanted, max(fewest, min(MAX_MOTION_NUMBERS // self.rows, WORK_BETWEEN_CHECKS // max(1, self.cost))))

    def scores(self, poses: Array, stop: Stop = NEVER) -> Array:
        """phi of all labels, the requirement and the room, (N, 3, steps + 1, B) -> (L + 2, B). Raises what `stop`
        raises, which is asked again and again where this takes long."""
        count = poses.shape[-1]
        some = max(1, WORK_BETWEEN_CHECKS // max(1, self.cost))
        out = np.empty((len(self.labels) + len(GATES), count))
        for start in range(0, count, some):
            if start:
                stop.check()
            part = slice(start, start + some)
            out[:-1, part] = self.score(poses if some >= count else poses[..., part])
        out[-1] = self.room(poses)
        return out

    def judge(self, poses: Array, low: Array, high: Array, stop: Stop = NEVER) -> tuple[Flags, Array]:
        """Which motions have scores from `low` to `high`, (L + 2,) each, and their scores (L + 2, B): without meaning
        where a motion does not, and with no more than the sign of a requirement that `low` has at 0. Raises what `stop`
        raises."""
        count = poses.shape[-1]
        if self.lean is None:
            scores = self.scores(poses, stop)
            return _in_range(scores, low, high), scores
        scores = np.zeros((len(self.labels) + len(GATES), count))
        scores[ROOM] = self.room(poses)
        held = _in_range(scores[ROOM:], low[ROOM:], high[ROOM:])
        some = max(1, min(WORK_BETWEEN_CHECKS // max(1, self.cost), MAX_STATES_AT_ONCE // (self.steps + 1)))
        for start in range(0, count, some):
            if start:
                stop.check()
            index = start + np.flatnonzero(held[start : start + some])
            if not len(index):
                continue
            part = poses if len(index) == count else poses.take(index, axis=-1)
            phi = self.lean.of_labels(part)
            good = _in_range(phi, low[:REQUIRED], high[:REQUIRED])
            scores[:REQUIRED, index] = phi
            if good.any():
                part = part if good.all() else part.compress(good, axis=-1)
                margin = self.lean.of_requirement(part, bool(low[REQUIRED] >= 0.0))
                scores[REQUIRED, index[good]] = margin
                good[good] = _in_range(margin[None], low[REQUIRED:ROOM], high[REQUIRED:ROOM])
            held[index] = good
        return held, scores


def _in_range(scores: Array, low: Array, high: Array) -> Flags:
    """Which columns of scores (L, B) are within; NaN is not, where anything is asked for."""
    anything = np.isneginf(low) & np.isposinf(high)
    inside = (scores >= low[:, None]) & (scores <= high[:, None]) | anything[:, None]
    return np.asarray(inside.all(axis=0))


SHAPE_SAVING = 6  # shapes cost less than in single scenes: a batch has all moments of a motion


def cost(spec: CheckedSpec) -> int:
    """About the cost of phi of one motion, in visits of nodes."""
    timed = spec.timed
    assert timed is not None
    plain = len(timed.state.nodes)
    shaped = (state_cost(timed.state) - plain) // SHAPE_SAVING
    return (plain + shaped + len(timed.nodes) + 8 * len(timed.objects)) * timed.horizon.moments


@dataclass(slots=True)
class Variables:
    """The base variables of P motions: what is drawn, and the poses follow from it. `first` (N, 3, P), the first scene,
    or the numbers that the problem's `base` makes it of; `mover` (T, P), indices of the problem's `movable`, all 0 if
    all move; `unit` (T, M, 3, P), M = 1 if one object moves in each step, else as many as can move.

    All are independent and uniform: the first scene over its box, the mover of each step, its displacement over the
    unit disc and its turn over -1 to 1, both in units of the mover's reach. So every change that keeps these variables
    within their sets, and is as probable as its reverse, leaves the base distribution as it is. The motions stand along
    the last axis of every array: whatever is done to all of them works on contiguous memory.
    """

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


def is_legal(unit: Array) -> Flags:
    """Which steps (..., 3, P) lie in the unit disc and turn by at most 1."""
    flags: Flags = (unit[..., 0, :] ** 2 + unit[..., 1, :] ** 2 <= 1.0) & (np.abs(unit[..., 2, :]) <= 1.0)
    return flags


def choose_step(flags: Flags, rng: np.random.Generator) -> tuple[Index, Flags]:
    """One of the steps that are flagged (T, P), for each motion, all equally likely; and whether there is any."""
    step: Index = np.where(flags, rng.random(flags.shape), -1.0).argmax(axis=0)
    found: Flags = np.asarray(flags.any(axis=0))
    return step, found


def wrap_inside(problem: MotionProblem, first: Array) -> Flags:
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
    out[:, :, 0] = _first_scenes(problem, variables.first)
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


def _first_scenes(problem: MotionProblem, first: Array) -> Array:
    """The scenes in which motions begin, (N, 3, P)."""
    if problem.base is None:
        return first
    return problem.base.poses(first.reshape(-1, first.shape[2])).reshape(first.shape)


def within_a_turn(poses: Array) -> Array:
    """The same poses, headings brought to [0, 2 pi) in place."""
    for axis in ANGLES:
        turning = poses[:, axis]
        turning -= TWO_PI * np.floor(turning / TWO_PI)
        np.copyto(turning, 0.0, where=(turning >= TWO_PI) | (turning < 0.0))  # rounding
    return poses
