"""Logistic regression on features of starts.

Each feature enters through ramps, which rise from 0 to 1 between neighbouring quantiles: log odds are piecewise linear
in each feature, and constant beyond its ends (an additive model). A squared penalty on the heights of the ramps draws
all of them to 0. How strong it is, and which features take part, is chosen by cross-validation. Where success may not
fall as a feature rises, its ramps have no negative heights.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice, pairwise
from typing import Annotated, Self

import numpy as np
from pydantic import Field, FiniteFloat, model_validator

from scenegen.arrays import Array, Bool, Index
from scenegen.learn.success.features import MONOTONE_KINDS, Feature, Kind
from scenegen.learn.success.files import FileModel

KNOT_QUANTILES = (0.02, 0.25, 0.5, 0.75, 0.98)  # between them a feature has ramps
PHI_KNOT_QUANTILES = (0.02, 0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875, 0.98)
STRENGTHS = (1000.0, 100.0, 30.0, 10.0, 3.0, 1.0, 0.3, 0.1)  # of the penalty
FEATURE_SETS: Mapping[str, tuple[Kind, ...]] = {
    "nothing": (),
    "phi": ("phi",),
    "the formula": MONOTONE_KINDS,
    "everything": (*MONOTONE_KINDS, "clutter", "distance", "place"),
}
FOLDS = 5
NEWTON_STEPS, LAST_STEP = 60, 1e-5  # how many at most, and how small the last one is
MIN_PROBABILITY = 1e-6  # probability, for logarithms


class OddsCurve(FileModel):
    """The part of a feature: it adds `heights[k]` to the log odds on the way from `knots[k]` to `knots[k + 1]`."""

    feature: str
    kind: Kind
    knots: Annotated[tuple[FiniteFloat, ...], Field(min_length=2)]
    heights: tuple[FiniteFloat, ...]

    @model_validator(mode="after")
    def _check_knots(self) -> Self:
        if len(self.knots) != len(self.heights) + 1 or any(low >= high for low, high in pairwise(self.knots)):
            raise ValueError("the knots do not rise, or there is not a height between each two of them")
        return self

    @property
    def odds(self) -> Array:
        """What it adds at each knot."""
        return np.cumsum((0.0, *self.heights))


class Logistic(FileModel):
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

    def select(self, which: Bool) -> Outcomes:
        return Outcomes(self.features, self.values[:, which], self.success[which], self.start[which])

    def predict(self, fit: Logistic) -> Array:
        return fit([one.name for one in self.features], self.values)


def fit_logistic(outcomes: Outcomes, monotone: bool, seed: int = 0) -> Logistic:
    """The fit whose strength predicts held-out episodes best, by their log likelihood. More features take part where
    that is better by more than the standard error of the gain."""
    sets = list(FEATURE_SETS)
    loss = np.full((len(sets), len(STRENGTHS), len(outcomes.success)), np.inf)
    for held in _folds(outcomes, seed):
        some, rest = outcomes.select(~held), outcomes.select(held)
        for number, reads in enumerate(sets):
            for step, fit in enumerate(_path(some, reads, monotone)):
                p = np.clip(rest.predict(fit), MIN_PROBABILITY, 1.0 - MIN_PROBABILITY)
                loss[number, step, held] = -np.log(np.where(rest.success, p, 1.0 - p))
    best, step = 0, 0
    for number in range(1, len(sets)):
        mine = int(loss[number].mean(axis=1).argmin())
        gain = loss[best, step] - loss[number, mine]
        if gain.mean() > gain.std() / math.sqrt(len(gain)):
            best, step = number, mine
    return list(_path(outcomes, sets[best], monotone))[step]


def predict_held_out(outcomes: Outcomes, monotone: bool) -> Array:
    """The predicted success of each episode, (n,), by a fit of the episodes of other starts alone: features and
    strength are chosen for each of FOLDS parts by itself."""
    rates = np.empty(len(outcomes.success))
    for number, held in enumerate(_folds(outcomes, seed=1)):
        rates[held] = outcomes.select(held).predict(fit_logistic(outcomes.select(~held), monotone, seed=2 + number))
    return rates


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
    parts, kinds = [], FEATURE_SETS[reads]
    for feature, values in zip(outcomes.features, outcomes.values, strict=True):
        knots = np.unique(np.quantile(values, PHI_KNOT_QUANTILES if feature.kind == "phi" else KNOT_QUANTILES))
        if feature.kind in kinds and len(knots) > 1:  # else it is the same everywhere
            low, high = knots[:-1, None], knots[1:, None]
            parts.append((feature, knots, np.clip((values - low) / (high - low), 0.0, 1.0)))
    y = outcomes.success.astype(np.float64)
    columns = np.concatenate([*(ramps for *_, ramps in parts), np.ones((1, len(y)))]).T
    least = [0.0 if monotone and one.kind in MONOTONE_KINDS else -np.inf for one, _, ramps in parts for _ in ramps]
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

    for _ in range(NEWTON_STEPS):
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
        if moved < LAST_STEP:
            break
    return weights
