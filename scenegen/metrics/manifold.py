"""Precision and recall of generated scenes (Kynkaanniemi et al. 2019, "Improved Precision and Recall Metric for
Assessing Generative Models", eq. 1 and 2).

The support of a distribution is estimated by balls: around every scene of a set, one that reaches its k-th nearest
other scene of that set. Precision is the share of generated scenes inside the reference's support (are they right?),
recall the share of reference scenes inside the generated support (are all kinds there?). Coverage (Naeem et al. 2020)
is the recall with the balls of the reference, so that generated outliers cannot widen the support that recall is
counted with; it tells more than recall, and precision tells what coverage does not. Their density refines precision
in the same way. Neither figure is 1 for a perfect sampler: compare with the figures of a fresh set from the truth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy.typing as npt

from scenegen.errors import Diagnostic, RequestError
from scenegen.metrics.features import Array, checked_pair, features
from scenegen.metrics.neighbours import centred, kth_squared, least_squared, rounding

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
    at a few MB beyond the scenes. Raises DataError where the two sets hold different numbers of objects or a set has
    no more than `neighbours` scenes, RequestError for neighbours < 1.
    """
    if neighbours < 1:
        raise RequestError(Diagnostic(f"{neighbours} neighbours", help="ask for at least 1"))
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
