"""Which objects of a scene stand in each other: what pictures show as one thing going through another."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations

import numpy as np
import numpy.typing as npt

from scenegen.assets.library import Shape
from scenegen.assets.support import base_heights, carrier_first, carries
from scenegen.primitives import NUMPY, PRIMITIVES, Box, Circle, Footprint

Floats = npt.NDArray[np.float64]

SEEN = 1e-3  # metres that two objects share at least, sideways and upwards


def overlapping(shapes: Sequence[Shape], poses: Floats) -> list[list[tuple[int, int]]]:
    """For each scene the pairs of objects whose footprints overlap at one height, by more than a millimetre.

    `poses` is (scenes, objects, 3). What stands on another object, or inside it, does not overlap it.
    """
    found: list[list[tuple[int, int]]] = [[] for _ in poses]
    if not len(poses):
        return found
    gap = PRIMITIVES["gap"].evaluate
    bottoms = base_heights(shapes, poses)
    tops = bottoms + np.array([shape.height for shape in shapes])
    reach = [_radius(shape.footprint) for shape in shapes]
    with np.errstate(over="ignore", invalid="ignore"):  # of sizes that are no longer finite when multiplied
        for a, b in combinations(range(len(shapes)), 2):
            near = np.hypot(*(poses[:, a, :2] - poses[:, b, :2]).T) < reach[a] + reach[b]
            near &= np.minimum(tops[:, a], tops[:, b]) - np.maximum(bottoms[:, a], bottoms[:, b]) > SEEN
            if not near.any():
                continue
            some = np.flatnonzero(near)
            lower, upper = carrier_first(shapes, a, b)
            apart = gap(NUMPY, shapes[a].footprint, shapes[b].footprint, *poses[some, a].T, *poses[some, b].T)
            carried = carries(shapes[lower], shapes[upper], poses[some, lower], poses[some, upper])
            for scene in some[(apart < -SEEN) & ~carried]:
                found[scene].append((a, b))
    return found


def _radius(footprint: Footprint) -> float:
    """Of a circle round the origin that holds all of it, in metres."""
    match footprint:
        case Circle(radius):
            return radius
        case Box(length, width):
            return math.hypot(length, width) / 2.0
        case _:
            return max(math.hypot(x, y) for x, y in footprint.vertices)
