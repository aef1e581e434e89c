"""Coverage: how much of the true distribution a set of generated scenes reaches.

The share of reference scenes whose nearest generated scene lies within that reference scene's own k-th-nearest-
neighbour radius in the reference (Naeem et al. 2020, "Reliable Fidelity and Diversity Metrics for Generative Models",
section 3). A fresh set from the truth scores 1 - 2^-k on average for sets of equal size, i.e. 0.969 for k = 5.
"""

from __future__ import annotations

import numpy.typing as npt

from scenegen.evaluation.features import Array, checked_pair, features
from scenegen.evaluation.neighbours import centred, kth_squared, least_squared, rounding

NEIGHBOURS = 5


def coverage(reference: npt.ArrayLike, generated: npt.ArrayLike, *, neighbours: int = NEIGHBOURS) -> float:
    """Share in [0, 1] of the `reference` scenes (3N, R) that the `generated` scenes (3N, G) cover.

    Time grows with R * (R + G), 1 to 1.6 s for 20,000 each on one core; memory stays at a few MB beyond the scenes for
    any R and G. Raises DataError if the two sets have different numbers of objects, nothing was generated, or
    R <= neighbours.
    """
    poses = checked_pair(reference, generated, (neighbours + 1, 1))
    return covered_share(features(poses[0]), features(poses[1]), neighbours)


def covered_share(reference: Array, generated: Array, neighbours: int = NEIGHBOURS) -> float:
    """The same of points (R, D) and (G, D)."""
    truth, made = centred(reference, generated)
    radius = kth_squared(truth, neighbours)
    return float((least_squared(truth, made) <= radius + rounding(truth, made)).mean())
