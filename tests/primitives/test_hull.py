"""Convex hulls, areas and centroids against scipy and shapely, and which polygons pass as convex."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from scenegen.geometry import Polygon
from scenegen.geometry.footprint import area, centroid, clipped, convex_hull, is_convex, signed_area

coordinates = st.floats(-2.0, 2.0)


@pytest.mark.parametrize("seed", range(40))
def test_against_scipy_and_shapely(seed):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(rng.integers(3, 40), 2)) * 0.3 + rng.normal(size=2)
    hull = convex_hull(map(tuple, points.tolist()))
    expected = points[ConvexHull(points).vertices]  # counter-clockwise in the plane
    start = int(np.lexsort((expected[:, 1], expected[:, 0]))[0])
    assert np.array_equal(np.array(hull.vertices), np.roll(expected, -start, axis=0))
    other = shapely.Polygon(hull.vertices)
    assert area(hull) == pytest.approx(other.area) and signed_area(hull.vertices) > 0.0
    assert centroid(hull) == pytest.approx((other.centroid.x, other.centroid.y))
    assert is_convex(hull.vertices) and is_convex(hull.vertices[::-1])


def test_points_on_edges_and_doubles_go():
    square = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
    more = [*square, (0.5, 0.0), (0.5, 0.5), (1.0, 0.5), (0.0, 0.0)]
    assert convex_hull(more) == Polygon(tuple(square))


@pytest.mark.parametrize("points", [[], [(0, 0)], [(0, 0), (1, 1), (0, 0)], [(0, 0), (1, 1), (2, 2), (3, 3)]])
def test_no_polygon_without_area(points):
    with pytest.raises(ValueError, match="three points"):
        convex_hull(points)
    assert not is_convex(points)


def test_what_is_convex():
    square = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
    assert is_convex(square) and is_convex(square[::-1])
    assert is_convex([(0.0, 0.0), (0.5, 0.0), *square[1:]])  # a point on an edge
    assert is_convex([(0.0, 0.0), (0.1, 0.03), (0.2, 0.06), (0.3, 0.09), (0.0, 0.5)])  # decimals on a line
    assert not is_convex([*square[:2], (0.5, 0.4), *square[2:]])  # a dent
    assert not is_convex([square[0], square[2], square[1], square[3]])  # a bow tie
    assert not is_convex([*square, *square])  # twice around
    assert not is_convex([square[0], *square])  # a double
    assert not is_convex([(0.0, 0.0), (2.0, 0.0), (1.0, 0.0), (1.0, 1.0)])  # back along an edge
    star = [(math.cos(k * 0.8 * math.pi), math.sin(k * 0.8 * math.pi)) for k in range(5)]
    assert not is_convex(star)  # only left turns, but two rounds of them


def test_far_from_the_origin():
    far = Polygon(((1e6, 1e6), (1e6 + 0.5, 1e6), (1e6 + 0.5, 1e6 + 0.25), (1e6, 1e6 + 0.25)))
    assert area(far) == 0.125 and centroid(far) == (1e6 + 0.25, 1e6 + 0.125)
    with pytest.raises(ValueError, match="centroid"):
        centroid(Polygon(((0.0, 0.0), (1.0, 1.0), (2.0, 2.0))))


def test_what_a_polygon_and_a_rectangle_share():
    square = ((0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0))
    assert clipped(square, (-1.0, -1.0, 3.0, 3.0)) == square
    assert signed_area(clipped(square, (1.0, -1.0, 3.0, 1.0))) == 1.0
    assert signed_area(clipped(((0.0, 0.0), (2.0, 0.0), (0.0, 2.0)), (0.0, 0.0, 1.0, 1.0))) == 1.0
    assert len(clipped(((0.0, 0.0), (2.0, 0.0), (0.0, 2.0)), (0.0, 0.0, 1.5, 1.5))) == 5
    assert clipped(square, (2.5, 0.0, 3.0, 1.0)) == ()


@given(st.lists(st.tuples(coordinates, coordinates), min_size=3, max_size=12))
def test_what_is_shared_is_what_shapely_says(points):
    try:
        hull = convex_hull(points)
    except ValueError:
        return
    shared = clipped(hull.vertices, (-0.5, -0.25, 0.5, 0.75))
    expected = shapely.Polygon(hull.vertices).intersection(shapely.box(-0.5, -0.25, 0.5, 0.75)).area
    assert (signed_area(shared) if len(shared) > 2 else 0.0) == pytest.approx(expected, abs=1e-9)
    assert all(-0.5 - 1e-9 <= x <= 0.5 + 1e-9 and -0.25 - 1e-9 <= y <= 0.75 + 1e-9 for x, y in shared)
