"""Changes of who moves when, where one object moves in each step."""

from __future__ import annotations

import numpy as np

from scenegen.motions.paths import segment
from scenegen.motions.problem import Index, MotionProblem
from scenegen.motions.variables import Flags, Variables, at_home, chosen, legal, unit_steps

SHIFTS, STARTS, STEPS = range(3)  # what makes up for a step that comes or goes: nothing, the first pose, another step


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
    return Variables(now.first, mover, np.take_along_axis(now.unit, source[:, None, None], axis=0)), _all(count)


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
        starts = how == STARTS
        first[thing[starts], :, motion[starts]] += (by * problem.reach[thing])[starts]
        other, found = other_step(now, step, who, rng)
        good &= (how != STEPS) | found
        some = np.flatnonzero((how == STEPS) & found)
        unit[other[some], 0, :, some] += by[some]
        good[some] &= legal(unit[other[some], 0, :, some].T)
    unit[step, 0, :, motion] = fresh
    mover[step, motion] = taker
    good &= at_home(problem, first)
    return Variables(first, mover, unit), good


def other_step(now: Variables, step: Index, who: Index, rng: np.random.Generator) -> tuple[Index, Flags]:
    """A step of object `who` (P,) other than `step` (P,), chosen uniformly, and whether there is one."""
    flags = now.mover == who
    flags[step, np.arange(now.count)] = False
    return chosen(flags, rng)


def _all(count: int) -> Flags:
    return np.ones(count, dtype=bool)
