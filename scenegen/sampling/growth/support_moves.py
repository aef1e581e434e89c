"""Moves of what stands on what, where supports are choices: hops from surface to surface, and carrying.

An object and the switch that says what it stands on change together: where surfaces lie apart, such as the slots of a
rack, neither can change alone. What stands on an object that moves, in the scene at hand, moves along.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from scenegen.arrays import Array, Bool, Index
from scenegen.geometry import Circle, Footprint, Polygon
from scenegen.geometry.footprint import measures
from scenegen.lang.spec import CheckedSpec, SurfaceChoice, options_of
from scenegen.pose import FLAT, PLACE, THETA, X, Y, row_of
from scenegen.sampling.growth.insertion import attempt
from scenegen.sampling.growth.model import GrowthModel, MoveTally, Particles


@dataclass(frozen=True, slots=True)
class SupportMove:
    """An object that a choice puts somewhere, or that carries what a choice puts there. `choice` is its own, where its
    surfaces lie apart; `boxes` (K, 4) then hold its centre on each of them: x, y of the middle and half the sizes, in
    the surface's frame. `riders` are all that can come to stand on it, what carries before what is carried."""

    thing: int
    riders: tuple[int, ...]
    choice: SurfaceChoice | None = None
    boxes: tuple[tuple[float, float, float, float], ...] = ()


def support_moves(model: GrowthModel) -> tuple[SupportMove, ...]:
    """The hops of a request, worked out once."""
    if "hops" not in model.notes:
        model.notes["hops"] = _find_support_moves(model.problem.spec, model.at, model.graph.rows)
    known: tuple[SupportMove, ...] = model.notes["hops"]
    return known


def _find_support_moves(spec: CheckedSpec, free: Collection[int], rows: Collection[int]) -> tuple[SupportMove, ...]:
    options = [under for choice in spec.choices.values() for under in choice.options]
    carriers = {under.carrier for under in options if under.carrier is not None}
    found = []
    for thing in sorted(spec.choices.keys() | carriers):
        if not all(row_of(thing, axis) in rows for axis in PLACE):
            continue
        choice = spec.choices.get(thing)
        if choice is not None and choice.switch not in free:
            continue
        if choice is not None and len({(one.carrier, one.outline, one.pose) for one in choice.options}) == 1:
            choice = None  # boards one above the other: the switch can change alone
        riders = _riders(spec, thing)
        if choice is None and not any(rider in spec.choices for rider in riders):
            continue
        upper = spec.shapes[thing].footprint
        own = () if choice is None else choice.options
        boxes = tuple(_box(upper if one.walled else None, one.outline) for one in own)
        found.append(SupportMove(thing, riders, choice, boxes))
    return tuple(found)


def _riders(spec: CheckedSpec, thing: int) -> tuple[int, ...]:
    """What can come to stand on an object, or on what stands on it."""
    waiting = sorted(spec.supports.keys() | spec.choices.keys())
    under = {
        one: {option.carrier for option in options_of(one, spec.supports, spec.choices)} & {thing, *waiting}
        for one in waiting
    }
    riders: list[int] = []
    done = {one for one in (thing, *waiting) if one == thing or not under[one]}
    reached = {thing}
    while ready := [one for one in waiting if one not in done and under[one] <= done]:
        done.update(ready)
        riders += [one for one in ready if under[one] & reached]
        reached.update(riders)
    return tuple(riders)


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


FINEST_STEP = 9  # step lengths go down to the box's over 2 to this power
KEEP_HEADING_SHARE = 0.5  # share of the hops in which an object keeps its heading against what carries it


def is_ready(particles: Particles, one: SupportMove) -> bool:
    """Whether a hop's object is placed, with its switch and all that it can stand on."""
    asked = {one.thing}
    if one.choice is not None:
        asked |= {one.choice.switch, *(under.carrier for under in one.choice.options if under.carrier is not None)}
    return all(_is_placed(particles, thing) for thing in asked)


def switch_support(particles: Particles, one: SupportMove, tally: MoveTally) -> None:
    """Put an object on another surface, or elsewhere on its own: an independence move over the surfaces' boxes. Its
    heading is drawn as well, or stays the same against what carries it."""
    if one.choice is None:
        return
    model, rng, count, scenes = particles.model, particles.rng, particles.count, particles.scenes
    graph, column = model.graph, np.arange(particles.count)
    switch, (x, y, theta) = row_of(one.choice.switch, X), (row_of(one.thing, axis) for axis in FLAT)
    ends = np.array([0.0, *one.choice.ends])
    before, after = _option(one.choice, scenes[switch]), rng.integers(len(one.choice.ends), size=count)
    number = ends[after] + rng.random(count) * np.diff(ends)[after]
    (left, low, heading), boxes = _frames(particles, one.choice), np.array(one.boxes)
    middle, half = boxes[:, :2], boxes[:, 2:]
    place = middle[after].T + (2.0 * rng.random((2, count)) - 1.0) * half[after].T
    u, v = _rotate(place[0], place[1], heading[after, column])
    old = _rotate(scenes[x] - left[before, column], scenes[y] - low[before, column], -heading[before, column])
    volume = half.prod(axis=1) * np.diff(ends)  # all surfaces are tried equally often, however large their share is
    allowed = rng.random(count) * volume[before] < volume[after]
    allowed &= (np.abs(np.array(old) - middle[before].T) <= half[before].T).all(axis=0)
    new = {switch: number, x: u + left[after, column], y: v + low[after, column]}
    if theta in graph.rows:
        kept = scenes[theta] + heading[after, column] - heading[before, column]
        new[theta] = kept if rng.random() < KEEP_HEADING_SHARE else _random_row(particles, theta)
    _move_load(particles, one, (one.thing, one.choice.switch), new, allowed, "hop", tally)


def move_with_load(particles: Particles, one: SupportMove, tally: MoveTally) -> None:
    """Move an object by a random step, with all that stands on it."""
    model, rng, count, scenes = particles.model, particles.rng, particles.count, particles.scenes
    if not one.riders:
        return
    factor, new = 2.0 ** -(FINEST_STEP * rng.random()), {}
    for axis in FLAT if rng.random() < 0.5 else PLACE:
        row = row_of(one.thing, axis)
        if row in model.graph.rows:
            width = float(model.problem.highest[row] - model.problem.lowest[row])
            new[row] = scenes[row] + (rng.random(count) - 0.5) * (factor * width)
    _move_load(particles, one, (one.thing,), new, np.ones(count, dtype=bool), "carry", tally)


def _move_load(
    particles: Particles,
    one: SupportMove,
    things: tuple[int, ...],
    new: dict[int, Array],
    allowed: Bool,
    kind: str,
    tally: MoveTally,
) -> None:
    """Try an object's new pose, with what stands on it turned and moved along."""
    scenes, rows = particles.scenes, particles.model.graph.rows
    x, y, theta = (row_of(one.thing, axis) for axis in FLAT)
    turn = new[theta] - scenes[theta] if theta in new else np.zeros(particles.count)
    riding: dict[int, Bool] = {one.thing: np.ones(particles.count, dtype=bool)}
    for rider in one.riders:
        along = _riding_scenes(particles, rider, riding)
        if along is None:
            continue
        riding[rider] = along
        u, v = _rotate(scenes[row_of(rider, X)] - scenes[x], scenes[row_of(rider, Y)] - scenes[y], turn)
        moved = (new[x] + u, new[y] + v, scenes[row_of(rider, THETA)] + turn)
        for axis, value in zip(FLAT, moved, strict=True):
            row = row_of(rider, axis)
            if row in rows:
                new[row] = np.where(along, value, scenes[row])
    constraints = particles.model.constraints
    things = tuple(thing for thing in things if thing in constraints)  # a switch can be a part of its object
    attempt(
        particles, (*things, *(rider for rider in riding if rider != one.thing)), new, allowed, kind=kind, tally=tally
    )


def _riding_scenes(particles: Particles, rider: int, riding: dict[int, Bool]) -> Bool | None:
    """In which scenes (P,) something stands on what moves; None where it is not placed yet, or cannot move."""
    spec, rows = particles.model.problem.spec, particles.model.graph.rows
    if not _is_placed(particles, rider) or not all(row_of(rider, axis) in rows for axis in PLACE):
        return None
    never = np.zeros(particles.count, dtype=bool)
    choice = spec.choices.get(rider)
    if choice is None:
        return riding.get(spec.supports[rider].carrier)  # type: ignore[arg-type]
    if not _is_placed(particles, choice.switch):
        return None
    on = np.array([riding.get(one.carrier, never) for one in choice.options])  # type: ignore[arg-type]
    out: Bool = on[_option(choice, particles.scenes[row_of(choice.switch, X)]), np.arange(particles.count)]
    return out


def _is_placed(particles: Particles, thing: int) -> bool:
    """Also of what is held in place."""
    return particles.model.at.get(thing, -1) <= particles.stage


def _random_row(particles: Particles, row: int) -> Array:
    low, high = particles.model.graph.low[row], particles.model.graph.high[row]
    if len(low) > 1:
        low, high = low[particles.cell], high[particles.cell]
    out: Array = low + particles.rng.random(particles.count) * (high - low)
    return out


def _frames(particles: Particles, choice: SurfaceChoice) -> tuple[Array, Array, Array]:
    """x, y and heading of what carries the object on each surface, (K, P) each."""
    count = particles.count
    poses = [
        [np.full(count, number) for number in under.pose]
        if under.carrier is None
        else [particles.scenes[row_of(under.carrier, axis)] for axis in FLAT]
        for under in choice.options
    ]
    x, y, theta = (np.array([pose[axis] for pose in poses]) for axis in range(3))
    return x, y, theta


def _option(choice: SurfaceChoice, number: Array) -> Index:
    return np.minimum(np.searchsorted(np.array(choice.ends), number), len(choice.ends) - 1)


def _rotate(x: Array, y: Array, by: Array) -> tuple[Array, Array]:
    cos, sin = np.cos(by), np.sin(by)
    return cos * x - sin * y, sin * x + cos * y
