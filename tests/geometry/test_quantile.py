"""Quantiles: the distributions that they give, against scipy's and counted areas; bounds that hold every value, and
backward rules that lose none, for every kind of option and mixtures of these."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from scenegen.geometry import NUMPY
from scenegen.geometry.quantile import (
    CutNormal,
    NormalRun,
    Quantile,
    UniformRun,
    narrow_quantile,
    quantile,
    quantile_bounds,
    region_runs,
)

from ..laws import examples

LOW, HIGH = 0.2, 1.7  # of the coordinate, and of both uniform numbers
TRIANGLE = ((0.3, 0.4), (1.5, 0.5), (0.8, 1.6))
MANY = np.random.default_rng(7).uniform(LOW, HIGH - 0.1, 40)
X, Y = region_runs(TRIANGLE, 0)
ROOMS = UniformRun(np.array([0.3, 1.0, 0.3]), np.array([0.5, 1.6, 1.7]))


def made(*runs, weights=None, alone=True):
    counts = [run.count for run in runs]
    weights = np.repeat(1.0 / np.array(counts), counts) if weights is None else np.array(weights)
    ends = np.cumsum(weights) / weights.sum()
    ends[-1] = 1.0
    return Quantile((LOW, HIGH), (LOW, HIGH), ends, runs, alone)


KINDS = {
    "normal": (made(NormalRun(0.4, 0.3, LOW, HIGH)), 0),
    "far": (made(NormalRun(9.0, 0.3, LOW, HIGH)), 0),
    "relative": (made(NormalRun(0, 0.2, LOW, HIGH)), 1),
    "offset": (made(NormalRun(0, 0.2, LOW, HIGH, offset=True)), 1),
    "heading": (made(NormalRun(0, 0.5, -math.inf, math.inf, math.pi)), 1),
    "rooms": (made(ROOMS, weights=(1, 2, 3)), 0),
    "rooms of another": (made(ROOMS, alone=False), 0),
    "many": (made(UniformRun(MANY, MANY + 0.05)), 0),
    "many of another": (made(UniformRun(MANY, MANY + 0.05), alone=False), 0),
    "x in a region": (made(X), 0),
    "y in a region": (made(Y), 1),
    "mixture": (made(NormalRun(0.4, 0.1, LOW, HIGH), ROOMS, NormalRun(0, 0.05, LOW, HIGH), weights=(3, 1, 1, 1, 4)), 1),
    "of another": (made(NormalRun(0.4, 0.1, LOW, HIGH), Y, alone=False), 1),
}


def boxes(rng, count, arity, width):
    low = rng.uniform(LOW, HIGH, size=(arity, count))
    high = np.minimum(low + width * rng.random(low.shape) * rng.integers(0, 2, size=low.shape), HIGH)
    low[:, : count // 10] = LOW
    return low, high


def ends_of(of, low, high):
    """Arguments as bounds: what says where is what chooses, where it is alone."""
    parts = list(zip(low, high, strict=True))
    return [parts[0], parts[0] if of.alone else parts[1], *parts[2:]]


@pytest.mark.parametrize("name", KINDS)
@settings(max_examples=examples(60), deadline=None)
@given(seed=st.integers(0, 2**31), width=st.sampled_from([0.0, 1e-6, 0.01, 0.2, 2.0]))
def test_bounds_hold_every_value_and_nothing_wanted_is_lost(name, seed, width):
    of, more = KINDS[name]
    rng = np.random.default_rng(seed)
    low, high = boxes(rng, 200, 2 + more, width)
    parts = ends_of(of, low, high)
    lo, hi = quantile_bounds(of, *parts)
    assert lo.shape == hi.shape == (200,)
    for share in (0.0, 1.0, rng.random(low.shape)):
        inside = np.minimum(low + share * (high - low), high)
        inside[1] = inside[0] if of.alone else inside[1]
        value = quantile(NUMPY, of, *inside)
        assert (lo <= value).all() and (value <= hi).all()
        for slack in (0.0, 0.03):
            chosen, own = narrow_quantile(of, (value - slack, value + slack), *parts)
            for (least, most), was in ((chosen, inside[0]), (own, inside[1])):
                assert (least <= was).all() and (was <= most).all()


@pytest.mark.parametrize("name", [name for name, (of, _) in KINDS.items() if of.alone])
def test_a_point_has_next_to_no_width(name):
    of, more = KINDS[name]
    values = np.random.default_rng(1).uniform(LOW, HIGH, size=(2 + more, 500))
    values[1] = values[0]
    lo, hi = quantile_bounds(of, *ends_of(of, values, values))
    near = np.minimum.reduce([np.abs((values[0] - LOW) / (HIGH - LOW) - end) for end in of.ends]) > 1e-9
    assert (hi - lo)[near].max() < 1e-11


@pytest.mark.parametrize("ends", [(-1.0, 2.0), (3.0, 9.0), (-9.0, -3.0), (12.0, 20.0), (-3.0, 3.0), (-40.0, 0.5)])
def test_normals_cut_off_are_those_of_scipy(ends):
    u = np.random.default_rng(2).random(1000)
    found = CutNormal.make(*ends).quantile(u)
    assert np.abs(found - stats.truncnorm.ppf(u, *ends)).max() < 1e-9
    assert np.abs(CutNormal.make(*ends).share(found) - u).max() < 1e-9


def test_a_normal_whose_share_is_zero_lies_at_the_near_end():
    assert (CutNormal.make(60.0, 70.0).quantile(np.array([0.1, 0.9])) == 60.0).all()
    assert (CutNormal.make(-70.0, -60.0).quantile(np.array([0.1, 0.9])) == -60.0).all()


def test_each_option_gets_its_share():
    of = made(ROOMS, weights=(1, 2, 3))
    numbers = np.linspace(LOW, HIGH, 60_000, endpoint=False) + (HIGH - LOW) / 120_000
    value = quantile(NUMPY, of, numbers, numbers)
    expected = sum(
        weight / 6.0 * np.clip((0.45 - low) / (high - low), 0.0, 1.0)
        for weight, low, high in ((1, 0.3, 0.5), (2, 1.0, 1.6), (3, 0.3, 1.7))
    )
    assert abs((value < 0.45).mean() - expected) < 1e-4


def test_places_in_a_region_are_uniform():
    rng = np.random.default_rng(3)
    numbers = rng.uniform(LOW, HIGH, size=(2, 200_000))
    x = quantile(NUMPY, made(X), numbers[0], numbers[0])
    y = quantile(NUMPY, made(Y, alone=False), numbers[0], numbers[1], x)
    (ax, ay), (bx, by), (cx, cy) = TRIANGLE
    # barycentric coordinates of a uniform point: each is 1 less the square root of a uniform number
    whole = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
    one = ((x - ax) * (cy - ay) - (cx - ax) * (y - ay)) / whole
    two = ((bx - ax) * (y - ay) - (x - ax) * (by - ay)) / whole
    assert min(one.min(), two.min(), (1.0 - one - two).min()) > -1e-9
    for part in (one, two, 1.0 - one - two):
        assert stats.kstest((1.0 - part) ** 2, "uniform").pvalue > 1e-3
