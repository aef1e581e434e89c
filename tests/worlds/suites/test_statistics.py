"""Intervals and tests against independent computations, and what they promise over many repeats."""

import math

import numpy as np
import pytest
from scipy import stats

from scenegen.worlds.suites.statistics import PairedDifference, needed_unpaired, wilson


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
