"""What settles: footprints of one height as rigid bodies.

A body is the upright prism over its object's footprint, the solid that specs reason with; handles, hollows and round
undersides are not modelled. All have the same density, so its value cancels wherever two of them push each other.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from scenegen.assets import Shape
from scenegen.assets.outline import simplified
from scenegen.assets.physics import DENSITY
from scenegen.primitives import Box, Circle, Footprint, Polygon
from scenegen.primitives.hull import Point, centroid, signed_area

SIDES = 32  # of the prisms that stand for round things
MOST = 64  # corners of an outline; one with more is replaced by one drawn round it


@dataclass(frozen=True, slots=True)
class Body:
    """A homogeneous prism in its frame of inertia: the origin at the centre of mass, z upwards, x and y along the
    principal axes.

    `outline` has corners (x, y) in metres, counter-clockwise; `center` (x, y) in metres and `turn` in radians say where
    this frame lies in the object's; `mass` in kg, `inertia` about x, y and z in kg m^2. No mass: it cannot be moved.
    """

    outline: tuple[Point, ...]
    height: float
    center: Point
    turn: float
    mass: float
    inertia: tuple[float, float, float]


def body_of(shape: Shape, *, fixed: bool = False) -> Body:
    """The body of an object of this shape; one without mass where it is fixed."""
    corners = _corners(shape.footprint)
    x, y = centroid(Polygon(tuple(corners)))
    centred = [(u - x, v - y) for u, v in corners]
    along, across, mixed = _moments(centred)
    turn = math.atan2(2.0 * mixed, along - across) / 2.0 if mixed else 0.0
    cos, sin = math.cos(turn), math.sin(turn)
    outline = [(cos * u + sin * v, cos * v - sin * u) for u, v in centred]
    along, across, _ = _moments(outline)
    mass = 0.0 if fixed else DENSITY * signed_area(corners) * shape.height
    upright = shape.height**2 / 12.0
    inertia = mass * (across + upright), mass * (along + upright), mass * (along + across)
    return Body(tuple(outline), shape.height, (x, y), turn, mass, inertia)


def _corners(footprint: Footprint) -> Sequence[Point]:
    match footprint:
        case Circle(radius):
            # Inscribed, so that round things which do not overlap are not pushed apart; 0.5 % of the radius too small.
            turns = [k * math.tau / SIDES for k in range(SIDES)]
            return [(radius * math.cos(turn), radius * math.sin(turn)) for turn in turns]
        case Box(length, width):
            x, y = length / 2.0, width / 2.0
            return [(-x, -y), (x, -y), (x, y), (-x, y)]
        case Polygon(vertices):
            return simplified(vertices, MOST)


def _moments(corners: Sequence[Point]) -> tuple[float, float, float]:
    """The means of x^2, y^2 and xy over a polygon, in m^2: Green's theorem makes the integrals sums over edges."""
    along = across = mixed = 0.0
    for (ax, ay), (bx, by) in pairwise((*corners, corners[0])):
        twice = ax * by - bx * ay
        along += twice * (ax * ax + ax * bx + bx * bx)
        across += twice * (ay * ay + ay * by + by * by)
        mixed += twice * (ax * by + 2.0 * ax * ay + 2.0 * bx * by + bx * ay)
    area = signed_area(corners)
    return along / (12.0 * area), across / (12.0 * area), mixed / (24.0 * area)
