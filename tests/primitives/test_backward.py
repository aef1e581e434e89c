"""Backward rules never lose a solution, whatever the rounding; and they narrow as far as worked examples say."""

import math

import numpy as np
import pytest

from scenegen.geometry import NUMPY, PRIMITIVES, Box, Circle, Interval

from .drawing import boxes, shapes, within

RULES = [name for name, primitive in PRIMITIVES.items() if primitive.backward]
BOXES = 1000


@pytest.mark.long
@pytest.mark.parametrize("name", RULES)
@pytest.mark.parametrize("width", [0.0, 1e-9, 0.3, 10.0])
@pytest.mark.parametrize("slack", [0.0, 1e-12, 0.1, math.inf])
def test_no_solution_is_lost(name, width, slack):
    primitive = PRIMITIVES[name]
    rng = np.random.default_rng([*name.encode(), int(width * 1e9), int(min(slack, 9.0) * 1e12)])
    for footprints in shapes(name):
        count = BOXES if not footprints else 100
        low, high = boxes(name, rng, count, width)
        for inside in within(rng, low, high):
            value = primitive.evaluate(NUMPY, *footprints, *inside)
            side = rng.integers(0, 2, size=count)  # half-open wishes, as `phi >= 0` makes them, among them
            if slack == math.inf:
                wanted = Interval(np.where(side, -math.inf, value), np.where(side, value, math.inf))
            else:
                wanted = Interval(value - slack * side, value + slack * rng.uniform(size=count))
            narrowed = primitive.backward(*footprints, wanted, *map(Interval, low, high))
            assert len(narrowed) == len(low)
            for number, old_low, old_high, new in zip(inside, low, high, narrowed, strict=True):
                assert ((new.lo <= number) & (number <= new.hi)).all(), footprints
                assert ((old_low <= new.lo) & (new.hi <= old_high)).all(), footprints


def box(low, high):
    return Interval(np.float64(low), np.float64(high))


INF = math.inf
WORKED = {
    "add": [((3, 4), [(0, 2), (0, 3)], [(0, 2), (1, 3)]), ((9, 10), [(0, 2), (0, 3)], None)],
    "sub": [((0, INF), [(0, 1), (0.5, 2)], [(0.5, 1), (0.5, 1)])],
    "neg": [((1, 2), [(-5, -1.5)], [(-2, -1.5)])],
    "mul": [
        ((1, 2), [(0, 10), (-1, 2)], [(0.5, 10), (0.1, 2)]),
        ((4, 9), [(-1, 1), (2, 3)], None),
        ((6, 9), [(-5, 5), (2, 3)], [(2, 4.5), (2, 3)]),
        ((-1, 1), [(-5, 5), (-2, 3)], [(-5, 5), (-2, 3)]),
        ((1, 2), [(0, 1), (0, 0)], None),
        ((-8, -4), [(-5, 5), (-2, 0)], [(2, 5), (-2, -0.8)]),
    ],
    "div": [((1, 2), [(-10, 10), (-2, -2)], [(-4, -2), (-2, -2)])],
    "pick": [  # switch, end, before, after
        ((3, 4), [(0, 1), (0.5, 0.5), (0, 1), (2, 9)], [(0.5, 1), (0.5, 0.5), (0, 1), (3, 4)]),
        ((0, 1), [(0, 1), (0.5, 0.5), (0, 3), (2, 9)], [(0, 0.5), (0.5, 0.5), (0, 1), (2, 9)]),
        ((0, 2), [(0, 1), (0.5, 0.5), (0, 3), (2, 9)], [(0, 1), (0.5, 0.5), (0, 3), (2, 9)]),
        ((0, 2), [(0.6, 1), (0.5, 0.5), (0, 3), (1, 9)], [(0.6, 1), (0.5, 0.5), (0, 3), (1, 2)]),
        ((5, 6), [(0, 1), (0.5, 0.5), (0, 3), (7, 9)], None),
    ],
    "dist": [
        ((0, 1), [(0, 5), (0, 0), (3, 3), (0, 0)], [(2, 4), (0, 0), (3, 3), (0, 0)]),
        ((5, INF), [(0, 5), (0, 3), (0, 0), (0, 0)], [(4, 5), (0, 3), (0, 0), (0, 0)]),
        ((-2, -1), [(0, 5), (0, 0), (3, 3), (0, 0)], None),
    ],
    "abs": [((1, 2), [(-5, 0.5)], [(-2, -1)]), ((1, 2), [(-5, 1.5)], [(-2, 1.5)]), ((-2, -1), [(-5, 5)], None)],
    "min": [((1, 2), [(0, 5), (3, 4)], [(1, 2), (3, 4)]), ((1, 2), [(0, 5), (1, 4)], [(1, 5), (1, 4)])],
    "max": [((1, 2), [(0, 5), (-3, 0)], [(1, 2), (-3, 0)]), ((1, 2), [(3, 5), (3, 4)], None)],
    "sum": [((5, 9), [(0, 1), (0, 2), (0, 3)], [(0, 1), (1, 2), (2, 3)]), ((2, 3), [(0, 5)], [(2, 3)])],
    "mean": [((2, 3), [(0, 1), (0, 2), (3, 4)], [(0, 1), (1, 2), (3, 4)])],
    "wrap": [
        ((0, 1), [(0.5, 6)], [(0.5, 1)]),
        ((-1, 1), [(2, 9)], [(2 * math.pi - 1, 2 * math.pi + 1)]),
        ((2, 3), [(-1, 1)], None),
    ],
}


@pytest.mark.parametrize("name", [name for name in RULES if set(PRIMITIVES[name].params) <= {"number", "place"}])
def test_rules_worked_by_hand(name):
    for wanted, args, expected in WORKED[name]:
        found = PRIMITIVES[name].backward(box(*wanted), *(box(*arg) for arg in args))
        if expected is None:
            assert any(one.lo > one.hi for one in found), (wanted, args)
        else:
            assert np.array(found) == pytest.approx(np.array(expected, dtype=float), abs=1e-12), (wanted, args)


def test_clearances_worked_by_hand():
    """Boxes of 0.2 x 0.1 m and discs, with headings known or not, next to one that stands still."""
    whole, still, anywhere = box(-math.pi, math.pi), box(0, 0), box(-5, 5)
    touching = box(-INF, 0)

    def narrowed(name, a, b, wanted, heading):
        ax, ay, _, *rest = PRIMITIVES[name].backward(a, b, wanted, anywhere, anywhere, heading, still, still, still)
        assert rest == [still, still, still]
        return np.array([ax, ay])

    # headings known: the sides decide; unknown: half the diagonal of a, and the sides of b
    slab, disc = Box(0.2, 0.1), Circle(0.3)
    assert narrowed("gap", slab, slab, touching, still) == pytest.approx(np.array([[-0.2, 0.2], [-0.1, 0.1]]))
    far = 0.1 + math.hypot(0.1, 0.05)
    assert narrowed("gap", slab, slab, touching, whole)[0] == pytest.approx([-far, far])
    assert narrowed("gap", disc, slab, touching, whole) == pytest.approx(np.array([[-0.4, 0.4], [-0.35, 0.35]]))
    inside, halfway = box(0, INF), box(-0.02, INF)
    tray = Box(1.0, 0.6)
    assert narrowed("room", slab, tray, inside, still) == pytest.approx(np.array([[-0.4, 0.4], [-0.25, 0.25]]))
    assert narrowed("room", slab, tray, inside, whole) == pytest.approx(np.array([[-0.45, 0.45], [-0.25, 0.25]]))
    limit = 0.02 * math.sqrt(2.0)
    assert narrowed("room", slab, tray, halfway, still)[0] == pytest.approx([-0.4 - limit, 0.4 + limit])
    assert narrowed("room", Circle(0.1), disc, inside, whole) == pytest.approx(np.array([[-0.2, 0.2], [-0.2, 0.2]]))


def test_what_cannot_fit_is_empty():
    nowhere = PRIMITIVES["room"].backward(
        Circle(0.4), Box(1.0, 0.6), box(0, INF), *(box(-5, 5),) * 2, box(0, 7), *(box(0, 0),) * 3
    )
    assert any(one.lo > one.hi for one in nowhere)
    nowhere = PRIMITIVES["gap"].backward(
        Circle(0.1), Circle(0.1), box(0.1, 0.2), *(box(-0.1, 0.1),) * 2, box(0, 7), *(box(0, 0.01),) * 3
    )
    assert any(one.lo > one.hi for one in nowhere)
