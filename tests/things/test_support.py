"""What stands on what: against shapely, in hollows, in towers. Masses, and the convex pieces that objects collide
with.
"""

import math

import numpy as np
import pytest
from scipy.spatial import ConvexHull
from shapely import Point, affinity, box
from shapely import Polygon as Region

from scenegen.geometry import Box, Circle, Polygon
from scenegen.things import ASSETS, Shape, shape_of
from scenegen.things.bodies import DENSITY, collision_of, friction_of, mass_of
from scenegen.things.surfaces import base_heights, rooms_of

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


NAMES = sorted(ASSETS)
PLAINS = [
    Shape("box", Box(0.3, 0.1), 0.05),
    Shape("cylinder", Circle(0.1), 0.02),
    Shape("urdf", Polygon(((0.0, 0.0), (0.2, 0.0), (0.0, 0.1))), 0.07),
    Shape("mug", Circle(0.124), 0.19),
]


def reach(shape, points):
    match shape.footprint:
        case Circle(radius):
            return float((np.hypot(*points[:, :2].T) / radius).max())
        case Box(length, width):
            return float((np.abs(points[:, :2]) * 2 / (length, width)).max())
    return None


@pytest.mark.parametrize("shape", [*map(shape_of, NAMES), *PLAINS], ids=str)
def test_pieces_are_convex_closed_and_within_footprint_and_height(shape):
    pieces = collision_of(shape)
    for piece in pieces:
        assert piece.is_closed
        hull = ConvexHull(piece.vertices)
        assert piece.volume == pytest.approx(hull.volume, rel=1e-6)
    points = np.concatenate([piece.vertices for piece in pieces])
    far = reach(shape, points)
    assert far is None or 0.97 < far < 1 + 1e-9
    assert points[:, 2].min() == pytest.approx(0.0, abs=1e-12)
    assert points[:, 2].max() == pytest.approx(shape.height)


@pytest.mark.parametrize("name", NAMES)
def test_things_stand_on_a_base_that_holds_their_middle(name):
    """The corners of the pieces on the table surround the centre of mass of all pieces, by 4 mm at least."""
    pieces = collision_of(shape_of(name))
    low = np.concatenate([piece.vertices for piece in pieces])
    low = low[low[:, 2] < 1e-9][:, :2]
    centers = np.array([piece.vertices.mean(axis=0)[:2] for piece in pieces])
    volumes = np.array([piece.volume for piece in pieces])
    middle = (centers * volumes[:, None]).sum(axis=0) / volumes.sum()
    assert (ConvexHull(low).equations @ (*middle, 1.0) < -0.004).all()


@pytest.mark.long
@pytest.mark.parametrize("name", [name for name in NAMES if rooms_of(shape_of(name))])
def test_rooms_are_free_of_pieces(name):
    """An upright prism that fills a room touches no piece above the room's floor; rooms grow from the bottom up."""
    shape = shape_of(name)
    rooms = rooms_of(shape)
    heights = [height for _, height in rooms]
    assert heights == sorted(heights) and heights[0] > 0.0 and heights[-1] <= shape.height + 1e-12
    for room, height in rooms:
        if isinstance(room, Circle):
            turns = np.linspace(0.0, 2 * np.pi, 90, endpoint=False)
            ring = 0.999 * room.radius * np.column_stack([np.cos(turns), np.sin(turns)])
        else:
            ring = 0.999 * np.array([(x, y) for x in (-0.5, 0.5) for y in (-0.5, 0.5)]) * room.extent
        for share in (0.0, 0.3, 0.7):
            z = height + 1e-6 + share * (shape.height - height)
            points = np.column_stack([ring, np.full(len(ring), z), np.ones(len(ring))])
            for piece in collision_of(shape):
                inside = (ConvexHull(piece.vertices).equations @ points.T < -1e-6).all(axis=0)
                assert not inside.any()


def test_masses_and_friction():
    for asset in ASSETS.values():
        assert 0.005 <= asset.mass <= 8.0 and 0.2 <= asset.friction <= 0.9
        assert (mass_of(shape_of(asset.name)), friction_of(shape_of(asset.name))) == (asset.mass, asset.friction)
    assert mass_of(Shape("box", Box(0.3, 0.1), 0.05)) == pytest.approx(DENSITY * 0.0015)
    assert mass_of(Shape("mug", Circle(0.124), 0.19)) == pytest.approx(8 * ASSETS["mug"].mass)
