"""What can move between surfaces, and what can come to stand on what, where supports are choices."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from scenegen.lang.choices import options_of
from scenegen.lang.spec import CheckedSpec, Choice
from scenegen.pose import PLACE, row_of
from scenegen.primitives import Circle, Footprint, Polygon
from scenegen.primitives.outline import measures
from scenegen.sampling.growth.machine import Machine


@dataclass(frozen=True, slots=True)
class Hop:
    """An object that a choice puts somewhere, or that carries what a choice puts there. `choice` is its own, where its
    surfaces lie apart; `boxes` (K, 4) then hold its centre on each of them: x, y of the middle and half the sizes, in
    the surface's frame. `riders` are all that can come to stand on it, what carries before what is carried."""

    thing: int
    riders: tuple[int, ...]
    choice: Choice | None = None
    boxes: tuple[tuple[float, float, float, float], ...] = ()


def hops(machine: Machine) -> tuple[Hop, ...]:
    """The hops of a request, worked out once."""
    if "hops" not in machine.notes:
        machine.notes["hops"] = _hops(machine.problem.spec, machine.at, machine.graph.rows)
    known: tuple[Hop, ...] = machine.notes["hops"]
    return known


def _hops(spec: CheckedSpec, free: Collection[int], rows: Collection[int]) -> tuple[Hop, ...]:
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
        found.append(Hop(thing, riders, choice, boxes))
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
