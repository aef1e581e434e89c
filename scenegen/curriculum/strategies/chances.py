"""Weighted draws, and success rates of parts: the building blocks of most strategies."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def drawn(weights: Floats, rng: np.random.Generator) -> int:
    """An index, drawn by weights >= 0 that are not all 0."""
    upto = weights.cumsum()
    found = int(upto.searchsorted(rng.random() * upto[-1], side="right"))
    return min(found, len(weights) - 1)  # the product may round up to the last sum


def any_of(count: int, rng: np.random.Generator) -> int:
    """An index below `count`."""
    return int(rng.random() * count)


def hear(rate: Floats, heard: Ints, part: int, score: float, span: int) -> None:
    """Move a part's rate towards a score: at first the mean of all outcomes, with the initial guess as one observation;
    after `span` outcomes a running mean with step 1 / span."""
    heard[part] += 1
    rate[part] += (score - rate[part]) / min(int(heard[part]) + 1, span)
