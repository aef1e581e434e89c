"""Placing the next object in every scene, and what that makes of the scenes' weights."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.pose import FLAT, axis_of, owner, row_of
from scenegen.sampling.growth.aim import New, aimed, chances_of, look_out, newly
from scenegen.sampling.growth.particles import Particles
from scenegen.sampling.growth.room import Boxes
from scenegen.sampling.growth.stand import Places

Array = npt.NDArray[np.float64]

NUMBERS = 1 << 18  # poses tried at a time
MANY = 0.3  # share of the poses from which on each try is scored for all scenes
WIDE = 0.6  # share of an object's box from which on its room is not worth contracting


@dataclass(frozen=True, slots=True)
class Placed:
    """`weights` (P,): the share of the object's box that its scene leaves free, as estimated by the tries. `hits` is
    the number of tries that met all clauses, `attracted` of those that met all but the pairs, among `tries`."""

    weights: Array
    hits: int
    attracted: int
    tries: int


def place(particles: Particles, tries: int, *, planning: bool = False) -> Placed:
    """Place the next object: `tries` poses for every scene, of which one that meets all clauses is taken. The weight is
    an unbiased estimate of the share of the object's box in which they are met, times how the chances of the choices
    change by that. While `planning`, rooms that are nearly as large as the box are noted: they are not contracted from
    then on."""
    machine = particles.machine
    stage = particles.stage + 1
    thing = machine.order[stage]
    room = machine.room(thing, stage)
    boxes = room.boxes(particles.scenes, particles.cell, machine.effort)
    if planning and room.nodes and boxes.volumes.sum(axis=0).mean() > WIDE:
        machine.leave_whole(thing, stage)
    machine.count(6 * len(room.nodes) * len(room.branches), particles.count)
    new = newly(machine, stage)
    if isinstance(boxes, Boxes):  # what stands is drawn on its surfaces, whatever its choices ask
        boxes = aimed(particles, boxes, new, stage)
    rows = machine.touch[thing].rows
    count = particles.count
    total = np.zeros(count)
    pose = particles.scenes[list(rows)]
    hits = attracted = 0
    chunk = max(1, min(tries, NUMBERS // count))
    for begin in range(0, tries, chunk):
        poses = boxes.draw(min(chunk, tries - begin), particles.rng)
        value, some = _score(particles, boxes, poses, new, stage)
        attracted += some
        hits += int(np.count_nonzero(value))
        # one of all tries so far, with a probability in proportion to its value
        edges = np.cumsum(value, axis=0)
        sum_ = total + edges[-1]
        mark = particles.rng.random(count) * sum_ - total
        taken = np.flatnonzero((mark >= 0.0) & (edges[-1] > 0.0))
        which = np.minimum((edges[:, taken] <= mark[taken]).sum(axis=0), len(edges) - 1)
        which = np.where(value[which, taken] > 0.0, which, value[:, taken].argmax(axis=0))
        pose[:, taken] = poses[:, which, taken]
        total = sum_
    particles.scenes[list(rows)] = pose
    particles.stage = stage
    factor = look_out(particles, new)
    return Placed(total / tries * factor, hits, attracted, tries * count)


def _score(
    particles: Particles, boxes: Boxes | Places, poses: Array, new: Sequence[New], stage: int
) -> tuple[Array, int]:
    """What each pose (R, M, P) of the stage's object counts, (M, P): 0 where a clause is not met, else the chance that
    choices are met which it touches, over the density with which it was drawn; and how many meet all clauses but the
    pairs."""
    machine = particles.machine
    thing = machine.order[stage]
    value, attracted = scored(particles, boxes, poses, thing, stage)
    if new and attracted:
        tried, column = np.nonzero(value)
        mine = {row: values[tried, column] for row, values in zip(machine.touch[thing].rows, poses, strict=True)}
        value[tried, column] *= chances_of(particles, new, mine, column, stage)
    return value, attracted


def scored(particles: Particles, boxes: Boxes | Places, poses: Array, thing: int, stage: int) -> tuple[Array, int]:
    """What each pose (R, M, P) of an object counts, choices apart, (M, P): 0 where a clause over it and objects placed
    by a stage is not met, else one over the density with which it was drawn; and how many meet all but the pairs."""
    machine, cell = particles.machine, particles.cell
    touch = machine.touch[thing]
    rows: list[Array] = list(particles.scenes)
    for row, values in zip(touch.rows, poses, strict=True):
        rows[row] = values
    good = np.broadcast_to(boxes.volumes.sum(axis=0) > 0.0, poses.shape[1:]).copy()
    met = touch.meets(rows, cell, stage, machine.effort.check)
    if met is not None:
        good &= met
        machine.count(len(touch.values(len(touch.in_force(stage)), ()).steps), good.size)
    attracted = int(np.count_nonzero(good))
    if touch.layers and attracted:
        _keep_clear(particles, poses, good, thing, stage)
    density = boxes.density(poses)
    return np.where(density > 0.0, good / np.where(density > 0.0, density, 1.0), 0.0), attracted


def _keep_clear(particles: Particles, poses: Array, good: npt.NDArray[np.bool_], thing: int, stage: int) -> None:
    """Take out of `good` (M, P) the poses (R, M, P) of an object that are too near to something."""
    machine, cell, scenes = particles.machine, particles.cell, particles.scenes
    touch = machine.touch[thing]
    place = {axis_of(row): values for row, values in zip(touch.rows, poses, strict=True) if owner(row) == thing}
    if good.mean() > MANY:  # most are to be looked at: try by try, the scenes are read where they are
        machine.count(6 * stage, good.size)
        for which, mine in enumerate(good):
            pose = [place[axis][which] if axis in place else scenes[row_of(thing, axis)] for axis in FLAT]
            touch.clear((pose[0], pose[1], pose[2]), scenes, cell, stage, mine)
        return
    tried, scene = np.nonzero(good)
    machine.count(6 * stage, len(tried))
    step = max(1, NUMBERS // max(1, len(scenes)))
    for begin in range(0, len(tried), step):
        number, column = tried[begin : begin + step], scene[begin : begin + step]
        pose = [place[axis][number, column] if axis in place else scenes[row_of(thing, axis), column] for axis in FLAT]
        clear = np.ones(len(column), dtype=bool)
        touch.clear((pose[0], pose[1], pose[2]), scenes, cell[column], stage, clear, column)
        good[number[~clear], column[~clear]] = False
