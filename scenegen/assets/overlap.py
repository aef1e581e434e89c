"""Which objects of a scene stand in each other: what pictures show as one thing going through another."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np
import numpy.typing as npt

from scenegen.assets.library import Shape
from scenegen.assets.support import base_heights, carrier_first, carries
from scenegen.assets.surfaces import reach_of, slabs_of
from scenegen.pose import flat, places
from scenegen.primitives import NUMPY, PRIMITIVES, Footprint

Floats = npt.NDArray[np.float64]

SEEN = 1e-3  # metres that two objects share at least, sideways and upwards


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
    reach = [reach_of(shape.footprint) for shape in shapes]
    with np.errstate(over="ignore", invalid="ignore"):  # of sizes that are no longer finite when multiplied
        for a, b in combinations(range(len(shapes)), 2):
            near = np.hypot(*(places(poses[:, a]) - places(poses[:, b])).T) < reach[a] + reach[b]
            near &= np.minimum(tops[:, a], tops[:, b]) - np.maximum(bottoms[:, a], bottoms[:, b]) > SEEN
            if not near.any():
                continue
            some = np.flatnonzero(near)
            lower, upper = carrier_first(shapes, a, b)
            apart = _apart(shapes[a], shapes[b], poses[some, a], poses[some, b], bottoms[some, a], bottoms[some, b])
            carried = carries(shapes[lower], shapes[upper], poses[some, lower], poses[some, upper])
            for scene in some[(apart < -SEEN) & ~carried]:
                found[scene].append((a, b))
    return found


def _apart(one: Shape, other: Shape, first: Floats, second: Floats, low: Floats, lowest: Floats) -> Floats:
    """(P,): the clearance of two objects' footprints at poses (P, 3); of furniture, of its pieces at that height."""
    gap = PRIMITIVES["gap"].evaluate
    found = np.full(len(first), np.inf)
    for a, start, stop in _upright(one):
        for b, begin, end in _upright(other):
            apart = gap(NUMPY, a, b, *first.T, *second.T)
            shared = np.minimum(low + stop, lowest + end) - np.maximum(low + start, lowest + begin)
            found = np.where(shared > SEEN, np.minimum(found, apart), found)
    return found


def _upright(shape: Shape) -> list[tuple[Footprint, float, float]]:
    """What an object consists of, as upright prisms with the heights of their ends."""
    pieces: list[tuple[Footprint, float, float]]
    pieces = [(one.footprint, one.low, one.high) for one in slabs_of(shape)]
    return pieces or [(shape.footprint, 0.0, shape.height)]
