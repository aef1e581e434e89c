"""Systematic resampling: whom to go on with, each about as often as its weight says (Kitagawa 1996)."""

from __future__ import annotations

import numpy as np

from scenegen.arrays import Array, Index


def resample(weights: Array, count: int, rng: np.random.Generator) -> Index:
    """`count` indices in order, each as often as its weight says, up or down to a whole number. Some weight must be
    positive."""
    place = np.cumsum(weights)
    marks = (np.arange(count) + rng.random()) * (place[-1] / count)
    index: Index = np.minimum(np.searchsorted(place, marks, side="right"), len(weights) - 1)
    return index


def resample_groups(weights: Array, group: Index, rng: np.random.Generator) -> tuple[Index, Array]:
    """Resampling within each group (Carpenter et al. 1999): whom to go on with, and the mean weight of each one's
    group, (P,) each. Groups in which all weights are 0 are left out: they have died."""
    keep: list[Index] = []
    mean = np.zeros(len(weights))
    for which in np.unique(group):
        mine = np.flatnonzero(group == which)
        own = weights[mine]
        mean[mine] = np.cumsum(own)[-1] / len(mine)
        if mean[mine[0]] > 0.0:
            keep.append(mine if (own == own[0]).all() else mine[resample(own, len(mine), rng)])
    return (np.concatenate(keep) if keep else np.empty(0, dtype=np.intp)), mean
