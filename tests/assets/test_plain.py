"""Meshes and colours of plain shapes: boxes, cylinders and prisms of any size."""

import itertools
import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from scenegen.geometry import Box, Circle, Polygon
from scenegen.geometry.footprint import convex_hull
from scenegen.things import ASSETS, Shape
from scenegen.things.bodies import parts_of, parts_of_asset
from scenegen.things.palette import colors_of

from ..laws import examples

GREY = (0.5, 0.5, 0.5)
SIZES = st.floats(0.001, 5.0)


@st.composite
def prisms(draw):
    """Polygons of three to twelve corners that need not surround the origin."""
    x, y, count = draw(st.floats(-3.0, 3.0)), draw(st.floats(-3.0, 3.0)), draw(st.integers(3, 12))
    long, wide, start = draw(SIZES), draw(SIZES), draw(st.floats(0.0, 1.0))
    turns = [math.tau * (k + start) / count for k in range(count)]
    return convex_hull([(x + long * math.cos(turn), y + wide * math.sin(turn)) for turn in turns])


def area_of(footprint):
    match footprint:
        case Circle(radius):
            return math.pi * radius**2
        case Box(length, width):
            return length * width
    return shapely.Polygon(footprint.vertices).area


def reach(footprint, points):
    """How far points (P, 2) get out of the footprint, in metres."""
    match footprint:
        case Circle(radius):
            return float((np.hypot(*points.T) - radius).max())
        case Box(length, width):
            return float((np.abs(points) - (length / 2, width / 2)).max())
    outline = shapely.Polygon(footprint.vertices)
    return max(outline.distance(point) for point in shapely.points(points))


FOOTPRINTS = st.one_of(SIZES.map(Circle), st.builds(Box, SIZES, SIZES), prisms())


@settings(max_examples=examples(150), deadline=None)
@given(footprint=FOOTPRINTS, height=SIZES)
def test_meshes_are_closed_and_fill_footprint_and_height(footprint, height):
    body, mark = parts_of(Shape("urdf", footprint, height), GREY)
    size = max(*footprint.extent, height)
    for part in (body, mark):
        assert part.mesh.closed and part.mesh.volume > 0.0
        assert len(part.mesh.faces) * 3 < 8192  # pybullet's limit for meshes in memory on some systems
        assert reach(footprint, part.mesh.vertices[:, :2]) < 1e-9 * size
        assert part.mesh.vertices[:, 2].min() > -1e-12 * size
    assert mark.color != body.color
    top = mark.mesh.vertices[:, 2].max()
    assert top == pytest.approx(height)
    assert 0.9 * height < body.mesh.vertices[:, 2].max() < top  # the mark is to be seen
    # A regular polygon stands for the circle, bevels and the mark's rise take a little.
    assert 0.85 * area_of(footprint) * height < body.mesh.volume <= area_of(footprint) * height * (1 + 1e-9)


@pytest.mark.parametrize(
    "footprint", [Circle(0.1), Box(0.3, 0.1), Box(0.1, 0.3), convex_hull([(1, 1), (2, 1), (1, 3)])]
)
def test_the_mark_points_along_the_heading(footprint):
    """Its front is narrower than its back, and it is as wide to the left as to the right."""
    _, mark = parts_of(Shape("prism", footprint, 0.1), GREY)
    x, y = mark.mesh.vertices[:, :2].T
    front, back = y[x > x.max() - 1e-9], y[x < x.min() + 1e-9]
    assert np.ptp(front) < 0.3 * np.ptp(back)
    assert front.mean() == pytest.approx(back.mean(), abs=1e-9)


@pytest.mark.long
def test_a_prism_with_very_many_corners_can_be_drawn():
    turns = np.linspace(0.0, math.tau, 3000, endpoint=False)
    body, _ = parts_of(Shape("prism", Polygon(tuple(zip(np.cos(turns), np.sin(turns), strict=True))), 1.0), GREY)
    assert len(body.mesh.faces) * 3 < 8192
    assert body.mesh.closed


def test_an_asset_with_a_polygon_is_a_prism_and_with_another_size_is_stretched():
    corners = Polygon(((0.0, 0.0), (0.2, 0.0), (0.0, 0.1)))
    for a, b in zip(
        parts_of(Shape("mug", corners, 0.1), GREY), parts_of(Shape("prism", corners, 0.1), GREY), strict=True
    ):
        assert np.array_equal(a.mesh.vertices, b.mesh.vertices)
    stretched = parts_of(Shape("mug", Circle(0.124), 0.095), ASSETS["mug"].color)
    for part, own in zip(stretched, parts_of_asset(ASSETS["mug"]), strict=True):
        assert np.allclose(part.mesh.vertices, own.mesh.vertices * (2.0, 2.0, 1.0))


def test_elements_of_an_array_can_have_shades_and_the_first_has_the_colour_of_the_name():
    names = [f"post[{k}]" for k in range(1, 8)]
    colors = colors_of([(name, "cylinder") for name in names], distinct=True)
    for a, b in itertools.combinations(colors, 2):
        assert np.abs(np.subtract(a, b)).max() > 0.08
    assert colors[:1] == colors_of([("post", "cylinder")])
    # The same whatever stands beside it, as long as that is of the library.
    assert colors_of([("mug", "mug"), *((name, "cylinder") for name in names)], distinct=True)[1:] == colors


def test_a_plain_shape_with_the_name_of_an_asset_has_its_colour():
    assert colors_of([("block[1]", "box"), ("mug", "prism")]) == (ASSETS["block"].color, ASSETS["mug"].color)


def test_plain_shapes_of_all_kinds_can_be_told_apart():
    names = [("tray", "box"), ("post", "cylinder"), ("wedge", "prism"), ("server", "urdf"), ("block", "box")]
    names += [("block2", "box"), ("shelf[1]", "box"), ("shelf[2]", "box")]
    for a, b in itertools.combinations(colors_of(names, distinct=True), 2):
        assert np.abs(np.subtract(a, b)).max() > 0.08
