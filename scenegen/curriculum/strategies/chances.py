"""Draws by weight, and success rates of parts: the two things that most strategies are made of."""

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
    """Move a part's rate towards a score: a mean of all with one observation's worth of the first guess, and from
    `span` outcomes on one that forgets, by 1 / span each time."""
    heard[part] += 1
    rate[part] += (score - rate[part]) / min(int(heard[part]) + 1, span)
