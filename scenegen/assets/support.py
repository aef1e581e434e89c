"""What objects stand on: the table, or another object that carries their middle.

Where a spec does not declare heights (docs/adr/0011-supports.md), this is how they are read from the poses
(x, y, theta), for pictures, for files of simulators and for settling alike.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from scenegen.assets.library import Shape
from scenegen.assets.rooms import rooms_of
from scenegen.assets.surfaces import pocketed, reach_of, rim_of, surfaces_of
from scenegen.pose import flat
from scenegen.primitives import NUMPY, POINT, PRIMITIVES, Box, Circle, Footprint, Polygon
from scenegen.primitives.hull import area, centroid

Floats = npt.NDArray[np.float64]

ROUNDING = 1e-9  # of a distance: far more than computing it can lose


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
    middle = _middle(upper.footprint, flat(upper_poses))
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
        u, v, _ = _middle(shapes[upper].footprint, poses[:, upper])
        apart = (x[:, :place] - u[:, None]) ** 2 + (y[:, :place] - v[:, None]) ** 2
        scenes, lower = np.nonzero(apart <= (reach[:place] * (1.0 + ROUNDING)) ** 2)
        for kind in np.unique(kinds[lower]):
            some, below = (numbers[kinds[lower] == kind] for numbers in (scenes, lower))
            carrier = shapes[order[below[0]]]
            carried = _carried(carrier, shapes[upper], poses[some, np.take(order, below)], poses[some, upper], solid)
            np.maximum.at(heights, (some, place), np.where(carried >= 0.0, heights[some, below] + carried, 0.0))
    found = np.empty_like(heights)
    found[:, order] = heights
    return found


def kinds_of(shapes: Sequence[Shape]) -> npt.NDArray[np.int64]:
    """(objects,): a number for each shape, the same for equal ones, so that their pairs can be looked at together."""
    numbers: dict[Shape, int] = {}
    return np.array([numbers.setdefault(shape, len(numbers)) for shape in shapes], dtype=np.int64)


def _carried(lower: Shape, upper: Shape, below: Floats, poses: Floats, solid: bool) -> Floats:
    """(P,): how high above the lowest point of an object another one stands in it or on it, at poses (P, 3) each; -1
    where it is not carried."""
    inside = PRIMITIVES["room"].evaluate
    carried = carries(lower, upper, below, poses)
    if not carried.any():
        return np.full(len(poses), -1.0)
    pockets = None if solid else pocketed(lower)
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


def _middle(footprint: Footprint, poses: Floats) -> tuple[Floats, Floats, Floats]:
    """Where the centroid of a footprint is at poses (P, 3): x, y and, of no meaning for a point, the heading."""
    x, y, theta = poses.T
    if not isinstance(footprint, Polygon):
        return x, y, theta
    u, v = centroid(footprint)
    cos, sin = np.cos(theta), np.sin(theta)
    return x + cos * u - sin * v, y + sin * u + cos * v, theta
