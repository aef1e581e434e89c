from itertools import pairwise

import numpy as np
import pytest
from scipy import special

from experiments.metrics import chi_square_tail, kolmogorov_tail, kuiper_tail


@pytest.mark.parametrize("x", [0.0, 0.03, 0.2, 0.5, 0.8275735, 0.999999, 1.0, 1.000001, 1.36, 2.0, 5.0, 18.0])
def test_kolmogorov(x):
    assert kolmogorov_tail(x) == pytest.approx(special.kolmogorov(x), rel=1e-10)


# Upper quantiles that Stephens 1974 (EDF statistics for goodness of fit, table 1A) prints for Kuiper's V.
@pytest.mark.parametrize(
    ("level", "quantile"), [(0.15, 1.537), (0.10, 1.620), (0.05, 1.747), (0.025, 1.862), (0.01, 2.001)]
)
def test_kuiper_quantiles(level, quantile):
    assert kuiper_tail(quantile + 0.0006) < level < kuiper_tail(quantile - 0.0006)


def test_kuiper_falls_from_one_to_nothing():
    tails = [kuiper_tail(x) for x in np.linspace(0.0, 6.0, 601)]
    assert tails[0] == 1.0
    assert all(0.0 <= after <= before for before, after in pairwise(tails))
    assert kuiper_tail(0.4) == pytest.approx(1.0, abs=1e-6)
    assert 0.0 < tails[-1] < 1e-25


@pytest.mark.parametrize("degrees", [1, 2, 3, 7, 31, 255, 4095, 100_000])
def test_chi_square(degrees):
    deviation = np.sqrt(2.0 * degrees)
    points = [degrees + t * deviation for t in (-5, -2, -0.5, 0.0, 0.3, 1.41, 1.43, 3, 8, 20)]
    for x in [0.0, 1e-12, *points]:
        x = max(x, 0.0)
        assert chi_square_tail(x, degrees) == pytest.approx(special.gammaincc(degrees / 2, x / 2), rel=1e-9, abs=1e-290)


def test_chi_square_far_out_is_zero_not_an_error():
    assert chi_square_tail(1e6, 3) == 0.0
