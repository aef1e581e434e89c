"""Random formulas with a meaning, as text, and random scenes for them; and how large the numbers get on the way."""

import math

import numpy as np
from hypothesis import strategies as st

from scenegen.geometry import MATH
from scenegen.lang.checker import check_text
from scenegen.lang.formula.interpret import evaluate

NAMES = ("mug", "plate", "fork", "knife")
objects = st.integers(1, 4).map(lambda count: NAMES[:count])
lengths = st.sampled_from(["0", "0.1", "0.25", "25 cm", "30 mm", "1 m", "-0.4", "0.07", "2 / 3"])
angles = st.sampled_from(["0.2", "90 deg", "NORTH", "0.25 turn", "-1 rad", "WEST", "3"])
factors = st.sampled_from(["2", "-1", "0.5", "-0.3", "1.7", "3"])


def places(names):
    return st.one_of(st.sampled_from(names), st.builds("({}, {})".format, lengths, lengths))


def length_exprs(names):
    """Scalars in metres."""
    some = st.sampled_from(names)
    leaves = st.one_of(
        st.builds("x({})".format, some),
        st.builds("y({})".format, some),
        st.builds("dist({}, {})".format, some, places(names)),
        st.builds("(abs(wrap(theta({}) - {})) * 0.1 m / 1 rad)".format, some, angles),
        st.builds("(sin(theta({})) * x({}))".format, some, some),
        st.builds("(cos(theta({}) + {}) * y({}))".format, some, angles, some),
        lengths,
    )

    def grow(below):
        return st.one_of(
            st.builds("({} + {})".format, below, below),
            st.builds("({} - {})".format, below, below),
            st.builds("({} * {})".format, factors, below),
            st.builds("({} / {})".format, below, factors),
            st.builds("(-{})".format, below),
            st.builds("abs({})".format, below),
            st.builds("min({}, {})".format, below, below),
            st.builds("max({}, {}, {})".format, below, below, below),
            st.builds("dist({}, ({}, {}))".format, some, below, below),
        )

    return st.recursive(leaves, grow, max_leaves=4)


def atoms(names):
    some, place, number = st.sampled_from(names), places(names), length_exprs(names)
    relations = st.sampled_from(["leftOf", "rightOf", "belowOf", "aboveOf", "closeTo", "farFrom"])
    return st.one_of(
        st.builds("{}({}, {})".format, relations, some, place),
        st.builds("closeTo({}, {}, {})".format, some, place, number),
        st.builds("farFrom({}, {}, e = {})".format, place, some, number),
        st.builds("angle({}, {})".format, some, angles),
        st.builds("angle({}, {}, {})".format, some, angles, angles),
        st.builds("{} <= {}".format, st.builds("x({})".format, some), number),
        st.builds("{} >= {}".format, number, st.builds("y({})".format, some)),
        st.builds("0 <= {} < {}".format, number, st.builds("x({}) + 1".format, some)),
        st.builds("theta({}) - {} <= 0.3".format, some, angles),
        st.builds("near({}, {})".format, some, place),
        st.builds("beside({}, {}, {})".format, some, place, number),
    )


def formulas(names):
    def grow(below):
        return st.one_of(
            st.builds("({} & {})".format, below, below),
            st.builds("({} & {} & {})".format, below, below, below),
            st.builds("({} | {})".format, below, below),
            st.builds("({} -> {})".format, below, below),
            st.builds("!({})".format, below),
        )

    return st.recursive(atoms(names).map("({})".format), grow, max_leaves=6)


HEAD = """object {}
const EPS_FAR = 0.3
def near(a, b) = closeTo(a, b, 0.4) & !leftOf(a, b)
def beside(a, b, e) = abs(y(a) - y(b)) <= e | near(a, b)
"""


def spec_text(names, **labels):
    return HEAD.format(", ".join(names)) + "".join(f"{name}: {text}\n" for name, text in labels.items())


@st.composite
def specs(draw, labels=("task",)):
    """A checked spec over 1 to 4 objects."""
    names = draw(objects)
    own = formulas(names).map(f"({{}}) & x({names[0]}) <= 5".format)  # never constant
    return check_text(spec_text(names, **{label: draw(own) for label in labels}))


seeds = st.integers(0, 2**32 - 1)


def scenes(count, batch, seed):
    """Rows (3N, B): most are uniform, some have objects on top of each other or on a grid of ties."""
    rng = np.random.default_rng(seed)
    rows = rng.uniform(-0.2, 1.2, size=(3 * count, batch))
    rows[2::3] = rng.uniform(0.0, 2.0 * math.pi, size=(count, batch))
    rows[:, batch // 2 :] = np.round(rows[:, batch // 2 :], 1)
    if batch > 2:
        rows[:, -1] = np.tile(rows[:3, -1], count)
    return rows


class Size:
    """How large the numbers are that a value is made of: what its rounding error is relative to."""

    def __init__(self, size):
        self.size = size

    def __add__(self, other):
        return Size(self.size + size(other))

    def __mul__(self, other):
        return Size(self.size * size(other))

    def __truediv__(self, other):
        return Size(self.size / size(other))

    def __neg__(self):
        return self

    def __rsub__(self, other):
        return self + other

    __radd__ = __sub__ = __add__
    __rmul__ = __mul__


def size(value):
    return value.size if isinstance(value, Size) else abs(value)


class Sizes:
    """The namespace that goes with Size."""

    def maximum(self, a, b):
        return Size(max(size(a), size(b)))

    def hypot(self, a, b):
        return Size(size(a) + size(b))

    def ceil(self, a):
        return Size(size(a) + 1.0)

    def absolute(self, a):
        return Size(size(a))

    def sin(self, a):
        return Size(size(a) + 1.0)

    minimum = maximum
    cos = sin


def magnitude(core, column):
    """The size of the numbers behind the labels of one scene."""
    values = evaluate(core, [Size(abs(value)) for value in column], Sizes())
    return max(size(values[index]) for index in core.labels.values())


class _Jumps:
    """Plain floats that notice how close `ceil` came to its jump."""

    def __init__(self):
        self.nearest = 1.0

    def __getattr__(self, name):
        return getattr(MATH, name)

    def ceil(self, a):
        self.nearest = min(self.nearest, abs(a - round(a)))
        return math.ceil(a)


def away_from_jumps(core, column):
    """How far every wrap of one scene is from where it jumps, in turns."""
    jumps = _Jumps()
    evaluate(core, list(column), jumps)
    return jumps.nearest
