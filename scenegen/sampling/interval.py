"""95 % intervals of probabilities, in log10, from a few independent estimates."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

# Student's t for 95 % by degrees of freedom, two-sided; beyond the table the normal's value is near enough.
_STUDENT = (12.71, 4.30, 3.18, 2.78, 2.57, 2.45, 2.36, 2.31, 2.26, 2.23, 2.20, 2.18, 2.16, 2.14, 2.13)


@dataclass(frozen=True, slots=True)
class Estimate:
    """log10 of a probability, and half of its 95 % interval, in the same units."""

    log10: float
    error: float


def student(degrees: int) -> float:
    """The quantile of Student's t that leaves 2.5 % on either side, for so many degrees of freedom (at least 1)."""
    return _STUDENT[degrees - 1] if degrees <= len(_STUDENT) else 1.96 + 2.5 / degrees


def of_hits(hits: float, drawn: float, log_share: float = 0.0) -> dict[str, object]:
    """log10 of the probability that `hits` of `drawn` independent draws tell, and half of its 95 % interval, as a file
    says them; None if unknown. `log_share`, a natural logarithm, is added to that of the share."""
    if not hits:
        return {"log10_probability": None, "log10_error": None}
    kept, log10 = hits / drawn, math.log10(math.e)
    return {
        "log10_probability": round(log_share * log10 + math.log10(kept), 6) + 0.0,
        "log10_error": round(1.96 * log10 * math.sqrt((1.0 - kept) / hits), 6),
    }


def ratio(mine: Array, base: Array) -> Estimate | None:
    """The ratio of the means of two sets of estimates, (B,) each, entry b of both from independent run b; None if it is
    0.

    An estimate that is a product over many levels is nearly lognormal (Berard, Del Moral and Doucet 2014), and skewed:
    most runs are below the mean, and if all are, their standard deviation is too small as well. So the variance of the
    mean is computed from the scatter of the logarithms, which does not depend on how large the mean came out. Where a
    run found nothing there is no logarithm, and the ratio is linearised instead (Cochran 1977, 6.4).
    """
    value = float(mine.sum() / base.sum()) if base.sum() > 0.0 else 0.0
    if not value > 0.0:
        return None
    count = len(mine)
    if (mine > 0.0).all():
        log = np.log(np.stack([mine, base]))
        covariance = np.cov(log)
        # of X / E X and Y / E Y for lognormal X and Y; 0 where both are the same
        variance = float(np.exp(covariance[0, 0]) + np.exp(covariance[1, 1]) - 2.0 * np.exp(covariance[0, 1]))
    else:
        variance = float(((mine - value * base) / mine.mean()).var(ddof=1))
    error = student(count - 1) * math.sqrt(max(0.0, variance) / count)
    return Estimate(math.log10(value), error / math.log(10.0))
