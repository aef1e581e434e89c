"""The measurement of an atom as lines to draw: the distance, the gap, the offset along an axis or the angle it
compares.

Derived from the core alone, so that a spec's own comparisons are drawn like the prelude's relations.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

from scenegen.geometry import PRIMITIVES, Box, Circle, Footprint, Polygon
from scenegen.geometry.footprint import corners
from scenegen.lang.formula.core import Apply, Atom, Const, Coord, Core, children
from scenegen.lang.formula.interpret import evaluate
from scenegen.looks.usual import UsualPlace
from scenegen.pictures.figures.sights import FigureSights
from scenegen.pose import FLAT, THETA, X, Y, row_of, span_of

# Where a clearance is measured: the two points whose distance is gap(a, b) or room(a, b), for drawings.
# One scene at a time, in plain floats; the values themselves come from scenegen.geometry.clearance, and a test
# compares the lengths with them. A circle is treated as its centre, expanded by its radius.
Point = tuple[float, float]
Pose = tuple[float, float, float]
Segment = tuple[Point, Point]


def outline(footprint: Box | Polygon, pose: Pose) -> list[Point]:
    """The corners of a footprint at a pose, counter-clockwise, in metres."""
    x, y, theta = pose
    cos, sin = math.cos(theta), math.sin(theta)
    return [(x + cos * u - sin * v, y + sin * u + cos * v) for u, v in corners(footprint)]


def gap_segment(a: Footprint, a_pose: Pose, b: Footprint, b_pose: Pose) -> Segment:
    """From the outline of a to that of b, where they are nearest; if they overlap, along the penetration depth."""
    (a_bones, a_radius), (b_bones, b_radius) = _bones(a, a_pose), _bones(b, b_pose)
    (ax, ay), (bx, by), (nx, ny) = _nearest(a_bones, b_bones)
    return (ax + a_radius * nx, ay + a_radius * ny), (bx - b_radius * nx, by - b_radius * ny)


def room_segment(a: Footprint, a_pose: Pose, b: Footprint, b_pose: Pose) -> Segment:
    """From the point of a with the least clearance inside b to the border of b (to the line through its side)."""
    bones, radius = _bones(a, a_pose)
    if isinstance(b, Circle):
        x, y, _ = b_pose
        far = max(bones, key=lambda point: math.hypot(point[0] - x, point[1] - y))
        nx, ny = _unit((far[0] - x, far[1] - y))
        return (far[0] + radius * nx, far[1] + radius * ny), (x + b.radius * nx, y + b.radius * ny)
    least, found = math.inf, ((0.0, 0.0), (0.0, 0.0))
    for (px, py), (nx, ny) in _sides(outline(b, b_pose)):
        far = max(bones, key=lambda point: nx * point[0] + ny * point[1])
        slack = nx * (px - far[0]) + ny * (py - far[1]) - radius
        if slack < least:
            start = far[0] + radius * nx, far[1] + radius * ny
            least, found = slack, (start, (start[0] + slack * nx, start[1] + slack * ny))
    return found


def _bones(footprint: Footprint, pose: Pose) -> tuple[list[Point], float]:
    if isinstance(footprint, Circle):
        return [pose[:2]], footprint.radius
    return outline(footprint, pose), 0.0


def _unit(vector: Point) -> Point:
    length = math.hypot(*vector)
    return (vector[0] / length, vector[1] / length) if length > 0.0 else (1.0, 0.0)


def _sides(polygon: Sequence[Point]) -> list[tuple[Point, Point]]:
    """A point and the outward normal of each side of positive length; none for a single point."""
    if len(polygon) == 1:
        return []
    return [
        (start, _unit((end[1] - start[1], start[0] - end[0])))
        for start, end in pairwise((*polygon, polygon[0]))
        if start != end
    ]


def _nearest(a: Sequence[Point], b: Sequence[Point]) -> tuple[Point, Point, Point]:
    """A point of a, a point of b, and the direction in which b has to move away from a to separate them."""
    best, deepest = -math.inf, None
    for first, second, sign in ((a, b, 1.0), (b, a, -1.0)):
        for (px, py), (nx, ny) in _sides(first):
            low = min(second, key=lambda point: nx * point[0] + ny * point[1])
            height = nx * (low[0] - px) + ny * (low[1] - py)
            if height > best:
                foot = low[0] - height * nx, low[1] - height * ny
                pair = (foot, low) if sign > 0.0 else (low, foot)
                best, deepest = height, (*pair, (sign * nx, sign * ny))
    if deepest is not None and best <= 0.0:
        return deepest
    candidates = [(_onto(point, b), point, True) for point in a] + [(_onto(point, a), point, False) for point in b]
    foot, point, of_a = min(candidates, key=lambda one: math.dist(one[0], one[1]))
    start, end = (point, foot) if of_a else (foot, point)
    return start, end, _unit((end[0] - start[0], end[1] - start[1]))


def _onto(point: Point, polygon: Sequence[Point]) -> Point:
    """The nearest point of a polygon's outline."""
    best = polygon[0]
    for start, end in pairwise((*polygon, polygon[0])):
        dx, dy = end[0] - start[0], end[1] - start[1]
        square = dx * dx + dy * dy
        share = ((point[0] - start[0]) * dx + (point[1] - start[1]) * dy) / square if square > 0.0 else 0.0
        share = min(max(share, 0.0), 1.0)
        foot = start[0] + share * dx, start[1] + share * dy
        if math.dist(foot, point) < math.dist(best, point):
            best = foot
    return best


@dataclass(frozen=True, slots=True)
class FigureObject:
    """An object, or with `zone` a region: its footprint, pose and name. `tint` is a colour of SVG, if given; `inside`
    are thin lines in its frame: the cells of a rack, the drawers of a cabinet."""

    name: str
    footprint: Footprint
    pose: Pose
    zone: bool = False
    tint: str = ""
    inside: tuple[Box | Polygon, ...] = ()


@dataclass(frozen=True, slots=True)
class Dimension:
    """A dimension line with its measured value; green if `good`, else red."""

    start: Point
    end: Point
    text: str
    good: bool = True


@dataclass(frozen=True, slots=True)
class Turn:
    """The angle at `center` from the heading `start` to the heading `stop`."""

    center: Point
    start: float
    stop: float
    text: str
    good: bool = True


@dataclass(frozen=True, slots=True)
class Guide:
    """A thin dashed line: an axis, a mirror, an extension line."""

    start: Point
    end: Point


Mark = Dimension | Turn | Guide


@dataclass(frozen=True, slots=True)
class FigureScene:
    """A scene and its text: `x` and `y` are the ends of the workspace, `caption` the lines below. The things of
    `usual` are counted without zones."""

    things: Sequence[FigureObject]
    x: tuple[float, float] = (0.0, 1.0)
    y: tuple[float, float] = (0.0, 1.0)
    marks: Sequence[Mark] = ()
    caption: Sequence[str] = ()
    good: bool | None = None
    sights: FigureSights | None = None
    usual: Sequence[UsualPlace] = ()


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
    for index in _below(core, node.margin, values):
        part = core.nodes[index]
        if isinstance(part, Apply):
            marks.extend(_marks(core, part, index, values, rows, good))
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


def _below(core: Core, root: int, values: Sequence[float] | None = None) -> Iterator[int]:
    """The nodes that a number is computed from, each once, parents first; with the `values` of a scene, of a minimum or
    a maximum only those that it is."""
    seen, stack = set[int](), [root]
    while stack:
        index = stack.pop()
        if index not in seen:
            seen.add(index)
            yield index
            node = core.nodes[index]
            below = children(node)
            if values is not None and isinstance(node, Apply) and node.primitive in ("min", "max"):
                below = tuple(one for one in below if values[one] == values[index])
            stack.extend(reversed(below))


def _marks(
    core: Core, part: Apply, index: int, values: Sequence[float], rows: Sequence[float], good: bool
) -> Iterator[Mark]:
    numbers = [values[arg] for arg in part.args]
    primitive = PRIMITIVES[part.primitive]
    match primitive.drawn:
        case "centres":
            start, end = ((numbers[x], numbers[y]) for x, y in primitive.places)
            yield Dimension(start, end, metres(values[index]), good)
        case "gap" | "room":
            segment = gap_segment if primitive.drawn == "gap" else room_segment
            (a, b), (ax, ay, a_theta, bx, by, b_theta) = part.shapes, numbers
            start, end = segment(a, (ax, ay, a_theta), b, (bx, by, b_theta))
            yield Dimension(start, end, metres(values[index]), good)
        case "turn":
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
            case Apply(name, (first, *_)) if PRIMITIVES[name].drawn == "edge" and isinstance(
                centre := core.nodes[first], Coord
            ):
                total.places.setdefault(centre.object, _Place()).amount += weight * values[index]
            case _:
                total.plain = False
    return total
