"""What outcomes say: intervals of shares, of weighted shares and of paired differences; an exact test; how many
episodes a difference needs. Two-sided, at 95 %; power 80 %.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

Z, POWER = 1.959964, 0.841621  # quantiles of the normal distribution: 97.5 %, 80 %
PRIOR = 4.0  # episodes with the share of all strata that each stratum's variance counts in


def wilson(share: float, n: float) -> tuple[float, float]:
    """The interval of a share of n (Wilson 1927)."""
    if not n:
        return 0.0, 1.0
    half = Z * Z / n
    middle = (share + half / 2.0) / (1.0 + half)
    width = Z / (1.0 + half) * math.sqrt(share * (1.0 - share) / n + half / (4.0 * n))
    return max(0.0, middle - width), min(1.0, middle + width)


@dataclass(frozen=True, slots=True)
class Stratum:
    """`hits` of `n` episodes of a cell whose probability is `weight`; `error` is half of a 95 % interval of its
    log10."""

    hits: int
    n: int
    weight: float
    error: float = 0.0


def weighted_share(strata: Sequence[Stratum]) -> tuple[float, float, float]:
    """The share over all strata, by their weights, and its interval: Wilson's for as many episodes as have its variance
    (Korn and Graubard 1998 do so with the exact interval). The variance is that of the strata's shares, each with a few
    episodes like all strata beside its own, and that of weights as far as they are not known."""
    hits, n, weight, error = (np.array([getattr(one, name) for one in strata]) for name in Stratum.__slots__)
    weight = weight / weight.sum()
    shares = hits / n
    share = float(weight @ shares)
    near = (hits + PRIOR * share) / (n + PRIOR)
    unsure = error * math.log(10.0) / Z * (shares - share)
    variance = float((weight**2 * (near * (1.0 - near) / n + unsure**2)).sum())
    return share, *wilson(share, share * (1.0 - share) / variance if variance else 1.0 / float((weight**2 / n).sum()))


@dataclass(frozen=True, slots=True)
class PairedDifference:
    """Two policies on the same starts: `first` are those that the first one alone solved, `second` likewise, of `n`;
    the difference of their shares, its interval, and the p-value that there is none."""

    first: int
    second: int
    n: int

    @property
    def difference(self) -> float:
        return (self.first - self.second) / self.n

    @property
    def interval(self) -> tuple[float, float]:
        """Adjusted as of Bonett and Price (2012): one more of each, of two more."""
        one, other = (self.first + 1.0) / (self.n + 2.0), (self.second + 1.0) / (self.n + 2.0)
        half = Z * math.sqrt(max(0.0, one + other - (one - other) ** 2) / (self.n + 2.0))
        return max(-1.0, one - other - half), min(1.0, one - other + half)

    @property
    def p(self) -> float:
        """McNemar's exact test: of episodes that one alone solved, each does half, where there is no difference."""
        most, least = self.first + self.second, min(self.first, self.second)
        return min(1.0, float(2 * sum(math.comb(most, k) for k in range(least + 1)) / 2**most))

    def needed(self, difference: float) -> int:
        """How many starts, of the same make, tell such a difference apart: at least as many disagree as it takes, and
        else as many as here (Connor 1987)."""
        disagree = max((self.first + self.second + 1.0) / (self.n + 2.0), difference)
        within = math.sqrt(max(0.0, disagree - difference**2))
        return math.ceil(((Z * math.sqrt(disagree) + POWER * within) / difference) ** 2)


def needed_unpaired(share: float, difference: float) -> int:
    """How many episodes of each of two policies it takes on starts of their own: shares around `share`."""
    one, other = min(1.0, share + difference / 2.0), max(0.0, share - difference / 2.0)
    middle = (one + other) / 2.0
    within = math.sqrt(one * (1.0 - one) + other * (1.0 - other))
    return math.ceil(((Z * math.sqrt(2.0 * middle * (1.0 - middle)) + POWER * within) / difference) ** 2)
