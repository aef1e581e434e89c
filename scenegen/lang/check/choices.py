"""A support that is a choice: `object book on any of [shelf[1], shelf[2], workspace]`.

Each scene has one of the surfaces. Which one is a coordinate like others, a number in [0, 1] of a further entry of the
core's objects, the switch, so that samplers, bounds and backward rules need to know nothing of choices: the requirement
that supports stand for becomes a disjunction over parts of that interval, and heights become numbers that the switch
picks (`pick`). See docs/adr/0011-supports.md.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import product
from math import prod
from typing import TYPE_CHECKING

from scenegen.geometry.footprint import POINT, Box, Circle, Footprint, Polygon, clipped, standing_area
from scenegen.geometry.workspace import Workspace
from scenegen.lang.check.values import ChosenValue, NumberValue, Value
from scenegen.lang.spec import Support, SurfaceChoice
from scenegen.pose import X

if TYPE_CHECKING:
    from scenegen.lang.check.lower import Lowering

MOST_CASES = 512  # combinations of choices that are distinguished for one pair of objects

Heights = Sequence[float | None]


def area_of(upper: Footprint, one: Support) -> float:
    """The area on which an object's centre can be on a surface, in square metres."""
    return standing_area(upper if one.walled else POINT, one.outline)


def choose(upper: Footprint, options: Sequence[Support], switch: int, *, by_area: bool) -> SurfaceChoice:
    """The choice among some surfaces, equally likely or by the area on which the object can stand.

    All share one box of centres, and centres that are not on the surface chosen are left out. That alone makes a
    surface as likely as its area is large; for equal shares, its part of the switch is the larger the smaller it is.
    """
    weights = [1.0 if by_area else 1.0 / area_of(upper, one) for one in options]
    total, ends = 0.0, []
    for weight in weights:
        total += weight
        ends.append(total)
    return SurfaceChoice(switch, tuple(options), (*(end / total for end in ends[:-1]), 1.0))


def cut_off(under: Support, space: Workspace) -> Support | None:
    """A region without what lies outside of the workspace, where no centre is; None where nothing is left of it, or
    where that is no footprint."""
    left, bottom, right, top = under.box
    (x0, x1), (y0, y1) = space.x, space.y
    if under.carrier is not None or (x0 <= left and right <= x1 and y0 <= bottom and top <= y1):
        return under
    left, bottom, right, top = max(left, x0), max(bottom, y0), min(right, x1), min(top, y1)
    if not (left < right and bottom < top) or isinstance(under.outline, Circle):
        return None
    x, y, _ = under.pose
    outline: Footprint
    if isinstance(under.outline, Box):
        outline, (x, y) = Box(right - left, top - bottom), ((left + right) / 2.0, (bottom + top) / 2.0)
    else:
        points = clipped(under.outline.vertices, (left - x, bottom - y, right - x, top - y))
        if len(points) < 3:
            return None
        outline = Polygon(points)
    box = (left, bottom, right, top)
    return Support(under.name, None, outline, under.height, pose=(x, y, 0.0), box=box)


def options_of(
    which: int, supports: Mapping[int, Support], choices: Mapping[int, SurfaceChoice]
) -> tuple[Support, ...]:
    """What an object can stand on; nothing where it stands on the table."""
    if which in choices:
        return choices[which].options
    return (supports[which],) if which in supports else ()


def grouped(choice: SurfaceChoice) -> Iterator[tuple[float, float, tuple[Support, ...]]]:
    """Neighbouring options with one outline at one place, such as the boards of a shelf, and where they lie on the
    switch."""
    low = 0.0
    run: list[Support] = []
    for one, end, after in zip(choice.options, choice.ends, (*choice.options[1:], None), strict=True):
        run.append(one)
        if after is None or _place(after) != _place(one):
            yield low, end, tuple(run)
            low, run = end, []


def _place(one: Support) -> tuple[object, ...]:
    return one.carrier, one.outline, one.walled, one.pose


def picked(lowering: Lowering, choice: SurfaceChoice, numbers: Sequence[int]) -> int:
    """The number among some that the switch of a choice picks."""
    builder = lowering.builder
    switch = builder.coord(choice.switch, X)
    found = numbers[-1]
    for number, end in zip(reversed(numbers[:-1]), reversed(choice.ends[:-1]), strict=True):
        if number != found:
            found = builder.apply("pick", (switch, builder.const(end), number, found))
    return found


def of_options(lowering: Lowering, value: ChosenValue, number: Callable[[Value], NumberValue]) -> NumberValue:
    """A number of what a choice picks: `number` gives it for each of the options."""
    made = [number(one) for one in value.options]
    choice = lowering.choices[value.chooser]
    return NumberValue(picked(lowering, choice, [one.node for one in made]), made[0].unit, origin=made[0].origin)


def level(lowering: Lowering, which: int) -> int:
    """How high an object's lowest point is above the table: a number of the core."""
    assert lowering.heights is not None
    builder = lowering.builder
    made: dict[int, int] = {}
    stack = [which]
    while stack:
        one = stack[-1]
        known = lowering.heights[one]
        if known is not None:
            made[one] = builder.const(known)
        if one in made:
            stack.pop()
            continue
        options = options_of(one, lowering.supports, lowering.choices)
        waiting = [under.carrier for under in options if under.carrier is not None and under.carrier not in made]
        if waiting:
            stack.extend(waiting)
            continue
        stack.pop()
        numbers = []
        for under in options:
            rise = builder.const(under.height)
            numbers.append(rise if under.carrier is None else builder.apply("add", (made[under.carrier], rise)))
        made[one] = picked(lowering, lowering.choices[one], numbers) if one in lowering.choices else numbers[0]
    return made[which]


def choosers(lowering: Lowering, things: Sequence[int]) -> list[int]:
    """The objects whose choices decide how high some objects stand."""
    found, stack, seen = list[int](), list(things), set[int]()
    while stack:
        one = stack.pop()
        if one in seen:
            continue
        seen.add(one)
        if one in lowering.choices:
            found.append(one)
        options = options_of(one, lowering.supports, lowering.choices)
        stack.extend(under.carrier for under in options if under.carrier is not None)
    return sorted(found)


def by_cases(lowering: Lowering, things: Sequence[int], number: Callable[[Mapping[int, Support]], int]) -> int | None:
    """A number of the core that depends on what some objects stand on: `number` gives it for the supports of each case.
    None where there are too many cases."""
    free = choosers(lowering, things)
    return of_cases(lowering, {one: range(len(lowering.choices[one].options)) for one in free}, number)


def of_cases(
    lowering: Lowering, free: Mapping[int, Sequence[int]], number: Callable[[Mapping[int, Support]], int]
) -> int | None:
    """A number that depends on the choices of some objects: `free` says for each of a chooser's options which option
    stands for it, one with the same number. `number` gives it for the supports of each case. None where there are too
    many cases."""
    apart = {one: sorted(set(classes)) for one, classes in free.items()}
    if prod(map(len, apart.values())) > MOST_CASES:
        return None
    fixed = dict(lowering.supports)
    values = [
        number({**fixed, **{one: lowering.choices[one].options[at] for one, at in zip(apart, case, strict=True)}})
        for case in product(*apart.values())
    ]
    for one in reversed(apart):  # the last object's options lie side by side
        size = len(apart[one])
        chunks = [
            dict(zip(apart[one], values[start : start + size], strict=True)) for start in range(0, len(values), size)
        ]
        values = [picked(lowering, lowering.choices[one], [chunk[at] for at in free[one]]) for chunk in chunks]
    return values[0]


def height_in(which: int, supports: Mapping[int, Support]) -> float:
    """How high an object stands where every support is known."""
    total: list[float] = []
    while which in supports:
        under = supports[which]
        total.append(under.height)
        if under.carrier is None:
            break
        which = under.carrier
    height = 0.0
    for rise in reversed(total):  # added up as `heights` does, from the table
        height += rise
    return height
