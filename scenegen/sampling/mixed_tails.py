"""How phi is distributed where the number of things is drawn: tails of the members, in equal shares."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.sampling.interval import Estimate
from scenegen.sampling.tails import Rarity, Reach, Run, Tail

Array = npt.NDArray[np.float64]

CERTAIN = Estimate(0.0, 0.0)


@dataclass(frozen=True, slots=True)
class MixedTail:
    """Tails of the same direction, each with the same share of the scenes; it has what `Tail` has."""

    tails: tuple[Run, ...]

    @property
    def sign(self) -> int:
        return self.tails[0].sign

    @property
    def levels(self) -> Array:
        """Those of all tails."""
        found = np.unique(np.concatenate([tail.levels[1:] for tail in self.tails]))
        return np.concatenate([[-np.inf], found])

    @property
    def end(self) -> float:
        return self.sign * max(self.sign * tail.end for tail in self.tails)

    @property
    def whole(self) -> bool:
        return all(tail.whole for tail in self.tails)

    def __call__(self, phi: float) -> Estimate | None:
        """As of `Tail`; a tail that has too few scenes there counts as having none."""
        return mean([tail(phi) for tail in self.tails])

    def quantile(self, share: float) -> float:
        """As of `Tail`."""
        each = [tail.values[0].ravel() for tail in self.tails if isinstance(tail, Tail)]
        values = np.concatenate(each)
        weights = np.concatenate([np.full(len(one), 1.0 / len(one) / len(each)) for one in each])
        order = np.argsort(-values, kind="stable")
        beyond = np.cumsum(weights[order])
        place = min(int(np.searchsorted(beyond, share * (1.0 - 1e-12))), len(values) - 1)
        return self.sign * float(values[order[place]])


def mean(estimates: Sequence[Estimate | None]) -> Estimate | None:
    """The mean of probabilities; None counts as 0, and is what there is where all are None."""
    known = [(10.0**one.log10, one.error) for one in estimates if one is not None]
    total = sum(value for value, _ in known)
    if not total > 0.0:
        return None
    error = math.sqrt(sum((value * error) ** 2 for value, error in known)) / total
    return Estimate(math.log10(total / len(estimates)), error)


def mixed(found: Sequence[Rarity]) -> Rarity:
    """The distribution over members in equal shares, each among its own scenes that meet the requirement."""
    reaches = {}
    for label in found[0].reaches:
        each = [one.reaches[label] for one in found]
        up, down = (MixedTail(tuple(tails)) for tails in ([one.up for one in each], [one.down for one in each]))
        reaches[label] = Reach(up, down, sum(one.evaluations for one in each))
    required = [one.requirement for one in found]
    requirement = None if not any(required) else mean([one or CERTAIN for one in required])
    return Rarity(reaches, requirement, sum(one.evaluations for one in found))
