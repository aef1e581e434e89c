"""Pearson's chi-square test of counts against expected shares (Pearson 1900).

Used for "orderings have equal shares" and "scenes are spread evenly over the cells". The p-value assumes independent
scenes: scenes of a Markov chain, or survivors of few ancestors, have more variance and are rejected even if their
distribution is right, so the test detects such dependence.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.errors import DataError
from scenegen.errors.models import BAD_COUNTS, TOO_FEW_EXPECTED, WRONG_SHAPE
from scenegen.evaluation.tails import chi_square_tail

LEAST_EXPECTED = 1.0


@dataclass(frozen=True, slots=True)
class ChiSquare:
    """Sum of (count - expected)^2 / expected, its degrees of freedom (classes - 1), and the p-value."""

    statistic: float
    degrees: int
    p: float


def chi_square(counts: npt.ArrayLike, expected: npt.ArrayLike | None = None) -> ChiSquare:
    """Tests `counts` (K,) of scenes in K classes against `expected` (K,) shares in any unit; None means equal shares.

    The distribution is asymptotic: good if at least 5 scenes are expected per class (Cochran 1954). Raises DataError
    for fewer than two classes, counts that are negative or not whole, shares that are not positive, shapes that differ,
    or a class in which less than one scene is expected.
    """
    seen = np.asarray(counts, dtype=np.float64)
    shares = np.ones(seen.shape) if expected is None else np.asarray(expected, dtype=np.float64)
    if seen.ndim != 1 or len(seen) < 2 or shares.shape != seen.shape:
        found = f"{seen.shape} against shares of shape {shares.shape}"
        wanted = "one count, and one expected share, for each of at least two classes"
        raise DataError(WRONG_SHAPE(what="counts", found=found, wanted=wanted))
    if not (np.isfinite(seen).all() and (seen >= 0.0).all() and (seen == np.round(seen)).all()):
        raise DataError(BAD_COUNTS(what="a count is negative or not a whole number", remedy="give counts, not shares"))
    if not (np.isfinite(shares).all() and (shares > 0.0).all()):
        remedy = "leave out classes that cannot occur, and assert that"
        raise DataError(BAD_COUNTS(what="an expected share is not positive", remedy=remedy))
    wanted = shares * (seen.sum() / shares.sum())
    if wanted.min() < LEAST_EXPECTED:
        raise DataError(TOO_FEW_EXPECTED(expected=wanted.min(), classes=len(seen)))
    statistic = float(((seen - wanted) ** 2 / wanted).sum())
    return ChiSquare(statistic, len(seen) - 1, chi_square_tail(statistic, len(seen) - 1))
