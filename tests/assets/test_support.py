"""What stands on what: against shapely, in hollows, in towers."""

import math

import numpy as np
import pytest
from shapely import Point, affinity, box
from shapely import Polygon as Region

from scenegen.geometry import Box, Circle, Polygon
from scenegen.things import Shape, shape_of
from scenegen.things.surfaces import base_heights

WEDGE = Polygon(((0.02, 0.01), (0.09, 0.01), (0.03, 0.06)))  # beside its own origin
SHAPES = (
    Shape("box", Box(0.5, 0.4), 0.03),
    Shape("cylinder", Circle(0.12), 0.02),
    Shape("box", Box(0.1, 0.05), 0.07),
    Shape("prism", WEDGE, 0.11),
    Shape("cylinder", Circle(0.02), 0.2),
)


def _region(footprint, x, y, theta):
    match footprint:
        case Circle(radius):
            flat = Point(0, 0).buffer(radius, quad_segs=256)
        case Box(length, width):
            flat = box(-length / 2, -width / 2, length / 2, width / 2)
        case _:
            flat = Region(footprint.vertices)
    return affinity.translate(affinity.rotate(flat, theta, origin=(0, 0), use_radians=True), x, y)


def test_objects_stand_on_the_highest_that_holds_their_middle():
    """Against shapely, over random scenes: the larger carries, heights follow by recursion."""
    poses = np.random.default_rng(3).uniform((0, 0, 0), (0.4, 0.4, 2 * math.pi), size=(300, len(SHAPES), 3))
    found = base_heights(SHAPES, poses)
    stood = 0
    for scene, heights in zip(poses, found, strict=True):
        regions = [_region(shape.footprint, *pose) for shape, pose in zip(SHAPES, scene.tolist(), strict=True)]

        def height(k, regions=regions):
            below = [m for m in range(len(SHAPES)) if regions[m].area > regions[k].area]
            below = [m for m in below if regions[m].contains(regions[k].centroid)]
            return max((height(m) + SHAPES[m].height for m in below), default=0.0)

        expected = [height(k) for k in range(len(SHAPES))]
        stood += sum(1 for one in expected if one > 0)
        assert heights == pytest.approx(expected)
    assert stood > 200


def test_of_equals_the_first_carries_and_towers_stand():
    block = shape_of("block")
    poses = np.array([[(0.5, 0.5, 0.0), (0.51, 0.5, 1.0), (0.52, 0.5, 2.0)], [(0.5, 0.5, 0.0)] * 3])
    assert base_heights((block,) * 3, poses) == pytest.approx(np.array([[0.0, 0.05, 0.10]] * 2))


def test_the_middle_on_the_edge_is_not_carried():
    shapes = (Shape("box", Box(0.2, 0.2), 0.1), Shape("box", Box(0.1, 0.1), 0.1))
    poses = np.array([[(0.0, 0.0, 0.0), (x, 0.0, 0.0)] for x in (0.0999, 0.1, 0.1001)])
    assert base_heights(shapes, poses)[:, 1].tolist() == [0.1, 0.0, 0.0]


def test_hollows_hold_what_fits_and_the_rim_carries_the_rest():
    plate = shape_of("plate")
    rod = [Shape("cylinder", Circle(radius), 0.05) for radius in (0.02, 0.07, 0.09, 0.10, 0.124)]
    poses = np.zeros((1, 2, 3))
    deep = [float(base_heights((plate, one), poses)[0, 1]) for one in rod]
    assert deep[:2] == [0.007, 0.007] and 0.007 < deep[2] < deep[3] < 0.022 and deep[4] == plate.height
    assert [float(base_heights((plate, one), poses, solid=True)[0, 1]) for one in rod] == [plate.height] * 5
    poses[0, 1, 0] = 0.07  # its middle over the slope
    assert 0.007 < float(base_heights((plate, rod[0]), poses)[0, 1]) < plate.height


def test_heights_grow_with_stretched_things():
    large = Shape("bowl", Circle(0.16), 0.12)
    rod = Shape("cylinder", Circle(0.05), 0.05)
    assert float(base_heights((large, rod), np.zeros((1, 2, 3)))[0, 1]) == pytest.approx(0.02)


def test_no_scenes_and_no_objects_are_no_work():
    assert base_heights(SHAPES, np.empty((0, 5, 3))).shape == (0, 5)
    assert base_heights((), np.empty((4, 0, 3))).shape == (4, 0)
