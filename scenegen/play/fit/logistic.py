"""Logistic regression on features of starts, and how good its predictions are at starts that it has not seen.

Each feature enters through ramps, which rise from 0 to 1 between neighbouring quantiles: log odds are piecewise linear
in each feature, and constant beyond its ends (an additive model). A squared penalty on the heights of the ramps draws
all of them to 0. How strong it is, and which features take part, is chosen by cross-validation. Where success may not
fall as a feature rises, its ramps have no negative heights.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice, pairwise
from typing import Annotated, Self

import numpy as np
import numpy.typing as npt
from pydantic import Field, FiniteFloat, model_validator

from scenegen.arrays import Array, Bool, Index
from scenegen.play.fit.features import RISING, Feature, Kind
from scenegen.play.suites.statistics import wilson
from scenegen.play.suites.suite import SuiteModel

QUANTILES = (0.02, 0.25, 0.5, 0.75, 0.98)  # between them a feature has ramps
OF_PHI = (0.02, 0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875, 0.98)
STRENGTHS = (1000.0, 100.0, 30.0, 10.0, 3.0, 1.0, 0.3, 0.1)  # of the penalty
SETS: Mapping[str, tuple[Kind, ...]] = {
    "nothing": (),
    "phi": ("phi",),
    "the formula": RISING,
    "everything": (*RISING, "clutter", "distance", "place"),
}
FOLDS = 5
STEPS, CLOSE = 60, 1e-5  # of Newton's method: how many at most, and how small the last one is
LEAST = 1e-6  # probability, for logarithms


class OddsCurve(SuiteModel):
    """The part of a feature: it adds `heights[k]` to the log odds on the way from `knots[k]` to `knots[k + 1]`."""

    feature: str
    kind: Kind
    knots: Annotated[tuple[FiniteFloat, ...], Field(min_length=2)]
    heights: tuple[FiniteFloat, ...]

    @model_validator(mode="after")
    def _rising(self) -> Self:
        if len(self.knots) != len(self.heights) + 1 or any(low >= high for low, high in pairwise(self.knots)):
            raise ValueError("the knots do not rise, or there is not a height between each two of them")
        return self

    @property
    def odds(self) -> Array:
        """What it adds at each knot."""
        return np.cumsum((0.0, *self.heights))


class Logistic(SuiteModel):
    """log odds of success = `intercept` and the sum of the `curves`. `reads` names the set of features that take part,
    `strength` is that of the penalty."""

    reads: str
    intercept: FiniteFloat
    curves: tuple[OddsCurve, ...]
    strength: FiniteFloat

    def __call__(self, names: Sequence[str], values: Array) -> Array:
        """The probability of success, (B,), where the features of these names have the values (F, B). One number at a
        time: it does not depend on which scenes are predicted together."""
        odds = np.full(values.shape[1], self.intercept)
        for curve in self.curves:
            odds += np.interp(values[names.index(curve.feature)], curve.knots, curve.odds)
        return _sigmoid(odds)

    @property
    def bounds(self) -> tuple[float, float]:
        """What no prediction lies beyond."""
        low, high = (self.intercept + sum(end(one.odds) for one in self.curves) for end in (np.min, np.max))
        return float(_sigmoid(np.array(low))), float(_sigmoid(np.array(high)))


def _sigmoid(odds: Array) -> Array:
    return np.asarray(0.5 * (1.0 + np.tanh(0.5 * odds)))


@dataclass(frozen=True, slots=True, eq=False)
class Outcomes:
    """The values (F, n) of `features` at the start of each of n episodes, whether it was a `success` (n,), and the
    number of its start, (n,): several episodes may have the same one."""

    features: tuple[Feature, ...]
    values: Array
    success: Bool
    start: Index

    def of(self, which: Bool) -> Outcomes:
        return Outcomes(self.features, self.values[:, which], self.success[which], self.start[which])

    def predicted(self, fit: Logistic) -> Array:
        return fit([one.name for one in self.features], self.values)


def chosen(outcomes: Outcomes, monotone: bool, seed: int = 0) -> Logistic:
    """The fit whose strength predicts held-out episodes best, by their log likelihood. More features take part where
    that is better by more than the standard error of the gain."""
    sets = list(SETS)
    loss = np.full((len(sets), len(STRENGTHS), len(outcomes.success)), np.inf)
    for held in _folds(outcomes, seed):
        some, rest = outcomes.of(~held), outcomes.of(held)
        for number, reads in enumerate(sets):
            for step, fit in enumerate(_path(some, reads, monotone)):
                p = np.clip(rest.predicted(fit), LEAST, 1.0 - LEAST)
                loss[number, step, held] = -np.log(np.where(rest.success, p, 1.0 - p))
    best, step = 0, 0
    for number in range(1, len(sets)):
        mine = int(loss[number].mean(axis=1).argmin())
        gain = loss[best, step] - loss[number, mine]
        if gain.mean() > gain.std() / math.sqrt(len(gain)):
            best, step = number, mine
    return list(_path(outcomes, sets[best], monotone))[step]


def held_out(outcomes: Outcomes, monotone: bool) -> Array:
    """The predicted success of each episode, (n,), by a fit of the episodes of other starts alone: features and
    strength are chosen for each of FOLDS parts by itself."""
    found = np.empty(len(outcomes.success))
    for number, held in enumerate(_folds(outcomes, seed=1)):
        found[held] = outcomes.of(held).predicted(chosen(outcomes.of(~held), monotone, seed=2 + number))
    return found


def _folds(outcomes: Outcomes, seed: int) -> Iterator[Bool]:
    """Which episodes are held out, FOLDS times: each start once, and as many successes each time."""
    _, number, count = np.unique(outcomes.start, return_inverse=True, return_counts=True)
    rate = np.bincount(number, outcomes.success) / count
    fold = np.empty(len(count), dtype=np.intp)
    fold[np.lexsort((np.random.default_rng(seed).random(len(count)), rate))] = np.arange(len(count)) % FOLDS
    for k in range(FOLDS):
        yield fold[number] == k


def _path(outcomes: Outcomes, reads: str, monotone: bool) -> Iterator[Logistic]:
    """A fit for each strength, the strongest first: each starts from the one before."""
    parts, kinds = [], SETS[reads]
    for feature, values in zip(outcomes.features, outcomes.values, strict=True):
        knots = np.unique(np.quantile(values, OF_PHI if feature.kind == "phi" else QUANTILES))
        if feature.kind in kinds and len(knots) > 1:  # else it is the same everywhere
            low, high = knots[:-1, None], knots[1:, None]
            parts.append((feature, knots, np.clip((values - low) / (high - low), 0.0, 1.0)))
    y = outcomes.success.astype(np.float64)
    columns = np.concatenate([*(ramps for *_, ramps in parts), np.ones((1, len(y)))]).T
    least = [0.0 if monotone and one.kind in RISING else -np.inf for one, _, ramps in parts for _ in ramps]
    rate = (y.sum() + 1.0) / (len(y) + 2.0)
    weights = np.array([*(0.0 for _ in least), math.log(rate / (1.0 - rate))])
    for strength in STRENGTHS:
        if 0.0 < y.mean() < 1.0:  # else nothing but the rate can be told
            weights = _newton(columns, y, strength, np.array([*least, -np.inf]), weights)
        heights = iter(weights.tolist())
        curves = [
            OddsCurve(
                feature=one.name, kind=one.kind, knots=tuple(knots.tolist()), heights=tuple(islice(heights, len(ramps)))
            )
            for one, knots, ramps in parts
        ]
        yield Logistic(reads=reads, intercept=next(heights), curves=tuple(curves), strength=strength)


def _newton(x: Array, y: Array, strength: float, least: Array, weights: Array) -> Array:
    """The weights (D,), none below `least` (D,), of least loss: minus the log likelihood of y (n,) given the columns x
    (n, D), and strength / 2 times the squares of all weights but the last (projected Newton, Bertsekas 1982)."""
    penalty = np.append(np.full(len(weights) - 1, strength), 0.0)

    def loss(w: Array) -> float:
        odds = x @ w
        return float(np.logaddexp(0.0, odds).sum() - y @ odds + 0.5 * (penalty * w * w).sum())

    for _ in range(STEPS):
        p = _sigmoid(x @ weights)
        slope = x.T @ (p - y) + penalty * weights
        free = ~((weights <= least) & (slope > 0.0))
        curvature = (x[:, free].T * (p * (1.0 - p))) @ x[:, free] + np.diag(penalty[free] + 1e-9)
        step, before = np.zeros(len(weights)), loss(weights)
        step[free] = np.linalg.solve(curvature, slope[free])
        for size in 0.5 ** np.arange(20):  # a step that does not lower the loss is too long
            new = np.maximum(weights - size * step, least)
            if loss(new) <= before:
                break
        moved, weights = float(np.abs(new - weights).max()), new
        if moved < CLOSE:
            break
    return weights


# Measures of predictions p (n,) of success y (n,).
BINS, IN_A_BIN = 10, 40  # of predictions, at most; episodes, at least: of 20 the rate itself is off by 0.1 by chance
REPEATS = 400
FEW = 10  # starts that succeeded, or failed, below which a bootstrap is too narrow

Interval = tuple[float, float, float]
"""An estimate, and its 95 % interval."""


def calibration_error(y: npt.ArrayLike, p: npt.ArrayLike) -> float:
    """The mean difference of predicted and true rates over groups of equal size of similar predictions (expected
    calibration error). Episodes of one prediction count as their mean, wherever a group ends among them."""
    y, p = np.asarray(y, dtype=np.float64), np.asarray(p, dtype=np.float64)
    _, which, count = np.unique(p, return_inverse=True, return_counts=True)
    y = (np.bincount(which, y) / count)[which]
    groups = np.array_split(np.argsort(p, kind="stable"), max(1, min(BINS, len(p) // IN_A_BIN)))
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


def by_chance(p: Array) -> tuple[float, float]:
    """The calibration error that perfect predictions would show in so few episodes: the mean, and what they exceed in 5
    % of repeats."""
    rng = np.random.default_rng(0)
    found = [calibration_error(rng.random(len(p)) < p, p) for _ in range(REPEATS)]
    return float(np.mean(found)), float(np.quantile(found, 0.95))


def with_interval(
    measure: Callable[[npt.ArrayLike, npt.ArrayLike], float], y: Bool, p: Array, start: Index
) -> Interval:
    """A measure of predictions, and its 95 % interval: percentiles of a bootstrap over starts, of its draws that have
    the measure."""
    _, number, count = np.unique(start, return_inverse=True, return_counts=True)
    members = np.split(np.argsort(number, kind="stable"), np.cumsum(count)[:-1])
    rng = np.random.default_rng(0)
    drawn = (rng.integers(len(count), size=len(count)) for _ in range(REPEATS))
    found = [measure(y[some], p[some]) for some in (np.concatenate([members[k] for k in one]) for one in drawn)]
    low, high = np.nanquantile(found, (0.025, 0.975))
    return measure(y, p), float(low), float(high)


def auc_with_interval(y: Bool, score: Array, start: Index) -> Interval:
    """The same for the AUC. Where few starts failed, or few succeeded, or where all draws are alike, a bootstrap is too
    narrow; Wilson's interval of as many never is: the variance of an AUC a is at most a (1 - a) over the smaller number
    (Birnbaum and Klose 1957)."""
    found, low, high = with_interval(auc, y, score, start)
    rare = min(len(np.unique(start[y])), len(np.unique(start[~y])))
    widest = wilson(found, rare) if rare < FEW or low == high else (low, high)
    return found, min(low, widest[0]), max(high, widest[1])
