"""What stands in what: not what lies on it, or inside it."""

import numpy as np
import pytest

from scenegen.geometry import Polygon
from scenegen.things import Shape, shape_of
from scenegen.things.surfaces import overlapping

WEDGE = Shape("prism", Polygon(((0.0, 0.0), (0.2, 0.0), (0.0, 0.2))), 0.05)
PAIRS = [
    ("spoon", "bowl", (0.12, 0.0, 0.0), True),  # through the wall: its middle is beside the bowl
    ("spoon", "bowl", (0.02, 0.0, 0.0), False),  # across the rim
    ("apple", "bowl", (0.01, 0.0, 0.0), False),  # inside
    ("mug", "plate", (0.05, 0.0, 0.0), False),  # on it
    ("mug", "plate", (0.15, 0.0, 0.0), True),  # half on it
    ("mug", "plate", (0.19, 0.0, 0.0), False),  # beside it
    ("mug", "plate", (0.1865, 0.0, 0.0), False),  # by half a millimetre, which nobody sees
    ("napkin", "spoon", (0.16, 0.0, 0.0), True),
]


@pytest.mark.parametrize(("one", "other", "pose", "through"), PAIRS)
def test_pairs(one, other, pose, through):
    shapes, away = [shape_of(one), shape_of(other)], (2.0, 2.0, 0.0)
    at = (0.0, 0.0, 0.0)
    wanted = [[(0, 1)], []] if through else [[], []]
    assert overlapping(shapes, _scenes([pose, at], [away, at])) == wanted
    assert overlapping(shapes[::-1], _scenes([at, pose], [at, away])) == wanted


def test_heights_count():
    """A book on a carton reaches over the can beside it, and through the bottle, which is taller."""
    shapes = [shape_of("carton"), shape_of("book"), shape_of("can"), shape_of("bottle")]
    scene = [(0.0, 0.0, 0.0), (0.1, 0.0, 0.0), (0.22, 0.0, 0.0), (0.19, 0.08, 0.0)]
    assert overlapping(shapes, _scenes(scene)) == [[(1, 3)]]


def test_polygons_and_nothing_at_all():
    at = (0.0, 0.0, 0.0)
    assert overlapping([WEDGE, shape_of("can")], _scenes([at, (0.21, 0.02, 0.0)], [at, (0.14, 0.14, 0.0)])) == [
        [(0, 1)],
        [],
    ]
    assert overlapping([WEDGE], _scenes([at])) == [[]]
    assert overlapping([WEDGE, WEDGE], _scenes([at, at])[:0]) == []


def _scenes(*rows):
    return np.array(rows)
