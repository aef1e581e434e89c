"""Intervals of probabilities from a few independent runs, on lognormal estimates as deep levels give them."""

import math

import numpy as np
import pytest
from scipy import stats

from scenegen.sampling.report import probability, ratio, student

ISLANDS, TRIALS = 16, 1000


def lognormal(rng, sigma, size):
    """Of mean 1."""
    return np.exp(rng.normal(-(sigma**2) / 2.0, sigma, size))


@pytest.mark.parametrize("sigma", [0.05, 0.4, 0.8, 1.2])
def test_the_interval_holds_the_mean_of_skewed_estimates(sigma):
    """The standard deviation of the estimates themselves falls short: it holds 89 % at 1, 85 % at 1.3."""
    rng = np.random.default_rng(0)
    held = linear = 0
    for _ in range(TRIALS):
        mine = lognormal(rng, sigma, ISLANDS)
        found = ratio(3e-7 * mine, np.ones(ISLANDS))
        held += abs(found.log10 - math.log10(3e-7)) <= found.error
        error = 2.13 * mine.std(ddof=1) / mine.mean() / math.sqrt(ISLANDS)
        linear += abs(math.log(mine.mean())) <= error
    assert held / TRIALS == pytest.approx(0.945, abs=0.027)  # three standard errors, and half of one percent
    assert sigma < 1.0 or linear / TRIALS < 0.9


@pytest.mark.parametrize(("deep", "base"), [(0.1, 0.3), (0.5, 0.8)])
def test_what_both_means_share_cancels(deep, base):
    rng = np.random.default_rng(1)
    held, width = 0, []
    for _ in range(TRIALS):
        below = lognormal(rng, base, ISLANDS)
        found = ratio(0.25 * below * lognormal(rng, deep, ISLANDS), below)
        held += abs(found.log10 - math.log10(0.25)) <= found.error
        width.append(found.error)
    # of few runs that differ much the largest outweigh the others, so the interval is wider than it need be
    assert 0.92 < held / TRIALS < 0.985
    assert np.median(width) < 1.3 * 2.13 * math.hypot(deep, deep * base) / math.log(10.0) / math.sqrt(ISLANDS)


def test_runs_that_found_nothing_count_as_zeros():
    hits = np.array([0.0, 2.0, 1.0, 3.0])
    found = ratio(hits, np.full(4, 100.0))
    assert found.log10 == pytest.approx(math.log10(0.015))
    assert found.error == pytest.approx(3.18 * stats.sem(hits) / hits.mean() / math.log(10.0))
    assert ratio(np.zeros(4), np.ones(4)) is None and ratio(np.zeros(4), np.zeros(4)) is None


def test_what_is_the_same_in_all_runs_is_certain():
    found = ratio(np.array([0.2, 0.4, 0.3]), np.array([0.2, 0.4, 0.3]))
    assert (found.log10, found.error) == (0.0, pytest.approx(0.0, abs=1e-6))


@pytest.mark.parametrize("degrees", [1, 2, 5, 15, 16, 31, 200])
def test_students_quantiles(degrees):
    assert student(degrees) == pytest.approx(stats.t.ppf(0.975, degrees), rel=2e-3)


@pytest.mark.parametrize("count", [4, 8])
@pytest.mark.parametrize("sigma", [0.3, 1.0, 1.5])
def test_the_interval_of_few_pieces_holds(count, sigma):
    """Their standard deviation alone holds 83 % at 1.5: skewed estimates lie close together where they are too low."""
    rng = np.random.default_rng(2)
    held = plain = 0
    for _ in range(TRIALS):
        mine = lognormal(rng, sigma, count)
        logs = np.log(mine)
        sums = count, float(mine.sum()), float((mine**2).sum())
        found = probability(*sums, (float(logs.sum()), float((logs**2).sum())))
        held += abs(found["log10_probability"]) <= found["log10_error"]
        plain += abs(found["log10_probability"]) <= probability(*sums)["log10_error"]
    assert held / TRIALS > 0.89
    assert sigma < 1.5 or plain / TRIALS < 0.86
