"""Are shares as they should be? Pearson's chi-square test of counts (Pearson 1900).

For "orderings come in equal shares" and "scenes lie evenly over the cells". The p-value is that of independent scenes:
scenes of a Markov chain, or survivors of few ancestors, scatter more and are rejected though their law is right, which
is what makes the test sensitive to them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.errors import DataError, Diagnostic
from scenegen.metrics.tails import chi_square_tail

LEAST_EXPECTED = 1.0


@dataclass(frozen=True, slots=True)
class ChiSquare:
    """Sum of (count - expected)^2 / expected, its degrees of freedom (classes - 1), and P(at least this | right)."""

    statistic: float
    degrees: int
    p: float


def chi_square(counts: npt.ArrayLike, expected: npt.ArrayLike | None = None) -> ChiSquare:
    """Tests `counts` (K,) of scenes in K classes against `expected` (K,) shares in any unit; None means equal shares.

    The law is asymptotic: good where at least 5 scenes are expected per class (Cochran 1954). Raises DataError for
    fewer than two classes, counts that are negative or not whole, shares that are not positive, shapes that differ, or
    a class in which less than one scene is expected.
    """
    seen = np.asarray(counts, dtype=np.float64)
    shares = np.ones(seen.shape) if expected is None else np.asarray(expected, dtype=np.float64)
    if seen.ndim != 1 or len(seen) < 2 or shares.shape != seen.shape:
        raise DataError(
            Diagnostic(
                f"counts of shape {seen.shape} against shares of shape {shares.shape}",
                help="give one count, and one expected share, for each of at least two classes",
            )
        )
    if not (np.isfinite(seen).all() and (seen >= 0.0).all() and (seen == np.round(seen)).all()):
        raise DataError(Diagnostic("a count is negative or not a whole number", help="give counts, not shares"))
    if not (np.isfinite(shares).all() and (shares > 0.0).all()):
        raise DataError(
            Diagnostic("an expected share is not positive", help="leave out classes that cannot occur, and assert that")
        )
    wanted = shares * (seen.sum() / shares.sum())
    if wanted.min() < LEAST_EXPECTED:
        raise DataError(
            Diagnostic(
                f"only {wanted.min():.3g} scenes are expected in one of the {len(seen)} classes",
                help="draw more scenes (5 per class at least), or join classes",
            )
        )
    statistic = float(((seen - wanted) ** 2 / wanted).sum())
    return ChiSquare(statistic, len(seen) - 1, chi_square_tail(statistic, len(seen) - 1))
