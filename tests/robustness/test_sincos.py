"""Sines and cosines of compiled formulas: how near, how far, and where their factors come from."""

import math

import mpmath
import numpy as np
import pytest
import torch

from scenegen.robustness.sincos import DOUBLE, SINGLE, turn


def fitted(function, degree):
    """The factors of the polynomial through a function of r^2 at the Chebyshev nodes of [0, (pi/4)^2]."""
    with mpmath.workdps(60):
        top, count = (mpmath.pi / 4) ** 2 * 1.0001, degree + 1
        nodes = [top * (1 + mpmath.cos(mpmath.pi * (2 * i + 1) / (2 * count))) / 2 for i in range(count)]
        powers = mpmath.matrix([[node**j for j in range(count)] for node in nodes])
        factors = mpmath.lu_solve(powers, mpmath.matrix([function(node) for node in nodes]))
        return tuple(float(factor) for factor in factors)


@pytest.mark.parametrize("constants", [DOUBLE, SINGLE])
def test_the_factors(constants):
    sine = fitted(lambda z: (mpmath.sin(mpmath.sqrt(z)) / mpmath.sqrt(z) - 1) / z, len(constants.sine) - 1)
    cosine = fitted(lambda z: (mpmath.cos(mpmath.sqrt(z)) - 1 + z / 2) / z**2, len(constants.cosine) - 1)
    assert constants.sine == pytest.approx(sine, rel=1e-15) and constants.cosine == pytest.approx(cosine, rel=1e-15)
    with mpmath.workdps(60):
        assert abs(mpmath.fsum(constants.quarter) - mpmath.pi / 2) < 2.0 ** (-100 if constants is DOUBLE else -43)


@pytest.mark.parametrize("constants, dtype, error", [(DOUBLE, torch.float64, 2e-16), (SINGLE, torch.float32, 1e-7)])
def test_errors(constants, dtype, error):
    rng = np.random.default_rng(0)
    some = [rng.uniform(-top, top, 50_000) for top in (1e-3, 7.0, constants.largest)]
    angles = torch.from_numpy(np.concatenate([*some, np.arange(-40, 41) * math.pi / 4])).to(dtype)
    exact = angles.numpy().astype(np.longdouble)
    cosine, sine = turn(angles, constants)
    assert cosine.dtype == sine.dtype == dtype
    assert np.abs(cosine.numpy() - np.cos(exact)).max() < error and np.abs(sine.numpy() - np.sin(exact)).max() < error


@pytest.mark.parametrize("constants", [DOUBLE, SINGLE])
def test_what_is_too_large_is_marked(constants):
    angles = torch.tensor([constants.largest, 1.01 * constants.largest, -2.0 * constants.largest])
    for values in turn(angles, constants):
        assert values.isnan().tolist() == [False, True, True]
