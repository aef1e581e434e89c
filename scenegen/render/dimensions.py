"""What an atom measures, as lines to draw: the distance, the gap, the offset along an axis or the angle it compares.

Read off the core alone, so that a spec's own comparisons are drawn as the prelude's relations are.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from scenegen.lang.core import Apply, Atom, Const, Coord, Core, children
from scenegen.lang.interpret import evaluate
from scenegen.render.topview import Dimension, Guide, Mark, Point, Turn
from scenegen.render.witness import gap_segment, room_segment

UNIT = 1e-9  # how far from 1 the weight of a coordinate may be that is drawn to scale


def dimensions(core: Core, atom: int, rows: Sequence[float]) -> list[Mark]:
    """The marks of an atom (its node) in one scene of 3N coordinates. Empty where it measures nothing of the kind.

    Their text is what was measured, in metres or radians; they are `good` where the atom is satisfied.
    """
    node = core.nodes[atom]
    assert isinstance(node, Atom)
    values = evaluate(core, rows)
    good = values[atom] >= 0.0
    marks: list[Mark] = []
    for index in _below(core, node.margin):
        part = core.nodes[index]
        if isinstance(part, Apply):
            marks.extend(_measured(core, part, index, values, rows, good))
    if not marks:
        below = [core.nodes[index] for index in _below(core, node.margin)]
        inner = [part.args[0] for part in below if isinstance(part, Apply) and part.primitive == "abs"]
        for root in (node.margin, *inner):
            marks = marks or list(_offset(core, root, values, rows, good))
    return list(dict.fromkeys(marks))


def metres(value: float) -> str:
    return f"{short(value)} m"


def short(value: float) -> str:
    """Three decimals, without zeros at the end and without a minus before 0."""
    text = f"{value:.3f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text.replace("-", "\N{MINUS SIGN}")


def _below(core: Core, root: int) -> Iterator[int]:
    """The nodes that a number is computed from, each once, from the outside inwards."""
    seen, stack = set[int](), [root]
    while stack:
        index = stack.pop()
        if index not in seen:
            seen.add(index)
            yield index
            stack.extend(reversed(children(core.nodes[index])))


def _measured(
    core: Core, part: Apply, index: int, values: Sequence[float], rows: Sequence[float], good: bool
) -> Iterator[Mark]:
    numbers = [values[arg] for arg in part.args]
    match part.primitive, numbers:
        case "dist", (ax, ay, bx, by):
            yield Dimension((ax, ay), (bx, by), metres(values[index]), good)
        case "gap" | "room", (ax, ay, a_theta, bx, by, b_theta):
            segment = gap_segment if part.primitive == "gap" else room_segment
            a, b = part.shapes
            start, end = segment(a, (ax, ay, a_theta), b, (bx, by, b_theta))
            yield Dimension(start, end, metres(values[index]), good)
        case "wrap", _:
            for below in _below(core, index):
                turned = core.nodes[below]
                if isinstance(turned, Coord) and turned.axis == 2:
                    x, y, theta = rows[3 * turned.object : 3 * turned.object + 3]
                    text = f"{short(abs(values[index]))} rad"
                    yield Turn((x, y), theta - values[index], theta, text, good)
                    return


@dataclass(slots=True)
class _Place:
    """What a sum says of one object along one axis: its centre or an edge, `weight` times."""

    weight: float = 0.0
    amount: float = 0.0  # weight * centre, and what the footprint adds


@dataclass(slots=True)
class _Sum:
    places: dict[int, _Place] = field(default_factory=dict)
    axes: set[int] = field(default_factory=set)
    rest: float = 0.0
    plain: bool = True  # made of nothing but coordinates, reaches and constants


def _offset(core: Core, root: int, values: Sequence[float], rows: Sequence[float], good: bool) -> Iterator[Mark]:
    """A difference of places along x or y: a dimension line parallel to that axis, with guides to what it measures."""
    total = _terms(core, root, values)
    if not total.plain or len(total.axes) != 1 or not total.axes <= {0, 1} or len(total.places) > 2:
        return
    (axis,) = total.axes
    ends: dict[float, float] = {}
    heights = []
    for index, place in total.places.items():
        if abs(abs(place.weight) - 1.0) > UNIT or place.weight in ends:
            return
        ends[place.weight] = place.amount / place.weight
        heights.append((place.amount / place.weight, rows[3 * index + 1 - axis]))
    level = sum(height for _, height in heights) / len(heights)
    # What the sum adds to a lone place is where the line ends that it is held against.
    upper = ends.get(1.0, total.rest)
    lower = ends.get(-1.0, -total.rest)

    def point(along: float, across: float) -> Point:
        return (along, across) if axis == 0 else (across, along)

    for along, height in heights:
        if height != level:
            yield Guide(point(along, height), point(along, level))
    yield Dimension(point(lower, level), point(upper, level), metres(abs(upper - lower)), good)


def _terms(core: Core, root: int, values: Sequence[float]) -> _Sum:
    """A number as a weighted sum of what stands where."""
    total = _Sum()
    stack = [(root, 1.0)]
    while stack:
        index, weight = stack.pop()
        match core.nodes[index]:
            case Const(value):
                total.rest += weight * value
            case Coord(place, axis):
                total.axes.add(axis)
                one = total.places.setdefault(place, _Place())
                one.weight += weight
                one.amount += weight * values[index]
            case Apply("add", (left, right)):
                stack += [(left, weight), (right, weight)]
            case Apply("sub", (left, right)):
                stack += [(left, weight), (right, -weight)]
            case Apply("neg", (inner,)):
                stack.append((inner, -weight))
            case Apply("reach", (first, *_)) if isinstance(centre := core.nodes[first], Coord):
                total.places.setdefault(centre.object, _Place()).amount += weight * values[index]
            case _:
                total.plain = False
    return total
