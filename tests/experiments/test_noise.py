"""The noise of a policy, and what a fit tells, against policies whose rates are known: `success/noise.py`."""

import numpy as np
import pytest

from experiments.success.noise import measures
from scenegen.learn.success.measures import auc


@pytest.mark.parametrize("a, b", [(0.5, 0.5), (2.0, 0.5), (5.0, 1.0)])
@pytest.mark.parametrize("some", [False, True])
def test_noise_and_ceiling_are_those_of_known_rates(a, b, some):
    rng = np.random.default_rng(0)
    rates = rng.beta(a, b, 400_000)
    runs = (rng.random((3, len(rates))) < rates).astype(np.float64)
    fit = rates / 2.0 + 0.2
    first = runs[0] > 0.0
    again = ~first | (rng.random(len(rates)) < 0.2) if some else np.full(len(rates), True)
    weight = np.where(first, first.sum() / (first & again).sum(), 1.0)
    mean, noise, told, untold, another, ceiling = measures(runs[:, again], weight[again], fit[again])
    assert mean == pytest.approx(rates.mean(), abs=0.005)
    assert noise == pytest.approx((rates * (1 - rates)).mean() / (mean * (1 - mean)), abs=0.01)
    assert untold == pytest.approx(((rates - fit) ** 2).mean() / (mean * (1 - mean)), abs=0.01)
    assert told == pytest.approx(1.0 - ((runs[0] - fit) ** 2).mean() / (mean * (1 - mean)), abs=0.02)
    best = auc(rng.random(len(rates)) < rates, rates)
    assert another < best and ceiling == pytest.approx(best, abs=0.01)


def test_a_policy_that_the_start_decides_has_no_noise():
    runs, one = np.repeat(np.array([[1.0, 0.0, 1.0, 1.0]]), 2, axis=0), np.ones(4)
    assert measures(runs, one, runs[0]) == pytest.approx((0.75, 0.0, 1.0, 0.0, 1.0, 1.0), abs=1e-3)
    assert np.isnan(measures(np.ones((2, 4)), one, one)[1:]).all()
