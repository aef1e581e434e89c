"""What objects stand on before they settle: the table, or an object whose footprint holds all of theirs.

So what lies on a tray or stands on a napkin rests on it, while objects that overlap in part stand in each other and
will be pushed apart. Heights are not part of a scene (poses are x, y, theta); this is how they are read from it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from scenegen.assets import Shape
from scenegen.primitives import NUMPY, PRIMITIVES, Box, Circle, Footprint
from scenegen.primitives.hull import area

Floats = npt.NDArray[np.float64]


def levels(shapes: Sequence[Shape], poses: Floats) -> Floats:
    """(scenes, objects): how high above the table each object stands, in metres; `poses` is (scenes, objects, 3).

    An object stands on the highest of the objects that hold its whole footprint. Only a larger footprint can, so that
    no two objects ever stand on each other.
    """
    areas = [_area(shape.footprint) for shape in shapes]
    order = sorted(range(len(shapes)), key=lambda k: -areas[k])  # what may carry an object comes before it
    inside = PRIMITIVES["room"].evaluate
    heights = np.zeros(poses.shape[:2])
    coordinates = poses.transpose(1, 2, 0)
    for place, upper in enumerate(order):
        for lower in order[:place]:
            if areas[lower] <= areas[upper]:
                continue
            footprints = shapes[upper].footprint, shapes[lower].footprint
            held = inside(NUMPY, *footprints, *coordinates[upper], *coordinates[lower]) >= 0.0
            top = np.where(held, heights[:, lower] + shapes[lower].height, 0.0)
            heights[:, upper] = np.maximum(heights[:, upper], top)
    return heights


def _area(footprint: Footprint) -> float:
    match footprint:
        case Circle(radius):
            return math.pi * radius**2
        case Box(length, width):
            return length * width
        case _:
            return area(footprint)
