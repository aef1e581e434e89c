"""What outcomes say: intervals of shares, of rates over strata and of paired differences; an exact test; how many
episodes a difference needs. Two-sided, at 95 %; power 80 %.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.errors import RequestError
from scenegen.errors.requests import WRONG_VALUE

Z, POWER = 1.959964, 0.841621  # quantiles of the normal distribution: 97.5 %, 80 %
ALPHA = 0.05  # how often two policies may be told apart that do not differ
MIN_STRATUM = 1e-100  # probability of a stratum: squares of smaller ones are 0


def wilson(share: float, n: float) -> tuple[float, float]:
    """The interval of a share of n (Wilson 1927)."""
    if not n:
        return 0.0, 1.0
    half = Z * Z / n
    middle = (share + half / 2.0) / (1.0 + half)
    width = Z / (1.0 + half) * math.sqrt(share * (1.0 - share) / n + half / (4.0 * n))
    return max(0.0, middle - width), min(1.0, middle + width)


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
    arrays = successes, episodes, probabilities, np.zeros(np.shape(episodes)) if errors is None else errors
    s, n, w, e = (np.atleast_1d(np.asarray(one, dtype=np.float64)) for one in arrays)
    if not (s.shape == n.shape == w.shape == e.shape and s.ndim == 1 and len(s)):
        shapes = f"of the shapes {s.shape}, {n.shape} and {w.shape}"
        wanted = "successes, episodes and probabilities of the same strata, (k,) each"
        raise RequestError(WRONG_VALUE(argument="successes", value=shapes, wanted=wanted))
    run = (n > 0) & (w > MIN_STRATUM)
    for argument, value, right, wanted in (
        ("successes", s, (s >= 0) & (s <= n), "from 0 to the episodes"),
        ("episodes", n, n < math.inf, "finite numbers"),
        ("probabilities", w, (w >= 0) & (w.sum() <= 1.001), "at least 0, at most 1 together: strata do not overlap"),
        ("errors", e, (e >= 0) & (e < math.inf), "at least 0: they are halves of intervals"),
        ("episodes", n, run.any(keepdims=True), "at least one where the probability is above 0"),
    ):
        if not right.all():
            raise RequestError(WRONG_VALUE(argument=argument, value=str(value.tolist()), wanted=wanted))
    s, n, w, e = s[run], n[run], w[run] / max(1.0, w.sum()), e[run]
    known = float(w.sum())
    solved = float((w * s / n).sum())
    p = (s + 1.0) / (n + 2.0)
    variance = w**2 * p * (1.0 - p) / n
    skew = Z**2 / 2.0 * float((variance * w * (1.0 - 2.0 * p) / n).sum() / variance.sum())
    unlike = w * math.log(10.0) * e * (s / n - solved / known)  # what it matters that a probability is another one
    half = math.sqrt(float((Z**2 * variance + unlike**2).sum()))
    low, high = solved + min(0.0, skew - half), solved + max(0.0, skew + half)
    return solved / known, max(0.0, low), min(1.0, high + 1.0 - known)


@dataclass(frozen=True, slots=True)
class PairedDifference:
    """Two policies on the same starts: `first` are those that the first one alone solved, `second` likewise, of `n`;
    the difference of their shares, its interval, and the p-value that there is none."""

    first: int
    second: int
    n: int

    @property
    def difference(self) -> float:
        return self.first / max(self.n, 1) - self.second / max(self.n, 1)

    @property
    def interval(self) -> tuple[float, float]:
        """Adjusted as of Bonett and Price (2012): one more of each, of two more."""
        one, other = (self.first + 1.0) / (self.n + 2.0), (self.second + 1.0) / (self.n + 2.0)
        half = Z * math.sqrt(max(0.0, one + other - (one - other) ** 2) / (self.n + 2.0))
        return max(-1.0, one - other - half), min(1.0, one - other + half)

    @property
    def p(self) -> float:
        """McNemar's exact test: of episodes that one alone solved, each does half, where there is no difference."""
        most, least = int(self.first) + int(self.second), int(min(self.first, self.second))  # numpy's overflow
        return min(1.0, float(2 * sum(math.comb(most, k) for k in range(least + 1)) / 2**most))

    @property
    def evidence(self) -> float:
        """How much likelier the episodes that one alone solved are where the first one solves a share of them that is
        unknown (Jeffreys' prior, Krichevsky and Trofimov 1981) than where each solves half, from 0 on. It may be looked
        at after every episode: where there is no difference it *ever* reaches 1 / ALPHA with a probability of at most
        ALPHA (Ville 1939; Ramdas and others 2023, section 3)."""
        one, other = int(self.first), int(self.second)
        beta = math.lgamma(one + 0.5) + math.lgamma(other + 0.5) - math.lgamma(one + other + 1.0) - math.log(math.pi)
        return math.exp(min(beta + (one + other) * math.log(2.0), 700.0))  # 700: what a float can be

    @property
    def is_decided(self) -> bool:
        """Whether one of the two is shown to be better, however often one looked."""
        return self.evidence >= 1.0 / ALPHA

    def required_starts(self, difference: float) -> int:
        """How many starts, of the same make, tell such a difference apart: at least as many disagree as it takes, and
        else as many as here (Connor 1987)."""
        disagree = max((self.first + self.second + 1.0) / (self.n + 2.0), difference)
        within = math.sqrt(max(0.0, disagree - difference**2))
        return math.ceil(((Z * math.sqrt(disagree) + POWER * within) / difference) ** 2)


def decided_after(order: Iterable[int], first: Mapping[int, bool], second: Mapping[int, bool]) -> int | None:
    """After how many episodes, in an order drawn by lot, one of two policies is shown to be better; None if it is not,
    or not yet. `first` and `second` are success by the number of the episode; the first that is missing ends the
    look."""
    one = other = 0
    for count, number in enumerate(order, 1):
        if number not in first or number not in second:
            return None
        if first[number] != second[number]:
            one, other = one + first[number], other + second[number]
            if PairedDifference(one, other, count).is_decided:
                return count
    return None


def required_unpaired_starts(share: float, difference: float) -> int:
    """How many episodes of each of two policies it takes on starts of their own: shares around `share`."""
    one = min(1.0, max(share + difference / 2.0, difference))
    other = one - difference
    middle = (one + other) / 2.0
    within = math.sqrt(one * (1.0 - one) + other * (1.0 - other))
    return math.ceil(((Z * math.sqrt(2.0 * middle * (1.0 - middle)) + POWER * within) / difference) ** 2)
