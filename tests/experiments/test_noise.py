"""The noise of a policy, and the ceiling of an AUC, against policies whose rates are known: `success/noise.py`."""

import numpy as np
import pytest

from experiments.success.noise import measures
from scenegen.learn.success.measures import auc


@pytest.mark.parametrize("a, b", [(0.5, 0.5), (2.0, 0.5), (5.0, 1.0)])
def test_noise_and_ceiling_are_those_of_known_rates(a, b):
    rng = np.random.default_rng(0)
    rates = rng.beta(a, b, 100_000)
    runs = (rng.random((3, len(rates))) < rates).astype(np.float64)
    mean, noise, told, ceiling = measures(runs)
    assert mean == pytest.approx(rates.mean(), abs=0.005)
    assert noise == pytest.approx((rates * (1 - rates)).mean() / (mean * (1 - mean)), abs=0.01)
    best = auc(rng.random(len(rates)) < rates, rates)
    assert told < best and ceiling == pytest.approx(best, abs=0.01)


def test_a_policy_that_the_start_decides_has_no_noise():
    runs = np.repeat(np.array([[1.0, 0.0, 1.0, 1.0]]), 2, axis=0)
    assert measures(runs) == pytest.approx((0.75, 0.0, 1.0, 1.0), abs=1e-3)
    assert np.isnan(measures(np.ones((2, 3)))[1:]).all()
