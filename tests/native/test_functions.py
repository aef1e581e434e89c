"""Sines, cosines and angles of compiled formulas: how near, how far, and where their factors come from."""

import math

import mpmath
import numpy as np
import pytest

import scenegen
from scenegen.learn.native import make_kernel
from scenegen.learn.native.functions import DOUBLE, SINGLE

BOTH = pytest.mark.parametrize("constants, dtype", [(DOUBLE, np.float64), (SINGLE, np.float32)])
TEXT = """object a
cosine: cos(theta(a)) >= 0
sine: sin(theta(a)) >= 0
"""


def fitted(function, top, degree):
    """The factors of the polynomial through a function of r^2 at the Chebyshev nodes of [0, top]."""
    with mpmath.workdps(60):
        count = degree + 1
        nodes = [top * (1 + mpmath.cos(mpmath.pi * (2 * i + 1) / (2 * count))) / 2 for i in range(count)]
        powers = mpmath.matrix([[node**j for j in range(count)] for node in nodes])
        factors = mpmath.lu_solve(powers, mpmath.matrix([function(node) for node in nodes]))
        return tuple(float(factor) for factor in factors)


def kernel(text, dtype):
    core = scenegen.parse(text).checked.core
    run = make_kernel(core, single=dtype == np.float32)

    def call(*columns):
        rows = np.zeros((3 * len(core.objects), len(columns[0])), dtype)
        rows[: len(columns)] = columns
        out = np.empty((len(core.labels), rows.shape[1]), dtype)
        return run(rows, out), out

    return call


@pytest.mark.parametrize("constants", [DOUBLE, SINGLE])
def test_the_factors(constants):
    with mpmath.workdps(60):
        top, slope = (mpmath.pi / 4) ** 2 * 1.0001, mpmath.tan(mpmath.pi / 8) ** 2 * mpmath.mpf("1.0001")
        sine = fitted(lambda z: (mpmath.sin(mpmath.sqrt(z)) / mpmath.sqrt(z) - 1) / z, top, len(constants.sine) - 1)
        cosine = fitted(lambda z: (mpmath.cos(mpmath.sqrt(z)) - 1 + z / 2) / z**2, top, len(constants.cosine) - 1)
        tangent = fitted(
            lambda z: (mpmath.atan(mpmath.sqrt(z)) / mpmath.sqrt(z) - 1) / z, slope, len(constants.tangent) - 1
        )
        assert constants.sine == pytest.approx(sine, rel=1e-15) and constants.cosine == pytest.approx(cosine, rel=1e-15)
        assert constants.tangent == pytest.approx(tangent, rel=1e-15)
        assert abs(mpmath.fsum(constants.quarter) - mpmath.pi / 2) < 2.0 ** (-100 if constants is DOUBLE else -43)


@pytest.mark.long
@BOTH
def test_errors_of_sine_and_cosine(constants, dtype):
    rng = np.random.default_rng(0)
    some = [rng.uniform(-top, top, 50_000) for top in (1e-3, 7.0, constants.largest)]
    angles = np.concatenate([*some, np.arange(-40, 41) * math.pi / 4]).astype(dtype)
    good, (cosine, sine) = kernel(TEXT, dtype)(angles, angles, angles)
    assert good
    exact = angles.astype(np.longdouble)
    error = 2e-16 if constants is DOUBLE else 1e-7
    assert np.abs(cosine - np.cos(exact)).max() < error and np.abs(sine - np.sin(exact)).max() < error


@pytest.mark.long
@BOTH
def test_what_is_too_large_is_said(constants, dtype):
    call, angles = kernel(TEXT, dtype), np.full(100, constants.largest, dtype)
    assert call(np.zeros(100), angles, angles)[0]
    for place in (3, 99):
        for wrong in (1.01 * constants.largest, -2.0 * constants.largest, math.nan, math.inf):
            bad = angles.copy()
            bad[place] = wrong
            assert not call(np.zeros(100), angles, bad)[0]


@pytest.mark.long
@BOTH
def test_errors_of_angles(constants, dtype):
    text = "object a\ntask: bearing((0, 0), a) >= 0"
    rng = np.random.default_rng(1)
    x, y = (rng.normal(size=50_000) * 10.0 ** rng.uniform(-6, 1, 50_000) for _ in range(2))
    axes = np.array([[1, 0], [0, 1], [-1, 0], [0, -1], [1, 1], [-1, 1], [-1, -1], [1, -1], [0, 0]], float).T
    x, y = np.concatenate([x, axes[0]]).astype(dtype), np.concatenate([y, axes[1]]).astype(dtype)
    good, (angle,) = kernel(text, dtype)(x, y)
    exact = np.arctan2(y.astype(np.longdouble), x.astype(np.longdouble))
    assert good and np.abs(angle - exact).max() < (5e-16 if constants is DOUBLE else 3e-7)


@pytest.mark.long
@BOTH
def test_headings_are_brought_into_one_turn(constants, dtype):
    rng = np.random.default_rng(2)
    near = np.arange(-20, 21) * (2.0 * math.pi)
    angles = np.concatenate([rng.uniform(-100, 100, 50_000), near, np.nextafter(near, -1e9), [0.0, -1e-17]]).astype(
        dtype
    )
    good, (found,) = kernel("object a\ntask: theta(a) >= 0", dtype)(angles * 0, angles * 0, angles)
    turn = dtype(2.0 * math.pi)
    wanted = np.remainder(angles, turn)
    wanted = np.where(wanted >= turn, wanted - turn, wanted)
    assert good and ((found >= 0) & (found < turn)).all()
    off = np.abs(found - wanted)
    assert np.minimum(off, turn - off).max() < 4 * np.finfo(dtype).eps
