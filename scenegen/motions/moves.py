"""Changes to motions that keep the base distribution: each is as probable as its reverse and preserves volume.

A change is made to every motion of a population at once. It returns the changed variables and which of them stayed
within their sets; the others are refused. Sizes of local changes are drawn from a wide range, so nothing is tuned.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from scenegen.motions.problem import Array, Index, MotionProblem
from scenegen.motions.variables import Flags, Variables, legal, unit_steps
from scenegen.pose import TWO_PI

Change = Callable[[MotionProblem, Variables, np.random.Generator], tuple[Variables, Flags]]

SMALLEST, LARGEST = -2.5, 0.0  # log10 of the sizes of local changes, in units of the whole set


def _sizes(rng: np.random.Generator, count: int) -> Array:
    """Local changes, (P, 3): normal, with a size of their own each."""
    size = 10.0 ** rng.uniform(SMALLEST, LARGEST, (count, 1))
    return size * rng.standard_normal((count, 3))


def _pick(flags: Flags, rng: np.random.Generator) -> tuple[Index, Flags]:
    """A uniform choice among the flagged columns of each row, and whether there was any."""
    chosen: Index = np.where(flags, rng.random(flags.shape), -1.0).argmax(axis=1)
    found: Flags = np.asarray(flags.any(axis=1))
    return chosen, found


def _segment(now: Variables, rng: np.random.Generator) -> Flags:
    """A window of steps for each motion, (P, T): any length, short ones more often."""
    count, steps = now.mover.shape
    length = np.floor(float(steps) ** rng.random(count)).astype(np.intp)
    start = rng.integers(steps, size=(count,))
    place = np.arange(steps)
    flags: Flags = (place >= start[:, None]) & (place < (start + length)[:, None])
    return flags


def _one_step(now: Variables, rng: np.random.Generator) -> tuple[Index, Index, Index]:
    count, steps, width, _ = now.unit.shape
    row: Index = np.arange(count)
    return row, rng.integers(steps, size=row.shape), rng.integers(width, size=row.shape)


def shift_step(problem: MotionProblem, now: Variables, rng: np.random.Generator) -> tuple[Variables, Flags]:
    """One step a little different; everything after it shifts along."""
    new, here = now.copy(), _one_step(now, rng)
    new.unit[here] += _sizes(rng, len(now.unit))
    return new, legal(new.unit[here])


def redraw_step(problem: MotionProblem, now: Variables, rng: np.random.Generator) -> tuple[Variables, Flags]:
    """One step drawn anew, with its mover."""
    new, here = now.copy(), _one_step(now, rng)
    new.unit[here] = unit_steps(rng, len(now.unit))
    if problem.moves == "one":
        new.mover[here[:2]] = rng.integers(len(problem.movable), size=len(now.unit))
    return new, np.ones(len(now.unit), dtype=bool)


def redraw_segment(problem: MotionProblem, now: Variables, rng: np.random.Generator) -> tuple[Variables, Flags]:
    """A window of steps drawn anew."""
    window = _segment(now, rng)
    unit = np.where(window[:, :, None, None], unit_steps(rng, *now.unit.shape[:3]), now.unit)
    mover = now.mover
    if problem.moves == "one":
        mover = np.where(window, rng.integers(len(problem.movable), size=mover.shape), mover)
    return Variables(now.first.copy(), mover, unit), np.ones(len(unit), dtype=bool)


def shift_segment(problem: MotionProblem, now: Variables, rng: np.random.Generator) -> tuple[Variables, Flags]:
    """A window of steps, each a little different."""
    window = _segment(now, rng)[:, :, None, None]
    size = 10.0 ** rng.uniform(SMALLEST, LARGEST, (len(now.unit), 1, 1, 1))
    unit = np.where(window, now.unit + size * rng.standard_normal(now.unit.shape), now.unit)
    good: Flags = np.asarray(legal(unit).all(axis=(1, 2)))
    return Variables(now.first.copy(), now.mover, unit), good


def redraw_mover(problem: MotionProblem, now: Variables, rng: np.random.Generator) -> tuple[Variables, Flags]:
    """Another object makes a step."""
    new, (row, step, _) = now.copy(), _one_step(now, rng)
    new.mover[row, step] = rng.integers(len(problem.movable), size=len(row))
    return new, np.ones(len(row), dtype=bool)


def exchange_steps(problem: MotionProblem, now: Variables, rng: np.random.Generator) -> tuple[Variables, Flags]:
    """Two steps change places: the last scene stays."""
    new, (row, one, _), (_, two, _) = now.copy(), _one_step(now, rng), _one_step(now, rng)
    for values, old in ((new.mover, now.mover), (new.unit, now.unit)):
        values[row, one], values[row, two] = old[row, two], old[row, one]
    return new, np.ones(len(row), dtype=bool)


def reverse_segment(problem: MotionProblem, now: Variables, rng: np.random.Generator) -> tuple[Variables, Flags]:
    """The steps of a window in reverse order."""
    row, one, _ = _one_step(now, rng)
    other = rng.integers(now.mover.shape[1], size=len(row))
    start, end = np.minimum(one, other)[:, None], np.maximum(one, other)[:, None]
    place = np.broadcast_to(np.arange(now.mover.shape[1]), now.mover.shape)
    order = np.where((place >= start) & (place <= end), start + end - place, place)
    row = row[:, None]
    return Variables(now.first.copy(), now.mover[row, order], now.unit[row, order]), np.ones(len(row), dtype=bool)


def shift_first(problem: MotionProblem, now: Variables, rng: np.random.Generator) -> tuple[Variables, Flags]:
    """One object shifted at all moments."""
    new, count = now.copy(), len(now.first)
    row, thing = np.arange(count), rng.integers(len(problem.names), size=count)
    width = (problem.highest - problem.lowest)[thing]
    return new, _shift(problem, new, row, thing, width * _sizes(rng, count))


def redraw_first(problem: MotionProblem, now: Variables, rng: np.random.Generator) -> tuple[Variables, Flags]:
    """One object's first pose drawn anew."""
    new, count = now.copy(), len(now.first)
    row, thing = np.arange(count), rng.integers(len(problem.names), size=count)
    low, high = problem.lowest[thing], problem.highest[thing]
    new.first[row, thing] = low + (high - low) * rng.random((count, 3))
    return new, np.ones(count, dtype=bool)


def shift_start(problem: MotionProblem, now: Variables, rng: np.random.Generator) -> tuple[Variables, Flags]:
    """One object shifted until one of its steps, which makes up for it: it ends where it did."""
    new, (row, step, slot) = now.copy(), _one_step(now, rng)
    thing = problem.movable[now.mover[row, step] if problem.moves == "one" else slot]
    by = _sizes(rng, len(row))
    free = problem.highest[thing] > problem.lowest[thing]
    by = np.where(free, by, 0.0)
    good = _shift(problem, new, row, thing, by * problem.reach[thing])
    new.unit[row, step, slot] -= by
    return new, good & legal(new.unit[row, step, slot])


def transfer(problem: MotionProblem, now: Variables, rng: np.random.Generator) -> tuple[Variables, Flags]:
    """Part of an object's step is done in another of its steps: it ends where it did."""
    new, (row, one, slot) = now.copy(), _one_step(now, rng)
    two, found = _other_step(now, row, one, now.mover[row, one], rng)
    by = _sizes(rng, len(row))
    new.unit[row, one, slot] += by
    new.unit[row, two, slot] -= by
    return new, found & legal(new.unit[row, one, slot]) & legal(new.unit[row, two, slot])


def hand_over(problem: MotionProblem, now: Variables, rng: np.random.Generator) -> tuple[Variables, Flags]:
    """A step passes from one object to another; another step of each makes up for it: both end where they did."""
    new, (row, step, _) = now.copy(), _one_step(now, rng)
    giver, taker = now.mover[row, step], rng.integers(len(problem.movable), size=len(row))
    one, mine = _other_step(now, row, step, giver, rng)
    two, yours = _other_step(now, row, step, taker, rng)
    fresh = unit_steps(rng, len(row))
    new.unit[row, one, 0] += now.unit[row, step, 0]
    new.unit[row, two, 0] -= fresh
    new.unit[row, step, 0], new.mover[row, step] = fresh, taker
    good = mine & yours & (giver != taker)
    return new, good & legal(new.unit[row, one, 0]) & legal(new.unit[row, two, 0])


def _other_step(now: Variables, row: Index, step: Index, who: Index, rng: np.random.Generator) -> tuple[Index, Flags]:
    """A step of object `who` (P,) other than `step` (P,), and whether there is one."""
    flags = now.mover == who[:, None]
    flags[row, step] = False
    return _pick(flags, rng)


def _shift(problem: MotionProblem, new: Variables, row: Index, thing: Index, by: Array) -> Flags:
    """Shift first poses in place; headings that are free wrap. Returns which are still within their box."""
    low, high = problem.lowest[thing], problem.highest[thing]
    pose = new.first[row, thing] + by
    wide = problem.wide[thing]
    pose[wide, 2] = low[wide, 2] + np.remainder(pose[wide, 2] - low[wide, 2], TWO_PI)
    new.first[row, thing] = pose
    inside: Flags = np.asarray(((pose >= low) & (pose <= high)).all(axis=1))
    return inside


def changes(problem: MotionProblem) -> tuple[Change, ...]:
    """The changes that apply to a problem."""
    made: tuple[Change, ...] = ()
    if (problem.highest > problem.lowest).any():
        made += (shift_first, shift_first, redraw_first)
    if problem.steps and len(problem.movable):
        made += (shift_step, shift_step, redraw_step, redraw_segment, shift_segment, exchange_steps, reverse_segment)
        made += (shift_start, transfer, transfer)
        if problem.moves == "one" and len(problem.movable) > 1:
            made += (redraw_mover, hand_over)
    return made
