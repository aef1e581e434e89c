"""How things that taper stand in vessels whose walls slope: how deep they go, and how far they can then be moved.

Both are taken as solids of revolution on one axis: how wide a thing is at each height, against how wide the vessel is
there. `rooms.py` has what fits as a prism; this is for what does not.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise

from scenegen.assets.boards import Surface
from scenegen.assets.hollow import SIDES, Vessel
from scenegen.assets.library import Shape
from scenegen.assets.rooms import asset_of, stretch_of
from scenegen.assets.solids import GRIP, HANDLES, HOLLOWS, ROUNDS, Rows
from scenegen.primitives import Box, Circle

SLACK = (
    0.0001  # metres to each side of what stands between sloping walls: where it fits exactly there is one place alone
)
NARROWEST = 0.001  # metres that a foot overlaps a rim on which it stands
UNSURE = 0.0018  # metres by which a height may be off: walls are flat pieces, so it depends on how both are turned
TILT = math.tan(math.radians(2.2))  # that what is no solid of revolution may lean by
BULGING = ("mouse", "teapot", "laptop")  # of these, less than the footprint's corners touches a wall
FLAT = math.cos(math.pi / SIDES)  # how far the pieces of a wall come in
STEPS = 60  # of a bisection


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
    asset, name = asset_of(shape), shape.asset
    x, y, z = stretch_of(shape)
    if asset is not None and name in ROUNDS:
        return Profile(_scaled(ROUNDS[name], max(x, y), z))
    vessel = None if asset is None else HOLLOWS.get(name)
    if not isinstance(vessel, Vessel):
        reach = _reach(shape)
        return Profile(((0.0, reach), (shape.height, reach)))
    body = _scaled([(height, outer) for height, outer, _ in vessel.rows], max(x, y), z)
    if name not in HANDLES:
        return Profile(body)
    _, end, low, high = HANDLES[name]
    return Profile(body, ((low * z, high * z, math.hypot(end, GRIP / 2.0) * max(x, y)),))


@cache
def leeway(lower: Shape, upper: Shape, height: float) -> float | None:
    """How far the axes of two things can be apart where `upper` begins at a height above the lowest point of the vessel
    `lower`, in metres; negative where they share space. None where `lower` is no vessel."""
    walls = _walls(lower)
    return None if walls is None else _leeway(walls, profile_of(upper), height)


@cache
def nested(lower: Shape, upper: Shape) -> Surface | None:
    """Where an object stands in a vessel, as deep as its own shape lets it, or on the vessel's rim. Its outline holds
    the circle round the footprint wherever the object can stand. None where it would tilt, jam or fall through, and
    where `lower` is no vessel."""
    walls = _walls(lower)
    if walls is None:
        return None
    profile, (floor, _), (rim, mouth) = profile_of(upper), walls[0], walls[-1]
    free = _leeway(walls, profile, floor)
    if free >= SLACK:
        return _surface("inside", upper, floor, free)
    if profile.foot >= mouth + NARROWEST:
        return _on_rim(upper, profile.foot * FLAT - mouth, mouth * FLAT, rim)
    high = _lowest(lambda height: _of_body(walls, profile, height, FLAT) >= SLACK, floor, rim)
    low = _lowest(lambda height: _of_body(walls, profile, height, 1.0) >= 0.0, floor, rim)
    height = high if high - low <= UNSURE / 2.0 else (low + high) / 2.0
    held = _of_body(walls, profile, high, FLAT) >= SLACK and _of_ears(walls, profile, low) >= SLACK
    held = held and high - height <= UNSURE and _lies_level(upper, high - low)
    return _surface("inside", upper, height, SLACK) if held else None


def _lies_level(upper: Shape, unsure: float) -> bool:
    """Whether a thing lies level on the walls where heights under its corners differ by as much as they can."""
    if isinstance(upper.footprint, Circle):
        return True
    return upper.asset not in BULGING and unsure <= TILT * min(upper.footprint.extent)


def _on_rim(upper: Shape, free: float, mouth: float, height: float) -> Surface | None:
    """On a ring: a foot that covers all of it, the middle over the mouth."""
    if free < SLACK or not isinstance(upper.footprint, Circle):
        return None
    if free < mouth:
        return _surface("rim", upper, height, free)
    return Surface("rim", Circle(mouth), height, far=mouth)


def _surface(name: str, upper: Shape, height: float, free: float) -> Surface:
    outline = Circle(free + _reach(upper))
    far = free if isinstance(upper.footprint, Circle) else outline.radius
    if isinstance(upper.footprint, Box):  # both ends of a diagonal are in the circle
        far = math.sqrt(outline.radius**2 - _reach(upper) ** 2)
    return Surface(name, outline, height, walled=True, far=far)


def _walls(shape: Shape) -> Rows | None:
    """(z, inner radius) of a vessel from its floor to its rim."""
    vessel = None if asset_of(shape) is None else HOLLOWS.get(shape.asset)
    if not isinstance(vessel, Vessel):
        return None
    x, y, z = stretch_of(shape)
    return _scaled([(height, inner) for height, _, inner in vessel.rows if inner > 0.0], min(x, y), z)


def _leeway(walls: Rows, profile: Profile, height: float) -> float:
    return min(_of_body(walls, profile, height, FLAT), _of_ears(walls, profile, height))


def _of_body(walls: Rows, profile: Profile, height: float, flat: float) -> float:
    """The least of what the walls are wider than a thing, of all heights up to the rim."""
    start, end = max(walls[0][0], height), min(walls[-1][0], height + profile.body[-1][0])
    levels = {start, end, *(z for z, _ in walls), *(height + z for z, _ in profile.body)}
    return min(flat * _at(walls, z, min) - _at(profile.body, z - height, max) for z in levels if start <= z <= end)


def _of_ears(walls: Rows, profile: Profile, height: float) -> float:
    """The same of handles: walls lean outwards, so they are closest to the lowest point of one."""
    floor, rim = walls[0][0], walls[-1][0]
    places = ((max(floor, height + low), reach) for low, _, reach in profile.ears)
    return min((FLAT * _at(walls, z, min) - reach for z, reach in places if z <= rim), default=math.inf)


def _at(rows: Rows, z: float, pick: Callable[[Iterable[float]], float]) -> float:
    """The radius at a height; at a step, `pick` of both."""
    found = []
    for (low, below), (high, above) in pairwise(rows):
        if low <= z <= high:
            found += [below, above] if low == high else [below + (above - below) * (z - low) / (high - low)]
    return pick(found or [rows[0][1] if z < rows[0][0] else rows[-1][1]])  # beyond an end by rounding


def _lowest(holds: Callable[[float], bool], low: float, high: float) -> float:
    """The least number between two from which on something holds."""
    for _ in range(STEPS):
        middle = (low + high) / 2.0
        low, high = (low, middle) if holds(middle) else (middle, high)
    return high


def _scaled(rows: Sequence[tuple[float, float]], wide: float, tall: float) -> Rows:
    return tuple((z * tall, radius * wide) for z, radius in rows)


def _reach(shape: Shape) -> float:
    match shape.footprint:
        case Circle(radius):
            return radius
        case Box(length, width):
            return math.hypot(length, width) / 2.0
        case outline:
            return max(math.hypot(x, y) for x, y in outline.vertices)
