"""Rigid bodies of footprints: mass, centre and inertia against sampling."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import Polygon as Region

from scenegen.geometry import Box, Circle, Polygon
from scenegen.things import Shape
from scenegen.worlds.physics.bodies import DENSITY, SIDES, prism_of

from ..laws import examples

WEDGE = Polygon(((0.0, 0.0), (0.3, 0.0), (0.25, 0.1), (0.05, 0.03)))


def outline(body):
    """The corners (x, y) of a prism's top."""
    return body.corners[len(body.corners) // 2 :, :2].tolist()


@pytest.mark.parametrize(
    ("shape", "inertia"),
    [
        (Shape("box", Box(0.2, 0.1), 0.3), (0.1**2 + 0.3**2, 0.2**2 + 0.3**2, 0.2**2 + 0.1**2)),
        (Shape("cylinder", Circle(0.1), 0.3), (3 * 0.1**2 + 0.3**2, 3 * 0.1**2 + 0.3**2, 6 * 0.1**2)),
    ],
)
def test_boxes_and_cylinders_have_the_inertia_of_the_textbook(shape, inertia):
    """m/12 (w^2 + h^2) and so on; a cylinder within what 32 sides leave out."""
    body = prism_of(shape)
    volume = 0.2 * 0.1 * 0.3 if shape.asset == "box" else math.pi * 0.1**2 * 0.3
    slack = 1e-12 if shape.asset == "box" else 0.02
    assert body.mass == pytest.approx(DENSITY * volume, rel=slack)
    assert body.inertia == pytest.approx([body.mass * part / 12.0 for part in inertia], rel=slack)
    assert np.allclose(body.center, (0.0, 0.0, 0.15), atol=1e-15)


@given(
    corners=st.lists(st.tuples(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3)), min_size=3, max_size=8),
    height=st.floats(0.01, 0.5),
)
@settings(max_examples=examples(30), deadline=None)
def test_the_inertia_of_a_prism_is_that_of_its_triangles(corners, height):
    """Oracle: shapely's hull in triangles, whose second moments about a point are exact by the midpoint rule.
    Corners that stand out by less than a millionth are left out of bodies, which costs a few such parts."""
    hull = Region(corners).convex_hull if len(set(corners)) > 2 else None
    if hull is None or hull.geom_type != "Polygon" or hull.area < 1e-3:
        return
    ring = np.array(hull.exterior.coords)[:-1]
    ring = ring if hull.exterior.is_ccw else ring[::-1]
    body = prism_of(Shape("prism", Polygon(tuple(map(tuple, ring.tolist()))), height))
    center = np.array([hull.centroid.x, hull.centroid.y])
    second = np.zeros((2, 2))
    for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True):
        sides = [(a + b) / 2 - center, (b - center) / 2, (a - center) / 2]
        area = ((a - center)[0] * (b - center)[1] - (a - center)[1] * (b - center)[0]) / 2
        second += area / 3 * sum(np.outer(side, side) for side in sides)
    assert np.allclose(body.center[:2], center, atol=1e-6)
    axis = np.array([math.cos(body.turn), math.sin(body.turn)])
    cross = np.array([-axis[1], axis[0]])
    along, across = axis @ second @ axis, cross @ second @ cross
    assert abs(axis @ second @ cross) < 1e-5 * np.trace(second)
    mass = DENSITY * hull.area * height
    tall = mass * height**2 / 12
    weight = DENSITY * height
    expected = (weight * across + tall, weight * along + tall, weight * (along + across))
    assert body.inertia == pytest.approx(expected, rel=1e-5)


def test_the_outline_lies_where_the_footprint_does():
    body = prism_of(Shape("prism", WEDGE, 0.1))
    cos, sin = math.cos(body.turn), math.sin(body.turn)
    back = [(body.center[0] + cos * x - sin * y, body.center[1] + sin * x + cos * y) for x, y in outline(body)]
    assert np.allclose(back, WEDGE.vertices, atol=1e-12)


def test_a_round_body_stays_inside_its_footprint():
    """So that round things that just do not overlap are not pushed apart."""
    body = prism_of(Shape("cylinder", Circle(0.1), 0.1))
    assert len(outline(body)) == SIDES
    assert max(math.hypot(x, y) for x, y in outline(body)) <= 0.1 * (1 + 1e-12)


def test_fixed_bodies_have_no_mass():
    body = prism_of(Shape("box", Box(0.2, 0.1), 0.3), fixed=True)
    assert (body.mass, body.inertia) == (0.0, (0.0, 0.0, 0.0))
