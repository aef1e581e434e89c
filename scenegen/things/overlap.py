"""Which objects of a scene stand in each other: what pictures show as one thing going through another."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from scenegen.geometry import NUMPY, PRIMITIVES, Footprint
from scenegen.pose import flat, places
from scenegen.things.library import Shape
from scenegen.things.surfaces import base_heights, carrier_first, carries, kinds_of, reach_of, slabs_of

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
    reach = np.array([reach_of(shape.footprint) for shape in shapes])
    x, y = np.moveaxis(places(poses), -1, 0)
    kinds = kinds_of(shapes)
    with np.errstate(over="ignore", invalid="ignore"):  # of sizes that are no longer finite when multiplied
        for a in range(len(shapes) - 1):
            rest = slice(a + 1, None)
            near = np.hypot(x[:, a, None] - x[:, rest], y[:, a, None] - y[:, rest]) < reach[a] + reach[rest]
            near &= (
                np.minimum(tops[:, a, None], tops[:, rest]) - np.maximum(bottoms[:, a, None], bottoms[:, rest]) > SEEN
            )
            scenes, others = np.nonzero(near)
            others += a + 1
            pairs: list[tuple[int, int]] = []
            for kind in np.unique(kinds[others]):
                some, b = (numbers[kinds[others] == kind] for numbers in (scenes, others))
                seen = _seen(shapes, (a, int(b[0])), poses[some, a], poses[some, b], bottoms[some, a], bottoms[some, b])
                pairs += zip(some[seen].tolist(), b[seen].tolist(), strict=True)
            for scene, other in sorted(pairs):
                found[scene].append((a, other))
    return found


def _seen(
    shapes: Sequence[Shape], pair: tuple[int, int], first: Floats, second: Floats, low: Floats, lowest: Floats
) -> npt.NDArray[np.bool_]:
    """(P,): whether two objects overlap, and neither carries the other, at poses (P, 3) each."""
    a, b = pair
    lower, upper = carrier_first(shapes, a, b)
    below, above = (first, second) if lower == a else (second, first)
    carried = carries(shapes[lower], shapes[upper], below, above)
    return np.asarray((_apart(shapes[a], shapes[b], first, second, low, lowest) < -SEEN) & ~carried)


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
