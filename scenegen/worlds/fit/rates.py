"""The success rate of the base distribution, from episodes of strata whose probabilities are known."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from scenegen.api.sample import sample
from scenegen.arrays import Array, Index
from scenegen.errors import RequestError
from scenegen.errors.requests import WRONG_VALUE

if TYPE_CHECKING:
    from scenegen.api.spec import Spec
    from scenegen.worlds.fit.fit import Fit

Z = 1.959964  # of the normal distribution, for 95 %
MOST_STRATA = 8


def base_rate(
    successes: npt.ArrayLike,
    episodes: npt.ArrayLike,
    probabilities: npt.ArrayLike,
    errors: npt.ArrayLike | None = None,
) -> tuple[float, float, float]:
    """The success rate over all strata, and its 95 % interval: (estimate, low, high).

    Of stratum k, `episodes` (k,) episodes were run, at starts that follow the base distribution within it, `successes`
    (k,) of them succeeded, and the base distribution has the probability `probabilities` (k,) of it. A stratum without
    episodes, and what is missing from 1, may succeed always or never: the interval covers both, and the estimate takes
    it to be like the rest.

    `errors` (k,) are half of 95 % intervals of log10 of the probabilities, where these are estimates, as those of the
    bands of a suite are. The variance of each stratum counts one success and one failure more than there were, since a
    stratum without failures is not known to have none (Agresti and Coull 1998); strata add up as in Cochran 1977, 5.3,
    and the interval is moved by the skewness of the sum, which makes Wilson's of it where there is one stratum.
    Raises RequestError for numbers that can be none of these.
    """
    given = successes, episodes, probabilities, np.zeros(np.shape(episodes)) if errors is None else errors
    s, n, w, e = (np.atleast_1d(np.asarray(one, dtype=np.float64)) for one in given)
    if not (s.shape == n.shape == w.shape == e.shape and s.ndim == 1 and len(s)):
        shapes = f"of the shapes {s.shape}, {n.shape} and {w.shape}"
        wanted = "successes, episodes and probabilities of the same strata, (k,) each"
        raise RequestError(WRONG_VALUE(argument="successes", value=shapes, wanted=wanted))
    if not ((s >= 0) & (s <= n)).all():
        raise RequestError(WRONG_VALUE(argument="successes", value=str(s.tolist()), wanted="from 0 to the episodes"))
    if not ((w >= 0).all() and w.sum() <= 1.001):  # they may be rounded
        wanted = "probabilities of strata that do not overlap: at least 0, and at most 1 together"
        raise RequestError(WRONG_VALUE(argument="probabilities", value=str(w.tolist()), wanted=wanted))
    run, w = n > 0, w / max(1.0, w.sum())
    s, n, w, e = s[run], n[run], w[run], e[run]
    known = float(w.sum())
    if not known > 0.0:
        return 0.5, 0.0, 1.0
    met = float((w * s / n).sum())
    p = (s + 1.0) / (n + 2.0)
    variance = w**2 * p * (1.0 - p) / n
    skew = Z**2 / 2.0 * float((variance * w * (1.0 - 2.0 * p) / n).sum() / variance.sum())
    unlike = w * math.log(10.0) * e * (s / n - met / known)  # what it matters that a probability is another one
    half = math.sqrt(float((Z**2 * variance + unlike**2).sum()))
    low, high = met + min(0.0, skew - half), met + max(0.0, skew + half)
    return met / known, max(0.0, low), min(1.0, high + 1.0 - known)


def _variance(n: Array, p: Array, w: Array) -> Array:
    """The variance that each stratum of the probability w has in the interval above, with n episodes at a rate p."""
    p = (n * p + 1.0) / (n + 2.0)
    return np.asarray(w**2 * p * (1.0 - p) / n)


def allocate(probabilities: npt.ArrayLike, predicted: npt.ArrayLike, n: int) -> Index:
    """How many of n episodes each stratum gets, (k,), at least one, so that the interval of `base_rate` is as narrow as
    can be if its rate is as `predicted`, (k,): Neyman's shares (1934), but for what the interval adds to strata of few
    failures. Raises RequestError for fewer episodes than strata."""
    w, p = np.asarray(probabilities, dtype=np.float64), np.asarray(predicted, dtype=np.float64)
    if n < len(w):
        raise RequestError(WRONG_VALUE(argument="n", value=str(n), wanted=f"at least 1 for each of {len(w)} strata"))
    given = np.ones(len(w))
    for _ in range(n - len(w)):
        given[np.argmax(_variance(given, p, w) - _variance(given + 1.0, p, w))] += 1.0
    return given.astype(np.intp)


def strata(fit: Fit, spec: Spec, n: int, *, scenes: int = 50_000, seed: int = 0) -> tuple[Array, Array, Index]:
    """Strata by predicted success for n episodes over a spec's base distribution: their ends (k + 1,), from 0 to 1,
    their probabilities (k,) in so many random scenes, and how many episodes each gets (k,). k is what makes the
    interval of `base_rate` narrowest, if predictions are right. Raises what `sample`, `Fit.predict` and `allocate`
    raise."""
    return cut(fit.predict(sample(spec, n=scenes, seed=seed, spread="base")), n)


def cut(rate: Array, n: int) -> tuple[Array, Array, Index]:
    """The same for random scenes whose predicted rates are `rate` (B,)."""
    known, order = np.unique(rate), np.sort(rate)
    share = np.cumsum(np.sqrt(order * (1.0 - order) + 1e-3))
    found = []
    for count in range(1, min(MOST_STRATA, n) + 1):
        cuts = order[np.searchsorted(share, share[-1] * np.arange(1, count) / count)]  # of equal standard deviations
        place = np.unique(np.searchsorted(known, cuts))
        ends = np.array([0.0, *((known[one - 1] + known[one]) / 2.0 for one in place if one > 0), 1.0])
        which = np.searchsorted(ends[1:-1], rate)  # no scene has the rate of an end
        size = np.bincount(which, minlength=len(ends) - 1)
        w, p = size / len(rate), np.bincount(which, rate) / size
        given = allocate(w, p, n)
        found.append((float(_variance(given.astype(np.float64), p, w).sum()), ends, w, given))
    return min(found, key=lambda one: one[0])[1:]
