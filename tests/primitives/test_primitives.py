"""Laws over the whole table of primitives: a new entry is tested as soon as it is there."""

import math

import numpy as np
import pytest
import torch

from scenegen.geometry import ANGLE, BARE, LENGTH, MATH, NUMPY, PRIMITIVES, Interval, Unit, UnitMismatch
from scenegen.geometry import interval as iv
from scenegen.geometry.units import agree, over, quantity, times
from scenegen.learn.robustness.compile import TORCH

from .drawing import arguments, boxes, shapes, within

COUNT = 4000
LIBRARY = {"sin": 1, "cos": 1, "bearing": 1}  # their last bit is the library's
TURNED = {name for name, primitive in PRIMITIVES.items() if "footprint" in primitive.params}  # by sines and cosines
EXACT = set(PRIMITIVES) - TURNED - {"wrap", "bearing", *LIBRARY}


def cases(name, seed=0):
    """Footprints, and arguments to go with them: fewer of these where there are many of those."""
    combinations = shapes(name)
    count = COUNT if len(combinations) == 1 else 200
    return [(footprints, arguments(name, [seed, i], count)) for i, footprints in enumerate(combinations)]


@pytest.mark.parametrize("name", PRIMITIVES)
def test_every_namespace_gives_the_same(name):
    evaluate = PRIMITIVES[name].evaluate
    for footprints, values in cases(name):
        expected = np.array([evaluate(MATH, *footprints, *column) for column in values.T.tolist()])
        array = evaluate(NUMPY, *footprints, *values)
        tensor = evaluate(TORCH, *footprints, *torch.from_numpy(values)).numpy()
        assert array.shape == tensor.shape == expected.shape
        # What comes out of sines and cosines may differ by their last bits, of numbers below 1 here.
        room = np.full(expected.shape, 1e-15 if name in TURNED else 0.0)
        assert (np.abs(array - expected) <= room + LIBRARY.get(name, 0) * np.spacing(np.abs(expected))).all()
        ulps = {"dist": 1, "bearing": 2}.get(name, LIBRARY.get(name, 0))  # torch takes its square roots from MKL
        assert (np.abs(tensor - expected) <= room + ulps * np.spacing(np.abs(expected))).all()


@pytest.mark.long
@pytest.mark.parametrize("name", PRIMITIVES)
@pytest.mark.parametrize("width", [0.0, 1e-12, 0.1, 3.0])
def test_the_interval_rule_holds_every_value(name, width):
    primitive, rng = PRIMITIVES[name], np.random.default_rng([2, *name.encode()])
    for footprints in shapes(name):
        low, high = boxes(name, rng, COUNT if not footprints else 200, width)
        bound = primitive.interval(*footprints, *map(Interval, low, high))
        assert (bound.lo <= bound.hi).all()
        for inside in within(rng, low, high):
            value = primitive.evaluate(NUMPY, *footprints, *inside)
            assert ((bound.lo <= value) & (value <= bound.hi)).all(), footprints
        assert np.isfinite(bound.lo).all() and np.isfinite(bound.hi).all()


@pytest.mark.parametrize("name", sorted(EXACT))
def test_the_interval_of_a_point_is_a_point(name):
    values = arguments(name, 3, COUNT)
    bound = PRIMITIVES[name].interval(*map(Interval, values, values))
    assert np.array_equal(bound.lo, bound.hi) and np.array_equal(bound.lo, PRIMITIVES[name].evaluate(NUMPY, *values))


@pytest.mark.parametrize("name", PRIMITIVES)
def test_the_interval_of_a_point_is_next_to_nothing(name):
    if name == "wrap":
        return  # next to its jump it is the whole circle
    for footprints, values in cases(name, 3):
        bound = PRIMITIVES[name].interval(*footprints, *map(Interval, values, values))
        assert (bound.hi - bound.lo <= 1e-12 * (1.0 + np.abs(values).max(0) ** 2)).all(), footprints


@pytest.mark.parametrize("name", sorted(TURNED | {"bearing"}))
def test_boxes_in_boxes_have_bounds_in_bounds(name):
    primitive, rng = PRIMITIVES[name], np.random.default_rng([4, *name.encode()])
    for footprints in shapes(name):
        low, high = boxes(name, rng, 200, 1.0)
        outer = primitive.interval(*footprints, *map(Interval, low, high))
        ends = np.sort(rng.uniform(size=(2, *low.shape)), axis=0)
        inner_low, inner_high = (np.clip(low + end * (high - low), low, high) for end in ends)
        inner = primitive.interval(*footprints, *map(Interval, inner_low, inner_high))
        assert (inner.lo >= outer.lo - 1e-14).all() and (inner.hi <= outer.hi + 1e-14).all(), footprints


@pytest.mark.parametrize("name", sorted(TURNED))
def test_one_box_beside_many(name):
    """Constants, as fixed objects are, have bounds of shape ()."""
    primitive, rng = PRIMITIVES[name], np.random.default_rng([5, *name.encode()])
    for footprints in shapes(name):
        low, high = boxes(name, rng, 20, 0.3)
        for fixed in range(len(low)):
            low[fixed], high[fixed] = low[fixed, 0], high[fixed, 0]
            mixed = [Interval(a, b) for a, b in zip(low, high, strict=True)]
            mixed[fixed] = Interval(low[fixed, 0], high[fixed, 0])
            bound = primitive.interval(*footprints, *mixed)
            same = primitive.interval(*footprints, *map(Interval, low, high))
            for end, many in zip(bound, same, strict=True):
                assert np.array_equal(np.broadcast_to(end, many.shape), many)


@pytest.mark.parametrize("name", PRIMITIVES)
def test_the_entry_says_what_it_is(name):
    primitive = PRIMITIVES[name]
    angular = name in {"wrap", "sin", "cos", "reach"}
    units = [ANGLE if angular and shape == "number" else LENGTH for shape in primitive.params]
    assert primitive.name == name and primitive.doc
    assert isinstance(primitive.unit(*units), Unit) and isinstance(primitive.unit(*[BARE] * len(units)), Unit)
    assert not primitive.operator or primitive.operator in "+-*/"


@pytest.mark.parametrize("name", PRIMITIVES)
def test_gradients_are_finite_wherever_the_value_is_defined(name):
    for footprints, numbers in cases(name):
        values = torch.from_numpy(numbers).requires_grad_()
        PRIMITIVES[name].evaluate(TORCH, *footprints, *values).sum().backward()
        assert torch.isfinite(values.grad).all(), footprints


UNITS = [
    ("add", (LENGTH, LENGTH), LENGTH),
    ("add", (LENGTH, BARE), LENGTH),
    ("sub", (BARE, ANGLE), ANGLE),
    ("mul", (LENGTH, LENGTH), Unit(2, 0)),
    ("mul", (BARE, ANGLE), ANGLE),
    ("div", (LENGTH, ANGLE), Unit(1, -1)),
    ("div", (LENGTH, LENGTH), BARE),
    ("neg", (ANGLE,), ANGLE),
    ("abs", (LENGTH,), LENGTH),
    ("dist", (LENGTH, LENGTH), LENGTH),
    ("wrap", (BARE,), ANGLE),
    ("sin", (ANGLE,), BARE),
    ("cos", (BARE,), BARE),
    ("min", (BARE, LENGTH, LENGTH), LENGTH),
    ("max", (ANGLE, BARE), ANGLE),
    ("sum", (BARE, LENGTH, LENGTH), LENGTH),
    ("mean", (ANGLE, ANGLE), ANGLE),
    ("gap", (LENGTH, LENGTH), LENGTH),
    ("room", (LENGTH, LENGTH), LENGTH),
    ("reach", (LENGTH, ANGLE), LENGTH),
    ("reach", (LENGTH, BARE), LENGTH),
    ("bearing", (LENGTH, LENGTH), ANGLE),
    ("add", (LENGTH, ANGLE), None),
    ("sub", (Unit(2, 0), LENGTH), None),
    ("min", (BARE, LENGTH, ANGLE), None),
    ("sin", (LENGTH,), None),
    ("wrap", (LENGTH,), None),
    ("sum", (LENGTH, ANGLE), None),
    ("reach", (LENGTH, LENGTH), None),
]


@pytest.mark.parametrize(("name", "given", "expected"), UNITS)
def test_units(name, given, expected):
    if expected is None:
        with pytest.raises(UnitMismatch):
            PRIMITIVES[name].unit(*given)
    else:
        assert PRIMITIVES[name].unit(*given) == expected


def test_units_in_words():
    assert [unit.words for unit in (LENGTH, ANGLE, BARE, Unit(2, 0))] == [
        "a length",
        "an angle",
        "a plain number",
        "an area",
    ]
    assert Unit(1, -1).words == "a quantity in m rad^-1" and str(Unit(2, 1)) == "m^2 rad" and str(BARE) == ""
    assert agree() == BARE and times(LENGTH, ANGLE) == Unit(1, 1) and over(LENGTH, ANGLE) == Unit(1, -1)
    assert quantity("25", "cm") == (0.25, LENGTH) and quantity("0.25", "turn") == (math.pi / 2, ANGLE)


def test_interval_rules_worked_by_hand():
    def box(low, high):
        return Interval(np.float64(low), np.float64(high))

    assert iv.mul(box(-2, 3), box(-5, 7)) == (-15, 21)
    assert iv.absolute(box(-2, 1)) == (0, 2) and iv.absolute(box(-2, -1)) == (1, 2)
    assert iv.sub(box(0, 1), box(0, 1)) == (-1, 1) and iv.div(box(1, 2), box(-2, -2)) == (-1, -0.5)
    assert iv.hypot(box(-3, 1), box(4, 4)) == (4, 5)
    assert iv.minimum(box(0, 3), box(1, 2)) == (0, 2) and iv.maximum(box(0, 3), box(1, 2)) == (1, 3)
    tight = {"wrap": (iv.wrap, box(6.0, 6.5), 6.0 - 2 * math.pi, 6.5 - 2 * math.pi)}
    tight["cos"] = iv.cos, box(-0.5, 1.0), math.cos(1.0), 1.0
    tight["sin"] = iv.sin, box(1.0, 2.0), math.sin(1.0), 1.0
    tight["cos at pi"] = iv.cos, box(3.0, 3.5), -1.0, math.cos(3.5)
    tight["wrap across"] = iv.wrap, box(3.0, 3.5), -math.pi, math.pi
    for name, (rule, given, low, high) in tight.items():
        bound = rule(given)
        assert (bound.lo, bound.hi) == pytest.approx((low, high), abs=1e-14), name
