"""Intervals and tests against independent computations, and what they promise over many repeats."""

import math

import numpy as np
import pytest
from scipy import stats

from scenegen.worlds.suites.statistics import (
    PairedDifference,
    Stratum,
    needed_unpaired,
    weighted_share,
    wilson,
)


@pytest.mark.parametrize("hits, n", [(0, 10), (3, 10), (50, 50), (417, 2500)])
def test_wilson(hits, n):
    expected = stats.binomtest(hits, n).proportion_ci(method="wilson")
    assert wilson(hits / n, n) == pytest.approx((expected.low, expected.high), abs=1e-6)


@pytest.mark.parametrize("first, second", [(0, 0), (4, 0), (9, 3), (120, 87), (3, 9)])
def test_mcnemar(first, second):
    expected = stats.binomtest(first, first + second).pvalue if first + second else 1.0
    assert PairedDifference(first, second, 500).p == pytest.approx(expected)


def test_intervals_cover():
    """Those of paired differences, in 1,000 repeats of a small sample."""
    rng = np.random.default_rng(3)
    truth, covered = np.array([0.2, 0.1, 0.7]), 0
    for _ in range(1000):
        one, other, _ = rng.multinomial(60, truth)
        low, high = PairedDifference(int(one), int(other), 60).interval
        covered += low <= 0.1 <= high
    assert covered >= 930


@pytest.mark.parametrize("n", [1, 2, 5, 50])
@pytest.mark.parametrize("level", [-4.0, 0.0, 3.0])
def test_intervals_of_weighted_shares_cover(n, level):
    """Of 50 cells whose shares and weights differ, in 1,000 repeats."""
    rng = np.random.default_rng([n, 7])
    weights, covered, widths = rng.dirichlet(np.full(50, 4.0)), 0, []
    for _ in range(1000):
        shares = 1.0 / (1.0 + np.exp(-level - 2.0 * rng.normal(size=50)))
        strata = [Stratum(int(k), n, w) for k, w in zip(rng.binomial(n, shares), weights, strict=True)]
        share, low, high = weighted_share(strata)
        assert low <= share <= high
        covered += low <= weights @ shares <= high
        widths.append(high - low)
    assert covered >= 930
    assert np.mean(widths) <= 2.2 * 1.96 * 0.5 / np.sqrt(50 * n) + 0.02


def test_weights_that_are_uncertain_widen_the_interval():
    def width(error):
        _, low, high = weighted_share([Stratum(95, 100, 0.5, error), Stratum(5, 100, 0.5, error)])
        return high - low

    assert width(0.1) > 1.5 * width(0.0)


def test_episodes_that_a_difference_needs():
    """So many give the power that is promised: 80 %, in 1,000 repeats of the exact test."""
    rng = np.random.default_rng(5)
    n = PairedDifference(150, 100, 1000).needed(0.05)
    one, other, _ = rng.multinomial(n, [0.15, 0.10, 0.75], size=1000).T
    found = np.mean([PairedDifference(int(a), int(b), n).p < 0.05 for a, b in zip(one, other, strict=True)])
    assert 0.74 <= found <= 0.84
    assert needed_unpaired(0.45, 0.1) == 388  # as tables have it
    assert math.isclose(
        PairedDifference(0, 0, 1000).needed(0.05), PairedDifference(0, 49, 1000).needed(0.05), abs_tol=9
    )
