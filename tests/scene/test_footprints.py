"""Footprints of scene files: the corners of a polygon are convex and counter-clockwise, or the file is refused."""

import math

import pytest
from pydantic import ValidationError

from scenegen.geometry import Box, Circle, Polygon
from scenegen.scenes.data import PolygonFootprint, footprint_data, footprint_of


@pytest.mark.parametrize("footprint", [Circle(0.1), Box(0.1, 1 / 3), Polygon(((0.0, 0.0), (0.1, 1e-17), (1 / 3, 0.2)))])
def test_a_footprint_reads_back_bit_for_bit(footprint):
    data = footprint_data(footprint)
    assert footprint_of(type(data).model_validate_json(data.model_dump_json())) == footprint


STAR = [(math.cos(math.tau * 2 * k / 5), math.sin(math.tau * 2 * k / 5)) for k in range(5)]


@pytest.mark.parametrize(
    "corners",
    [
        [(0, 0), (0, 1), (1, 0)],
        [(0, 0), (1, 0), (0.1, 0.1), (0, 1)],
        [(0, 0), (1, 0), (2, 0)],
        [(0, 0), (0, 0), (0, 0)],
        STAR,
    ],
    ids=["clockwise", "not convex", "on a line", "a point", "a star"],
)
def test_other_corners_are_refused(corners):
    with pytest.raises(ValidationError, match="convex polygon, counter-clockwise"):
        PolygonFootprint(vertices=[(float(x), float(y)) for x, y in corners])
