"""Changes to motions that keep the base distribution: each is as probable as its reverse and preserves volume.

A change is made to every motion of a population at once. It returns the changed variables and which of them stayed
within their sets; the others are refused. Sizes of local changes are drawn from a wide range, so nothing is tuned.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from scenegen.motions.exchange import Part, exchange_ways
from scenegen.motions.paths import go_back, redraw_beginning, redraw_pairs, reflect, segment
from scenegen.motions.problem import Array, Index, MotionProblem
from scenegen.motions.relocate import After, Before, relocate
from scenegen.motions.swing import Side, swing
from scenegen.motions.turns import hand_over, other_step, retime
from scenegen.motions.variables import Flags, Variables, legal, unit_steps
from scenegen.pose import PLACE, THETA, TWO_PI

Change = Callable[[MotionProblem, Variables, np.random.Generator], tuple[Variables, Flags]]

WAYS: tuple[tuple[Before, After], ...] = (
    ("first", "kept"), ("redrawn", "kept"), ("step", "kept"), ("first", "redrawn"), ("redrawn", "redrawn"),
    ("first", "step"), ("step", "step"),
)  # fmt: skip

SIDES: tuple[Side, ...] = ("before", "after", "both")
PARTS: tuple[Part, ...] = ("before", "after", "whole")

SMALLEST, LARGEST = -2.5, 0.0  # log10 of the sizes of local changes, in units of the whole set


def _sizes(rng: np.random.Generator, count: int) -> Array:
    """Local changes, (P, 3): normal, with a size of their own each."""
    size = 10.0 ** rng.uniform(SMALLEST, LARGEST, (count, 1))
    return size * rng.standard_normal((count, 3))


Here = tuple[Index, Index, Index]
"""A step of each motion: the step, the slot of its mover, and the motion."""


def _one_step(now: Variables, rng: np.random.Generator) -> Here:
    steps, width, _, count = now.unit.shape
    motion: Index = np.arange(count)
    return rng.integers(steps, size=motion.shape), rng.integers(width, size=motion.shape), motion


def _get(unit: Array, here: Here) -> Array:
    """The chosen step of each motion, (P, 3)."""
    step, slot, motion = here
    found: Array = unit[step, slot, :, motion]
    return found


def _set(unit: Array, here: Here, value: Array) -> Flags:
    """Replace it; returns which are legal."""
    step, slot, motion = here
    unit[step, slot, :, motion] = value
    return legal(value.T)


def shift_step(problem: MotionProblem, now: Variables, rng: np.random.Generator) -> tuple[Variables, Flags]:
    """One step a little different; everything after it shifts along."""
    unit, here = now.unit.copy(), _one_step(now, rng)
    good = _set(unit, here, _get(unit, here) + _sizes(rng, now.count))
    return Variables(now.first, now.mover, unit), good


def redraw_step(problem: MotionProblem, now: Variables, rng: np.random.Generator) -> tuple[Variables, Flags]:
    """Redraw one step, with its mover."""
    unit, mover, here = now.unit.copy(), now.mover, _one_step(now, rng)
    good = _set(unit, here, unit_steps(rng, now.count).T)
    if problem.moves == "one":
        mover = now.mover.copy()
        mover[here[0], here[2]] = rng.integers(len(problem.movable), size=now.count)
    return Variables(now.first, mover, unit), good


def redraw_segment(problem: MotionProblem, now: Variables, rng: np.random.Generator) -> tuple[Variables, Flags]:
    """Redraw a window of steps."""
    window = segment(now, rng)
    steps, width, _, count = now.unit.shape
    unit = np.where(window[:, None, None], unit_steps(rng, steps, width, count), now.unit)
    mover = now.mover
    if problem.moves == "one":
        mover = np.where(window, rng.integers(len(problem.movable), size=mover.shape), mover)
    return Variables(now.first, mover, unit), np.ones(count, dtype=bool)


def shift_segment(problem: MotionProblem, now: Variables, rng: np.random.Generator) -> tuple[Variables, Flags]:
    """A window of steps, each a little different."""
    window = segment(now, rng)[:, None, None]
    size = 10.0 ** rng.uniform(SMALLEST, LARGEST, now.count)
    unit = np.where(window, now.unit + size * rng.standard_normal(now.unit.shape), now.unit)
    good: Flags = np.asarray(legal(unit).all(axis=(0, 1)))
    return Variables(now.first, now.mover, unit), good


def exchange_steps(problem: MotionProblem, now: Variables, rng: np.random.Generator) -> tuple[Variables, Flags]:
    """Two steps change places: the last scene stays."""
    (one, _, motion), (two, _, _) = _one_step(now, rng), _one_step(now, rng)
    mover, unit = now.mover.copy(), now.unit.copy()
    mover[one, motion], mover[two, motion] = now.mover[two, motion], now.mover[one, motion]
    unit[one, ..., motion], unit[two, ..., motion] = now.unit[two, ..., motion], now.unit[one, ..., motion]
    return Variables(now.first, mover, unit), np.ones(now.count, dtype=bool)


def reverse_segment(problem: MotionProblem, now: Variables, rng: np.random.Generator) -> tuple[Variables, Flags]:
    """The steps of a window in reverse order."""
    steps, count = now.mover.shape
    one, other = rng.integers(steps, size=(2, count))
    start, end = np.minimum(one, other), np.maximum(one, other)
    place = np.arange(steps)[:, None]
    order = np.where((place >= start) & (place <= end), start + end - place, place)
    mover = np.take_along_axis(now.mover, order, axis=0)
    unit = np.take_along_axis(now.unit, order[:, None, None], axis=0)
    return Variables(now.first, mover, unit), np.ones(count, dtype=bool)


def shift_first(problem: MotionProblem, now: Variables, rng: np.random.Generator) -> tuple[Variables, Flags]:
    """One object shifted at all moments."""
    first, thing = now.first.copy(), rng.integers(len(problem.names), size=now.count)
    width = (problem.highest - problem.lowest)[thing]
    good = _shift(problem, first, thing, width * _sizes(rng, now.count))
    return Variables(first, now.mover, now.unit), good


def redraw_first(problem: MotionProblem, now: Variables, rng: np.random.Generator) -> tuple[Variables, Flags]:
    """Redraw one object's first pose."""
    first, count = now.first.copy(), now.count
    thing = rng.integers(len(problem.names), size=count)
    low, high = problem.lowest[thing], problem.highest[thing]
    first[thing, :, np.arange(count)] = low + (high - low) * rng.random((count, 3))
    return Variables(first, now.mover, now.unit), np.ones(count, dtype=bool)


def redraw_heading(problem: MotionProblem, now: Variables, rng: np.random.Generator) -> tuple[Variables, Flags]:
    """Redraw one object's first heading, or those of all: later headings turn with them."""
    first, count, names = now.first.copy(), now.count, len(problem.names)
    which = (rng.integers(names, size=count) == np.arange(names)[:, None]) | (rng.random(count) < 0.5)
    low, high = problem.lowest[:, THETA, None], problem.highest[:, THETA, None]
    np.copyto(first[:, THETA], low + (high - low) * rng.random((names, count)), where=which)
    return Variables(first, now.mover, now.unit), np.ones(count, dtype=bool)


def shift_start(problem: MotionProblem, now: Variables, rng: np.random.Generator) -> tuple[Variables, Flags]:
    """One object shifted until one of its steps, which makes up for it: it ends where it did."""
    first, unit, here = now.first.copy(), now.unit.copy(), _one_step(now, rng)
    step, slot, motion = here
    thing = problem.movable[now.mover[step, motion] if problem.moves == "one" else slot]
    by = np.where(problem.highest[thing] > problem.lowest[thing], _sizes(rng, now.count), 0.0)
    good = _shift(problem, first, thing, by * problem.reach[thing])
    good &= _set(unit, here, _get(unit, here) - by)
    return Variables(first, now.mover, unit), good


def transfer(problem: MotionProblem, now: Variables, rng: np.random.Generator) -> tuple[Variables, Flags]:
    """Part of an object's step is done in another of its steps: it ends where it did."""
    unit, here = now.unit.copy(), _one_step(now, rng)
    step, slot, motion = here
    other, found = other_step(now, step, now.mover[step, motion], rng)
    by = _sizes(rng, now.count)
    good = found & _set(unit, here, _get(unit, here) + by)
    good &= _set(unit, (other, slot, motion), _get(unit, (other, slot, motion)) - by)
    return Variables(now.first, now.mover, unit), good


def _shift(problem: MotionProblem, first: Array, thing: Index, by: Array) -> Flags:
    """Shift first poses in place; headings that are free wrap. Returns which are still within their box."""
    low, high, motion = problem.lowest[thing], problem.highest[thing], np.arange(len(thing))
    pose = first[thing, :, motion] + by
    wide = problem.wide[thing]
    pose[wide, 2] = low[wide, 2] + np.remainder(pose[wide, 2] - low[wide, 2], TWO_PI)
    first[thing, :, motion] = pose
    inside: Flags = np.asarray(((pose >= low) & (pose <= high)).all(axis=1))
    return inside


def changes(problem: MotionProblem) -> tuple[Change, ...]:
    """The changes that apply to a problem."""
    made: tuple[Change, ...] = ()
    if (problem.highest > problem.lowest).any():
        made += (shift_first, redraw_first, redraw_heading)
    if not (problem.steps and len(problem.movable)):
        return made
    made += (shift_step, redraw_step, redraw_segment, shift_segment, exchange_steps, reverse_segment, shift_start)
    made += (transfer, redraw_beginning, redraw_pairs, reflect, go_back)
    if (problem.highest > problem.lowest)[:, PLACE].any():
        made += tuple(partial(relocate, before=before, after=after) for before, after in WAYS)
        made += tuple(partial(swing, side=side) for side in SIDES)
    if len(problem.movable) > 1:
        made += tuple(partial(exchange_ways, part=part) for part in PARTS)
    if problem.moves == "one" and len(problem.movable) > 1:
        made += (retime, hand_over)
    return made
