"""Precision and recall of generated scenes (Kynkaanniemi et al. 2019, "Improved Precision and Recall Metric for
Assessing Generative Models", eq. 1 and 2).

The support of a distribution is estimated by balls: around every scene of a set, one that reaches its k-th nearest
other scene of that set. Precision is the share of generated scenes inside the reference's support (fidelity), recall
the share of reference scenes inside the generated support (diversity). Coverage (Naeem et al. 2020) is recall with the
balls of the reference, so that generated outliers cannot widen the support; it is more informative than recall, and
precision complements it. Their density improves precision in the same way. Neither value is 1 for a perfect sampler:
compare with the values of a new set of true scenes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy.typing as npt

from scenegen.errors import RequestError
from scenegen.errors.requests import OUT_OF_RANGE
from scenegen.evaluation.features import Array, checked_pair, features
from scenegen.evaluation.neighbours import centred, kth_squared, least_squared, rounding

NEIGHBOURS = 3  # the paper's k


@dataclass(frozen=True, slots=True)
class PrecisionRecall:
    """Shares in [0, 1]: generated scenes in the reference's support, reference scenes in the generated support."""

    precision: float
    recall: float


def precision_recall(
    reference: npt.ArrayLike, generated: npt.ArrayLike, *, neighbours: int = NEIGHBOURS
) -> PrecisionRecall:
    """Precision and recall of the `generated` scenes (3N, G) against the `reference` scenes (3N, R).

    Distances are those of `features`. Time grows with (R + G)^2, 2 to 3 s for 20,000 each on one core; memory stays
    at a few MB beyond the scenes. Raises DataError if the two sets have different numbers of objects or a set has
    no more than `neighbours` scenes, RequestError for neighbours < 1.
    """
    if neighbours < 1:
        raise RequestError(OUT_OF_RANGE(argument="neighbours", value=neighbours, wanted="at least 1"))
    poses = checked_pair(reference, generated, (neighbours + 1, neighbours + 1))
    truth, made = centred(features(poses[0]), features(poses[1]))
    return PrecisionRecall(
        precision=_inside(made, truth, neighbours),
        recall=_inside(truth, made, neighbours),
    )


def _inside(queries: Array, points: Array, neighbours: int) -> float:
    """Share of the queries that lie in the ball of at least one point."""
    power = least_squared(queries, points, -kth_squared(points, neighbours))
    return float((power <= rounding(queries, points)).mean())
