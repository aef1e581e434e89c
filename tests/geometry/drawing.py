"""Arguments for any entry of the table of primitives, footprints included."""

import math
from itertools import product

import numpy as np

from scenegen.geometry import POINT, PRIMITIVES, Box, Circle, Polygon
from scenegen.geometry.footprint import convex_hull

# A point, thin and square ones, one whose origin is outside, and one whose origin is on its edge.
FOOTPRINTS = (
    POINT,
    Circle(0.1),
    Box(0.2, 0.1),
    Box(0.3, 0.0),
    Polygon(((-0.1, -0.1), (0.2, -0.1), (0.0, 0.15))),
    Polygon(((0.1, 0.05), (0.3, 0.0), (0.4, 0.2), (0.15, 0.2))),
    Polygon(((0.0, -0.1), (0.1, -0.05), (0.1, 0.05), (0.0, 0.1))),
)
_KINDS = {"number": ("number",), "place": ("length",) * 2, "footprint": ("length", "length", "angle")}
_ANGLES = {"wrap", "sin", "cos"}


def numbers(name):
    """What each number that the primitive is given measures."""
    primitive = PRIMITIVES[name]
    if primitive.variadic:
        return ("number",) * 3
    found = [kind for shape in primitive.params for kind in _KINDS[shape]]
    if name == "reach":
        found[-1] = "angle"
    return tuple(found)


def shapes(name):
    """Tuples of footprints to try."""
    return list(product(FOOTPRINTS, repeat=sum(shape == "footprint" for shape in PRIMITIVES[name].params)))


def arguments(name, seed, count):
    """(arity, count): uniform values of several sizes, exact zeros, ties, and for angles the neighbourhood of jumps."""
    kinds = numbers(name)
    rng = np.random.default_rng([*np.atleast_1d(seed), *name.encode()])
    ties = count // 20
    if "footprint" in PRIMITIVES[name].params:  # near enough to overlap, and touching, coinciding, nested
        values = rng.uniform(-0.4, 0.4, size=(len(kinds), count))
        values[:, : 8 * ties] = rng.integers(-4, 5, size=(len(kinds), 8 * ties)) / 20.0
        for row, kind in enumerate(kinds):
            if kind == "angle":
                values[row] = rng.uniform(-7.0, 7.0, size=count)
                values[row, : 6 * ties] = math.pi / 2.0 * rng.integers(-4, 5, size=6 * ties)
        if name == "shadowGap":  # copies of a body from its own size on
            values[-2:] = 1.0 + np.abs(values[-2:])
        if name == "visibleShare":
            _see(values, rng)
        return values
    values = rng.uniform(-1.0, 1.0, size=(len(kinds), count)) * 10.0 ** rng.integers(-3, 3, size=(1, count))
    values[:, :ties] = rng.integers(-2, 3, size=(len(kinds), ties))
    if name in _ANGLES:
        jumps = math.pi * rng.integers(-9, 10, size=2 * ties) / 2.0 + rng.choice([0.0, 1e-15, -1e-15], 2 * ties)
        values[:, ties : 3 * ties] = jumps
    if name == "div":
        values[1][values[1] == 0.0] = 0.5
    return values


def _see(values, rng):
    """Makes of numbers a camera that is above the table and looks down, and bodies that end above where they begin."""
    for low in (3, 15):
        values[low + 1] = values[low] + np.abs(values[low + 1]) + 0.01
    values[7] = 0.5 + np.abs(values[7])
    some = slice(-(values.shape[1] // 8), None)  # of which most have it where the other body is, some inside of that
    values[5:7, some] = values[12:14, some] + values[3:5, some] / 8.0
    values[7, some] = 0.3
    values[16, some] += 0.5
    level, down = rng.uniform(-math.pi, math.pi, size=values.shape[1]), rng.uniform(0.1, 1.5, size=values.shape[1])
    values[8:10], values[10:12] = (np.cos(level), np.sin(level)), (np.sin(down), np.cos(down))


def boxes(name, rng, count, width):
    """Lowest and highest arguments, (arity, count) each: boxes and points of any width up to `width`."""
    low = arguments(name, rng.integers(2**31), count)
    high = low + width * rng.uniform(size=low.shape) * rng.integers(0, 2, size=low.shape)
    ties = count // 10
    high[:, :ties] = low[:, :ties] + width * rng.integers(0, 3, size=(len(low), ties)) / 4.0
    if name == "div":
        high[1] = low[1]  # the checker lets constants alone divide
    return low, high


def within(rng, low, high):
    """Points of the boxes: lowest and highest ends, corners, and anywhere."""
    for share in (0.0, 1.0, rng.uniform(size=low.shape), rng.integers(0, 2, size=low.shape)):
        yield np.clip(low + share * (high - low), low, high)


def random_footprint(rng, kind):
    """A footprint of a kind: "point", "circle", "box" or "polygon" (3 to 8 corners, not always around its origin)."""
    if kind == "point":
        return POINT
    if kind == "circle":
        return Circle(float(rng.uniform(0.02, 0.3)))
    if kind == "box":
        return Box(*rng.uniform(0.02, 0.5, size=2).tolist())
    points = rng.normal(size=(rng.integers(3, 9), 2)) * 0.2 + rng.normal(size=2) * rng.choice([0.0, 0.15])
    return convex_hull(map(tuple, points.tolist()))
