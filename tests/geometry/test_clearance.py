"""gap, room, reach and bearing against independent geometry (shapely, scipy), worked examples and invariances.
Interval and backward rules of gap, room and reach on footprints that hypothesis makes up, and how tight they are.
Convex hulls, areas and centroids against scipy and shapely, and which polygons pass as convex.
"""

import math
from itertools import product

import numpy as np
import pytest
import shapely
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from scenegen.geometry import MATH, NUMPY, POINT, PRIMITIVES, Box, Circle, Interval, Polygon
from scenegen.geometry.footprint import area, centroid, clip, convex_hull, is_convex, measures, signed_area
from scenegen.learn.robustness.compile import TORCH

from ..laws import examples
from .drawing import random_footprint, within

KINDS = ("point", "circle", "box", "polygon")
PAIRS = list(product(KINDS, KINDS))
gap, room, reach, bearing = (PRIMITIVES[name].evaluate for name in ("gap", "room", "reach", "bearing"))


def local(footprint):
    """Corners of the footprint's core, which its radius goes around, and that radius."""
    if isinstance(footprint, Circle):
        return np.zeros((1, 2)), footprint.radius
    if isinstance(footprint, Box):
        x, y = footprint.length / 2, footprint.width / 2
        return np.array([(-x, -y), (x, -y), (x, y), (-x, y)]), 0.0
    return np.array(footprint.vertices), 0.0


def placed(footprint, pose):
    """Corners of the core in the world, (K, corners, 2), for poses (3, K); and the radius."""
    corners, radius = local(footprint)
    x, y, theta = pose
    cos, sin = np.cos(theta), np.sin(theta)
    turn = np.array([[cos, -sin], [sin, cos]]).transpose(2, 0, 1)
    return np.stack([x, y], -1)[:, None] + corners @ turn.transpose(0, 2, 1), radius


def shape(corners):
    """shapely geometries of cores: points or polygons."""
    return shapely.points(corners[:, 0]) if corners.shape[1] == 1 else shapely.polygons(corners)


def grown(footprint):
    """Three times as large, so that something fits in."""
    if isinstance(footprint, Circle):
        return Circle(3.0 * footprint.radius)
    if isinstance(footprint, Box):
        return Box(3.0 * footprint.length, 3.0 * footprint.width)
    return Polygon(tuple((3.0 * x, 3.0 * y) for x, y in footprint.vertices))


def draws(kinds, seed, count=12, poses=50):
    """Footprints of the kinds and poses, (3, K) for each."""
    rng = np.random.default_rng([seed, *"".join(kinds).encode()])
    for _ in range(count):
        places = [rng.uniform([[-0.4], [-0.4], [-7.0]], [[0.4], [0.4], [7.0]], size=(3, poses)) for _ in kinds]
        yield [random_footprint(rng, kind) for kind in kinds], places


@pytest.mark.parametrize("kinds", PAIRS, ids="-".join)
def test_gap_is_the_signed_distance_of_the_minkowski_difference(kinds):
    seen = np.zeros(2, dtype=int)
    for (a, b), (pose, other) in draws(kinds, 0):
        (of_a, radius), (of_b, other_radius) = placed(a, pose), placed(b, other)
        value = gap(NUMPY, a, b, *pose, *other)
        distance = shapely.distance(shape(of_a), shape(of_b)) - radius - other_radius
        disjoint = distance > 0.0
        assert value[disjoint] == pytest.approx(distance[disjoint], abs=1e-14)
        # All differences of corners, and their hull made by shapely: the translations that make the cores meet.
        differences = (of_a[:, :, None] - of_b[:, None]).reshape(len(of_a), -1, 2)
        hull = shapely.convex_hull(shapely.multipoints(list(map(shapely.points, differences))))
        origin = shapely.points(0.0, 0.0)
        inside = shapely.contains(hull, origin)
        depth = np.where(inside, -shapely.distance(shapely.boundary(hull), origin), shapely.distance(hull, origin))
        assert value == pytest.approx(depth - radius - other_radius, abs=1e-14)
        seen += disjoint.sum(), (~disjoint).sum()
    assert seen.min() > 20 or kinds == ("point", "point")


@pytest.mark.long
@pytest.mark.parametrize("kinds", [pair for pair in PAIRS if pair != ("point", "point")], ids="-".join)
def test_penetration_is_the_smallest_translation_that_parts(kinds):
    angles = np.arange(720) * (math.tau / 720)
    away = np.stack([np.cos(angles), np.sin(angles)], -1)
    for (a, b), (pose, other) in draws(kinds, 1, count=4, poses=12):
        (of_a, radius), (of_b, other_radius) = placed(a, pose), placed(b, other)
        depth = -gap(NUMPY, a, b, *pose, *other)
        for of_one, of_other, deep in zip(of_a, of_b, depth, strict=True):
            if deep < 1e-6:
                continue
            fixed = shape(of_one[None])[0]

            def parted(far, of_other=of_other, fixed=fixed, touch=radius + other_radius):
                cores = shape(of_other + far * away[:, None])
                apart = shapely.distance(cores, fixed) - touch
                if touch == 0.0:  # cores with an inside: they are parted once they do but touch
                    apart = np.where(shapely.relate_pattern(cores, fixed, "T********"), -1.0, apart)
                return apart >= 0.0

            assert not parted(deep * (1.0 - 1e-9) - 1e-12).any()
            assert parted(deep / math.cos(math.pi / 720) + 1e-9).any()  # the nearest of 720 directions


@pytest.mark.parametrize("kinds", PAIRS, ids="-".join)
def test_room_against_shapely_and_half_planes(kinds):
    fits = 0
    for (a, b), (pose, other) in draws(kinds, 2, poses=40):
        b = grown(b)
        (of_a, radius), (of_b, other_radius) = placed(a, pose), placed(b, other)
        value = room(NUMPY, a, b, *pose, *other)
        if isinstance(b, Circle):
            expected = other_radius - radius - np.linalg.norm(of_a - of_b, axis=-1).max(-1)
        else:
            # Lines through b's edges from another library: outwards normal . x + offset <= 0 inside.
            lines = [ConvexHull(corners).equations for corners in of_b]
            expected = -np.array(
                [
                    (line[:, :2] @ corners.T + line[:, 2:]).max() + radius
                    for line, corners in zip(lines, of_a, strict=True)
                ]
            )
            inside = shapely.contains(shape(of_b), shape(of_a))
            clear = np.abs(value) > 1e-12
            to_edge = shapely.distance(shapely.boundary(shape(of_b)), shape(of_a))
            assert ((value >= 0.0) == (inside & (to_edge >= radius)))[clear].all()
            assert value[inside] == pytest.approx((to_edge - radius)[inside], abs=1e-14)
        assert value == pytest.approx(expected, abs=1e-14)
        fits += (value > 0.0).sum()
    assert fits > 0 or kinds[1] == "point"


@pytest.mark.parametrize("kind", KINDS)
def test_reach_is_the_farthest_corner(kind):
    for (a,), (pose,) in draws((kind,), 3):
        heading = np.linspace(-7.0, 7.0, pose.shape[1])
        corners, radius = placed(a, pose)
        along = (corners - pose[:2].T[:, None]) @ np.stack([np.cos(heading), np.sin(heading)], -1)[..., None]
        expected = along[..., 0].max(-1) + radius
        assert reach(NUMPY, a, *pose, heading) == pytest.approx(expected, abs=1e-14)


STILL = (0.0, 0.0, 0.0)
QUARTER, EIGHTH = math.pi / 2.0, math.pi / 4.0
TRIANGLE = Polygon(((0.0, 0.0), (2.0, 0.0), (0.0, 2.0)))
GAPS = [
    # side by side, corner to corner, touching, overlapping by 0.5 and 1 (the shorter way), one in the other
    (Box(2, 1), STILL, Box(2, 1), (3, 0, 0), 1.0),
    (Box(2, 1), STILL, Box(2, 1), (5, 5, 0), 5.0),
    (Box(2, 1), STILL, Box(2, 1), (2, 0.5, 0), 0.0),
    (Box(2, 2), STILL, Box(2, 2), (1.5, 1, 0), -0.5),
    (Box(4, 4), STILL, Box(2, 2), (0, 0.25, 0), -2.75),
    (Box(4, 2), STILL, Box(4, 2), (0, 0, QUARTER), -3.0),
    # a corner towards a side: half the diagonal of a unit square is sqrt(1/2)
    (Box(1, 1), STILL, Box(1, 1), (2, 0, EIGHTH), 1.5 - math.sqrt(0.5)),
    (Box(1, 1), STILL, Box(1, 1), (1, 0, EIGHTH), 0.5 - math.sqrt(0.5)),
    # a disc beside, at a corner, inside; points
    (Circle(0.5), (3, 0, 0), Box(2, 1), STILL, 1.5),
    (Circle(1), (4, 4.5, 1), Box(2, 1), STILL, 4.0),
    (Circle(0.5), (0, 0.25, 0), Box(4, 2), STILL, -1.25),
    (POINT, (0, 0, 0), POINT, (3, 4, 0), 5.0),
    (Circle(1), (0, 0, 0), Circle(2), (0, 0, 0), -3.0),
    # the triangle's long side is at 45 degrees, sqrt(2) from the origin
    (POINT, STILL, TRIANGLE, STILL, 0.0),
    (POINT, (2, 2, 0), TRIANGLE, STILL, math.sqrt(2)),
    (Circle(0.25), (0.5, 0.5, 0), TRIANGLE, STILL, -0.75),
    (Box(1, 1), (2, 2, EIGHTH), TRIANGLE, STILL, math.sqrt(2) - 0.5),
    (TRIANGLE, STILL, TRIANGLE, (2, 2, 2 * QUARTER), 0.0),
    (TRIANGLE, STILL, TRIANGLE, (3, 0, 0), 1.0),
]
ROOMS = [
    (Box(1, 0.5), STILL, Box(2, 1), STILL, 0.25),
    (Box(1, 0.5), (0.75, 0, 0), Box(2, 1), STILL, -0.25),
    (Box(1, 1), (0, 0, EIGHTH), Box(2, 2), STILL, 1.0 - math.sqrt(0.5)),
    (Circle(0.5), (0.25, 0, 0), Circle(1), STILL, 0.25),
    (Box(0.6, 0.8), (1, 1, QUARTER), Circle(1), (1, 1, 0), 0.5),
    (Box(0.6, 0.8), (1.3, 1, 0), Circle(1), (1, 1, 0), 1.0 - math.hypot(0.6, 0.4)),
    (POINT, (0.5, 0.5, 0), TRIANGLE, STILL, 0.5),
    (Circle(0.5), (1, 1, 0), TRIANGLE, STILL, -0.5),
    (TRIANGLE, STILL, TRIANGLE, STILL, 0.0),
    (POINT, (3, 0, 0), POINT, STILL, -3.0),
]


@pytest.mark.parametrize(
    ("function", "a", "pose", "b", "other", "expected"),
    [(gap, *row) for row in GAPS] + [(room, *row) for row in ROOMS],
)
def test_worked_by_hand(function, a, pose, b, other, expected):
    assert function(MATH, a, b, *pose, *other) == pytest.approx(expected, abs=1e-14)
    if function is gap:
        assert gap(MATH, b, a, *other, *pose) == pytest.approx(expected, abs=1e-14)


def test_reach_and_bearing_worked_by_hand():
    assert reach(MATH, Box(2, 1), 7.0, 8.0, QUARTER, QUARTER) == pytest.approx(1.0)
    assert reach(MATH, Box(2, 1), 7.0, 8.0, 0.0, QUARTER) == pytest.approx(0.5)
    assert reach(MATH, TRIANGLE, 7.0, 8.0, 0.0, EIGHTH) == pytest.approx(math.sqrt(2))
    assert reach(MATH, TRIANGLE, 7.0, 8.0, 0.0, -EIGHTH * 3) == 0.0 and reach(MATH, Circle(0.3), 0, 0, 1.0, 2.0) == 0.3
    for ns in (MATH, NUMPY):
        assert [bearing(ns, 1.0, 1.0, *to) for to in ((2.0, 1.0), (1.0, 3.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0))] == [
            0.0,
            math.pi / 2,
            math.pi,
            -math.pi / 2,
            0.0,
        ]
        for zero in (0.0, -0.0):  # never -pi, nor pi for a place itself, whatever the sign of zero
            assert bearing(ns, 0.0, 0.0, -1.0, zero) == math.pi and bearing(ns, 0.0, 0.0, zero, zero) == 0.0


@pytest.mark.parametrize("kinds", PAIRS, ids="-".join)
def test_moving_everything_changes_nothing(kinds):
    for (a, b), (pose, other) in draws(kinds, 4, count=6):
        turn = 1.234
        cos, sin = math.cos(turn), math.sin(turn)

        def moved(pose, cos=cos, sin=sin, turn=turn):
            x, y, theta = pose
            return np.stack([0.7 + cos * x - sin * y, -0.2 + sin * x + cos * y, theta + turn])

        for function in (gap, room):
            value = function(NUMPY, a, b, *pose, *other)
            assert function(NUMPY, a, b, *moved(pose), *moved(other)) == pytest.approx(value, abs=1e-14)
        assert gap(NUMPY, b, a, *other, *pose) == pytest.approx(gap(NUMPY, a, b, *pose, *other), abs=1e-15)
        assert (room(NUMPY, a, b, *pose, *other) <= room(NUMPY, a, Circle(9.0), *pose, *other)).all()


def test_boxes_are_polygons():
    for (a, b), (pose, other) in draws(("box", "box"), 5):
        as_polygon = [Polygon(tuple(map(tuple, local(one)[0].tolist()))) for one in (a, b)]
        for function in (gap, room):
            value = function(NUMPY, a, b, *pose, *other)
            for one, two in ((as_polygon[0], b), (a, as_polygon[1]), as_polygon):
                assert function(NUMPY, one, two, *pose, *other) == pytest.approx(value, abs=1e-14)


def test_boxes_on_a_grid():
    """Parallel and touching boxes, one above the middle of the other: signs of zero and ties must not matter."""
    steps = np.linspace(-1.0, 1.0, 9)
    poses = np.array(np.meshgrid(steps, steps, np.arange(-4, 5) * EIGHTH, np.arange(3) * QUARTER)).reshape(4, -1)
    x, y, theta, other = poses
    for a, b in ((Box(0.5, 0.25), Box(0.5, 0.25)), (Box(1.0, 0.25), Box(0.25, 0.5)), (Box(0.5, 0.0), Box(0.0, 0.25))):
        polygon = Polygon(tuple(map(tuple, local(a)[0].tolist())))
        value = gap(NUMPY, a, b, x, y, theta, 0.0 * x, -0.0 * y, other)
        assert gap(NUMPY, polygon, b, x, y, theta, 0.0 * x, -0.0 * y, other) == pytest.approx(value, abs=1e-15)
        assert (value == 0.0).any() and (value < 0.0).any() and (value > 0.0).any()


def test_boxes_in_contact_have_a_gradient():
    where = torch.tensor([0.0, 0.0, 0.0, 0.5, 0.0, 0.0], dtype=torch.float64, requires_grad=True)
    value = gap(TORCH, Box(0.5, 0.25), Box(0.5, 0.25), *where)
    value.backward()
    assert value == 0.0 and where.grad[:2].tolist() == [-1.0, 0.0] and where.grad[3:5].tolist() == [1.0, 0.0]


STEP = 1e-6


@pytest.mark.long
@pytest.mark.parametrize("function", [gap, room], ids=["gap", "room"])
@pytest.mark.parametrize("kinds", PAIRS, ids="-".join)
def test_gradients_away_from_ties(function, kinds):
    ties = total = 0
    for shapes, poses in draws(kinds, 6, count=6):
        rows = torch.from_numpy(np.concatenate(poses)).requires_grad_()
        function(TORCH, *shapes, *rows).sum().backward()
        values = np.concatenate(poses)
        for row in range(6):
            up, down = values.copy(), values.copy()
            up[row] += STEP
            down[row] -= STEP
            here, after, before = (function(NUMPY, *shapes, *rows) for rows in (values, up, down))
            smooth = np.abs((after - here) - (here - before)) < 1e-2 * STEP  # a kink shows on its two sides
            slope = (after - before) / (2.0 * STEP)
            assert rows.grad[row].numpy()[smooth] == pytest.approx(slope[smooth], abs=1e-4)
            ties, total = ties + (~smooth).sum(), total + smooth.size
    assert ties < 0.01 * total


@pytest.mark.long
def test_gradient_of_bearing_and_reach():
    rng = np.random.default_rng(7)
    points = torch.from_numpy(rng.uniform(-1.0, 1.0, size=(4, 15))).requires_grad_()
    assert torch.autograd.gradcheck(lambda rows: bearing(TORCH, *rows), points)
    rows = torch.from_numpy(rng.uniform(-3.0, 3.0, size=(4, 15))).requires_grad_()
    for footprint in (Circle(0.2), Box(0.3, 0.1), TRIANGLE):
        assert torch.autograd.gradcheck(lambda rows, a=footprint: reach(TORCH, a, *rows), rows)


@pytest.mark.parametrize("distance", [0.0, 1e-320, 1e-200, 1e-160, 1e-9])
def test_gradients_stay_finite_next_to_coincidence(distance):
    for name, shapes in (("bearing", ()), ("gap", (POINT, POINT)), ("gap", (POINT, Box(0.0, 0.0)))):
        numbers = torch.zeros(4 if name == "bearing" else 6, 1, dtype=torch.float64)
        numbers[0], numbers[1] = distance, -distance
        numbers.requires_grad_()
        PRIMITIVES[name].evaluate(TORCH, *shapes, *numbers).sum().backward()
        assert torch.isfinite(numbers.grad).all(), (name, shapes)
    assert distance or not numbers.grad.any()


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


STILL_BOUNDS = (box(0, 0), box(0, 0), box(0, 0))
SLAB = Box(0.2, 0.1)
TRIANGLE_BOUNDS = Polygon(((0.0, 0.0), (0.2, 0.0), (0.0, 0.2)))
HEXAGON = Polygon(tuple((math.cos(k * math.pi / 3), math.sin(k * math.pi / 3)) for k in range(6)))
TIGHT = [
    # side by side with headings held: exact on both sides
    ("gap", SLAB, SLAB, (box(0.5, 1.0), box(0, 0), box(0, 0)), (0.3, 0.8)),
    ("gap", SLAB, SLAB, (box(-0.05, 0.05), box(0.5, 1.0), box(0, 0)), (0.4, 0.9)),
    # any heading: a corner or the short side of the turning slab comes nearest
    ("gap", SLAB, Circle(0.1), (box(1, 1), box(0, 0), box(0, 7)), (0.9 - math.hypot(0.1, 0.05), 0.85)),
    # on top of each other they are parted soonest across the long side, by the altitude over it
    ("gap", TRIANGLE_BOUNDS, TRIANGLE_BOUNDS, (box(0, 3), box(0, 0), box(0, 0)), (-0.2 / math.sqrt(2.0), 2.8)),
    ("room", SLAB, Box(1.0, 0.6), (box(0, 0.1), box(0, 0.3), box(0, 0)), (-0.05, 0.25)),
    ("room", Circle(0.1), Box(1.0, 0.6), (box(0.3, 0.5), box(0, 0), box(0, 7)), (-0.1, 0.1)),
    ("room", SLAB, Circle(0.5), (box(0, 0.1), box(0, 0), box(0, 0)), (0.5 - math.hypot(0.2, 0.05), None)),
]


@pytest.mark.parametrize(("name", "a", "b", "pose", "expected"), TIGHT)
def test_bounds_worked_by_hand(name, a, b, pose, expected):
    bound = PRIMITIVES[name].interval(a, b, *pose, *STILL_BOUNDS)
    for found, wanted in zip(bound, expected, strict=True):
        assert wanted is None or found == pytest.approx(wanted, abs=1e-12)


def test_reach_over_arcs():
    rule = PRIMITIVES["reach"].interval
    assert rule(SLAB, *STILL_BOUNDS, box(0, 7)) == pytest.approx((0.05, math.hypot(0.1, 0.05)), abs=1e-12)
    assert rule(Circle(0.3), *STILL_BOUNDS, box(0, 7)) == (0.3, 0.3)
    low, high = rule(SLAB, *STILL_BOUNDS, box(1.0, 1.001))
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
    sharp = measures(TRIANGLE_BOUNDS)
    assert sharp.inner == 0.0 and sharp.mitre == pytest.approx(1.0 / math.sin(math.pi / 8))


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
    assert clip(square, (-1.0, -1.0, 3.0, 3.0)) == square
    assert signed_area(clip(square, (1.0, -1.0, 3.0, 1.0))) == 1.0
    assert signed_area(clip(((0.0, 0.0), (2.0, 0.0), (0.0, 2.0)), (0.0, 0.0, 1.0, 1.0))) == 1.0
    assert len(clip(((0.0, 0.0), (2.0, 0.0), (0.0, 2.0)), (0.0, 0.0, 1.5, 1.5))) == 5
    assert clip(square, (2.5, 0.0, 3.0, 1.0)) == ()


@given(st.lists(st.tuples(coordinates, coordinates), min_size=3, max_size=12))
def test_what_is_shared_is_what_shapely_says(points):
    try:
        hull = convex_hull(points)
    except ValueError:
        return
    shared = clip(hull.vertices, (-0.5, -0.25, 0.5, 0.75))
    expected = shapely.Polygon(hull.vertices).intersection(shapely.box(-0.5, -0.25, 0.5, 0.75)).area
    assert (signed_area(shared) if len(shared) > 2 else 0.0) == pytest.approx(expected, abs=1e-9)
    assert all(-0.5 - 1e-9 <= x <= 0.5 + 1e-9 and -0.25 - 1e-9 <= y <= 0.75 + 1e-9 for x, y in shared)
