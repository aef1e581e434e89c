"""Changes that move objects which stand together at some moment, all by the same way.

What a spec wants of several objects at once, such as a row or a pair that travels, can hardly be changed by one object
at a time. Who stands together is read from the motion itself: an object and the nearest ones around it. The change is
made only if they would be the nearest afterwards as well, so that it is as probable as its reverse.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from scenegen.arrays import Array, Index
from scenegen.sampling.motions.problem import (
    Flags,
    MotionProblem,
    Variables,
    choose_step,
    is_legal,
    unit_steps,
    wrap_inside,
)

Before = Literal["first", "step", "redrawn"]
After = Literal["kept", "step", "redrawn"]

SHIFT_DECADES = 2.5  # decades of the sizes of local changes; large ones are more often
FIRST_SHARE, LAST_SHARE = 0.15, 0.25  # of the first and the last moment among those at which a group is looked for


@dataclass(frozen=True, slots=True)
class ObjectGroup:
    """Of each of P motions: some objects that stand together at a `moment` (P,), `members` (N, P), around `seed` (P,),
    which then is at `place` (2, P); `apart` (N, 2, P) is how far all are from it, and `reach` (P,) how far members
    are."""

    members: Flags
    moment: Index
    seed: Index
    place: Array
    apart: Array
    reach: Array

    def stays(self, by: Array) -> Flags:
        """Whether the members would still be the nearest, moved by (2, P)."""
        distance = np.hypot(*np.moveaxis(self.apart - by, 1, 0))
        nearest: Array = np.where(self.members, np.inf, distance).min(axis=0)
        stays: Flags = np.asarray(nearest > self.reach)
        return stays


def _places(problem: MotionProblem, now: Variables, moment: Index) -> Array:
    """Where objects are at a moment of each motion, (N, 2, P)."""
    before = np.arange(problem.steps)[:, None] < moment
    out = now.first[:, :2].copy()
    for slot, thing in enumerate(problem.movable.tolist()):
        one = problem.moves == "one"
        counts = np.where(before & (now.mover == slot) if one else before, problem.radius[thing], 0.0)
        for axis in range(2):
            out[thing, axis] += np.einsum("tp,tp->p", now.unit[:, 0 if one else slot, axis], counts)
    return out


def find_group(problem: MotionProblem, now: Variables, rng: np.random.Generator) -> ObjectGroup:
    """An object that can stand elsewhere, and some number of nearest ones: few more often."""
    count, steps = now.count, problem.steps
    moment, luck = rng.integers(steps + 1, size=count), rng.random(count)
    moment = np.where(luck < FIRST_SHARE, 0, np.where(luck > 1.0 - LAST_SHARE, steps, moment))
    free: Flags = np.asarray((problem.highest > problem.lowest)[:, :2].any(axis=1))
    things, motion = np.flatnonzero(free), np.arange(count)
    seed = things[rng.integers(len(things), size=count)]
    places = _places(problem, now, moment)
    place = places[seed, :, motion].T
    apart = places - place
    distance = np.where(free[:, None], np.hypot(apart[:, 0], apart[:, 1]), np.inf)
    size = np.floor((len(things) + 1.0) ** rng.random(count)).astype(np.intp)
    reach = np.sort(distance, axis=0)[size - 1, motion]
    members: Flags = np.asarray(distance <= reach)
    apart[~free] = np.inf
    return ObjectGroup(members, moment, seed, place, apart, reach)


def _sizes(rng: np.random.Generator, count: int) -> Array:
    """A normal displacement of each motion, (2, P), in sizes of a wide range."""
    size: Array = 10.0 ** (-SHIFT_DECADES * rng.random(count) ** 2) * rng.standard_normal((2, count))
    return size


def _axes(rng: np.random.Generator, count: int) -> Array:
    """1 for the axes along which a group is moved, (2, P): half of the time both, else one, because specs that line
    things up leave them free along one axis alone."""
    kind = rng.integers(4, size=count)
    return np.stack([kind != 0, kind != 1]).astype(np.float64)


def _way(problem: MotionProblem, group: ObjectGroup, rng: np.random.Generator, before: Before, after: After) -> Array:
    """By how much a group is moved, (2, P)."""
    low, width = problem.lowest[group.seed, :2].T, (problem.highest - problem.lowest)[group.seed, :2].T
    count = len(group.seed)
    if "step" in (before, after):
        by = _sizes(rng, count) * np.where(problem.radius > 0.0, problem.radius, width.max())[group.seed]
    else:
        by, kind = 0.5 * width * _sizes(rng, count), rng.random(count)
        inside = ((group.place >= low) & (group.place <= low + width)).all(axis=0)  # else there were no way back
        anywhere = np.where(inside, low + width * rng.random((2, count)) - group.place, 0.0)
        by = np.where(kind < 0.4, anywhere, by)
        if "redrawn" in (before, after):
            by = np.where(kind > 0.8, 0.0, by)
    by *= _axes(rng, count)
    fixed = (problem.highest <= problem.lowest)[:, :2]
    held = np.asarray(group.members[:, None] & fixed[..., None]).any(axis=0)
    return np.where(held, 0.0, by)


def relocate(
    problem: MotionProblem, now: Variables, rng: np.random.Generator, *, before: Before, after: After
) -> tuple[Variables, Flags]:
    """Objects that stand together at a moment are moved by the same way. Their motion before is shifted along
    (`first`), or one of its steps makes up for it, or its beginning is redrawn. Their motion after is shifted along
    (`kept`), or a step makes up for it, or its end is redrawn."""
    group = find_group(problem, now, rng)
    by = _way(problem, group, rng, before, after)
    good = group.stays(by)
    first, unit = now.first.copy(), now.unit.copy()
    shifted = group.members
    if before == "step":
        done, fine = _by_steps(problem, now, group, unit, by, rng, early=True)
        shifted, good = shifted & ~done, good & fine
    if after == "step":
        good &= _by_steps(problem, now, group, unit, -by, rng, early=False)[1]
    first[:, :2] += np.where(shifted[:, None], by, 0.0)
    if "redrawn" in (before, after):
        first -= _redraw(problem, now, group, unit, rng, before == "redrawn", after == "redrawn")
    good &= wrap_inside(problem, first)
    return Variables(first, now.mover, unit), good


def _by_steps(
    problem: MotionProblem,
    now: Variables,
    group: ObjectGroup,
    unit: Array,
    by: Array,
    rng: np.random.Generator,
    early: bool,
) -> tuple[Flags, Flags]:
    """Adds `by` to one step of each member, before the moment or after it. Returns which had one (N, P), and the
    motions in which all changed steps are legal."""
    steps, count = now.mover.shape
    place = np.arange(steps)[:, None]
    side = place < group.moment if early else place >= group.moment
    done, good = np.zeros(group.members.shape, dtype=bool), np.ones(count, dtype=bool)
    one = problem.moves == "one"
    shared = None if one else choose_step(side, rng)
    for slot, thing in enumerate(problem.movable.tolist()):
        who = np.flatnonzero(group.members[thing])
        if not len(who) or problem.radius[thing] == 0.0:
            continue
        if shared is None:
            step, found = choose_step(side[:, who] & (now.mover[:, who] == slot), rng)
        else:  # at the same time, so that they stay together
            step, found = shared[0][who], shared[1][who]
        step, who = step[found], who[found]
        where = 0 if one else slot
        for axis in range(2):
            unit[step, where, axis, who] += by[axis, who] / problem.radius[thing]
        good[who] &= is_legal(unit[step, where, :, who].T)
        done[thing, who] = True
    return done, good


def _redraw(
    problem: MotionProblem,
    now: Variables,
    group: ObjectGroup,
    unit: Array,
    rng: np.random.Generator,
    early: bool,
    late: bool,
) -> Array:
    """Redraws the members' steps until a time before the moment, and from a time after it. Returns how much farther
    they go before, (N, 3, P)."""
    steps, count = now.mover.shape
    until = _random_part(rng, group.moment) if early else np.zeros_like(group.moment)
    since = steps - (_random_part(rng, steps - group.moment) if late else np.zeros_like(group.moment))
    place, one = np.arange(steps)[:, None], problem.moves == "one"
    window: Flags = np.asarray((place < until) | (place >= since))
    if one:
        window = (window & group.members[problem.movable[now.mover], np.arange(count)])[:, None]
    else:
        window = window[:, None] & group.members[problem.movable]
    step, slot, motion = np.nonzero(window)
    fresh = unit_steps(rng, len(step)).T
    more = np.where((step < group.moment[motion])[:, None], fresh - unit[step, slot, :, motion], 0.0)
    unit[step, slot, :, motion] = fresh
    thing = problem.movable[now.mover[step, motion] if one else slot]
    more *= problem.reach[thing]
    where = thing * count + motion
    out = [np.bincount(where, more[:, axis], len(problem.names) * count).reshape(-1, count) for axis in range(3)]
    ways: Array = np.stack(out, axis=1).astype(np.float64)
    return ways


def _random_part(rng: np.random.Generator, most: Index) -> Index:
    """All of a number, half of the time; else any number up to it."""
    all_, some = rng.random(most.shape) < 0.5, np.floor(rng.random(most.shape) * (most + 1)).astype(np.intp)
    return np.where(all_, most, some)
