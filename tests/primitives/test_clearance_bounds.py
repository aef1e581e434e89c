"""Interval and backward rules of gap, room and reach on footprints that hypothesis makes up, and how tight they are."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenegen.geometry import NUMPY, PRIMITIVES, Box, Circle, Interval, Polygon
from scenegen.geometry.footprint import convex_hull, measures

from ..laws import examples
from .drawing import within

sizes = st.floats(0.0, 0.6)
points = st.tuples(*(st.floats(-0.5, 0.5).map(lambda x: round(x, 3)),) * 2)


def has_area(corners):
    try:
        convex_hull(corners)
    except ValueError:
        return False
    return True


footprints = st.one_of(
    st.builds(Circle, sizes),
    st.builds(Box, sizes, sizes),
    st.lists(points, min_size=3, max_size=7).filter(has_area).map(convex_hull),
)
BOXES = 40


def poses(seed, width, turn):
    """Boxes of two poses, (6, BOXES), up to `width` m and `turn` rad wide; some on a grid, where footprints touch."""
    rng = np.random.default_rng(seed)
    low = rng.uniform(-0.5, 0.5, size=(6, BOXES))
    low[:, :10] = low[:, :10].round(1)
    low[2::3] = rng.choice([0.0, math.pi / 2.0, 3.0], size=(2, BOXES)) + low[2::3] * (rng.uniform() < 0.5)
    wide = np.full((6, 1), width)
    wide[2::3] = turn
    return rng, low, low + wide * rng.uniform(size=low.shape) * rng.integers(0, 2, size=low.shape)


@pytest.mark.long
@settings(max_examples=examples(150), deadline=None, derandomize=True)
@given(
    st.sampled_from(["gap", "room"]),
    footprints,
    footprints,
    st.integers(0, 2**32),
    st.sampled_from([0.0, 1e-9, 0.01, 0.3, 1.0]),
    st.sampled_from([0.0, 1e-6, 0.1, 1.0, 7.0]),
)
def test_bounds_hold_nest_and_shrink_and_no_solution_is_lost(name, a, b, seed, width, turn):
    primitive = PRIMITIVES[name]
    rng, low, high = poses(seed, width, turn)
    bound = primitive.interval(a, b, *map(Interval, low, high))
    for inside in within(rng, low, high):
        value = primitive.evaluate(NUMPY, a, b, *inside)
        assert ((bound.lo <= value) & (value <= bound.hi)).all()
        wanted = Interval(value - rng.choice([0.0, 0.01, math.inf]), value + rng.choice([0.0, 0.1, math.inf]))
        for number, new in zip(inside, primitive.backward(a, b, wanted, *map(Interval, low, high)), strict=True):
            assert ((new.lo <= number) & (number <= new.hi)).all()

    ends = np.sort(rng.uniform(size=(2, *low.shape)), axis=0)
    inner = primitive.interval(a, b, *(Interval(*(lo + end * (hi - lo))) for lo, hi, end in _each(low, high, ends)))
    assert (inner.lo >= bound.lo - 1e-13).all() and (inner.hi <= bound.hi + 1e-13).all()

    # By how much the value can change over the box, each coordinate on its own: twice that is wide enough.
    half = (high - low) / 2.0
    around = measures(a).outer * half[2] + measures(b).outer * half[5]
    if name == "room":
        distance = np.hypot(np.abs(low - high[[3, 4, 5, 0, 1, 2]])[0], np.abs(low - high[[3, 4, 5, 0, 1, 2]])[1])
        across = np.hypot(np.abs(high - low[[3, 4, 5, 0, 1, 2]])[0], np.abs(high - low[[3, 4, 5, 0, 1, 2]])[1])
        around = measures(a).outer * (half[2] + half[5]) + (distance + across) * half[5]
    assert (bound.hi - bound.lo <= 2.0 * (half[[0, 1, 3, 4]].sum(0) + around) + 1e-12).all()


def _each(low, high, ends):
    return zip(low, high, ends.transpose(1, 0, 2), strict=True)


def box(low, high):
    return Interval(np.float64(low), np.float64(high))


STILL = (box(0, 0), box(0, 0), box(0, 0))
SLAB = Box(0.2, 0.1)
TRIANGLE = Polygon(((0.0, 0.0), (0.2, 0.0), (0.0, 0.2)))
HEXAGON = Polygon(tuple((math.cos(k * math.pi / 3), math.sin(k * math.pi / 3)) for k in range(6)))
TIGHT = [
    # side by side with headings held: exact on both sides
    ("gap", SLAB, SLAB, (box(0.5, 1.0), box(0, 0), box(0, 0)), (0.3, 0.8)),
    ("gap", SLAB, SLAB, (box(-0.05, 0.05), box(0.5, 1.0), box(0, 0)), (0.4, 0.9)),
    # any heading: a corner or the short side of the turning slab comes nearest
    ("gap", SLAB, Circle(0.1), (box(1, 1), box(0, 0), box(0, 7)), (0.9 - math.hypot(0.1, 0.05), 0.85)),
    # on top of each other they are parted soonest across the long side, by the altitude over it
    ("gap", TRIANGLE, TRIANGLE, (box(0, 3), box(0, 0), box(0, 0)), (-0.2 / math.sqrt(2.0), 2.8)),
    ("room", SLAB, Box(1.0, 0.6), (box(0, 0.1), box(0, 0.3), box(0, 0)), (-0.05, 0.25)),
    ("room", Circle(0.1), Box(1.0, 0.6), (box(0.3, 0.5), box(0, 0), box(0, 7)), (-0.1, 0.1)),
    ("room", SLAB, Circle(0.5), (box(0, 0.1), box(0, 0), box(0, 0)), (0.5 - math.hypot(0.2, 0.05), None)),
]


@pytest.mark.parametrize(("name", "a", "b", "pose", "expected"), TIGHT)
def test_bounds_worked_by_hand(name, a, b, pose, expected):
    bound = PRIMITIVES[name].interval(a, b, *pose, *STILL)
    for found, wanted in zip(bound, expected, strict=True):
        assert wanted is None or found == pytest.approx(wanted, abs=1e-12)


def test_reach_over_arcs():
    rule = PRIMITIVES["reach"].interval
    assert rule(SLAB, *STILL, box(0, 7)) == pytest.approx((0.05, math.hypot(0.1, 0.05)), abs=1e-12)
    assert rule(Circle(0.3), *STILL, box(0, 7)) == (0.3, 0.3)
    low, high = rule(SLAB, *STILL, box(1.0, 1.001))
    assert high - low <= 0.001 * 0.1 + 1e-12  # no side is longer than 0.2: half of it per radian


def test_bearing_over_boxes():
    def arc(x, y):
        return PRIMITIVES["bearing"].interval(box(0, 0), box(0, 0), box(*x), box(*y))

    assert arc((1, 2), (1, 2)) == pytest.approx((math.atan2(1, 2), math.atan2(2, 1)))
    assert arc((-2, -1), (1, 2)) == pytest.approx((math.atan2(2, -1), math.atan2(1, -2)))
    assert arc((-1, 1), (1, 1)) == pytest.approx((math.pi / 4, 3 * math.pi / 4))
    assert arc((-2, -1), (0, 1)) == pytest.approx((3 * math.pi / 4, math.pi))
    for x, y in (((-2, -1), (-1, 0)), ((-2, -1), (-1, 1)), ((-1, 1), (-1, 1)), ((0, 1), (0, 1))):
        assert arc(x, y) == pytest.approx((-math.pi, math.pi))
    assert arc((0, 0), (0, 0)) == pytest.approx((0.0, 0.0))


def test_measures_worked_by_hand():
    assert measures(Circle(0.3)) == (0.3, 0.3, 0.0, 1.0)
    assert measures(SLAB) == pytest.approx((math.hypot(0.1, 0.05), 0.05, 0.1, math.sqrt(2)))
    as_polygon = Polygon(((-0.1, -0.05), (0.1, -0.05), (0.1, 0.05), (-0.1, 0.05)))
    assert measures(as_polygon) == pytest.approx(measures(SLAB))
    assert measures(HEXAGON) == pytest.approx((1.0, math.sqrt(0.75), 0.5, 1.0 / math.cos(math.pi / 6)))
    beside = Polygon(((1.0, -0.5), (2.0, -0.5), (2.0, 0.5), (1.0, 0.5)))  # the origin is 1 away
    assert measures(beside)[:3] == pytest.approx((math.hypot(2.0, 0.5), -1.0, math.hypot(2.0, 0.5)))
    corner = Polygon(((3.0, 4.0), (5.0, 4.0), (5.0, 6.0), (3.0, 6.0)))  # its nearest point is a corner, 5 away
    assert measures(corner).inner == pytest.approx(-5.0)
    sharp = measures(TRIANGLE)
    assert sharp.inner == 0.0 and sharp.mitre == pytest.approx(1.0 / math.sin(math.pi / 8))
