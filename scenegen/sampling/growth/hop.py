"""Hops between the surfaces of a choice: an object and the switch that says what it stands on change together.

Where surfaces lie apart, such as the slots of a rack, neither can change alone: the object is on one surface, and the
switch says which.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.lang.spec import CheckedSpec, Choice
from scenegen.pose import FLAT, THETA, X, Y, row_of
from scenegen.primitives import Circle, Footprint, Polygon
from scenegen.primitives.outline import measures
from scenegen.sampling.growth.attempt import attempt
from scenegen.sampling.growth.machine import Machine
from scenegen.sampling.growth.particles import Particles
from scenegen.sampling.growth.tally import Tally

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class Hop:
    """An object with a choice, and what always stands on it: `riders`. `boxes` (K, 4) hold its centre on each surface:
    x, y of the middle and half the sizes, in the surface's frame."""

    thing: int
    choice: Choice
    riders: tuple[int, ...]
    boxes: tuple[tuple[float, float, float, float], ...]

    @property
    def carriers(self) -> frozenset[int]:
        return frozenset(one.carrier for one in self.choice.options if one.carrier is not None)


def hops(machine: Machine) -> tuple[Hop, ...]:
    """The hops of a request, worked out once."""
    if "hops" not in machine.notes:
        machine.notes["hops"] = _hops(machine.problem.spec, machine.at)
    known: tuple[Hop, ...] = machine.notes["hops"]
    return known


def _hops(spec: CheckedSpec, free: Collection[int]) -> tuple[Hop, ...]:
    """Those between surfaces that lie apart, of objects that are `free` with their switches."""
    found = []
    for thing, choice in sorted(spec.choices.items()):
        if thing not in free or choice.switch not in free:
            continue
        if len({(one.carrier, one.outline, one.pose) for one in choice.options}) == 1:
            continue  # boards one above the other: the switch can change alone
        riders = [thing]
        for one in riders:
            riders.extend(upper for upper, under in sorted(spec.supports.items()) if under.carrier == one)
        upper = spec.shapes[thing].footprint
        boxes = tuple(_box(upper if one.walled else None, one.outline) for one in choice.options)
        found.append(Hop(thing, choice, tuple(riders[1:]), boxes))
    return tuple(found)


def hop(particles: Particles, one: Hop, tally: Tally | None) -> None:
    """Put an object on another surface, or elsewhere on its own: an independence move over the surfaces' boxes. Its
    heading is drawn as well, or stays the same against what carries it, and what stands on it moves along."""
    machine, rng, count, scenes = particles.machine, particles.rng, particles.count, particles.scenes
    graph, column = machine.graph, np.arange(particles.count)
    switch, (x, y, theta) = row_of(one.choice.switch, X), (row_of(one.thing, axis) for axis in FLAT)
    cell = particles.cell if graph.low.shape[1] > 1 else np.zeros(count, dtype=np.intp)

    def anywhere(row: int) -> Array:
        low, high = graph.low[row][cell], graph.high[row][cell]
        out: Array = low + rng.random(count) * (high - low)
        return out

    number = anywhere(switch)
    before, after = _option(one.choice, scenes[switch]), _option(one.choice, number)
    frames, boxes = _frames(particles, one), np.array(one.boxes)
    middle, half = boxes[:, :2], boxes[:, 2:]
    place = middle[after].T + (2.0 * rng.random((2, count)) - 1.0) * half[after].T
    new_x, new_y = _turned(place[0], place[1], frames[2][after, column])
    old = _turned(scenes[x] - frames[0][before, column], scenes[y] - frames[1][before, column], -frames[2][before, column])
    area = half.prod(axis=1)
    allowed = rng.random(count) * area[before] < area[after]
    allowed &= (np.abs(np.array(old) - middle[before].T) <= half[before].T).all(axis=0)
    new = {switch: number, x: new_x + frames[0][after, column], y: new_y + frames[1][after, column]}
    turn = np.zeros(count)
    if theta in graph.rows:
        new[theta] = anywhere(theta)
        if rng.random() < 0.5:
            new[theta] = scenes[theta] + frames[2][after, column] - frames[2][before, column]
        turn = new[theta] - scenes[theta]
    for rider in one.riders:
        away = _turned(scenes[row_of(rider, X)] - scenes[x], scenes[row_of(rider, Y)] - scenes[y], turn)
        moved = (new[x] + away[0], new[y] + away[1], scenes[row_of(rider, THETA)] + turn)
        new |= {row: value for axis, value in zip(FLAT, moved, strict=True) if (row := row_of(rider, axis)) in graph.rows}
    good = attempt(particles, (one.thing, one.choice.switch, *one.riders), new, allowed)
    if tally is not None:
        tally.note("hop", len(good), int(good.sum()))


def ready(particles: Particles, one: Hop) -> bool:
    """Whether all is there that a hop moves, and all that it can go to."""
    machine = particles.machine
    asked = {one.thing, one.choice.switch, *one.riders} | (one.carriers & machine.at.keys())
    return all(machine.at.get(thing, particles.stage + 1) <= particles.stage for thing in asked)


def _frames(particles: Particles, one: Hop) -> tuple[Array, Array, Array]:
    """x, y and heading of what carries the object on each surface, (K, P) each."""
    count = particles.count
    poses = [
        [np.full(count, number) for number in under.pose]
        if under.carrier is None
        else [particles.scenes[row_of(under.carrier, axis)] for axis in FLAT]
        for under in one.choice.options
    ]
    x, y, theta = (np.array([pose[axis] for pose in poses]) for axis in range(3))
    return x, y, theta


def _option(choice: Choice, number: Array) -> Index:
    return np.minimum(np.searchsorted(np.array(choice.ends), number), len(choice.ends) - 1)


def _turned(x: Array, y: Array, by: Array) -> tuple[Array, Array]:
    cos, sin = np.cos(by), np.sin(by)
    return cos * x - sin * y, sin * x + cos * y


def _box(upper: Footprint | None, outline: Footprint) -> tuple[float, float, float, float]:
    """The box of the centres on a surface: as far from its border as the circle inside the footprint `upper`."""
    inner = 0.0 if upper is None else max(0.0, measures(upper).inner)
    if isinstance(outline, Polygon):
        xs, ys = zip(*outline.vertices, strict=True)
    else:
        length, width = (2.0 * outline.radius,) * 2 if isinstance(outline, Circle) else outline.extent
        xs, ys = (-length / 2.0, length / 2.0), (-width / 2.0, width / 2.0)
    middle = ((min(xs) + max(xs)) / 2.0, (min(ys) + max(ys)) / 2.0)
    return *middle, max((max(xs) - min(xs)) / 2.0 - inner, 0.0), max((max(ys) - min(ys)) / 2.0 - inner, 0.0)
