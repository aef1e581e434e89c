"""Masses, and the convex pieces that objects collide with."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from scenegen.geometry import Polygon
from scenegen.things import ASSETS, Box, Circle, Shape, shape_of
from scenegen.things.bodies import DENSITY, collision_of, friction_of, mass_of
from scenegen.things.surfaces import rooms_of

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
        assert piece.closed
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
