"""Intervals and tests against independent computations, and what they promise over many repeats."""

import math

import numpy as np
import pytest
from scipy import integrate, stats

from scenegen.learn.success.statistics import PairedDifference, decided_after, required_unpaired_starts, wilson


@pytest.mark.parametrize("hits, n", [(0, 10), (3, 10), (50, 50), (417, 2500)])
def test_wilson(hits, n):
    expected = stats.binomtest(hits, n).proportion_ci(method="wilson")
    assert wilson(hits / n, n) == pytest.approx((expected.low, expected.high), abs=1e-6)


@pytest.mark.parametrize("first, second", [(0, 0), (4, 0), (9, 3), (120, 87), (3, 9)])
def test_mcnemar(first, second):
    expected = stats.binomtest(first, first + second).pvalue if first + second else 1.0
    assert PairedDifference(first, second, 500).p == pytest.approx(expected)


@pytest.mark.parametrize("first, second", [(0, 0), (7, 0), (9, 3), (40, 31)])
def test_evidence(first, second):
    """The mean over Jeffreys' prior of how likely the wins are, by quadrature, over how likely they are by halves."""
    likely = integrate.quad(
        lambda turn: math.sin(turn) ** (2 * first) * math.cos(turn) ** (2 * second) * 2 / math.pi, 0, math.pi / 2
    )[0]  # of a share sin^2
    assert PairedDifference(first, second, 500).evidence == pytest.approx(likely * 2.0 ** (first + second))


def test_one_may_look_after_every_episode():
    """2,000 comparisons of policies that do not differ, where one stops at the first look that decides: at most 5 %
    ever do, and not hardly any, within 150 episodes that one alone solves."""
    first = np.cumsum(np.random.default_rng(7).random((2000, 150)) < 0.5, axis=1)
    decided = np.array(
        [[PairedDifference(k, n - k, n).is_decided if k <= n else False for k in range(151)] for n in range(1, 151)]
    )
    assert 0.01 <= decided[np.arange(150), first].any(axis=1).mean() <= 0.05


def test_a_look_ends_at_an_episode_that_is_under_way():
    good, bad = dict.fromkeys(range(20), True), dict.fromkeys(range(20), False)
    assert decided_after(range(20), good, bad) == decided_after(range(20), bad, good) == 7
    assert decided_after([3, *range(10, 20), 0], {**good, 5: False}, bad) == 7
    del good[4]
    assert decided_after(range(20), good, bad) is None and decided_after(range(5, 20), good, bad) == 7
    assert decided_after(range(20), bad, bad) is None


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
    n = PairedDifference(150, 100, 1000).required_starts(0.05)
    one, other, _ = rng.multinomial(n, [0.15, 0.10, 0.75], size=1000).T
    found = np.mean([PairedDifference(int(a), int(b), n).p < 0.05 for a, b in zip(one, other, strict=True)])
    assert 0.74 <= found <= 0.84
    assert required_unpaired_starts(0.45, 0.1) == 388  # as tables have it
    assert math.isclose(
        PairedDifference(0, 0, 1000).required_starts(0.05),
        PairedDifference(0, 49, 1000).required_starts(0.05),
        abs_tol=9,
    )


@pytest.mark.parametrize(
    "share, low, high",
    [(1.0, 0.95, 1.0), (0.99, 0.95, 1.0), (0.975, 0.95, 1.0), (0.0, 0.0, 0.05), (0.01, 0.0, 0.05), (0.6, 0.575, 0.625)],
)
def test_a_difference_near_the_ends_needs_what_it_needs_there(share, low, high):
    """The pair that is that far apart; the number is by the textbook, from scipy's quantiles."""
    z, power, middle = stats.norm.ppf(0.975), stats.norm.ppf(0.8), (low + high) / 2
    root = z * math.sqrt(2 * middle * (1 - middle)) + power * math.sqrt(low * (1 - low) + high * (1 - high))
    assert required_unpaired_starts(share, 0.05) == math.ceil((root / 0.05) ** 2)
    assert required_unpaired_starts(1.0, 0.05) == 152


@pytest.mark.parametrize("kind", [np.int64, np.int32, np.uint8, np.uint64])
def test_numbers_of_numpy(kind):
    mine, theirs = PairedDifference(40, 90, 200), PairedDifference(*map(kind, (40, 90, 200)))
    for one in (lambda x: x.p, lambda x: x.difference, lambda x: x.interval, lambda x: x.required_starts(0.05)):
        assert one(theirs) == one(mine)
    assert PairedDifference(kind(100), kind(100), kind(200)).p == 1.0


def test_no_start_in_common_tells_nothing():
    none = PairedDifference(0, 0, 0)
    assert (none.difference, none.p, none.interval) == (0.0, 1.0, (-1.0, 1.0)) and not none.is_decided
