"""What is wrong with a model, in plain words, from the figures that its file keeps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from scenegen.errors import Diagnostic
from scenegen.errors.models import PHI_MISSED, SCENES_LEFT_OUT
from scenegen.models.card import QualityData

LEAST_COVERAGE = 0.85
MOST_ERROR = 0.02
SHOWN = 3

Ends = Mapping[str, tuple[float | None, float | None]]


def faults(found: Sequence[QualityData]) -> list[Diagnostic]:
    """A warning for each kind of fault; none where the model is as good as it should be."""
    lines = []
    left_out = sorted((one for one in found if one.coverage < LEAST_COVERAGE), key=lambda one: one.coverage)
    if left_out:
        places = "; ".join(f"{one.coverage:.2f} at {_where(one)}" for one in left_out[:SHOWN])
        lines.append(SCENES_LEFT_OUT(places=places + _more(left_out)))
    far = sorted((one for one in found if one.error > MOST_ERROR), key=lambda one: -one.error)
    if far:
        places = "; ".join(f"{one.error:.3f} at {_where(one)}" for one in far[:SHOWN])
        lines.append(PHI_MISSED(places=places + _more(far)))
    return lines


def concerned(found: Sequence[QualityData], ranges: Ends) -> list[QualityData]:
    """The figures that say something about a request: of the labels that it names, within its ranges, or the nearest
    where none is."""
    same = [one for one in found if set(one.wanted) == set(ranges)]
    same = same or [one for one in found if set(one.wanted) <= set(ranges)] or (list(found) if not ranges else [])
    inside = [one for one in same if _distance(one, ranges) == 0.0]
    return inside or sorted(same, key=lambda one: _distance(one, ranges))[:1]


def _distance(one: QualityData, ranges: Ends) -> float:
    far = [0.0]
    for label, value in one.wanted.items():
        low, high = ranges.get(label, (None, None))
        far += [low - value] if low is not None else []
        far += [value - high] if high is not None else []
    return max(far)


def _where(one: QualityData) -> str:
    return ", ".join(f"{label} {value:.3g}" for label, value in one.wanted.items())


def _more(found: Sequence[QualityData]) -> str:
    return f"; {len(found) - SHOWN} more" if len(found) > SHOWN else ""
