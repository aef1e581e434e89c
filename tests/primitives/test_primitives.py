"""Laws over the whole table of primitives: a new entry is tested as soon as it is there."""

import math

import numpy as np
import pytest
import torch

from scenegen.primitives import ANGLE, BARE, LENGTH, MATH, NUMPY, PRIMITIVES, Interval, Unit, UnitMismatch
from scenegen.primitives import interval as iv
from scenegen.primitives.units import agree, over, quantity, times
from scenegen.robustness.namespace import TORCH

ANGLES = {"wrap", "sin", "cos"}
COUNT = 4000


def arity(name):
    primitive = PRIMITIVES[name]
    return 3 if primitive.variadic else sum(2 if shape == "place" else 1 for shape in primitive.params)


def arguments(name, seed=0):
    """(arity, COUNT): uniform values of several sizes, exact zeros, ties, and for angles the neighbourhood of jumps."""
    rng = np.random.default_rng([seed, *name.encode()])
    values = rng.uniform(-1.0, 1.0, size=(arity(name), COUNT)) * 10.0 ** rng.integers(-3, 3, size=(1, COUNT))
    values[:, :200] = rng.integers(-2, 3, size=(arity(name), 200))
    if name in ANGLES:
        values[:, 200:600] = math.pi * rng.integers(-9, 10, size=400) / 2.0 + rng.choice([0.0, 1e-15, -1e-15], 400)
    if name == "div":
        values[1][values[1] == 0.0] = 0.5
    return values


@pytest.mark.parametrize("name", PRIMITIVES)
def test_every_namespace_gives_the_same(name):
    evaluate, values = PRIMITIVES[name].evaluate, arguments(name)
    expected = np.array([evaluate(MATH, *column) for column in values.T.tolist()])
    array = evaluate(NUMPY, *values)
    tensor = evaluate(TORCH, *torch.from_numpy(values)).numpy()
    ulps = {"sin": 1, "cos": 1}.get(name, 0)  # whose last bit is the library's
    assert (np.abs(array - expected) <= ulps * np.spacing(np.abs(expected))).all()
    ulps = {"dist": 1}.get(name, ulps)  # torch takes its square roots from MKL
    assert (np.abs(tensor - expected) <= ulps * np.spacing(np.abs(expected))).all()


@pytest.mark.parametrize("name", PRIMITIVES)
@pytest.mark.parametrize("width", [0.0, 1e-12, 0.1, 3.0])
def test_the_interval_rule_holds_every_value(name, width):
    primitive, low = PRIMITIVES[name], arguments(name, 1)
    rng = np.random.default_rng(2)
    high = low + width * rng.uniform(size=low.shape)
    if name == "div":
        high[1] = low[1]  # the checker lets constants alone divide
    bound = primitive.interval(*(Interval(a, b) for a, b in zip(low, high, strict=True)))
    assert (bound.lo <= bound.hi).all()
    for share in (0.0, 0.5, 1.0, rng.uniform(size=low.shape), rng.integers(0, 2, size=low.shape)):
        value = primitive.evaluate(NUMPY, *np.clip(low + share * (high - low), low, high))
        assert ((bound.lo <= value) & (value <= bound.hi)).all()
    assert np.isfinite(bound.lo).all() and np.isfinite(bound.hi).all()


@pytest.mark.parametrize("name", [name for name in PRIMITIVES if name not in ANGLES])
def test_the_interval_of_a_point_is_a_point(name):
    values = arguments(name, 3)
    bound = PRIMITIVES[name].interval(*(Interval(one, one) for one in values))
    assert np.array_equal(bound.lo, bound.hi) and np.array_equal(bound.lo, PRIMITIVES[name].evaluate(NUMPY, *values))


@pytest.mark.parametrize("name", PRIMITIVES)
def test_the_entry_says_what_it_is(name):
    primitive = PRIMITIVES[name]
    units = [ANGLE if name in ANGLES else LENGTH] * len(primitive.params)
    assert primitive.name == name and primitive.doc
    assert isinstance(primitive.unit(*units), Unit) and isinstance(primitive.unit(*[BARE] * len(units)), Unit)
    assert not primitive.operator or primitive.operator in "+-*/"


@pytest.mark.parametrize("name", PRIMITIVES)
def test_gradients_are_finite_wherever_the_value_is_defined(name):
    values = torch.from_numpy(arguments(name)).requires_grad_()
    PRIMITIVES[name].evaluate(TORCH, *values).sum().backward()
    assert torch.isfinite(values.grad).all()


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
    ("add", (LENGTH, ANGLE), None),
    ("sub", (Unit(2, 0), LENGTH), None),
    ("min", (BARE, LENGTH, ANGLE), None),
    ("sin", (LENGTH,), None),
    ("wrap", (LENGTH,), None),
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
