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
UNSURE = 0.02  # a predicted rate is taken to be at least so far from 0 and 1 where episodes are shared out


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
    if not ((w >= 0).all() and w.sum() <= 1.0 + 1e-6):
        wanted = "probabilities of strata that do not overlap: at least 0, and at most 1 together"
        raise RequestError(WRONG_VALUE(argument="probabilities", value=str(w.tolist()), wanted=wanted))
    run = n > 0
    s, n, w, e = s[run], n[run], w[run], e[run]
    known = min(1.0, float(w.sum()))
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


def allocate(probabilities: npt.ArrayLike, predicted: npt.ArrayLike, n: int) -> Index:
    """How many of n episodes each stratum gets, (k,), so that the variance of `base_rate` is least (Neyman 1934):
    by probability times sqrt(p (1 - p)) of the `predicted` success rate p, both (k,). A prediction is not trusted to
    within 2 %, and each stratum gets two episodes. Raises RequestError for fewer than two each."""
    w, p = np.asarray(probabilities, dtype=np.float64), np.clip(predicted, UNSURE, 1.0 - UNSURE)
    if n < 2 * len(w):
        raise RequestError(WRONG_VALUE(argument="n", value=str(n), wanted=f"at least 2 for each of {len(w)} strata"))
    share: Array = w * np.sqrt(p * (1.0 - p))
    exact = (n - 2 * len(w)) * share / share.sum()
    given: Index = np.floor(exact).astype(np.intp)
    last = np.argsort(given - exact, kind="stable")[: n - 2 * len(w) - int(given.sum())]  # the largest remainders
    given[last] += 1
    given += 2
    return given


def strata(fit: Fit, spec: Spec, count: int, *, scenes: int = 50_000, seed: int = 0) -> tuple[Array, Array, Array]:
    """Strata of a spec's base distribution by predicted success: their ends (k + 1,), from 0 to 1, their probabilities
    and their mean predictions, (k,) each, in `scenes` random scenes. k is `count`, or less where few rates are
    predicted; the strata have equal shares of the standard deviation, so that `allocate` gives them like numbers of
    episodes. Raises what `sample` and `Fit.predict` raise.
    """
    rate = fit.predict(sample(spec, n=scenes, seed=seed, spread="base"))
    ends = cut(rate, count)
    which = np.searchsorted(ends[1:-1], rate)
    size = np.bincount(which, minlength=len(ends) - 1)
    return ends, size / scenes, np.bincount(which, rate, minlength=len(size)) / size


def cut(rate: Array, count: int) -> Array:
    """The ends of strata, see `strata`, of scenes whose predicted rates are (n,)."""
    known, rate = np.unique(rate), np.sort(rate)
    unsure = np.clip(rate, UNSURE, 1.0 - UNSURE)
    share = np.cumsum(np.sqrt(unsure * (1.0 - unsure)))
    cuts = rate[np.searchsorted(share, share[-1] * np.arange(1, count) / count)]
    place = np.unique(np.searchsorted(known, cuts))
    between = [(known[one - 1] + known[one]) / 2.0 for one in place if one > 0]  # no scene has one of these rates
    return np.array([0.0, *between, 1.0])
