"""What objects can stand on: the named surfaces of things, and the upright pieces of open furniture.

All in the object's own frame: metres, z = 0 its lowest point, heading along +x, which is where furniture has its front.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from scenegen.geometry import MATH, NUMPY, POINT, PRIMITIVES, Box, Circle, Footprint, Polygon
from scenegen.geometry.footprint import area, centroid
from scenegen.pose import flat, places
from scenegen.things.furniture import (
    WALL_SIDES,
    Cabinet,
    Crate,
    Drawer,
    Rack,
    Rooms,
    RoundSolid,
    Rows,
    ShelfUnit,
    Slab,
    SupportSurface,
    Vessel,
)
from scenegen.things.library import PLAIN, Shape, entry_of, stretch_of

Floats = npt.NDArray[np.float64]

TRIED_HEADINGS = 180  # headings that are tried where a footprint has to fit between walls


def surfaces_of(shape: Shape, upper: Shape | None = None) -> tuple[SupportSurface, ...]:
    """The surfaces of an object, the one that is meant by the object's name alone first; none where nothing can stand
    on it. Where walls slope, `inside` lies as deep as the object `upper` goes; `rim` is instead of it where that stands
    on the rim."""

    entry, (x, y, z) = entry_of(shape), stretch_of(shape)
    if entry is None:
        own = shape.asset in PLAIN or isinstance(shape.footprint, Polygon)
        return (SupportSurface("top", shape.footprint, shape.height),) if own else ()
    pockets = pocket_furniture(shape)
    if pockets is not None:
        return tuple(_stretch(one, x, y, z) for one in pockets.surfaces())
    if isinstance(entry.form, ShelfUnit):
        levels = tuple(_stretch(one, x, y, z) for one in _of_unit(entry.form))
        return (levels[-1], *levels[:-1])
    rooms = rooms_of(shape)
    if rooms:
        inside = SupportSurface("inside", *rooms[0], walled=True)
        if upper is not None and not fits(upper.footprint, inside.outline):
            found = nesting_surface(shape, upper)
            inside = inside if found is None or (found.name == "rim" and entry.rim is not None) else found
        if entry.rim is None:
            return (inside,)
        return inside, _stretch(SupportSurface("rim", entry.rim, shape.height / z), x, y, z)
    if entry.top is not None:
        return (_stretch(SupportSurface("top", entry.top, shape.height / z), x, y, z),)
    return (SupportSurface("top", shape.footprint, shape.height),) if entry.flat else ()


def sizes_of(shape: Shape, surface: SupportSurface) -> dict[str, float]:
    """How large a surface is, in metres: `length` along the object's heading, `width` across it, and `depth`, the free
    height over it: up to the rim of a hollow thing or to the next board. Open above, it has no depth."""

    length, width = surface.outline.extent
    depth = surface.clear
    if not math.isfinite(depth) and surface.walled and rooms_of(shape):
        depth = shape.height - surface.height
    return {"length": length, "width": width, **({"depth": depth} if math.isfinite(depth) else {})}


def slabs_of(shape: Shape) -> tuple[Slab, ...]:
    """The pieces of open furniture; none of what is one prism, or hollow."""

    entry, (x, y, z) = entry_of(shape), stretch_of(shape)
    unit = None if entry is None or not isinstance(entry.form, ShelfUnit) else entry.form
    made = pocket_furniture(shape) or unit
    if made is None:
        return ()
    return tuple(
        Slab((one.box[0] * x, one.box[1] * y, one.box[2] * x, one.box[3] * y), one.low * z, one.high * z)
        for one in made.slabs()
    )


def pocket_furniture(shape: Shape) -> Cabinet | Drawer | Rack | None:
    """Furniture whose walled surfaces have nothing above them: all that stands there in full is clear of its pieces."""
    entry = entry_of(shape)
    form = None if entry is None else entry.form
    if isinstance(form, Cabinet) and shape.open:
        return Cabinet(shape.open)
    return form if isinstance(form, Cabinet | Drawer | Rack) else None


def _of_unit(unit: ShelfUnit) -> tuple[SupportSurface, ...]:
    """The tops of its boards, the lid last."""
    x, y = unit.depth / 2.0, unit.width / 2.0
    inner = Slab((unit.back - x, unit.side - y, x, y - unit.side), 0.0, 0.0).footprint
    found = [
        SupportSurface(f"shelf[{number}]", inner, low, high - unit.board - low, walled=True)
        for number, (low, high) in enumerate(zip(unit.levels, unit.levels[1:], strict=False), 1)
    ]
    return (*found, SupportSurface("top", Box(unit.depth, unit.width), unit.levels[-1]))


def cells_of(shape: Shape) -> tuple[Box | Polygon, ...]:
    """What drawings from above show of furniture: the outlines of its surfaces; none of what is one prism or round."""
    made = surfaces_of(shape) if pocket_furniture(shape) is not None or shape.asset == "bin" else ()
    seen = (one.outline for one in made if one.pull is None or one.pull.reach > 0.0)
    return tuple(outline for outline in seen if not isinstance(outline, Circle))


def rim_of(shape: Shape) -> float:
    """How high an object stands on pocketed furniture where it fits into no pocket: on the walls round them, metres."""
    made = pocket_furniture(shape)

    return shape.height if made is None else made.rim * stretch_of(shape)[2]


def reach_of(outline: Footprint) -> float:
    """The distance from the origin of the frame to the farthest point, in metres."""
    match outline:
        case Circle(radius):
            return radius
        case Box(length, width):
            return math.hypot(length, width) / 2.0
        case _:
            return max(math.hypot(x, y) for x, y in outline.vertices)


@cache
def fits(upper: Footprint, outline: Footprint) -> bool:
    """Whether a footprint fits into an outline at one heading or another, its centre in the outline's middle."""
    x, y = _middle(outline)
    room = PRIMITIVES["room"].evaluate
    headings = (0.0, math.pi / 2.0, *(math.pi * turn / TRIED_HEADINGS for turn in range(TRIED_HEADINGS)))
    return any(room(MATH, upper, outline, x, y, theta, 0.0, 0.0, 0.0) >= 0.0 for theta in headings)


@cache
def narrowest(upper: Footprint, width: float) -> float | None:
    """The least that a footprint takes of x, of all headings at which it takes no more than `width` of y; None where
    it always takes more. Metres."""
    if isinstance(upper, Circle):
        return 2.0 * upper.radius if 2.0 * upper.radius <= width else None
    corners = upper.vertices if isinstance(upper, Polygon) else _corners(upper)
    found = []
    for turn in range(2 * TRIED_HEADINGS):  # of a polygon, half a turn is enough as well
        cos, sin = math.cos(math.pi * turn / (2 * TRIED_HEADINGS)), math.sin(math.pi * turn / (2 * TRIED_HEADINGS))
        xs, ys = zip(*((cos * x - sin * y, sin * x + cos * y) for x, y in corners), strict=True)
        if max(ys) - min(ys) <= width:
            found.append(max(xs) - min(xs))
    return min(found, default=None)


def _corners(box: Box) -> tuple[tuple[float, float], ...]:
    x, y = box.length / 2.0, box.width / 2.0
    return (-x, -y), (x, -y), (x, y), (-x, y)


def _middle(outline: Footprint) -> tuple[float, float]:
    if not isinstance(outline, Polygon):
        return 0.0, 0.0
    x, y = zip(*outline.vertices, strict=True)
    return (min(x) + max(x)) / 2.0, (min(y) + max(y)) / 2.0


def _stretch(one: SupportSurface, x: float, y: float, z: float) -> SupportSurface:
    outline: Footprint
    match one.outline:
        case Circle(radius):
            outline = Circle(radius * min(x, y))
        case Box(length, width):
            outline = Box(length * x, width * y)
        case _:
            outline = Polygon(tuple((u * x, v * y) for u, v in one.outline.vertices))
    return replace(one, outline=outline, height=one.height * z, clear=one.clear * z)


def rooms_of(shape: Shape) -> Rooms:
    """(footprint, height): what fits inside the object, and how high it then stands; the deepest first, of solid
    things none."""
    entry = entry_of(shape)
    if entry is None or not isinstance(entry.form, Vessel | Crate):
        return ()
    x, y, z = stretch_of(shape)
    rooms: list[tuple[Circle | Box, float]] = []
    for room, height in entry.form.rooms():
        scaled = Circle(room.radius * min(x, y)) if isinstance(room, Circle) else Box(room.length * x, room.width * y)
        rooms.append((scaled, height * z))
    return tuple(rooms)


# What objects stand on: the table, or another object that carries their middle.
# Where a spec does not declare heights (docs/adr/0011-supports.md), this is how they are read from the poses (x, y,
# theta), for pictures, for files of simulators and for settling alike.
DISTANCE_ROUNDING = 1e-9  # of a distance: far more than computing it can lose


def base_heights(
    shapes: Sequence[Shape], poses: Floats, *, solid: bool = False, declared: Sequence[float] | Floats | None = None
) -> Floats:
    """(scenes, objects): how high above the table the lowest point of each object is, in metres.

    `poses` is (scenes, objects, 3). An object is carried where the middle of its footprint lies inside the footprint of
    another, so that it does not tip over an edge; it then stands on the highest of those. Of two objects the one with
    the larger footprint carries, of two equal ones the one that comes first: nothing stands on itself, and towers are
    allowed. In a hollow (see `physics.rooms_of`) an object stands as deep as its footprint fits; `solid` fills hollows
    up, for bodies that have none. `declared` is what a spec says of the heights, if it does: (objects,), or
    (scenes, objects).
    """
    if declared is not None and len(declared):
        return np.broadcast_to(np.array(declared), poses.shape[:2]).copy()
    with np.errstate(over="ignore", invalid="ignore"):  # of sizes that are no longer finite when multiplied
        return _heights(shapes, flat(poses), solid)


def carrier_first(shapes: Sequence[Shape], a: int, b: int) -> tuple[int, int]:
    """Two objects, by their numbers: the one that can carry the other first."""
    return (a, b) if (-_area(shapes[a].footprint), a) < (-_area(shapes[b].footprint), b) else (b, a)


def carries(lower: Shape, upper: Shape, lower_poses: Floats, upper_poses: Floats) -> npt.NDArray[np.bool_]:
    """(P,): whether the middle of one object is above another at poses (P, 3) each."""
    middle = _centroid_at(upper.footprint, flat(upper_poses))
    inside = PRIMITIVES["room"].evaluate
    return np.asarray(inside(NUMPY, POINT, lower.footprint, *middle, *flat(lower_poses).T) > 0.0)


def _heights(shapes: Sequence[Shape], poses: Floats, solid: bool) -> Floats:
    areas = [_area(shape.footprint) for shape in shapes]
    order = sorted(range(len(shapes)), key=lambda k: (-areas[k], k))  # what may carry an object comes before it
    reach = np.array([reach_of(shapes[k].footprint) for k in order])
    x, y = np.moveaxis(poses[:, order, :2], -1, 0)
    kinds = kinds_of([shapes[k] for k in order])
    heights = np.zeros(poses.shape[:2])  # in that order
    for place, upper in enumerate(order):
        u, v, _ = _centroid_at(shapes[upper].footprint, poses[:, upper])
        apart = (x[:, :place] - u[:, None]) ** 2 + (y[:, :place] - v[:, None]) ** 2
        scenes, lower = np.nonzero(apart <= (reach[:place] * (1.0 + DISTANCE_ROUNDING)) ** 2)
        for kind in np.unique(kinds[lower]):
            some, below = (numbers[kinds[lower] == kind] for numbers in (scenes, lower))
            carrier = shapes[order[below[0]]]
            carried = _rises(carrier, shapes[upper], poses[some, np.take(order, below)], poses[some, upper], solid)
            np.maximum.at(heights, (some, place), np.where(carried >= 0.0, heights[some, below] + carried, 0.0))
    found = np.empty_like(heights)
    found[:, order] = heights
    return found


def kinds_of(shapes: Sequence[Shape]) -> npt.NDArray[np.int64]:
    """(objects,): a number for each shape, the same for equal ones, so that their pairs can be looked at together."""
    numbers: dict[Shape, int] = {}
    return np.array([numbers.setdefault(shape, len(numbers)) for shape in shapes], dtype=np.int64)


def _rises(lower: Shape, upper: Shape, below: Floats, poses: Floats, solid: bool) -> Floats:
    """(P,): how high above the lowest point of an object another one stands in it or on it, at poses (P, 3) each; -1
    where it is not carried."""
    inside = PRIMITIVES["room"].evaluate
    carried = carries(lower, upper, below, poses)
    if not carried.any():
        return np.full(len(poses), -1.0)
    pockets = None if solid else pocket_furniture(lower)
    floor = np.full(len(poses), lower.height if pockets is None else rim_of(lower))
    rooms = rooms_of(lower) if pockets is None else ()
    for room, height in () if solid else reversed(rooms):  # from the rim downwards
        held = inside(NUMPY, upper.footprint, room, *poses.T, *below.T) >= 0.0
        floor = np.where(held, height, floor)
    for surface in () if pockets is None else surfaces_of(lower):
        footprint = upper.footprint if surface.walled else POINT
        held = inside(NUMPY, footprint, surface.outline, *poses.T, *below.T) >= 0.0
        floor = np.where(held, surface.height, floor)
    return np.where(carried, floor, -1.0)


def _area(footprint: Footprint) -> float:
    match footprint:
        case Circle(radius):
            return math.pi * radius * radius
        case Box(length, width):
            return length * width
        case _:
            return area(footprint)


def _centroid_at(footprint: Footprint, poses: Floats) -> tuple[Floats, Floats, Floats]:
    """Where the centroid of a footprint is at poses (P, 3): x, y and, of no meaning for a point, the heading."""
    x, y, theta = poses.T
    if not isinstance(footprint, Polygon):
        return x, y, theta
    u, v = centroid(footprint)
    cos, sin = np.cos(theta), np.sin(theta)
    return x + cos * u - sin * v, y + sin * u + cos * v, theta


# How things that taper stand in vessels whose walls slope: how deep they go, and how far they can then be moved.
# Both are taken as solids of revolution on one axis: how wide a thing is at each height, against how wide the vessel
# is there. `rooms_of` has what fits as a prism; this is for what does not.
WALL_SLACK = 0.0001  # metres to each side of what stands between sloping walls: an exact fit leaves one place alone
MIN_RIM_OVERLAP = 0.001  # metres that a foot overlaps a rim on which it stands
HEIGHT_TOLERANCE = 0.0018  # metres: walls are flat pieces, so heights depend on how both are turned
MAX_TILT = math.tan(math.radians(2.2))  # that what is no solid of revolution may lean by
HANDLE_WIDTH = 0.013  # how wide a handle is
COME_IN = math.cos(math.pi / WALL_SIDES)  # how far the pieces of a wall come in
BISECTION_STEPS = 60  # of a bisection


@dataclass(frozen=True, slots=True)
class Profile:
    """How wide a thing is: rows (z, radius) from the bottom up, in metres, with a step where a height occurs twice.
    `ears` are handles, which are on one side alone: (lowest z, highest z, reach)."""

    body: Rows
    ears: tuple[tuple[float, float, float], ...] = ()

    @property
    def foot(self) -> float:
        return self.body[0][1]


def profile_of(shape: Shape) -> Profile:
    """What holds an object's collision pieces, turned about its axis; of a prism, the circle round its footprint."""
    entry, (x, y, z) = entry_of(shape), stretch_of(shape)
    match None if entry is None else entry.form:
        case RoundSolid(rows):
            return Profile(_scale_profile(rows, max(x, y), z))
        case Vessel(rows, handle):
            body = _scale_profile([(height, outer) for height, outer, _ in rows], max(x, y), z)
            if handle is None:
                return Profile(body)
            _, end, low, high = handle
            return Profile(body, ((low * z, high * z, math.hypot(end, HANDLE_WIDTH / 2.0) * max(x, y)),))
        case _:
            reach = reach_of(shape.footprint)
            return Profile(((0.0, reach), (shape.height, reach)))


@cache
def leeway(lower: Shape, upper: Shape, height: float) -> float | None:
    """How far the axes of two things can be apart where `upper` begins at a height above the lowest point of the vessel
    `lower`, in metres; negative where they share space. None where `lower` is no vessel."""
    walls = _walls(lower)
    return None if walls is None else _leeway(walls, profile_of(upper), height)


@cache
def nesting_surface(lower: Shape, upper: Shape) -> SupportSurface | None:
    """Where an object stands in a vessel, as deep as its own shape lets it, or on the vessel's rim. Its outline holds
    the circle round the footprint wherever the object can stand. None where it would tilt, jam or fall through, and
    where `lower` is no vessel."""
    walls = _walls(lower)
    if walls is None:
        return None
    profile, (floor, _), (rim, mouth) = profile_of(upper), walls[0], walls[-1]
    free = _leeway(walls, profile, floor)
    if free >= WALL_SLACK:
        return _surface("inside", upper, floor, free)
    if profile.foot >= mouth + MIN_RIM_OVERLAP:
        return _on_rim(upper, profile.foot * COME_IN - mouth, mouth * COME_IN, rim)
    high = _lowest(lambda height: _of_body(walls, profile, height, COME_IN) >= WALL_SLACK, floor, rim)
    low = _lowest(lambda height: _of_body(walls, profile, height, 1.0) >= 0.0, floor, rim)
    height = high if high - low <= HEIGHT_TOLERANCE / 2.0 else (low + high) / 2.0
    held = _of_body(walls, profile, high, COME_IN) >= WALL_SLACK and _of_ears(walls, profile, low) >= WALL_SLACK
    held = held and high - height <= HEIGHT_TOLERANCE and _lies_level(upper, high - low)
    return _surface("inside", upper, height, WALL_SLACK) if held else None


def _lies_level(upper: Shape, unsure: float) -> bool:
    """Whether a thing lies level on the walls where heights under its corners differ by as much as they can."""
    if isinstance(upper.footprint, Circle):
        return True
    entry = entry_of(upper)
    return not (entry is not None and entry.bulging) and unsure <= MAX_TILT * min(upper.footprint.extent)


def _on_rim(upper: Shape, free: float, mouth: float, height: float) -> SupportSurface | None:
    """On a ring: a foot that covers all of it, the middle over the mouth."""
    if free < WALL_SLACK or not isinstance(upper.footprint, Circle):
        return None
    if free < mouth:
        return _surface("rim", upper, height, free)
    return SupportSurface("rim", Circle(mouth), height, far=mouth)


def _surface(name: str, upper: Shape, height: float, free: float) -> SupportSurface:
    outline = Circle(free + reach_of(upper.footprint))
    far = free if isinstance(upper.footprint, Circle) else outline.radius
    if isinstance(upper.footprint, Box):  # both ends of a diagonal are in the circle
        far = math.sqrt(outline.radius**2 - reach_of(upper.footprint) ** 2)
    return SupportSurface(name, outline, height, walled=True, far=far)


def _walls(shape: Shape) -> Rows | None:
    """(z, inner radius) of a vessel from its floor to its rim."""
    entry = entry_of(shape)
    if entry is None or not isinstance(entry.form, Vessel):
        return None
    x, y, z = stretch_of(shape)
    return _scale_profile([(height, inner) for height, _, inner in entry.form.rows if inner > 0.0], min(x, y), z)


def _leeway(walls: Rows, profile: Profile, height: float) -> float:
    return min(_of_body(walls, profile, height, COME_IN), _of_ears(walls, profile, height))


def _of_body(walls: Rows, profile: Profile, height: float, flat: float) -> float:
    """The least of what the walls are wider than a thing, of all heights up to the rim."""
    start, end = max(walls[0][0], height), min(walls[-1][0], height + profile.body[-1][0])
    levels = {start, end, *(z for z, _ in walls), *(height + z for z, _ in profile.body)}
    return min(
        flat * _radius(walls, z, min) - _radius(profile.body, z - height, max) for z in levels if start <= z <= end
    )


def _of_ears(walls: Rows, profile: Profile, height: float) -> float:
    """The same of handles: walls lean outwards, so they are closest to the lowest point of one."""
    floor, rim = walls[0][0], walls[-1][0]
    places = ((max(floor, height + low), reach) for low, _, reach in profile.ears)
    return min((COME_IN * _radius(walls, z, min) - reach for z, reach in places if z <= rim), default=math.inf)


def _radius(rows: Rows, z: float, pick: Callable[[Iterable[float]], float]) -> float:
    """The radius at a height; at a step, `pick` of both."""
    found = []
    for (low, below), (high, above) in pairwise(rows):
        if low <= z <= high:
            found += [below, above] if low == high else [below + (above - below) * (z - low) / (high - low)]
    return pick(found or [rows[0][1] if z < rows[0][0] else rows[-1][1]])  # beyond an end by rounding


def _lowest(holds: Callable[[float], bool], low: float, high: float) -> float:
    """The least number between two from which on something holds."""
    for _ in range(BISECTION_STEPS):
        middle = (low + high) / 2.0
        low, high = (low, middle) if holds(middle) else (middle, high)
    return high


def _scale_profile(rows: Sequence[tuple[float, float]], wide: float, tall: float) -> Rows:
    return tuple((z * tall, radius * wide) for z, radius in rows)


TOUCH = 1e-3  # metres that two objects share at least, sideways and upwards


def overlapping(
    shapes: Sequence[Shape], poses: Floats, declared: Sequence[float] | Floats | None = None
) -> list[list[tuple[int, int]]]:
    """For each scene the pairs of objects whose footprints overlap at one height, by more than a millimetre.

    `poses` is (scenes, objects, 3). What stands on another object, or inside it, does not overlap it.
    """
    found: list[list[tuple[int, int]]] = [[] for _ in poses]
    if not len(poses):
        return found
    poses = flat(poses)
    bottoms = base_heights(shapes, poses, declared=declared)
    tops = bottoms + np.array([shape.height for shape in shapes])
    reach = np.array([reach_of(shape.footprint) for shape in shapes])
    x, y = np.moveaxis(places(poses), -1, 0)
    kinds = kinds_of(shapes)
    with np.errstate(over="ignore", invalid="ignore"):  # of sizes that are no longer finite when multiplied
        for a in range(len(shapes) - 1):
            rest = slice(a + 1, None)
            near = np.hypot(x[:, a, None] - x[:, rest], y[:, a, None] - y[:, rest]) < reach[a] + reach[rest]
            near &= (
                np.minimum(tops[:, a, None], tops[:, rest]) - np.maximum(bottoms[:, a, None], bottoms[:, rest]) > TOUCH
            )
            scenes, others = np.nonzero(near)
            others += a + 1
            pairs: list[tuple[int, int]] = []
            for kind in np.unique(kinds[others]):
                some, b = (numbers[kinds[others] == kind] for numbers in (scenes, others))
                seen = _meet(shapes, (a, int(b[0])), poses[some, a], poses[some, b], bottoms[some, a], bottoms[some, b])
                pairs += zip(some[seen].tolist(), b[seen].tolist(), strict=True)
            for scene, other in sorted(pairs):
                found[scene].append((a, other))
    return found


def _meet(
    shapes: Sequence[Shape], pair: tuple[int, int], first: Floats, second: Floats, low: Floats, lowest: Floats
) -> npt.NDArray[np.bool_]:
    """(P,): whether two objects overlap, and neither carries the other, at poses (P, 3) each."""
    a, b = pair
    lower, upper = carrier_first(shapes, a, b)
    below, above = (first, second) if lower == a else (second, first)
    carried = carries(shapes[lower], shapes[upper], below, above)
    return np.asarray((_clearance(shapes[a], shapes[b], first, second, low, lowest) < -TOUCH) & ~carried)


def _clearance(one: Shape, other: Shape, first: Floats, second: Floats, low: Floats, lowest: Floats) -> Floats:
    """(P,): the clearance of two objects' footprints at poses (P, 3); of furniture, of its pieces at that height."""
    gap = PRIMITIVES["gap"].evaluate
    found = np.full(len(first), np.inf)
    for a, start, stop in _prisms(one):
        for b, begin, end in _prisms(other):
            apart = gap(NUMPY, a, b, *first.T, *second.T)
            shared = np.minimum(low + stop, lowest + end) - np.maximum(low + start, lowest + begin)
            found = np.where(shared > TOUCH, np.minimum(found, apart), found)
    return found


def _prisms(shape: Shape) -> list[tuple[Footprint, float, float]]:
    """What an object consists of, as upright prisms with the heights of their ends."""
    pieces: list[tuple[Footprint, float, float]]
    pieces = [(one.footprint, one.low, one.high) for one in slabs_of(shape)]
    return pieces or [(shape.footprint, 0.0, shape.height)]
