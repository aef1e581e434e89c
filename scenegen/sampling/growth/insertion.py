"""Placing the next object in every scene, and what that makes of the scenes' weights."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np

from scenegen.arrays import Array, Bool, Index
from scenegen.pose import FLAT, row_of
from scenegen.sampling.growth.constraints import ObjectConstraints, is_within
from scenegen.sampling.growth.graph import Clause, narrows_any
from scenegen.sampling.growth.model import GrowthModel, MoveTally, Particles, chance
from scenegen.sampling.growth.room import Boxes, SurfacePlaces, make_room


def placed_clauses(model: GrowthModel, choice: int, number: int, stage: int) -> tuple[Clause, ...]:
    """What a way asks of the objects placed by a stage: the whole of it once all of its objects are there."""
    way = model.graph.choices[choice].ways[number]
    if all(model.at[thing] <= stage for thing in way.whole.objects):
        return (way.whole,)
    return tuple(one for one in way.clauses if one.objects and all(model.at[thing] <= stage for thing in one.objects))


def open_ways(
    model: GrowthModel, touched: Mapping[int, Sequence[int]], rows: Sequence[Any], cell: Index, stage: int
) -> list[Bool]:
    """Which of some ways of several choices nothing placed by a stage rules out, (len(numbers), B) for each choice:
    what they share is computed once. `rows` are 3N arrays or numbers that broadcast to (B,), `cell` (B,)."""
    asked = {
        index: [placed_clauses(model, index, number, stage) for number in numbers] for index, numbers in touched.items()
    }
    key = ("all ways", stage, *((index, *numbers) for index, numbers in touched.items()))
    nodes = [one.node for each in asked.values() for clauses in each for one in clauses]
    found = iter(model.values(key, nodes)(rows, model.effort.check))
    held = []
    for index, each in asked.items():
        alone = ("ways", index, stage, *touched[index])  # work is counted as if each choice were looked at by itself
        model.count_values(model.values(alone, [one.node for clauses in each for one in clauses]), len(cell))
        held.append(_satisfied_clauses(each, found, cell))
    return held


def _satisfied_clauses(asked: Sequence[Sequence[Clause]], found: Iterator[Array], cell: Index) -> Bool:
    """Which columns meet all clauses of each entry, (len(asked), B); `found` are the values of all of them in turn."""
    held = np.ones((len(asked), len(cell)), dtype=bool)
    for row, clauses in zip(held, asked, strict=True):
        for one in clauses:
            inside = is_within(next(found), one, cell)
            if inside is not None:
                row &= inside
    return held


def choices_after(
    particles: Particles, things: Sequence[int], rows: Sequence[Any], column: Index | None = None
) -> dict[int, tuple[Bool, Array]]:
    """For every choice of which some way touches `things`: which of its ways hold, (W, B), and its chance, (B,), where
    `rows` are the rows of the scenes `column` (B,), of all where None."""
    touched = particles.touching(things)
    if not touched:
        return {}
    model, stage = particles.model, particles.stage
    cell = particles.cell if column is None else particles.cell[column]
    found: dict[int, tuple[Bool, Array]] = {}
    for index, held in zip(touched, open_ways(model, touched, rows, cell, stage), strict=True):
        known = particles.held[index]
        assert known is not None
        table = known.copy() if column is None else known[:, column]
        table[list(touched[index])] = held
        found[index] = table, chance(table, model.outlooks[index][:, stage], cell)
    return found


EVEN_BOXES_SHARE = 0.3  # share of the poses that is spread evenly over all boxes that may help, the whole room too
LEAST_CHANCE = 1e-6  # the least chance of a choice that gains are compared with
MAX_BOXES = 48  # boxes of a mixture; beyond these, ways get none of their own


@dataclass(frozen=True, slots=True, eq=False)
class NewClauses:
    """Ways `numbers` of choice `choice` which ask for `clauses` of an object that comes now, one entry for each way."""

    choice: int
    numbers: tuple[int, ...]
    clauses: tuple[tuple[Clause, ...], ...]


def new_clauses(model: GrowthModel, stage: int) -> tuple[NewClauses, ...]:
    """What choices newly ask of the object of a stage."""
    key = "newly", stage
    if key not in model.notes:
        found = []
        thing = model.order[stage]
        for index, numbers in model.constraints[thing].ways.items():
            ways = model.graph.choices[index].ways
            asked = {
                number: tuple(
                    one
                    for one in ways[number].clauses
                    if thing in one.objects and max(model.at[other] for other in one.objects) == stage
                )
                for number in numbers
            }
            asked = {number: clauses for number, clauses in asked.items() if clauses}
            if asked:
                found.append(NewClauses(index, tuple(asked), tuple(asked.values())))
        model.notes[key] = tuple(found)
    known: tuple[NewClauses, ...] = model.notes[key]
    return known


def aim_boxes(particles: Particles, boxes: Boxes, new: Sequence[NewClauses], stage: int) -> Boxes:
    """The mixture from which an object is drawn whose room under the clauses alone is `boxes`: that, and a box for each
    way that newly asks for something of the object, as contraction leaves it.

    How much a box gets depends on the scene: a way that is ruled out gets nothing, a choice that is met already needs
    nothing, and the last object that can meet a choice must. What the mixture is like decides how even the weights are;
    the weights undo it.
    """
    model, thing = particles.model, particles.model.order[stage]
    constraints = model.constraints[thing]
    new = [one for one in new if narrows_any(model.problem, chain(*one.clauses), constraints.rows)]
    if not new:
        return boxes
    each = max(1, MAX_BOXES // 2 // len(new))
    parts = [(one, place) for one in new for place in range(min(each, len(one.numbers)))]
    key = "aimed", stage
    if key not in model.rooms:
        asked = [one.clauses[place] for one, place in parts]
        model.rooms[key] = make_room(model.problem, constraints, constraints.clauses_at(stage), asked, halved=True)
    room = model.rooms[key]
    more = room.boxes(particles.scenes, particles.cell, model.effort)
    model.count(6 * len(room.nodes) * len(room.branches), particles.count)
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
    odds = (1.0 - EVEN_BOXES_SHARE) * gain / np.where(total > 0.0, total, 1.0)
    odds += EVEN_BOXES_SHARE * helps / np.maximum(helps.sum(axis=0), 1)
    of_whole = odds[0] * boxes.volumes / np.where(whole > 0.0, whole, 1.0)
    of_parts = odds[1:] * volumes / np.where(share > 0.0, share, 1.0)
    return Boxes(
        np.concatenate([boxes.low, more.low], axis=1),
        np.concatenate([boxes.width, more.width], axis=1),
        np.concatenate([boxes.volumes, more.volumes]),
        np.concatenate([of_whole, of_parts.reshape(len(room.branches), -1)]),
    )


def _gains(
    particles: Particles, new: Sequence[NewClauses], parts: Sequence[tuple[NewClauses, int]], stage: int
) -> list[Array]:
    """By how much each part raises the chance of its choice, relative to a pose that meets none of its new clauses:
    (P,) each, 0 for ways that are ruled out."""
    model, cell = particles.model, particles.cell
    found: list[Array] = []
    for one in new:
        table = model.outlooks[one.choice][:, stage]
        held = particles.held[one.choice]
        held = np.ones((len(table), particles.count), dtype=bool) if held is None else held.copy()
        mine = held[list(one.numbers)]
        held[list(one.numbers)] = False
        without = chance(held, table, cell)
        for place in range(sum(other is one for other, _ in parts)):
            ends = table[one.numbers[place]]
            good = 1.0 - (1.0 - without) * np.exp(ends[0] if len(ends) == 1 else ends[cell])
            found.append(np.where(mine[place], (good - without) / np.maximum(without, LEAST_CHANCE), 0.0))
    return found


def chances_of(
    particles: Particles, new: Sequence[NewClauses], poses: Mapping[int, Array], column: Index, stage: int
) -> Array:
    """The product of the chances of the choices that newly ask for something, (B,), for poses of the object (row ->
    (B,)) in scenes `column` (B,)."""
    model, cell = particles.model, particles.cell[column]
    rows: list[Array | float] = [0.0] * len(particles.scenes)
    out = np.ones(len(column))
    for one in new:
        key = "new", one.choice, stage
        values = model.values(key, [clause.node for clauses in one.clauses for clause in clauses])
        for row in values.rows:
            if isinstance(rows[row], float):
                rows[row] = poses[row] if row in poses else particles.scenes[row, column]
        known = particles.held[one.choice]
        table = model.outlooks[one.choice][:, stage]
        held = np.ones((len(table), len(column)), dtype=bool) if known is None else known[:, column]
        held[list(one.numbers)] &= _satisfied_clauses(one.clauses, iter(values(rows)), cell)
        model.count_values(values, len(cell))
        out *= chance(held, table, cell)
    return out


def update_choices(particles: Particles, new: Sequence[NewClauses]) -> Array:
    """Note which ways hold now that an object is placed, and the chances of the choices begun by now; by what weights
    change (P,): one over the chances so far, times the present ones of choices that ask for nothing new."""
    model, stage = particles.model, particles.stage
    asking = {one.choice: one for one in new}
    factor = np.ones(particles.count)
    for index, begin in enumerate(model.begins):
        if begin > stage:
            continue
        known = particles.held[index]
        if known is None:
            numbers = range(len(model.graph.choices[index].ways))
            (known,) = open_ways(model, {index: numbers}, list(particles.scenes), particles.cell, stage)
        elif index in asking:
            which = asking[index].numbers
            rows, known = list(particles.scenes), known.copy()
            (known[list(which)],) = open_ways(model, {index: which}, rows, particles.cell, stage)
        new_chance = chance(known, model.outlooks[index][:, stage], particles.cell)
        factor /= np.maximum(particles.chances[index], 1e-300)
        if index not in asking:
            factor *= new_chance
        particles.held[index], particles.chances[index] = known, new_chance
    return factor


MAX_POSES_AT_ONCE = 1 << 18  # poses tried at a time
DENSE_SHARE = 0.3  # share of the poses from which on each try is scored for all scenes
WIDE_SHARE = 0.6  # share of an object's box from which on its room is not worth contracting


@dataclass(frozen=True, slots=True)
class InsertionTally:
    """`weights` (P,): the share of the object's box that its scene leaves free, as estimated by the tries. `hits` is
    the number of tries that met all clauses, `attracted` of those that met all but the pairs, among `tries`."""

    weights: Array
    hits: int
    attracted: int
    tries: int


def place(particles: Particles, tries: int, *, planning: bool = False) -> InsertionTally:
    """Place the next object: `tries` poses for every scene, of which one that meets all clauses is taken. The weight is
    an unbiased estimate of the share of the object's box in which they are met, times how the chances of the choices
    change by that. While `planning`, rooms that are nearly as large as the box are noted: they are not contracted from
    then on."""
    model = particles.model
    stage = particles.stage + 1
    thing = model.order[stage]
    room = model.room(thing, stage)
    boxes = room.boxes(particles.scenes, particles.cell, model.effort)
    if planning and room.nodes and boxes.volumes.sum(axis=0).mean() > WIDE_SHARE:
        model.leave_whole(thing, stage)
    model.count(6 * len(room.nodes) * len(room.branches), particles.count)
    new = new_clauses(model, stage)
    if isinstance(boxes, Boxes):  # what stands is drawn on its surfaces, whatever its choices ask
        boxes = aim_boxes(particles, boxes, new, stage)
    rows = model.constraints[thing].rows
    count = particles.count
    total = np.zeros(count)
    pose = particles.scenes[list(rows)]
    hits = attracted = 0
    model.drawn += len(rows) * tries * count
    chunk = max(1, min(tries, MAX_POSES_AT_ONCE // count))
    for begin in range(0, tries, chunk):
        poses = boxes.draw(min(chunk, tries - begin), particles.rng)
        value, some = _score_with_choices(particles, boxes, poses, new, stage)
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
    factor = update_choices(particles, new)
    return InsertionTally(total / tries * factor, hits, attracted, tries * count)


def _score_with_choices(
    particles: Particles, boxes: Boxes | SurfacePlaces, poses: Array, new: Sequence[NewClauses], stage: int
) -> tuple[Array, int]:
    """What each pose (R, M, P) of the stage's object counts, (M, P): 0 where a clause is not met, else the chance that
    choices are met which it touches, over the density with which it was drawn; and how many meet all clauses but the
    pairs."""
    model = particles.model
    thing = model.order[stage]
    value, attracted = score_poses(particles, boxes, poses, thing, stage)
    if new and attracted:
        tried, column = np.nonzero(value)
        mine = {row: values[tried, column] for row, values in zip(model.constraints[thing].rows, poses, strict=True)}
        value[tried, column] *= chances_of(particles, new, mine, column, stage)
    return value, attracted


def score_poses(
    particles: Particles, boxes: Boxes | SurfacePlaces, poses: Array, thing: int, stage: int
) -> tuple[Array, int]:
    """What each pose (R, M, P) of an object counts, choices apart, (M, P): 0 where a clause over it and objects placed
    by a stage is not met, else one over the density with which it was drawn; and how many meet all but the pairs."""
    model, cell = particles.model, particles.cell
    constraints = model.constraints[thing]
    rows: list[Array] = list(particles.scenes)
    for row, values in zip(constraints.rows, poses, strict=True):
        rows[row] = values
    good = np.broadcast_to(boxes.volumes.sum(axis=0) > 0.0, poses.shape[1:]).copy()
    clauses = constraints.clauses_at(stage)
    if clauses:  # counted before, for it may take long
        model.count_values(constraints.values(len(clauses), [clause.node for clause in clauses]), good.size)
    met = constraints.meets(rows, cell, stage, model.effort.check)
    if met is not None:
        good &= met
    attracted = int(np.count_nonzero(good))
    if constraints.layers and attracted:
        model.count(6 * stage, good.size if good.mean() > DENSE_SHARE else attracted)
        place = [np.broadcast_to(rows[row_of(thing, axis)], good.shape) for axis in FLAT]
        _drop_near(constraints, place, particles.scenes, cell, stage, good)
    density = boxes.density(poses)
    return np.where(density > 0.0, good / np.where(density > 0.0, density, 1.0), 0.0), attracted


def _drop_near(
    constraints: ObjectConstraints, pose: Sequence[Array], scenes: Array, cell: Index, stage: int, good: Bool
) -> None:
    """Take out of `good` (M, P) the poses, x, y and heading (M, P) each, that are too near to something in `scenes`."""
    if good.mean() > DENSE_SHARE:  # most are to be looked at: try by try, the scenes are read where they are
        for which, mine in enumerate(good):
            constraints.drop_near((pose[0][which], pose[1][which], pose[2][which]), scenes, cell, stage, mine)
        return
    tried, scene = np.nonzero(good)
    step = max(1, MAX_POSES_AT_ONCE // max(1, len(scenes)))
    for begin in range(0, len(tried), step):
        number, column = tried[begin : begin + step], scene[begin : begin + step]
        clear = np.ones(len(column), dtype=bool)
        x, y, theta = (values[number, column] for values in pose)
        constraints.drop_near((x, y, theta), scenes, cell[column], stage, clear, column)
        good[number[~clear], column[~clear]] = False


def attempt(
    particles: Particles,
    things: Sequence[int],
    new: Mapping[int, Array],
    allowed: Bool | None = None,
    *,
    kind: str,
    tally: MoveTally,
) -> Bool:
    """Move `things` to the rows' new values, (P,) each, in the scenes in which all clauses in force stay met, and say
    in which that was so; `tally` counts it as a move of a `kind`. Where what begun choices promise changes, moves are
    taken in proportion to that."""
    model, cell = particles.model, particles.cell
    graph = model.graph
    good = np.ones(particles.count, dtype=bool) if allowed is None else allowed.copy()
    brought: dict[int, Array] = {}
    for row, value in new.items():
        low, high = graph.low[row], graph.high[row]
        least, most = (low[0], high[0]) if len(low) == 1 else (low[cell], high[cell])
        if model.is_circular(row):
            lowest, highest = model.problem.lowest[row], model.problem.highest[row]
            value = value - (highest - lowest) * np.floor((value - lowest) / (highest - lowest))
            value = np.where(value >= highest, lowest, value)
        good &= (value >= least) & (value <= most)
        brought[row] = value
    if len(things) == 1:
        rows, trial = list(particles.scenes), particles.scenes  # the others stay: their rows are read as they are
    else:
        trial = particles.scenes.copy()
        for row, value in brought.items():
            trial[row] = value
        rows = list(trial)
    for row, value in brought.items():
        rows[row] = value
    _drop_violations(particles, things, rows, trial, good)
    after = choices_after(particles, things, rows)
    for index, (_, chances) in after.items():
        good &= particles.rng.random(len(good)) * particles.chances[index] < chances
    for row, value in brought.items():
        np.copyto(particles.scenes[row], value, where=good)
    for index, (table, chances) in after.items():
        known = particles.held[index]
        assert known is not None
        np.copyto(known, table, where=good)
        np.copyto(particles.chances[index], chances, where=good)
    tally.note(kind, len(good), int(good.sum()))
    return good


def _drop_violations(
    particles: Particles, things: Sequence[int], rows: Sequence[Array], trial: Array, good: Bool
) -> None:
    """Take out of `good` (P,) the scenes that do not meet the clauses in force that touch `things`. `rows` are the
    tried rows, and `trial` (3N, P) the tried scenes, in which a single thing may stand as before."""
    model, cell, stage = particles.model, particles.cell, particles.stage
    for thing in things:
        constraints = model.constraints[thing]
        met = constraints.meets(rows, cell, stage, model.effort.check)
        if met is not None:
            good &= met
            model.count_values(constraints.values(len(constraints.clauses_at(stage)), ()), len(good))
    for thing in things:
        constraints = model.constraints[thing]
        if constraints.layers and good.any():
            model.count(6 * stage, len(good))
            _drop_near(constraints, [rows[row_of(thing, axis)][None] for axis in FLAT], trial, cell, stage, good[None])
