"""Logistic regression, held against scikit-learn's, and measures of predictions, against numbers worked by hand."""

import numpy as np
import pytest

from scenegen.learn.success import logistic
from scenegen.learn.success.features import Feature
from scenegen.learn.success.logistic import Logistic, OddsCurve, Outcomes, fit_logistic, predict_held_out
from scenegen.learn.success.measures import (
    auc,
    auc_interval,
    bootstrap_interval,
    brier,
    calibration_error,
    chance_error,
)
from scenegen.learn.success.statistics import wilson

KINDS = ("phi", "margin", "place")


def outcomes(n, odds, seed=0):
    """Starts with three features of two modes; log odds of success are a function of them."""
    rng = np.random.default_rng(seed)
    values = rng.normal(size=(3, n))
    success = rng.random(n) < 1.0 / (1.0 + np.exp(-odds(values)))
    return Outcomes(tuple(Feature(kind, kind) for kind in KINDS), values, success, np.arange(n))


@pytest.mark.long
def test_weights_are_those_of_scikit_learn():
    linear = pytest.importorskip("sklearn.linear_model")
    rng = np.random.default_rng(0)
    x = np.concatenate([rng.random((80, 5)), np.ones((80, 1))], axis=1)
    y = (rng.random(80) < x[:, 0]).astype(float)
    free = np.full(6, -np.inf)
    mine = logistic._newton(x, y, 2.0, free, np.zeros(6))
    theirs = linear.LogisticRegression(C=0.5, tol=1e-10, max_iter=1000).fit(x[:, :5], y)
    assert mine == pytest.approx([*theirs.coef_[0], *theirs.intercept_], abs=1e-5)
    bounded = logistic._newton(x, -y + 1.0, 2.0, np.array([0.0] * 5 + [-np.inf]), np.zeros(6))
    assert bounded[0] == 0.0 and (bounded[:5] >= 0.0).all()
    again = linear.LogisticRegression(C=0.5, tol=1e-10, max_iter=1000).fit(x[:, :5][:, bounded[:5] > 0.0], 1.0 - y)
    assert bounded[:5][bounded[:5] > 0.0] == pytest.approx(again.coef_[0], abs=1e-5)


def test_phi_alone_takes_part_where_phi_decides():
    fit = fit_logistic(outcomes(300, lambda v: 3.0 * v[0]), monotone=False)
    assert [one.feature for one in fit.curves] == ["phi"] and sum(fit.curves[0].heights) > 3.0


def test_nothing_takes_part_where_nothing_tells():
    fit = fit_logistic(outcomes(300, lambda v: 0.0 * v[0] + 0.4), monotone=False)
    assert fit.curves == () and fit.bounds == pytest.approx((0.6, 0.6), abs=0.06)


def test_predictions_are_calibrated_at_other_starts():
    def odds(v):
        return 2.0 * v[1] - 2.0 * np.abs(v[2])

    fit, other = fit_logistic(outcomes(400, odds), monotone=False), outcomes(20_000, odds, seed=1)
    assert len(fit.curves) == 3
    assert calibration_error(other.success, other.predict(fit)) < 0.05
    assert auc(other.success, other.predict(fit)) > 0.85
    low, high = fit.bounds
    assert low <= other.predict(fit).min() and other.predict(fit).max() <= high


def test_monotone_predictions_never_fall_as_a_margin_rises():
    seen = outcomes(300, lambda v: 3.0 * np.sin(2.0 * v[0]) - v[1] + 2.0 * v[2])
    fit = fit_logistic(seen, monotone=True)
    heights = {one.feature: np.array(one.heights) for one in fit.curves}
    assert (heights["phi"] >= 0.0).all() and (heights["margin"] == 0.0).all() and (heights["place"] > 0.0).any()


def test_one_kind_of_end_gives_a_rate():
    seen = outcomes(60, lambda v: 0.0 * v[0] + 50.0)
    assert seen.success.all()
    assert fit_logistic(seen, monotone=False).bounds == pytest.approx((61 / 62, 61 / 62))


def test_episodes_of_one_start_are_held_out_together():
    """Each start has one outcome, ten times: who has seen one of them knows the others."""
    rng = np.random.default_rng(0)
    start = np.repeat(np.arange(40), 10)
    values, success = np.repeat(rng.normal(size=(3, 40)), 10, axis=1), np.repeat(rng.random(40) < 0.5, 10)
    seen = Outcomes(tuple(Feature(kind, kind) for kind in KINDS), values, success, start)
    for held in logistic._folds(seen, 0):
        assert not set(start[held]) & set(start[~held]) and 0.3 < success[held].mean() < 0.7
    assert auc(success, predict_held_out(seen, monotone=False)) < 0.75


def test_a_prediction_does_not_depend_on_its_company():
    curve = OddsCurve(feature="phi", kind="phi", knots=(0.0, 1.0, 3.0), heights=(2.0, -1.0))
    fit = Logistic(reads="phi", intercept=-1.0, curves=(curve,), strength=1.0)
    values = np.array([[-5.0, 0.5, 1.0, 2.0, 9.0]])
    odds = np.array([-1.0, 0.0, 1.0, 0.5, 0.0])
    assert fit(["phi"], values) == pytest.approx(1.0 / (1.0 + np.exp(-odds)))
    assert (
        np.concatenate([fit(["phi"], values[:, k : k + 1]) for k in range(5)]).tolist() == fit(["phi"], values).tolist()
    )
    assert fit.bounds == pytest.approx((1.0 / (1.0 + np.e), np.e / (1.0 + np.e)))


def test_measures_by_hand():
    assert auc([1, 0, 1, 0], [0.9, 0.1, 0.5, 0.5]) == (1 + 1 + 1 + 0.5) / 4
    assert np.isnan(auc([1, 1], [0.1, 0.2]))
    assert brier([1, 0], [0.8, 0.4]) == pytest.approx((0.04 + 0.16) / 2)
    y, p = np.arange(80) % 2, np.repeat([0.4, 0.7], 40)
    assert calibration_error(y, p) == pytest.approx((0.1 + 0.2) / 2)
    assert calibration_error(y[:10], p[:10]) == pytest.approx(0.1)  # too few for more than one group


def test_chance_is_what_perfect_predictions_show():
    p = np.random.default_rng(0).random(300)
    mean, most = chance_error(p)
    one = calibration_error(np.random.default_rng(1).random(300) < p, p)
    assert 0.02 < mean < most < 0.12 and abs(one - mean) < 0.04


@pytest.mark.long
def test_intervals_of_measures_cover_what_is_true():
    rng, covered = np.random.default_rng(0), 0
    many = rng.normal(size=200_000)
    true = auc(rng.normal(size=200_000) < many, many)
    for _ in range(20):
        score = rng.normal(size=120)
        y = rng.normal(size=120) < score
        _, low, high = bootstrap_interval(auc, y, score, np.arange(120))
        covered += low <= true <= high
    assert covered >= 17


@pytest.mark.parametrize("knots, heights", [((0.0, 0.0), (1.0,)), ((0.0, 1.0), (1.0, 2.0)), ((0.0,), ())])
def test_curves_that_are_none_are_refused(knots, heights):
    with pytest.raises(ValueError):
        OddsCurve(feature="phi", kind="phi", knots=knots, heights=heights)


def test_the_calibration_error_does_not_depend_on_the_order():
    """Equal predictions are one group, or are shared out in equal parts."""
    rng = np.random.default_rng(0)
    y = np.repeat([True, False], 200)
    assert calibration_error(y, np.full(400, 0.5)) == 0.0 and calibration_error(y, np.full(400, 0.3)) == pytest.approx(
        0.2
    )
    some = np.array([0.2, 0.5, 0.7])[rng.integers(3, size=400)]
    by_hand = sum(abs(float((y[some == p] - p).sum())) for p in (0.2, 0.5, 0.7)) / 400
    found = {calibration_error(y[order], some[order]) for order in (rng.permutation(400) for _ in range(20))}
    assert len(found) == 1 and by_hand == pytest.approx(found.pop(), abs=0.03)


def test_few_of_a_kind_tell_little():
    """The interval is Wilson's of as many, or wider; with many of both it is the bootstrap's."""
    score, rng = np.arange(60) / 60.0, np.random.default_rng(0)
    for failed in ([7], [0], [3, 9], list(range(9))):
        y = ~np.isin(np.arange(60), failed)
        found, low, high = auc_interval(y, score, np.arange(60))
        least, most = wilson(found, len(failed))
        assert low <= least <= found <= most <= high
    y = rng.random(60) < score
    assert auc_interval(y, score, np.arange(60)) == bootstrap_interval(auc, y, score, np.arange(60))
    assert auc_interval(score > 0.5, score, np.arange(60))[1] == pytest.approx(wilson(1.0, 29)[0])
    repeated = auc_interval(np.repeat(score != 0.5, 10), np.repeat(score, 10), np.repeat(np.arange(60), 10))
    assert repeated[2] - repeated[1] > 0.8  # of one start, ten times
