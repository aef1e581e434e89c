"""The measurement of an atom as lines to draw: the distance, the gap, the offset along an axis or the angle it
compares.

Derived from the core alone, so that a spec's own comparisons are drawn like the prelude's relations.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from scenegen.figures.closest_points import gap_segment, room_segment
from scenegen.figures.drawing import Dimension, Guide, Mark, Point, Turn
from scenegen.lang.core import Apply, Atom, Const, Coord, Core, children
from scenegen.lang.interpret import evaluate
from scenegen.pose import FLAT, THETA, X, Y, row_of, span_of

UNIT = 1e-9  # tolerance for weights of coordinates that count as 1 and are drawn to scale


def dimensions(core: Core, atom: int, rows: Sequence[float]) -> list[Mark]:
    """The marks of an atom (its node) in one scene of 3N coordinates. Empty if it measures nothing that can be drawn.

    Their text is the measured value, in metres or radians; they are `good` if the atom is satisfied.
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
    """The nodes that a number is computed from, each once, parents first."""
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
                if isinstance(turned, Coord) and turned.axis == THETA:
                    x, y, theta = rows[span_of(turned.object, len(FLAT))]
                    text = f"{short(abs(values[index]))} rad"
                    yield Turn((x, y), theta - values[index], theta, text, good)
                    return


@dataclass(slots=True)
class _Place:
    """A term of a sum: an object's centre or edge along one axis, `weight` times."""

    weight: float = 0.0
    amount: float = 0.0  # weight * centre, and the footprint's contribution


@dataclass(slots=True)
class _Sum:
    places: dict[int, _Place] = field(default_factory=dict)
    axes: set[int] = field(default_factory=set)
    rest: float = 0.0
    plain: bool = True  # only coordinates, reaches and constants


def _offset(core: Core, root: int, values: Sequence[float], rows: Sequence[float], good: bool) -> Iterator[Mark]:
    """A difference of places along x or y: a dimension line parallel to that axis, with guides to its ends."""
    total = _terms(core, root, values)
    if not total.plain or len(total.axes) != 1 or not total.axes <= {X, Y} or len(total.places) > 2:
        return
    (axis,) = total.axes
    ends: dict[float, float] = {}
    heights = []
    for index, place in total.places.items():
        if abs(abs(place.weight) - 1.0) > UNIT or place.weight in ends:
            return
        ends[place.weight] = place.amount / place.weight
        heights.append((place.amount / place.weight, rows[row_of(index, X + Y - axis)]))
    level = sum(height for _, height in heights) / len(heights)
    # For a single place, the constant of the sum is the place with which it is compared.
    upper = ends.get(1.0, total.rest)
    lower = ends.get(-1.0, -total.rest)

    def point(along: float, across: float) -> Point:
        return (along, across) if axis == 0 else (across, along)

    for along, height in heights:
        if height != level:
            yield Guide(point(along, height), point(along, level))
    yield Dimension(point(lower, level), point(upper, level), metres(abs(upper - lower)), good)


def _terms(core: Core, root: int, values: Sequence[float]) -> _Sum:
    """A number as a weighted sum of places."""
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
