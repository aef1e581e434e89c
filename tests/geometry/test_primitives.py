"""Laws over the whole table of primitives: a new entry is tested as soon as it is there. Backward rules never lose a
solution, whatever the rounding; and they narrow as far as worked examples say. Sines and cosines of headings are
worked out once, and nothing else changes.
"""

import math

import numpy as np
import pytest
import torch

from scenegen.geometry import ANGLE, BARE, LENGTH, MATH, NUMPY, PRIMITIVES, Box, Circle, Interval, Unit, UnitMismatch
from scenegen.geometry import interval as iv
from scenegen.geometry.namespace import turning
from scenegen.geometry.primitives import agree, divide_units, quantity, times
from scenegen.geometry.quantile import QUANTILE
from scenegen.lang.checker import check_text
from scenegen.lang.formula.interpret import evaluate
from scenegen.learn.robustness.compile import TORCH

from .drawing import arguments, boxes, shapes, within

COUNT = 4000
SLOW = {"shadowGap", "visibleShare"}  # in plain floats, a millisecond each
NAMES = [name for name in PRIMITIVES if name != QUANTILE]  # samplers alone write quantiles: see test_quantile.py
LIBRARY = {"sin": 1, "cos": 1, "bearing": 1}  # their last bit is the library's
TURNED = {name for name, primitive in PRIMITIVES.items() if "footprint" in primitive.params}  # by sines and cosines
EXACT = set(NAMES) - TURNED - {"wrap", "bearing", *LIBRARY}


def cases(name, seed=0):
    """Footprints, and arguments to go with them: fewer of these where there are many of those."""
    combinations = shapes(name)
    count = COUNT if len(combinations) == 1 else 50 if name in SLOW else 200
    return [(footprints, arguments(name, [seed, i], count)) for i, footprints in enumerate(combinations)]


@pytest.mark.parametrize("name", NAMES)
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
@pytest.mark.parametrize("name", NAMES)
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


@pytest.mark.parametrize("name", NAMES)
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


@pytest.mark.parametrize("name", NAMES)
def test_the_entry_says_what_it_is(name):
    primitive = PRIMITIVES[name]
    angular = name in {"wrap", "sin", "cos", "reach"}
    units = [ANGLE if angular and shape == "number" else LENGTH for shape in primitive.params]
    assert primitive.name == name and primitive.doc
    assert isinstance(primitive.unit(*units), Unit) and isinstance(primitive.unit(*[BARE] * len(units)), Unit)
    assert not primitive.operator or primitive.operator in "+-*/"


@pytest.mark.parametrize("name", NAMES)
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
    assert agree() == BARE and times(LENGTH, ANGLE) == Unit(1, 1) and divide_units(LENGTH, ANGLE) == Unit(1, -1)
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


RULES = [name for name in NAMES if PRIMITIVES[name].backward]
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
    assert name in WORKED, f"`{name}` has a rule `backward`: add cases that you worked by hand to WORKED, above"
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


class Counting:
    """numpy's functions, counting sines."""

    def __init__(self):
        self.sines = 0

    def __getattr__(self, name):
        return getattr(NUMPY, name)

    def sin(self, a):
        self.sines += 1
        return NUMPY.sin(a)

    def turn(self, a):
        return NUMPY.cos(a), self.sin(a)


def test_each_heading_is_turned_by_once():
    core = check_text("object a, b, c, d = box(0.1, 0.06, 0.05)\ntask: noOverlap() & sin(theta(a)) <= 2").core
    rows = list(np.random.default_rng(0).random((12, 50)))
    counting = Counting()
    values = evaluate(core, rows, counting)
    assert counting.sines == 4
    plain = [evaluate(core, row) for row in np.array(rows).T.tolist()]
    assert np.abs(np.array(plain).T[-1] - values[-1]).max() < 1e-15


def test_only_headings_are_kept_and_by_identity():
    heading, other = np.array([0.3]), np.array([0.3])
    namespace = turning(NUMPY, [heading])
    assert namespace.sin(heading) is namespace.sin(heading)
    assert namespace.sin(other) is not namespace.sin(other)
    assert PRIMITIVES["sin"].evaluate(namespace, heading) == np.sin(0.3)
