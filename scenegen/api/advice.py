"""Notes and warnings about a model's scenes, from the figures measured when it was trained."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from scenegen.api.model import Model
from scenegen.errors import Diagnostic
from scenegen.errors.models import BEYOND_TRAINING, NO_TABLE_OF_PHI, NOT_MEASURED, RAW_BREAKS_REQUIREMENT
from scenegen.evaluation.faults import concerned, faults, measured, overlapping
from scenegen.lang.core import REQUIRE, gated
from scenegen.lang.counts import written
from scenegen.lang.interpret import phi as score
from scenegen.lang.members import members_of
from scenegen.primitives import NUMPY
from scenegen.sampling.request import Range

Array = npt.NDArray[np.float64]


def advice(model: Model, ranges: Mapping[str, Range], rows: Array | None, raw: bool) -> tuple[Diagnostic, ...]:
    """Warnings about scenes (3N, n) that a model made for a request; None where they are no longer in memory."""
    ends = {label: (wanted.low, wanted.high) for label, wanted in ranges.items()}
    found = dict[Diagnostic, None]()
    scenes = [None] * len(model.each) if rows is None or not raw else _scenes_of(model, rows)
    for (numbers, one), made in zip(model.each, scenes, strict=True):
        card = one.trained.card
        mine = faults(concerned(card.quality, ends), () if raw else overlapping(card, ends))
        if ends and card.ranges is not None and not measured(card, tables(one), ends):
            where = [f"{label}={wanted}" for label, wanted in ranges.items()]
            mine.append(NOT_MEASURED(where=" ".join(where), one=where[0] if len(where) == 1 else None))
        if not one.trained.regions and not all(wanted.bounded for wanted in ranges.values()):
            mine.append(NO_TABLE_OF_PHI(version=card.scenegen))
        if raw:
            mine += _beyond(one, ends)
            mine += [] if made is None else _unmet(one, made)
        found |= dict.fromkeys(each.but(counted=written(numbers)) if numbers else each for each in mine)
    return tuple(found)


def tables(model: Model) -> list[Array]:
    """How phi is distributed among exact scenes, as the model file tells, see `sampling.targets.occurring`."""
    return [each.double().numpy() for each in model.trained.regions]


def _scenes_of(model: Model, rows: Array) -> list[Array]:
    """The scenes (3N, n) by the model that made them: of each member's things alone, (3N', n')."""
    if not model.spec.counts:
        return [rows]
    members = members_of(model.spec.declared)
    found = dict(members.of(rows))
    none = np.empty(0, dtype=np.intp)
    return [rows[np.ix_(mine, found.get(number, none))] for number, mine in enumerate(members.rows)]


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
