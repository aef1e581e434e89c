"""Notes and warnings about a model's scenes, from the figures measured when it was trained."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from scenegen.api.model import Model
from scenegen.errors import Diagnostic
from scenegen.errors.models import BEYOND_TRAINING, RAW_BREAKS_REQUIREMENT
from scenegen.evaluation.faults import concerned, faults
from scenegen.lang.core import REQUIRE, gated
from scenegen.lang.interpret import phi as score
from scenegen.primitives import NUMPY
from scenegen.sampling.request import Range

Array = npt.NDArray[np.float64]


def advice(model: Model, ranges: Mapping[str, Range], rows: Array | None, raw: bool) -> tuple[Diagnostic, ...]:
    """Warnings about scenes (3N, n) that a model made for a request; None where they are no longer in memory."""
    ends = {label: (wanted.low, wanted.high) for label, wanted in ranges.items()}
    found = faults(concerned(model.trained.card.quality, ends))
    if raw:
        found += _beyond(model, ends)
        found += [] if rows is None else _unmet(model, rows)
    return tuple(found)


def _beyond(model: Model, ends: Mapping[str, tuple[float | None, float | None]]) -> list[Diagnostic]:
    """Targets outside of the range of phi that the model was trained on."""
    lines = []
    for label, (low, high) in ends.items():
        least, most = model.trained.label_ranges.get(label, (-np.inf, np.inf))
        if (low is not None and low < least) or (high is not None and high > most):
            lines.append(BEYOND_TRAINING(label=label, low=least, high=most))
    return lines


def _unmet(model: Model, rows: Array) -> list[Diagnostic]:
    """Raw scenes that break a requirement."""
    core = gated(model.spec.checked.core)
    if REQUIRE not in core.labels:
        return []
    broken = int((np.broadcast_to(score(core, list(rows), NUMPY)[REQUIRE], rows.shape[1]) < 0.0).sum())
    if not broken:
        return []
    return [RAW_BREAKS_REQUIREMENT(broken=broken, count=rows.shape[1])]
