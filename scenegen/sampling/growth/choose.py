"""Moves between the ways of a choice: an object jumps to where another way puts it, a cluster moves as one."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scenegen.pose import PLACE, X, Y, row_of
from scenegen.sampling.growth.attempt import attempt
from scenegen.sampling.growth.graph import Clause
from scenegen.sampling.growth.machine import Machine
from scenegen.sampling.growth.particles import Particles
from scenegen.sampling.growth.room import Room, make_room
from scenegen.sampling.growth.tally import Tally

Array = npt.NDArray[np.float64]

WAYS = 12  # ways that an object may jump between at a time
LARGEST = 40  # objects up to which clusters are looked for
SCALES = 4.0  # clusters are held together by distances down to the table's width over 2 to this power
FAR = 0.5  # share of their moves that go anywhere: across what lies between two parts of the table


def jump(particles: Particles, thing: int, tally: Tally | None) -> None:
    """Redraw an object where some way of a choice that touches it would have it: a mixture over the ways' rooms,
    which do not depend on where it stands now (an independence move, Tierney 1994)."""
    machine, rng = particles.machine, particles.rng
    touch = machine.touch[thing]
    if not touch.ways:
        return
    index = list(touch.ways)[int(rng.integers(len(touch.ways)))]
    placed, switched = set(particles.placed), machine.graph.switched  # heights say little of where things are
    asked = [
        tuple(one for one in clauses if thing in one.objects and one.objects <= placed and one.node not in switched)
        for clauses in (machine.graph.choices[index].ways[number].clauses for number in touch.ways[index])
    ]
    branches = [clauses for clauses in asked if clauses]
    if not branches:
        return
    if len(branches) > WAYS:
        branches = [branches[k] for k in np.sort(rng.choice(len(branches), WAYS, replace=False))]
    room = _room(machine, thing, touch.in_force(particles.stage), branches)
    boxes = room.boxes(particles.scenes, particles.cell, machine.effort)
    machine.count(6 * len(room.nodes) * len(room.branches), particles.count)
    poses = boxes.draw_evenly(rng)
    before, after = boxes.even_density(particles.scenes[list(touch.rows)]), boxes.even_density(poses)
    allowed = (after > 0.0) & (rng.random(particles.count) * after < before)
    good = attempt(particles, (thing,), dict(zip(touch.rows, poses, strict=True)), allowed)
    if tally is not None:
        tally.note("jump", len(good), int(good.sum()))


def _room(machine: Machine, thing: int, clauses: tuple[Clause, ...], branches: list[tuple[Clause, ...]]) -> Room:
    key = "jump", thing, len(clauses), *(id(one) for branch in branches for one in branch)
    if key not in machine.rooms:
        machine.rooms[key] = make_room(machine.problem, machine.touch[thing], clauses, branches)
    return machine.rooms[key]


def cluster(particles: Particles, tally: Tally | None) -> None:
    """Move all that hangs together with one object, by distances up to a random one, by one step. Taken only where
    nothing else comes so near, so that the way back starts from the same cluster."""
    machine, rng = particles.machine, particles.rng
    if not machine.graph.choices:
        return
    free = machine.graph.rows
    things = [thing for thing in particles.placed if row_of(thing, X) in free and row_of(thing, Y) in free]
    if not 2 <= len(things) <= LARGEST:
        return
    x, y = (particles.scenes[[row_of(thing, axis) for thing in things]] for axis in PLACE)
    width = float((machine.problem.highest - machine.problem.lowest)[row_of(things[0], X)])
    reach = width * 2.0 ** -(1.0 + (SCALES - 1.0) * rng.random())
    near = (np.abs(x[:, None] - x) <= reach) & (np.abs(y[:, None] - y) <= reach)
    member = np.zeros((len(things), particles.count), dtype=bool)
    member[rng.integers(len(things))] = True
    for _ in range(len(things)):
        more = (near & member).any(axis=1)
        if (more == member).all():
            break
        member = more
    longest = width if rng.random() < FAR else 0.5 * width * 2.0 ** -(SCALES * rng.random())
    step = (2.0 * rng.random((2, particles.count)) - 1.0) * longest
    new_x, new_y = np.where(member, x + step[0], x), np.where(member, y + step[1], y)
    close = (np.abs(new_x[:, None] - new_x) <= reach) & (np.abs(new_y[:, None] - new_y) <= reach)
    allowed = ~(close & member & ~member[:, None]).any(axis=(0, 1)) & ~member.all(axis=0)
    new: dict[int, Array] = {}
    for place, thing in enumerate(things):
        new[row_of(thing, X)], new[row_of(thing, Y)] = new_x[place], new_y[place]
    good = attempt(particles, things, new, allowed)
    if tally is not None:
        tally.note("cluster", len(good), int(good.sum()))
