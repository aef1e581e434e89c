"""Error statistics: phi of generated scenes minus the target phi (the paper's accuracy tables)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.errors import DataError
from scenegen.errors.models import ARRAY_NOT_FINITE, WRONG_SHAPE

TOLERANCE = 0.025  # the half-width of the paper's "within" counts, in the unit of phi


@dataclass(frozen=True, slots=True)
class LabelErrors:
    """phi minus the target phi of one label: mean, population standard deviation, mean absolute error, share within."""

    label: str
    wanted: float
    mean: float
    std: float
    mean_abs: float
    within: float


@dataclass(frozen=True, slots=True)
class ErrorStatistics:
    """Errors per label, and the share of scenes that are within the tolerance on *all* labels at once."""

    labels: tuple[LabelErrors, ...]
    within: float
    tolerance: float
    scenes: int


def error_statistics(
    phi: npt.ArrayLike, wanted: npt.ArrayLike, labels: Sequence[str], *, tolerance: float = TOLERANCE
) -> ErrorStatistics:
    """Errors of `phi` (L, B) against `wanted` (L,), in the unit of phi (metres or radians).

    `within` counts errors of at most `tolerance`. Raises DataError for shapes that do not fit, no scenes, or phi that
    is not finite.
    """
    values, target = np.asarray(phi, dtype=np.float64), np.asarray(wanted, dtype=np.float64)
    if values.ndim != 2 or values.shape[0] != len(labels) or target.shape != (len(labels),) or not values.size:
        found = f"{values.shape}, with wanted of shape {target.shape} and {len(labels)} labels"
        wanted = "phi as (L, B) with B >= 1 scenes, wanted as (L,)"
        raise DataError(WRONG_SHAPE(what="phi", found=found, wanted=wanted))
    if not (np.isfinite(values).all() and np.isfinite(target).all()):
        raise DataError(ARRAY_NOT_FINITE(what="phi"))
    error = values - target[:, None]
    inside = np.abs(error) <= tolerance
    rows = tuple(
        LabelErrors(
            label=label,
            wanted=float(target[index]),
            mean=float(error[index].mean()),
            std=float(error[index].std()),
            mean_abs=float(np.abs(error[index]).mean()),
            within=float(inside[index].mean()),
        )
        for index, label in enumerate(labels)
    )
    return ErrorStatistics(rows, float(inside.all(axis=0).mean()), tolerance, values.shape[1])
