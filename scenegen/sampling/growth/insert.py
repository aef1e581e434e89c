"""Placing the next object in every scene, and what that makes of the scenes' weights."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.sampling.growth.particles import Particles
from scenegen.sampling.growth.room import Boxes

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.intp]

NUMBERS = 1 << 18  # poses tried at a time
EVENLY = 0.3  # share of the decisions that are spread evenly over all ways, whatever they promise
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
    """Place the next object: `tries` poses for every scene, uniform over its room, of which one that meets all clauses
    is taken. The weight is an unbiased estimate of the share of the object's box in which they are met. While
    `planning`, rooms that are nearly as large as the box are noted: they are not contracted from then on."""
    machine = particles.machine
    stage = particles.stage + 1
    thing = machine.order[stage]
    promised = _decide(particles, stage)
    room = machine.room(thing, stage, placing=True)
    boxes = room.boxes(particles.scenes, particles.cell, particles.chosen)
    if planning and room.nodes and boxes.volumes.sum(axis=0).mean() > WIDE:
        machine.leave_whole(thing, stage)
    machine.count(6 * len(room.nodes) * len(room.branches), particles.count)
    rows = machine.touch[thing].rows
    count = particles.count
    total = np.zeros(count)
    pose = particles.scenes[list(rows)]
    hits = attracted = 0
    chunk = max(1, min(tries, NUMBERS // count))
    for begin in range(0, tries, chunk):
        poses = boxes.draw(min(chunk, tries - begin), particles.rng)
        value, some = _score(particles, boxes, poses, stage)
        attracted += some
        hits += int(np.count_nonzero(value))
        # one of all tries so far, with a probability in proportion to its value
        edges = np.cumsum(value, axis=0)
        new = total + edges[-1]
        mark = particles.rng.random(count) * new - total
        taken = np.flatnonzero((mark >= 0.0) & (edges[-1] > 0.0))
        which = np.minimum((edges[:, taken] <= mark[taken]).sum(axis=0), len(edges) - 1)
        which = np.where(value[which, taken] > 0.0, which, value[:, taken].argmax(axis=0))
        pose[:, taken] = poses[:, which, taken]
        total = new
    particles.scenes[list(rows)] = pose
    particles.stage = stage
    particles.fresh[thing] = True
    weights = boxes.volumes.sum(axis=0) * (total / tries)
    return Placed(weights * promised * _many_ways(particles), hits, attracted, tries * count)


def _decide(particles: Particles, stage: int) -> Array:
    """Decide on a way of every choice whose first object comes now; returns the factors (P,) that the weights get for
    that, and for what decided ways still promise: see promise.py."""
    machine = particles.machine
    log_factor = np.zeros(particles.count)
    for index, (begin, end) in enumerate(zip(machine.begins, machine.ends, strict=True)):
        promise = machine.promises[index]
        if begin == stage:
            likely = np.exp(promise[:, stage] - promise[:, stage].max())
            odds = (1.0 - EVENLY) * likely / likely.sum() + EVENLY / len(likely)
            marks = (particles.rng.permutation(particles.count) + particles.rng.random()) / particles.count
            chosen = np.minimum(np.searchsorted(np.cumsum(odds), marks, side="right"), len(odds) - 1)
            particles.chosen[index] = chosen
            log_factor += promise[chosen, stage] - np.log(odds[chosen])
        elif begin < stage <= end:
            chosen = particles.chosen[index]
            log_factor += promise[chosen, stage] - promise[chosen, stage - 1]
    out: Array = np.exp(log_factor)
    return out


def _score(particles: Particles, boxes: Boxes, poses: Array, stage: int) -> tuple[Array, int]:
    """What each pose (R, M, P) counts, (M, P): 0 where a clause is not met, else 1 over the branches that hold it; and
    how many meet all clauses but the pairs."""
    machine, cell = particles.machine, particles.cell
    thing = machine.order[stage]
    touch = machine.touch[thing]
    rows: list[Array] = list(particles.scenes)
    for row, values in zip(touch.rows, poses, strict=True):
        rows[row] = values
    good = np.broadcast_to(boxes.volumes.sum(axis=0) > 0.0, poses.shape[1:]).copy()
    met = touch.meets(rows, cell, stage)
    if met is not None:
        good &= met
        machine.count(len(touch.values(len(touch.in_force(stage)), ()).steps), good.size)
    for one in touch.way_clauses_in_force(stage):
        if machine.ends[one.choice] < stage:
            continue
        mine = np.flatnonzero(particles.chosen[one.choice] == one.way)
        if len(mine):
            values = touch.values(("way", one.clause.node), [one.clause.node])
            some = [row[..., mine] if np.ndim(row) else row for row in rows] if len(mine) < len(cell) else rows
            inside = _within(values(some)[0], one.clause.low, one.clause.high, cell[mine])
            good[:, mine] &= inside
            machine.count(len(values.steps), poses.shape[1] * len(mine))
    attracted = int(np.count_nonzero(good))
    if touch.layers and attracted:
        _keep_clear(particles, poses, good, stage)
    return good / np.maximum(boxes.holding(poses), 1.0), attracted


def _keep_clear(particles: Particles, poses: Array, good: npt.NDArray[np.bool_], stage: int) -> None:
    """Take out of `good` (M, P) the poses (R, M, P) that are too near to something."""
    machine, cell, scenes = particles.machine, particles.cell, particles.scenes
    thing = machine.order[stage]
    touch = machine.touch[thing]
    place = {row % 3: values for row, values in zip(touch.rows, poses, strict=True)}
    if good.mean() > MANY:  # most are to be looked at: try by try, the scenes are read where they are
        machine.count(6 * stage, good.size)
        for which, mine in enumerate(good):
            pose = [place[axis][which] if axis in place else scenes[3 * thing + axis] for axis in range(3)]
            touch.clear((pose[0], pose[1], pose[2]), scenes, cell, stage, mine)
        return
    tried, scene = np.nonzero(good)
    machine.count(6 * stage, len(tried))
    step = max(1, NUMBERS // max(1, len(scenes)))
    for begin in range(0, len(tried), step):
        number, column = tried[begin : begin + step], scene[begin : begin + step]
        pose = [place[axis][number, column] if axis in place else scenes[3 * thing + axis, column] for axis in range(3)]
        clear = np.ones(len(column), dtype=bool)
        touch.clear((pose[0], pose[1], pose[2]), scenes, cell[column], stage, clear, column)
        good[number[~clear], column[~clear]] = False


def _within(value: Array, low: Array, high: Array, cell: Index) -> npt.NDArray[np.bool_]:
    least, most = (ends[0] if len(ends) == 1 else ends[cell] for ends in (low, high))
    inside: npt.NDArray[np.bool_] = (value >= least) & (value <= most)
    return inside


def _many_ways(particles: Particles) -> Array:
    """The factor for choices whose last object has come: a scene that meets m ways was to be had in m ways."""
    machine = particles.machine
    factor = np.ones(particles.count)
    for index, end in enumerate(machine.ends):
        if end == particles.stage:
            met = machine.held_ways(index, particles.scenes, particles.cell)
            particles.met[index] = met
            held = met.sum(axis=0)
            factor *= np.where(held > 0, 1.0 / np.maximum(held, 1), 0.0)
    return factor
