"""Changes to motions that keep the base distribution: each is as probable as its reverse and preserves volume.

A change is made to every motion of a population at once. It returns the changed variables and which of them stayed
within their sets; the others are refused. Sizes of local changes are drawn from a wide range, so nothing is tuned.

Who comes from where, and who goes where, is a matter of order: small changes would have to lead objects past one
another. An exchange is its own reverse and preserves volume, because all base variables are alike. What a spec wants at
one moment, such as a meeting, leaves open where objects come from. Small changes walk around a meeting slowly; a turn
of the whole way there about the meeting does it at once (like the pivot moves of chain molecules, Madras and Sokal
1988). Turns and mirrors preserve volume, a turn is as probable as the one back, and a mirror is its own reverse. They
leave all distances within the group, and of others from its seed, as they were at the moment by which it was found: the
same group is found afterwards.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np

from scenegen.arrays import Array, Index
from scenegen.pose import PLACE, THETA, TWO_PI, X, Y
from scenegen.sampling.motions.groups import After, Before, find_group, relocate
from scenegen.sampling.motions.problem import (
    Flags,
    MotionProblem,
    Variables,
    choose_step,
    is_legal,
    unit_steps,
    wrap_inside,
)


def segment(now: Variables, rng: np.random.Generator) -> Flags:
    """A window of steps for each motion, (T, P): any length, short ones more often."""
    steps, count = now.mover.shape
    length = np.floor(float(steps) ** rng.random(count)).astype(np.intp)
    start = rng.integers(steps, size=(count,))
    place = np.arange(steps)[:, None]
    flags: Flags = (place >= start) & (place < start + length)
    return flags


def _own_steps(problem: MotionProblem, now: Variables, rng: np.random.Generator) -> tuple[Index, Flags]:
    """An object that can move (P,), by its slot, and its own steps (T, M, P)."""
    slots = np.arange(len(problem.movable))
    slot: Index = rng.integers(len(slots), size=now.count)
    if problem.moves == "one":
        return slot, (now.mover == slot)[:, None]
    return slot, np.broadcast_to(slots[:, None] == slot, now.unit[:, :, 0].shape)


def redraw_beginning(problem: MotionProblem, now: Variables, rng: np.random.Generator) -> tuple[Variables, Flags]:
    """A window of steps is redrawn, with its movers; first poses make up for it, so that all later ones stay."""
    steps, count = now.mover.shape
    until = rng.integers(1, steps + 1, size=count)
    whole = rng.random(count) < 0.5
    window = np.where(whole, np.arange(steps)[:, None] < until, segment(now, rng))
    mover, unit = _redraw_window(problem, now, rng, window)
    first = now.first + ways(problem, now.mover, now.unit, window) - ways(problem, mover, unit, window)
    good = wrap_inside(problem, first)
    return Variables(first, mover, unit), good


def _redraw_window(
    problem: MotionProblem, now: Variables, rng: np.random.Generator, window: Flags
) -> tuple[Index, Array]:
    """The movers and the steps, those of a window (T, P) drawn afresh."""
    steps, width, _, count = now.unit.shape
    unit = np.where(window[:, None, None], unit_steps(rng, steps, width, count), now.unit)
    if problem.moves != "one":
        return now.mover, unit
    return np.where(window, rng.integers(len(problem.movable), size=now.mover.shape), now.mover), unit


def ways(problem: MotionProblem, mover: Index, unit: Array, window: Flags) -> Array:
    """How far objects go in a window of steps, (N, 3, P)."""
    out = np.zeros((len(problem.names), 3, mover.shape[1]))
    for slot, thing in enumerate(problem.movable.tolist()):
        one = problem.moves == "one"
        counts = (window & (mover == slot) if one else window).astype(np.float64)
        for axis, reach in enumerate(problem.reach[thing].tolist()):
            if reach:
                out[thing, axis] = reach * np.einsum("tp,tp->p", unit[:, 0 if one else slot, axis], counts)
    return out


def redraw_pairs(problem: MotionProblem, now: Variables, rng: np.random.Generator) -> tuple[Variables, Flags]:
    """An object's steps in a window are put into pairs, and every pair is redrawn with the same sum: the ends of the
    way stay. A pair that cannot be is left as it was."""
    steps, width, _, count = now.unit.shape
    _, own = _own_steps(problem, now, rng)
    flags = (own & segment(now, rng)[:, None]).reshape(steps * width, count)
    rows = now.unit.reshape(steps * width, 3, count)
    rank = np.where(flags, rng.random(flags.shape), 2.0)
    order, number = np.argsort(rank, axis=0)[:steps], flags.sum(axis=0)
    one, motion = np.nonzero(np.arange(len(order) - 1)[:, None] + 1 < number)
    even = one % 2 == 0
    one, motion = one[even], motion[even]
    first, second = order[one, motion], order[one + 1, motion]
    total = rows[first, :, motion] + rows[second, :, motion]
    fresh = unit_steps(rng, len(one)).T
    fine = is_legal((total - fresh).T)
    unit = rows.copy()
    unit[first[fine], :, motion[fine]] = fresh[fine]
    unit[second[fine], :, motion[fine]] = (total - fresh)[fine]
    changed = np.zeros(count, dtype=bool)
    changed[motion[fine]] = True
    return Variables(now.first, now.mover, unit.reshape(now.unit.shape)), changed


def reflect(problem: MotionProblem, now: Variables, rng: np.random.Generator) -> tuple[Variables, Flags]:
    """An object's way in a window is reflected in the line through its ends."""
    window = (_own_steps(problem, now, rng)[1] & segment(now, rng)[:, None])[:, :, None]
    along = np.where(window, now.unit, 0.0).sum(axis=(0, 1))[: Y + 1]
    length = np.hypot(along[X], along[Y])
    along /= np.maximum(length, 1e-300)
    twice = 2.0 * (now.unit[:, :, X] * along[X] + now.unit[:, :, Y] * along[Y])
    unit = now.unit.copy()
    for axis in (X, Y):
        np.copyto(unit[:, :, axis], twice * along[axis] - now.unit[:, :, axis], where=window[:, :, 0])
    return Variables(now.first, now.mover, unit), length > 1e-9


def go_back(problem: MotionProblem, now: Variables, rng: np.random.Generator) -> tuple[Variables, Flags]:
    """An object goes its whole way backwards: it starts where it ended."""
    slot, own = _own_steps(problem, now, rng)
    mine = own.any(axis=1)
    thing, motion = problem.movable[slot], np.arange(now.count)
    total = np.where(own[:, :, None], now.unit, 0.0).sum(axis=(0, 1)).T * problem.reach[thing]
    rank = np.cumsum(mine, axis=0)  # the k-th of its steps becomes the last but k
    order = np.argsort(~mine, axis=0, kind="stable")
    source = np.take_along_axis(order, np.where(mine, rank[-1] - rank, 0), axis=0)
    unit = np.where(own[:, :, None], -np.take_along_axis(now.unit, source[:, None, None], axis=0), now.unit)
    first = now.first.copy()
    first[thing, :, motion] += total
    good = wrap_inside(problem, first)
    return Variables(first, now.mover, unit), good


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
        mover, unit = now.mover, _swap_steps(now, window, one, two)
    first, good = now.first, np.ones(count, dtype=bool)
    if part == "before":
        first = first + (ways(problem, now.mover, now.unit, early) - ways(problem, mover, unit, early))
        good = wrap_inside(problem, first)
    elif part == "whole":
        a, b = problem.movable[one], problem.movable[two]
        first = first.copy()
        first[a, :, motion], first[b, :, motion] = now.first[b, :, motion], now.first[a, :, motion]
        for ends in (problem.lowest, problem.highest):
            good &= (ends[a] == ends[b]).all(axis=1)
    return Variables(first, mover, unit), good


def _swap_steps(now: Variables, window: Flags, one: Index, two: Index) -> Array:
    """The steps, in which objects `one` and `two` (P,) have exchanged those in a window (T, P)."""
    order = np.broadcast_to(np.arange(now.unit.shape[1])[:, None], (now.unit.shape[1], now.count)).copy()
    motion = np.arange(now.count)
    order[one, motion], order[two, motion] = two, one
    exchanged = np.take_along_axis(now.unit, order[None, :, None], axis=1)
    return np.where(window[:, None, None], exchanged, now.unit)


Side = Literal["before", "after", "both"]

TURN_DECADES = 2.5  # decades of the sizes of small turns
ANY_ANGLE_SHARE, SMALL_TURN_SHARE, QUARTER_TURN_SHARE = 0.3, 0.3, 0.15  # of turns; the others mirror


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
    small = 0.5 * TWO_PI * 10.0 ** (-TURN_DECADES * rng.random(count)) * rng.standard_normal(count)
    quarter = 0.25 * TWO_PI * rng.integers(4, size=count)
    turn = np.where(kind < ANY_ANGLE_SHARE, angle, np.where(kind < ANY_ANGLE_SHARE + SMALL_TURN_SHARE, small, quarter))
    mirrored = kind >= ANY_ANGLE_SHARE + SMALL_TURN_SHARE + QUARTER_TURN_SHARE
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
    good &= wrap_inside(problem, first)
    return Variables(first, now.mover, unit), good


SHIFT_REST, MOVE_START, USE_STEP = range(3)  # what makes up for a step: nothing, the first pose, another step


def retime(problem: MotionProblem, now: Variables, rng: np.random.Generator) -> tuple[Variables, Flags]:
    """The movers of a window take turns in another order; each goes the same way as before."""
    steps, count = now.mover.shape
    window, place = segment(now, rng), np.arange(steps)[:, None]
    start = np.where(window, place, steps).min(axis=0)
    order = np.argsort(np.where(window, start + 0.5 * rng.random((steps, count)), place), axis=0, kind="stable")
    mover = np.take_along_axis(now.mover, order, axis=0)
    old, new = (np.argsort(one, axis=0, kind="stable") for one in (now.mover, mover))
    source = np.empty_like(old)
    np.put_along_axis(source, new, old, axis=0)
    unit = np.take_along_axis(now.unit, source[:, None, None], axis=0)
    return Variables(now.first, mover, unit), np.ones(count, dtype=bool)


def hand_over(problem: MotionProblem, now: Variables, rng: np.random.Generator) -> tuple[Variables, Flags]:
    """A step passes from one object to another, for which it is redrawn. For each of the two, what follows shifts
    along, or the first pose makes up for it, or another of its steps does."""
    steps, count = now.mover.shape
    first, mover, unit = now.first.copy(), now.mover.copy(), now.unit.copy()
    step: Index = rng.integers(steps, size=(count,))
    motion = np.arange(count)
    giver: Index = now.mover[step, motion]
    taker: Index = rng.integers(len(problem.movable), size=(count,))
    fresh = unit_steps(rng, count).T
    good = giver != taker
    for who, by in ((giver, now.unit[step, 0, :, motion]), (taker, -fresh)):
        how, thing = rng.integers(3, size=count), problem.movable[who]
        starts = how == MOVE_START
        first[thing[starts], :, motion[starts]] += (by * problem.reach[thing])[starts]
        other, found = other_step(now, step, who, rng)
        good &= (how != USE_STEP) | found
        some = np.flatnonzero((how == USE_STEP) & found)
        unit[other[some], 0, :, some] += by[some]
        good[some] &= is_legal(unit[other[some], 0, :, some].T)
    unit[step, 0, :, motion] = fresh
    mover[step, motion] = taker
    good &= wrap_inside(problem, first)
    return Variables(first, mover, unit), good


def other_step(now: Variables, step: Index, who: Index, rng: np.random.Generator) -> tuple[Index, Flags]:
    """A step of object `who` (P,) other than `step` (P,), chosen uniformly, and whether there is one."""
    flags = now.mover == who
    flags[step, np.arange(now.count)] = False
    return choose_step(flags, rng)


Change = Callable[[MotionProblem, Variables, np.random.Generator], tuple[Variables, Flags]]

RELOCATIONS: tuple[tuple[Before, After], ...] = (
    ("first", "kept"), ("redrawn", "kept"), ("step", "kept"), ("first", "redrawn"), ("redrawn", "redrawn"),
    ("first", "step"), ("step", "step"),
)  # fmt: skip

SWING_SIDES: tuple[Side, ...] = ("before", "after", "both")
EXCHANGED_PARTS: tuple[Part, ...] = ("before", "after", "whole")

MIN_LOG_SIZE, MAX_LOG_SIZE = -2.5, 0.0  # log10 of the sizes of local changes, in units of the whole set


def _sizes(rng: np.random.Generator, count: int) -> Array:
    """Local changes, (P, 3): normal, with a size of their own each."""
    size = 10.0 ** rng.uniform(MIN_LOG_SIZE, MAX_LOG_SIZE, (count, 1))
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
    return is_legal(value.T)


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
    mover, unit = _redraw_window(problem, now, rng, segment(now, rng))
    return Variables(now.first, mover, unit), np.ones(now.count, dtype=bool)


def shift_segment(problem: MotionProblem, now: Variables, rng: np.random.Generator) -> tuple[Variables, Flags]:
    """A window of steps, each a little different."""
    window = segment(now, rng)[:, None, None]
    size = 10.0 ** rng.uniform(MIN_LOG_SIZE, MAX_LOG_SIZE, now.count)
    unit = np.where(window, now.unit + size * rng.standard_normal(now.unit.shape), now.unit)
    good: Flags = np.asarray(is_legal(unit).all(axis=(0, 1)))
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
        made += tuple(partial(relocate, before=before, after=after) for before, after in RELOCATIONS)
        made += tuple(partial(swing, side=side) for side in SWING_SIDES)
    if len(problem.movable) > 1:
        made += tuple(partial(exchange_ways, part=part) for part in EXCHANGED_PARTS)
    if problem.moves == "one" and len(problem.movable) > 1:
        made += (retime, hand_over)
    return made
