"""The success rate of the base distribution, from episodes of strata whose probabilities are known."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from scenegen.arrays import Array, Index
from scenegen.errors import RequestError
from scenegen.errors.requests import WRONG_VALUE

Z = 1.959964  # of the normal distribution, for 95 %
UNSURE = 0.05  # a predicted rate is taken to be at least so far from 0 and 1 where episodes are shared out


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
    bands of a suite are. The variance of each stratum counts one success and one failure more than there were, since a stratum without
    failures is not known to have none (Agresti and Coull 1998); strata add up as in Cochran 1977, 5.3. Raises
    RequestError for numbers that can be none of these.
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
    cautious = (s + 1.0) / (n + 2.0)
    unlike = w * math.log(10.0) * e * (s / n - met / known)  # what it matters that a probability is another one
    half = math.sqrt(float((Z**2 * w**2 * cautious * (1.0 - cautious) / n + unlike**2).sum()))
    return met / known, max(0.0, met - half), min(1.0, met + half + 1.0 - known)


def allocate(probabilities: npt.ArrayLike, predicted: npt.ArrayLike, n: int) -> Index:
    """How many of n episodes each stratum gets, (k,), so that the variance of `base_rate` is least (Neyman 1934):
    by probability times sqrt(p (1 - p)) of the `predicted` success rate p, both (k,). A prediction is not trusted to
    within 5 %, and each stratum gets two episodes. Raises RequestError for fewer than two each."""
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
