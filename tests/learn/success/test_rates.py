"""The base rate from strata: the estimate, and how often its interval covers."""

import math
from itertools import pairwise

import numpy as np
import pytest

from scenegen.errors import RequestError
from scenegen.fit import allocate, base_rate
from scenegen.learn.success.rates import cut_strata


def test_one_stratum_is_a_plain_rate():
    """Its interval is about Wilson's."""
    estimate, low, high = base_rate([30], [100], [1.0])
    assert estimate == 0.3
    z = 1.959964
    middle, half = (30 + z * z / 2) / (100 + z * z), z * math.sqrt(0.21 * 100 + z * z / 4) / (100 + z * z)
    assert (low, high) == pytest.approx((middle - half, middle + half), abs=0.003)


def test_the_interval_holds_the_estimate():
    for won in (0, 25):
        estimate, low, high = base_rate([won, won], [25, 25], [0.5, 0.5])
        assert 0.0 <= low <= estimate <= high <= 1.0 and high - low < 0.2


def test_strata_are_weighted_by_their_probabilities():
    assert base_rate([0, 10], [10, 10], [0.9, 0.1])[0] == pytest.approx(0.1)


def test_what_was_not_run_may_succeed_always_or_never():
    estimate, low, high = base_rate([50, 0], [100, 0], [0.8, 0.2])
    known = base_rate([50], [100], [0.8])
    assert estimate == 0.5 and (estimate, low, high) == known
    assert high - low == pytest.approx(0.2 + 2 * 1.959964 * 0.8 * math.sqrt(0.25 / 100))


@pytest.mark.parametrize(
    "rates, weights, episodes",
    [
        ([0.5], [1.0], [200]),
        ([0.03], [1.0], [100]),
        ([0.05, 0.2, 0.5, 0.8, 0.95], [0.01, 0.1, 0.4, 0.39, 0.1], [50] * 5),
        ([0.0, 0.02, 0.5, 0.98, 1.0], [0.2] * 5, [40] * 5),
        ([0.5] * 20, [0.05] * 20, [5] * 20),
        ([0.01] * 5, [0.2] * 5, [40] * 5),
        ([0.02, 0.5], [0.9, 0.1], [60, 60]),  # a rare stratum is unlike the others
        ([0.01, 0.03], [0.5, 0.5], [100, 100]),
        ([0.01], [1.0], [1000]),
        ([0.002, 0.998], [0.5, 0.5], [20, 20]),
    ],
)
def test_the_interval_covers(rates, weights, episodes):
    rng = np.random.default_rng(0)
    true = float(np.dot(rates, weights))
    found = [base_rate(rng.binomial(episodes, rates), episodes, weights) for _ in range(1000)]
    assert np.mean([low <= true <= high for _, low, high in found]) >= 0.93


def test_probabilities_that_are_estimates_widen_the_interval():
    """By as much as their errors scatter the estimate: not at all where all strata succeed alike."""
    episodes, weights, errors = [1e9, 1e9], [0.5, 0.5], [0.05, 0.0]
    _, low, high = base_rate([0.2e9, 0.8e9], episodes, weights, errors)
    wrong = 0.5 * 10**0.05
    off = (0.2 * wrong + 0.8 * 0.5) / (wrong + 0.5) - 0.5
    assert (high - low) / 2 == pytest.approx(-off, rel=0.01)
    assert np.diff(base_rate([5e8, 5e8], episodes, weights, errors)[1:]) < 1e-4


def test_episodes_go_where_success_is_open():
    given = allocate([0.4, 0.2, 0.4], [0.0, 0.5, 1.0], 1000)
    assert given.sum() == 1000 and given[1] > 2 * given[0] and abs(given[0] - given[2]) <= 1
    assert allocate([1.0, 0.0], [0.5, 0.5], 10).tolist() == [9, 1]


def test_shares_are_neymans_where_there_are_many():
    weights, rates = np.array([0.5, 0.3, 0.2]), np.array([0.1, 0.5, 0.7])
    neyman = weights * np.sqrt(rates * (1.0 - rates))
    assert allocate(weights, rates, 3000) == pytest.approx(3000 * neyman / neyman.sum(), rel=0.02)


def test_neyman_beats_equal_shares():
    weights, rates = np.array([0.8, 0.2]), np.array([0.02, 0.5])

    def width(episodes):
        rng = np.random.default_rng(1)
        found = [base_rate(rng.binomial(episodes, rates), episodes, weights) for _ in range(200)]
        return np.mean([high - low for _, low, high in found])

    assert width(allocate(weights, rates, 200)) < width([100, 100])


@pytest.mark.parametrize(
    "given",
    [([1], [2, 3], [1.0]), ([5], [2], [1.0]), ([1, 1], [2, 2], [0.9, 0.9]), ([-1], [2], [0.5]), ([], [], [])]
    + [([0], [0], [1.0]), ([1], [2], [0.0]), ([0, 1], [0, 2], [1.0, 0.0]), ([1], [2], [1e-200]), ([1], [2], [math.nan])]
    + [([1], [math.inf], [1.0]), ([math.nan], [2], [1.0]), ([1], [math.nan], [1.0]), ([1], [2], [math.inf])]
    + [([1], [2], [1.0], [error]) for error in (math.nan, math.inf, -0.1)],
)
def test_numbers_that_can_be_no_strata_are_refused(given):
    with pytest.raises(RequestError):
        base_rate(*given)


def test_too_few_episodes_are_refused():
    with pytest.raises(RequestError, match="least 1 for each"):
        allocate([0.5, 0.5], [0.5, 0.5], 1)


@pytest.mark.parametrize(
    "given",
    [
        ([0.5, math.nan], [0.5, 0.5], 9),
        ([0.5, 0.5], [0.5, 1.5], 9),
        ([0.5, 0.5], [0.5], 9),
        ([0.5, 0.5], [0.5, 0.5], 2.5),
    ],
)
def test_strata_that_get_no_episodes(given):
    with pytest.raises(RequestError):
        allocate(*given)


def test_strata_are_as_many_as_pay():
    """Of predictions that are all alike one; of predictions that are near 0 or 1 two at least, at any price more with
    more episodes."""
    rng = np.random.default_rng(0)
    assert [len(one) for one in cut_strata(np.full(500, 0.3), 100)] == [2, 1, 1]
    odds = 9.0 * rng.normal(size=20_000)
    few, many = (cut_strata(1.0 / (1.0 + np.exp(-odds)), n) for n in (30, 2000))
    assert 2 <= len(few[1]) < len(many[1]) <= 8
    for ends, probability, episodes in (few, many):
        assert ends[0] == 0.0 and ends[-1] == 1.0 and (np.diff(ends) > 0.0).all() and (episodes > 0).all()
        assert probability.sum() == pytest.approx(1.0) and len(ends) == len(probability) + 1
    assert few[2].sum() == 30 and many[2].sum() == 2000


def test_no_prediction_is_an_end_of_a_stratum():
    """Predictions that many scenes share would be in two strata at once."""
    rate = np.repeat([0.0, 0.2, 0.5, 0.9, 1.0], [400, 100, 100, 100, 300])
    ends, probability, _ = cut_strata(rate, 200)
    assert not set(ends[1:-1]) & set(rate)
    inside = [int(((rate >= low) & (rate <= high)).sum()) for low, high in pairwise(ends)]
    assert inside == pytest.approx(probability * len(rate))


def test_predictions_that_are_nearly_alike_are_one():
    ends, probability, _ = cut_strata(np.repeat([0.5, np.nextafter(0.5, 1.0), np.nextafter(0.5, 0.0), 0.9], 50), 100)
    assert probability.min() > 0.2 and not set(ends[1:-1]) & {0.5, np.nextafter(0.5, 1.0), np.nextafter(0.5, 0.0)}
