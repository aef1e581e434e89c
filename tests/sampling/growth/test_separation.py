"""Whether footprints are a distance apart, against the clearance itself."""

import numpy as np
import pytest

from scenegen.geometry import NUMPY, PRIMITIVES
from scenegen.geometry.footprint import Box, Circle, Polygon
from scenegen.sampling.growth.touch import _beyond, apart

SHAPES = {
    "disc": Circle(0.05),
    "box": Box(0.2, 0.1),
    "square": Box(0.1, 0.1),
    "triangle": Polygon(((0.0, 0.0), (0.12, 0.0), (0.02, 0.1))),
    "off its origin": Polygon(((0.1, 0.1), (0.2, 0.1), (0.2, 0.25), (0.1, 0.2))),
}
PAIRS = [(a, b) for a in SHAPES for b in SHAPES]


def poses(count=4000):
    rng = np.random.default_rng(0)
    at, other = (rng.random((3, count)) * [[0.3], [0.3], [2.0 * np.pi]] for _ in range(2))
    return tuple(at), tuple(other)


@pytest.mark.parametrize(("a", "b"), PAIRS)
@pytest.mark.parametrize("least", [-0.03, 0.0, 0.04])
def test_it_says_what_the_clearance_says(a, b, least):
    at, other = poses()
    gap = PRIMITIVES["gap"].evaluate(NUMPY, SHAPES[a], SHAPES[b], *at, *other)
    for limit in (least, np.full(len(gap), least)):
        np.testing.assert_array_equal(apart(SHAPES[a], SHAPES[b], at, other, limit), gap >= limit)
    assert 0.02 < np.mean(gap >= least) < 0.98


@pytest.mark.parametrize(("a", "b"), [pair for pair in PAIRS if "disc" not in pair])
def test_no_edge_parts_footprints_by_more_than_their_clearance(a, b):
    at, other = poses()
    gap = PRIMITIVES["gap"].evaluate(NUMPY, SHAPES[a], SHAPES[b], *at, *other)
    beyond = _beyond(SHAPES[a], SHAPES[b], at, other)
    assert (beyond <= gap + 1e-12).all()
    np.testing.assert_allclose(beyond[gap < 0.0], gap[gap < 0.0], atol=1e-12)
