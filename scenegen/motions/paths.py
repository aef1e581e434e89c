"""Changes of the ways that objects go: redrawn, reflected or gone backwards, with ends that stay."""

from __future__ import annotations

import numpy as np

from scenegen.motions.problem import Array, Index, MotionProblem
from scenegen.motions.variables import Flags, Variables, at_home, legal, unit_steps
from scenegen.pose import X, Y


def segment(now: Variables, rng: np.random.Generator) -> Flags:
    """A window of steps for each motion, (T, P): any length, short ones more often."""
    steps, count = now.mover.shape
    length = np.floor(float(steps) ** rng.random(count)).astype(np.intp)
    start = rng.integers(steps, size=(count,))
    place = np.arange(steps)[:, None]
    flags: Flags = (place >= start) & (place < start + length)
    return flags


def _own(problem: MotionProblem, now: Variables, rng: np.random.Generator) -> tuple[Index, Flags]:
    """An object that can move (P,), by its slot, and its own steps (T, M, P)."""
    slots = np.arange(len(problem.movable))
    slot: Index = rng.integers(len(slots), size=now.count)
    if problem.moves == "one":
        return slot, (now.mover == slot)[:, None]
    return slot, np.broadcast_to(slots[:, None] == slot, now.unit[:, :, 0].shape)


def redraw_beginning(problem: MotionProblem, now: Variables, rng: np.random.Generator) -> tuple[Variables, Flags]:
    """A window of steps is redrawn, with its movers; first poses make up for it, so that all later ones stay."""
    steps, width, _, count = now.unit.shape
    until = rng.integers(1, steps + 1, size=count)
    whole = rng.random(count) < 0.5
    window = np.where(whole, np.arange(steps)[:, None] < until, segment(now, rng))
    unit = np.where(window[:, None, None], unit_steps(rng, steps, width, count), now.unit)
    mover = now.mover
    if problem.moves == "one":
        mover = np.where(window, rng.integers(len(problem.movable), size=mover.shape), mover)
    first = now.first + ways(problem, now.mover, now.unit, window) - ways(problem, mover, unit, window)
    good = at_home(problem, first)
    return Variables(first, mover, unit), good


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
    _, own = _own(problem, now, rng)
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
    fine = legal((total - fresh).T)
    unit = rows.copy()
    unit[first[fine], :, motion[fine]] = fresh[fine]
    unit[second[fine], :, motion[fine]] = (total - fresh)[fine]
    changed = np.zeros(count, dtype=bool)
    changed[motion[fine]] = True
    return Variables(now.first, now.mover, unit.reshape(now.unit.shape)), changed


def reflect(problem: MotionProblem, now: Variables, rng: np.random.Generator) -> tuple[Variables, Flags]:
    """An object's way in a window is reflected in the line through its ends."""
    window = (_own(problem, now, rng)[1] & segment(now, rng)[:, None])[:, :, None]
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
    slot, own = _own(problem, now, rng)
    mine = own.any(axis=1)
    thing, motion = problem.movable[slot], np.arange(now.count)
    total = np.where(own[:, :, None], now.unit, 0.0).sum(axis=(0, 1)).T * problem.reach[thing]
    rank = np.cumsum(mine, axis=0)  # the k-th of its steps becomes the last but k
    order = np.argsort(~mine, axis=0, kind="stable")
    source = np.take_along_axis(order, np.where(mine, rank[-1] - rank, 0), axis=0)
    unit = np.where(own[:, :, None], -np.take_along_axis(now.unit, source[:, None, None], axis=0), now.unit)
    first = now.first.copy()
    first[thing, :, motion] += total
    good = at_home(problem, first)
    return Variables(first, now.mover, unit), good
