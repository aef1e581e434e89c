"""Backward rules never lose a solution, whatever the rounding; and they narrow as far as worked examples say."""

import math

import numpy as np
import pytest

from scenegen.primitives import NUMPY, PRIMITIVES, Interval

RULES = [name for name, primitive in PRIMITIVES.items() if primitive.backward]
BOXES = 3000


def arity(name):
    primitive = PRIMITIVES[name]
    return 3 if primitive.variadic else sum({"place": 2}.get(shape, 1) for shape in primitive.params)


def boxes(name, rng, width):
    """Boxes of arguments of several sizes, zeros and touching ends among them."""
    low = rng.uniform(-1.0, 1.0, size=(arity(name), BOXES)) * 10.0 ** rng.integers(-3, 3, size=(1, BOXES))
    low[:, :500] = rng.integers(-2, 3, size=(arity(name), 500))
    high = low + width * rng.uniform(size=low.shape) * rng.integers(0, 2, size=low.shape)
    high[:, :500] = low[:, :500] + rng.integers(0, 3, size=(arity(name), 500)) * (width > 0)
    if name == "div":
        low[1][low[1] == 0.0] = 0.5
        high[1] = low[1]
    return low, high


@pytest.mark.parametrize("name", RULES)
@pytest.mark.parametrize("width", [0.0, 1e-9, 0.3, 10.0])
@pytest.mark.parametrize("slack", [0.0, 1e-12, 0.1, math.inf])
def test_no_solution_is_lost(name, width, slack):
    primitive = PRIMITIVES[name]
    rng = np.random.default_rng([*name.encode(), int(width * 1e9), int(min(slack, 9.0) * 1e12)])
    low, high = boxes(name, rng, width)
    for share in (0.0, 1.0, rng.uniform(size=low.shape), rng.integers(0, 2, size=low.shape)):
        inside = np.clip(low + share * (high - low), low, high)
        value = primitive.evaluate(NUMPY, *inside)
        side = rng.integers(0, 2, size=BOXES)  # half-open wishes, as `phi >= 0` makes them, among them
        if slack == math.inf:
            wanted = Interval(np.where(side, -math.inf, value), np.where(side, value, math.inf))
        else:
            wanted = Interval(value - slack * side, value + slack * rng.uniform(size=BOXES))
        narrowed = primitive.backward(wanted, *(Interval(*ends) for ends in zip(low, high, strict=True)))
        assert len(narrowed) == len(low)
        for number, old_low, old_high, new in zip(inside, low, high, narrowed, strict=True):
            assert ((new.lo <= number) & (number <= new.hi)).all()
            assert ((old_low <= new.lo) & (new.hi <= old_high)).all()


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
