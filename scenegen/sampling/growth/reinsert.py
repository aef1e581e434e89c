"""Moves that lift something off the table and put it down elsewhere: several places are tried in every scene at once.

One try finds a free place in one scene of fifty on a full table, so an object would hardly ever leave the hole in which
it was placed. The tries of a scene are drawn independently of where the object stands, and one of those that meet all
clauses is taken (multiple-try Metropolis with independent proposals, Liu et al. 2000): with equal weights always, else
with the probability that keeps the distribution. Dozens of tries in numpy cost little more than one.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from scenegen.pose import FLAT, PLACE, row_of
from scenegen.sampling.growth.insert import NUMBERS, scored
from scenegen.sampling.growth.outlook import chance
from scenegen.sampling.growth.particles import Particles
from scenegen.sampling.growth.room import Room
from scenegen.sampling.growth.stand import Standing
from scenegen.sampling.growth.tally import Tally
from scenegen.sampling.growth.ways import held_of_all

Array = npt.NDArray[np.float64]
Bool = npt.NDArray[np.bool_]
Index = npt.NDArray[np.intp]


def reinsert(particles: Particles, thing: int, room: Room | Standing, tries: int, tally: Tally | None) -> None:
    """Move one object to one of `tries` poses in its room."""
    machine, rng, stage = particles.machine, particles.rng, particles.stage
    rows = list(machine.touch[thing].rows)
    boxes = room.boxes(particles.scenes, particles.cell, machine.effort)
    machine.count(6 * len(room.nodes) * len(room.branches), particles.count)
    poses = boxes.draw(tries, rng)
    value, _ = scored(particles, boxes, poses, thing, stage)
    hits = int(np.count_nonzero(value))
    _note(tally, "redraw", thing, value.size, hits)
    if not hits:
        return
    density = boxes.density(particles.scenes[rows][:, None])[0]
    own = np.where(density > 0.0, 1.0 / np.where(density > 0.0, density, 1.0), np.inf)
    tried, column = np.nonzero(value)
    fresh = dict(zip(rows, poses[:, tried, column], strict=True))
    value[tried, column] *= _chances(particles, (thing,), fresh, column)
    own *= _chances_now(particles, (thing,))
    which, taken = _choose(value, own, rng)
    _set(particles, (thing,), {row: poses[place, which, taken] for place, row in enumerate(rows)}, taken)


def relocate(particles: Particles, group: Sequence[int], tries: int, tally: Tally | None) -> None:
    """Move objects that hang together to one of `tries` places, as they stand to each other."""
    machine, rng = particles.machine, particles.rng
    graph, cell, count = machine.graph, particles.cell, particles.count
    moved: dict[int, Array] = {}
    good = np.ones((tries, count), dtype=bool)
    for axis in PLACE:
        along = [row_of(one, axis) for one in group if row_of(one, axis) in machine.touch[one].rows]
        if not along:
            continue
        low, high = graph.low[along][:, cell], graph.high[along][:, cell]
        step = low[0] + rng.random((tries, count)) * (high[0] - low[0]) - particles.scenes[along[0]]
        for row, least, most in zip(along, low, high, strict=True):
            value = particles.scenes[row] + step
            good &= (value >= least) & (value <= most)
            moved[row] = value
    _keep(particles, group, moved, good)
    hits = int(np.count_nonzero(good))
    _note(tally, "relocate", group[0], good.size, hits)
    if not hits:
        return
    value = good.astype(np.float64)
    tried, column = np.nonzero(good)
    fresh = {row: values[tried, column] for row, values in moved.items()}
    value[tried, column] *= _chances(particles, group, fresh, column)
    which, taken = _choose(value, _chances_now(particles, group), rng)
    _set(particles, group, {row: values[which, taken] for row, values in moved.items()}, taken)


def _keep(particles: Particles, group: Sequence[int], moved: dict[int, Array], good: Bool) -> None:
    """Take out of `good` (M, P) the places of a group, `moved` row -> (M, P), at which some clause is not met. What
    keeps its members apart stays met, for they move as one."""
    machine, cell, scenes, stage = particles.machine, particles.cell, particles.scenes, particles.stage
    tried, scene = np.nonzero(good)
    size = max(1, NUMBERS // max(1, len(scenes)))
    for begin in range(0, len(tried), size):
        number, column = tried[begin : begin + size], scene[begin : begin + size]
        for thing in group:
            touch = machine.touch[thing]
            rows = [moved[row][number, column] if row in moved else scenes[row, column] for row in range(len(scenes))]
            there = cell[column]
            met = touch.meets(rows, there, stage, machine.effort.check)
            left = np.ones(len(column), dtype=bool) if met is None else met.copy()
            machine.count(6 * stage, len(column))
            if met is not None:
                machine.count(len(touch.values(len(touch.in_force(stage)), ()).steps), len(column))
            if touch.layers and left.any():
                x, y, theta = (rows[row_of(thing, axis)] for axis in FLAT)
                touch.clear((x, y, theta), scenes, there, stage, left, column, group)
            good[number[~left], column[~left]] = False
            number, column = number[left], column[left]
            if not len(number):
                break


def _choose(value: Array, own: Array, rng: np.random.Generator) -> tuple[Index, Index]:
    """Which try is taken, and in which scenes one is: `value` (M, P) of the tries, `own` (P,) of how things are."""
    edges = np.cumsum(value, axis=0)
    total = edges[-1]
    which = np.minimum((edges <= rng.random(len(own)) * total).sum(axis=0), len(value) - 1)
    picked = value[which, np.arange(len(own))]
    taken = np.flatnonzero((picked > 0.0) & (rng.random(len(own)) * (total - picked + own) < total))
    return which[taken], taken


def _note(tally: Tally | None, kind: str, thing: int, tried: int, free: int) -> None:
    if tally is not None:
        tally.note(kind, tried, free)
        tally.note(f"{kind} of {thing}", tried, free)


def _tables(
    particles: Particles, things: Sequence[int], fresh: dict[int, Array], column: Index
) -> dict[int, tuple[Bool, Array]]:
    """For every choice that touches some of the things: which of its ways hold, (W, B), and its chance, (B,), where
    they stand at rows `fresh` (B,) in scenes `column` (B,)."""
    touched = particles.touching(things)
    if not touched or not len(column):
        return {}
    machine, cell, stage = particles.machine, particles.cell[column], particles.stage
    rows = [fresh[row] if row in fresh else particles.scenes[row, column] for row in range(len(particles.scenes))]
    found = {}
    for index, held in zip(touched, held_of_all(machine, touched, rows, cell, stage), strict=True):
        known = particles.held[index]
        assert known is not None
        table = known[:, column]
        table[list(touched[index])] = held
        found[index] = table, chance(table, machine.outlooks[index][:, stage], cell)
    return found


def _chances(particles: Particles, things: Sequence[int], fresh: dict[int, Array], column: Index) -> Array:
    """The product of the chances of choices, (B,), where `things` stand at rows `fresh` (B,) in scenes `column`."""
    out = np.ones(len(column))
    for _, chances in _tables(particles, things, fresh, column).values():
        out *= chances
    return out


def _chances_now(particles: Particles, things: Sequence[int]) -> Array:
    """The same of the scenes as they are, (P,)."""
    out = np.ones(particles.count)
    for index in particles.touching(things):
        out *= particles.chances[index]
    return out


def _set(particles: Particles, things: Sequence[int], fresh: dict[int, Array], column: Index) -> None:
    """Put `things` at rows `fresh` (B,) in scenes `column`, and note what that makes of choices."""
    tables = _tables(particles, things, fresh, column)
    for row, values in fresh.items():
        particles.scenes[row, column] = values
    for index, (table, chances) in tables.items():
        known = particles.held[index]
        assert known is not None
        known[:, column] = table
        particles.chances[index, column] = chances
