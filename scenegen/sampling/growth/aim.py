"""Placing an object with an eye to the choices: some of its poses are drawn where they help a way to hold.

Poses come from a mixture: the object's room under the clauses that every scene meets, and a box for each way that
newly asks for something of the object, as contraction leaves it. How much a box gets depends on the scene: a way that
is ruled out gets nothing, a choice that is met already needs nothing, and the last object that can meet a choice must.
What the mixture is like decides how even the weights are; the weights undo it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.sampling.growth.graph import Clause
from scenegen.sampling.growth.machine import Machine
from scenegen.sampling.growth.outlook import chance
from scenegen.sampling.growth.particles import Particles
from scenegen.sampling.growth.room import Boxes, make_room
from scenegen.sampling.growth.ways import held_ways, met

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.intp]

EVENLY = 0.3  # share of the poses that is spread evenly over all boxes that may help, the whole room among them
TINY = 1e-6
MOST = 48  # boxes of a mixture; beyond these, ways get none of their own


@dataclass(frozen=True, slots=True, eq=False)
class New:
    """Ways `numbers` of choice `choice` which ask for `clauses` of an object that comes now, one entry for each way."""

    choice: int
    numbers: tuple[int, ...]
    clauses: tuple[tuple[Clause, ...], ...]


def newly(machine: Machine, stage: int) -> tuple[New, ...]:
    """What choices newly ask of the object of a stage."""
    key = "newly", stage
    if key not in machine.notes:
        found = []
        thing = machine.order[stage]
        for index, numbers in machine.touch[thing].ways.items():
            ways = machine.graph.choices[index].ways
            asked = {
                number: tuple(
                    one
                    for one in ways[number].clauses
                    if thing in one.objects and max(machine.at[other] for other in one.objects) == stage
                )
                for number in numbers
            }
            asked = {number: clauses for number, clauses in asked.items() if clauses}
            if asked:
                found.append(New(index, tuple(asked), tuple(asked.values())))
        machine.notes[key] = tuple(found)
    known: tuple[New, ...] = machine.notes[key]
    return known


def aimed(particles: Particles, boxes: Boxes, new: Sequence[New], stage: int) -> Boxes:
    """The mixture for an object whose room under the clauses alone is `boxes`."""
    if not new:
        return boxes
    machine, thing = particles.machine, particles.machine.order[stage]
    touch = machine.touch[thing]
    each = max(1, MOST // 2 // len(new))
    parts = [(one, place) for one in new for place in range(min(each, len(one.numbers)))]
    key = "aimed", stage
    if key not in machine.rooms:
        asked = [one.clauses[place] for one, place in parts]
        machine.rooms[key] = make_room(machine.problem, touch, touch.in_force(stage), asked, halved=True)
    room = machine.rooms[key]
    more = room.boxes(particles.scenes, particles.cell, machine.effort)
    machine.count(6 * len(room.nodes) * len(room.branches), particles.count)
    halves = len(room.branches) // len(parts)
    whole = boxes.volumes.sum(axis=0)
    volumes = more.volumes.reshape(halves, len(parts), -1)
    share = volumes.sum(axis=0)
    gain = np.zeros((1 + len(parts), particles.count))
    gain[0] = whole > 0.0
    for row, ratio in zip(gain[1:], _gains(particles, new, parts, stage), strict=True):
        row[:] = ratio
    gain[1:] *= share / np.where(whole > 0.0, whole, 1.0)
    total = gain.sum(axis=0)
    helps = gain > 0.0
    odds = (1.0 - EVENLY) * gain / np.where(total > 0.0, total, 1.0)
    odds += EVENLY * helps / np.maximum(helps.sum(axis=0), 1)
    of_whole = odds[0] * boxes.volumes / np.where(whole > 0.0, whole, 1.0)
    of_parts = odds[1:] * volumes / np.where(share > 0.0, share, 1.0)
    return Boxes(
        np.concatenate([boxes.low, more.low], axis=1),
        np.concatenate([boxes.width, more.width], axis=1),
        np.concatenate([boxes.volumes, more.volumes]),
        np.concatenate([of_whole, of_parts.reshape(len(room.branches), -1)]),
    )


def _gains(particles: Particles, new: Sequence[New], parts: Sequence[tuple[New, int]], stage: int) -> list[Array]:
    """By how much each part raises the chance of its choice, relative to a pose that meets none of its new clauses:
    (P,) each, 0 for ways that are ruled out."""
    machine, cell = particles.machine, particles.cell
    found: list[Array] = []
    for one in new:
        table = machine.outlooks[one.choice][:, stage]
        held = particles.held[one.choice]
        held = np.ones((len(table), particles.count), dtype=bool) if held is None else held.copy()
        mine = held[list(one.numbers)]
        held[list(one.numbers)] = False
        without = chance(held, table, cell)
        for place in range(sum(other is one for other, _ in parts)):
            ends = table[one.numbers[place]]
            good = 1.0 - (1.0 - without) * np.exp(ends[0] if len(ends) == 1 else ends[cell])
            found.append(np.where(mine[place], (good - without) / np.maximum(without, TINY), 0.0))
    return found


def chances_of(
    particles: Particles, new: Sequence[New], poses: Mapping[int, Array], column: Index, stage: int
) -> Array:
    """The product of the chances of the choices that newly ask for something, (B,), for poses of the object (row ->
    (B,)) in scenes `column` (B,)."""
    machine, cell = particles.machine, particles.cell[column]
    rows: list[Array | float] = [0.0] * len(particles.scenes)
    out = np.ones(len(column))
    for one in new:
        key = "new", one.choice, stage
        values = machine.values(key, [clause.node for clauses in one.clauses for clause in clauses])
        for row in values.rows:
            if isinstance(rows[row], float):
                rows[row] = poses[row] if row in poses else particles.scenes[row, column]
        known = particles.held[one.choice]
        table = machine.outlooks[one.choice][:, stage]
        held = np.ones((len(table), len(column)), dtype=bool) if known is None else known[:, column]
        held[list(one.numbers)] &= met(machine, key, one.clauses, rows, cell)
        out *= chance(held, table, cell)
    return out


def look_out(particles: Particles, new: Sequence[New]) -> Array:
    """Note which ways hold now that an object is placed, and the chances of the choices begun by now; by what weights
    change (P,): one over the chances so far, times the present ones of choices that ask for nothing new."""
    machine, stage = particles.machine, particles.stage
    asking = {one.choice: one for one in new}
    factor = np.ones(particles.count)
    for index, begin in enumerate(machine.begins):
        if begin > stage:
            continue
        known = particles.held[index]
        if known is None:
            numbers = range(len(machine.graph.choices[index].ways))
            known = held_ways(machine, index, numbers, list(particles.scenes), particles.cell, stage)
        elif index in asking:
            which = asking[index].numbers
            rows, known = list(particles.scenes), known.copy()
            known[list(which)] = held_ways(machine, index, which, rows, particles.cell, stage)
        new_chance = chance(known, machine.outlooks[index][:, stage], particles.cell)
        factor /= np.maximum(particles.chances[index], 1e-300)
        if index not in asking:
            factor *= new_chance
        particles.held[index], particles.chances[index] = known, new_chance
    return factor
