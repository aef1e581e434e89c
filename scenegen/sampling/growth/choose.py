"""Moves between the ways of a choice: an object jumps to where another way puts it, a cluster moves as one."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scenegen.sampling.growth.attempt import attempt
from scenegen.sampling.growth.machine import Machine
from scenegen.sampling.growth.particles import Particles
from scenegen.sampling.growth.room import Room, make_room
from scenegen.sampling.growth.tally import Tally

Array = npt.NDArray[np.float64]

WAYS = 12  # ways that an object may jump between at a time
LARGEST = 40  # objects up to which clusters are looked for
SCALES = 4.0  # clusters are held together by distances down to the table's width over 2 to this power


def jump(particles: Particles, thing: int, tally: Tally | None) -> None:
    """Draw an object anew where some way of a choice that touches it would have it: a mixture over the ways' rooms,
    which do not depend on where it stands now (an independence move, Tierney 1994)."""
    machine, rng = particles.machine, particles.rng
    touch = machine.touch[thing]
    choices = [index for index in touch.ways if particles.met[index] is not None]
    if not choices:
        return
    index = choices[int(rng.integers(len(choices)))]
    numbers = np.array(touch.ways[index])
    if len(numbers) > WAYS:
        numbers = np.sort(rng.choice(numbers, WAYS, replace=False))
    room = _room(machine, thing, index, tuple(map(int, numbers)), particles.stage)
    boxes = room.boxes(particles.scenes, particles.cell, particles.chosen)
    machine.count(6 * len(room.nodes) * len(room.branches), particles.count)
    poses = boxes.draw_evenly(rng)
    before, after = boxes.even_density(particles.scenes[list(touch.rows)]), boxes.even_density(poses)
    allowed = (after > 0.0) & (rng.random(particles.count) * after < before)
    good = attempt(particles, (thing,), dict(zip(touch.rows, poses, strict=True)), allowed)
    if tally is not None:
        tally.note("jump", len(good), int(good.sum()))


def _room(machine: Machine, thing: int, choice: int, numbers: tuple[int, ...], stage: int) -> Room:
    touch = machine.touch[thing]
    ways = [machine.graph.choices[choice].ways[number] for number in numbers]
    branches = [tuple(one for one in way.clauses if thing in one.objects) for way in ways]
    return make_room(machine.problem, touch, touch.in_force(stage), (), branches)


def cluster(particles: Particles, tally: Tally | None) -> None:
    """Move all that hangs together with one object, by distances up to a random one, by one step. Taken only where
    nothing else comes so near, so that the way back starts from the same cluster."""
    machine, rng = particles.machine, particles.rng
    if not machine.graph.choices:
        return
    free = machine.graph.rows
    things = [thing for thing in particles.placed if 3 * thing in free and 3 * thing + 1 in free]
    if not 2 <= len(things) <= LARGEST:
        return
    x, y = (particles.scenes[[3 * thing + axis for thing in things]] for axis in range(2))
    width = float((machine.problem.highest - machine.problem.lowest)[3 * things[0]])
    reach = width * 2.0 ** -(1.0 + (SCALES - 1.0) * rng.random())
    near = (np.abs(x[:, None] - x) <= reach) & (np.abs(y[:, None] - y) <= reach)
    member = np.zeros((len(things), particles.count), dtype=bool)
    member[rng.integers(len(things))] = True
    for _ in range(len(things)):
        more = (near & member).any(axis=1)
        if (more == member).all():
            break
        member = more
    step = (2.0 * rng.random((2, particles.count)) - 1.0) * (0.5 * width * 2.0 ** -(SCALES * rng.random()))
    new_x, new_y = np.where(member, x + step[0], x), np.where(member, y + step[1], y)
    close = (np.abs(new_x[:, None] - new_x) <= reach) & (np.abs(new_y[:, None] - new_y) <= reach)
    allowed = ~(close & member & ~member[:, None]).any(axis=(0, 1)) & ~member.all(axis=0)
    new: dict[int, Array] = {}
    for place, thing in enumerate(things):
        new[3 * thing], new[3 * thing + 1] = new_x[place], new_y[place]
    good = attempt(particles, things, new, allowed, places=False)
    particles.fresh[things] |= member & good
    if tally is not None:
        tally.note("cluster", len(good), int(good.sum()))
