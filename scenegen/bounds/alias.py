"""Drawing from a finite distribution in constant time (Walker 1977; the tables as in Vose 1991)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class Alias:
    """K columns of equal width: column k is `own` its first `keep[k]`, and `other[k]` the rest."""

    keep: Array
    other: Index

    def draw(self, count: int, rng: np.random.Generator) -> Index:
        """`count` independent indices."""
        place = rng.random(count)
        place *= len(self.keep)
        column = place.astype(np.intp)
        place -= column
        return np.where(place < self.keep.take(column), column, self.other.take(column))


def make_alias(weights: Array) -> Alias:
    """The tables for weights (K,) >= 0, not all of them 0."""
    count = len(weights)
    keep: list[float] = (weights * (count / weights.sum())).tolist()
    other = list(range(count))
    small = [index for index, value in enumerate(keep) if value < 1.0]
    large = [index for index, value in enumerate(keep) if value >= 1.0]
    while small and large:
        low, high = small.pop(), large[-1]
        other[low] = high
        keep[high] -= 1.0 - keep[low]
        if keep[high] < 1.0:
            small.append(large.pop())
    # What is left of either is 1 but for rounding; a column of weight 0 always has a partner by then.
    for index in (*small, *large):
        keep[index] = 1.0
    return Alias(np.array(keep), np.array(other, dtype=np.intp))
