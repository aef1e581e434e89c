"""How good predictions p (n,) of success y (n,) are at starts that a fit has not seen."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from scenegen.arrays import Array, Bool, Index
from scenegen.learn.success.statistics import wilson

MAX_BINS, MIN_IN_BIN = 10, 40  # of predictions; episodes: of 20 the rate itself is off by 0.1 by chance
BOOTSTRAP_REPEATS = 400
FEW_STARTS = 10  # starts that succeeded, or failed, below which a bootstrap is too narrow

Interval = tuple[float, float, float]
"""An estimate, and its 95 % interval."""


def calibration_error(y: npt.ArrayLike, p: npt.ArrayLike) -> float:
    """The mean difference of predicted and true rates over groups of equal size of similar predictions (expected
    calibration error). Episodes of one prediction count as their mean, wherever a group ends among them."""
    y, p = np.asarray(y, dtype=np.float64), np.asarray(p, dtype=np.float64)
    _, which, count = np.unique(p, return_inverse=True, return_counts=True)
    y = (np.bincount(which, y) / count)[which]
    groups = np.array_split(np.argsort(p, kind="stable"), max(1, min(MAX_BINS, len(p) // MIN_IN_BIN)))
    return float(sum(abs(float((y[one] - p[one]).sum())) for one in groups)) / len(p)


def brier(y: npt.ArrayLike, p: npt.ArrayLike) -> float:
    """The mean square of the difference."""
    return float(np.mean((np.asarray(y, dtype=np.float64) - np.asarray(p)) ** 2))


def auc(y: npt.ArrayLike, score: npt.ArrayLike) -> float:
    """The probability that a success has a higher score than a failure; equal scores count half. NaN where all episodes
    ended alike."""
    y, score = np.asarray(y, dtype=bool), np.asarray(score, dtype=np.float64)
    good, bad = score[y], np.sort(score[~y])
    if not (len(good) and len(bad)):
        return math.nan
    below = np.searchsorted(bad, good, side="left") + np.searchsorted(bad, good, side="right")
    return float(below.mean() / (2.0 * len(bad)))


def chance_error(p: Array) -> tuple[float, float]:
    """The calibration error that perfect predictions would show in so few episodes: the mean, and what they exceed in 5
    % of repeats."""
    rng = np.random.default_rng(0)
    errors = [calibration_error(rng.random(len(p)) < p, p) for _ in range(BOOTSTRAP_REPEATS)]
    return float(np.mean(errors)), float(np.quantile(errors, 0.95))


def bootstrap_interval(
    measure: Callable[[npt.ArrayLike, npt.ArrayLike], float], y: Bool, p: Array, start: Index
) -> Interval:
    """A measure of predictions, and its 95 % interval: percentiles of a bootstrap over starts, of its draws that have
    the measure."""
    _, number, count = np.unique(start, return_inverse=True, return_counts=True)
    members = np.split(np.argsort(number, kind="stable"), np.cumsum(count)[:-1])
    rng = np.random.default_rng(0)
    drawn = (rng.integers(len(count), size=len(count)) for _ in range(BOOTSTRAP_REPEATS))
    values = [measure(y[some], p[some]) for some in (np.concatenate([members[k] for k in one]) for one in drawn)]
    low, high = np.nanquantile(values, (0.025, 0.975))
    return measure(y, p), float(low), float(high)


def auc_interval(y: Bool, score: Array, start: Index) -> Interval:
    """The same for the AUC. Where few starts failed, or few succeeded, or where all draws are alike, a bootstrap is too
    narrow; Wilson's interval of as many never is: the variance of an AUC a is at most a (1 - a) over the smaller number
    (Birnbaum and Klose 1957)."""
    estimate, low, high = bootstrap_interval(auc, y, score, start)
    rare = min(len(np.unique(start[y])), len(np.unique(start[~y])))
    widest = wilson(estimate, rare) if rare < FEW_STARTS or low == high else (low, high)
    return estimate, min(low, widest[0]), max(high, widest[1])
