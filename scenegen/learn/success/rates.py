"""Strata of starts by how often success is predicted, and how many episodes each gets."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from scenegen.api.sample import sample
from scenegen.arrays import Array, Index
from scenegen.errors import RequestError
from scenegen.errors.requests import WRONG_VALUE
from scenegen.validation import as_int

if TYPE_CHECKING:
    from scenegen.api.spec import Spec
    from scenegen.learn.success.fit import Fit

MAX_STRATA = 8


def _variance(n: Array, p: Array, w: Array) -> Array:
    """The variance of each stratum of the probability w in the interval of `base_rate`, with n episodes at a rate p."""
    p = (n * p + 1.0) / (n + 2.0)
    return np.asarray(w**2 * p * (1.0 - p) / n)


def allocate(probabilities: npt.ArrayLike, predicted: npt.ArrayLike, n: int) -> Index:
    """How many of n episodes each stratum gets, (k,), at least one, so that the interval of `base_rate` is as narrow as
    can be if its rate is as `predicted`, (k,): Neyman's shares (1934), but for what the interval adds to strata of few
    failures. Raises RequestError for fewer episodes than strata, and for what are no such numbers."""
    w, p = np.asarray(probabilities, dtype=np.float64), np.asarray(predicted, dtype=np.float64)
    if w.shape != p.shape or not ((w >= 0.0) & (w < np.inf) & (p >= 0.0) & (p <= 1.0)).all():
        wanted = "a rate from 0 to 1 for each probability, which are 0 or more"
        raise RequestError(WRONG_VALUE(argument="predicted", value=f"{p.tolist()} for {w.tolist()}", wanted=wanted))
    if as_int("n", n) < len(w):
        raise RequestError(WRONG_VALUE(argument="n", value=str(n), wanted=f"at least 1 for each of {len(w)} strata"))
    episodes = np.ones(len(w))
    for _ in range(n - len(w)):
        episodes[np.argmax(_variance(episodes, p, w) - _variance(episodes + 1.0, p, w))] += 1.0
    return episodes.astype(np.intp)


def strata(fit: Fit, spec: Spec, n: int, *, scenes: int = 50_000, seed: int = 0) -> tuple[Array, Array, Index]:
    """Strata by predicted success for n episodes over a spec's base distribution: their ends (k + 1,), from 0 to 1,
    their probabilities (k,) in so many random scenes, and how many episodes each gets (k,). k is what makes the
    interval of `base_rate` narrowest, if predictions are right. Raises what `sample`, `Fit.predict` and `allocate`
    raise."""
    return cut_strata(fit.predict(sample(spec, n=scenes, seed=seed, spread="base")), n)


def cut_strata(rate: Array, n: int) -> tuple[Array, Array, Index]:
    """The same for random scenes whose predicted rates are `rate` (B,)."""
    order = np.sort(np.round(rate, 9))  # what differs by less is the same prediction
    known = np.unique(order)
    share = np.cumsum(np.sqrt(order * (1.0 - order) + 1e-3))
    choices = []
    for count in range(1, min(MAX_STRATA, n) + 1):
        cuts = order[np.searchsorted(share, share[-1] * np.arange(1, count) / count)]  # of equal standard deviations
        place = np.unique(np.searchsorted(known, cuts))
        ends = np.array([0.0, *((known[one - 1] + known[one]) / 2.0 for one in place if one > 0), 1.0])
        which = np.searchsorted(ends[1:-1], rate)  # no scene has the rate of an end
        size = np.bincount(which, minlength=len(ends) - 1)
        w, p = size / len(rate), np.bincount(which, rate) / size
        episodes = allocate(w, p, n)
        choices.append((float(_variance(episodes.astype(np.float64), p, w).sum()), ends, w, episodes))
    return min(choices, key=lambda choice: choice[0])[1:]
