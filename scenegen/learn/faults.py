"""What is wrong with a model, in plain words, from the figures that its file keeps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from scenegen.arrays import Array
from scenegen.errors import Diagnostic
from scenegen.errors.learning import POOR_MODEL
from scenegen.learn.guided import occurring
from scenegen.learn.models.card import ModelCard, QualityData, RangeData
from scenegen.sampling.request import Range

LEAST_COVERAGE = 0.85
MOST_ERROR = 0.02
MOST_DISTANCE = 0.2  # KS, of a thousand scenes: exact ones have up to 0.09
GOOD_PART = 0.2
FAULTS_SHOWN = 3


def faults(found: Sequence[QualityData], returned: Sequence[RangeData] = ()) -> list[Diagnostic]:
    """A warning for each kind of fault, of raw scenes and of those that `sample` returns; none where the model is as
    good as it should be."""
    lines = []
    poor = [one for one in returned if one.coverage < LEAST_COVERAGE or max(one.phi, one.ks) > MOST_DISTANCE]
    if poor:
        worst = sorted(poor, key=lambda one: one.coverage - max(one.phi, one.ks))[:FAULTS_SHOWN]
        places = "; ".join(
            f"cover {one.coverage:.2f}, KS {max(one.phi, one.ks):.2f} at {describe_range(one)}" for one in worst
        )
        lines.append(POOR_MODEL(unlike=places + _more(poor)))
    left_out = sorted((one for one in found if one.coverage < LEAST_COVERAGE), key=lambda one: one.coverage)
    if left_out:
        places = "; ".join(f"{one.coverage:.2f} at {_where(one)}" for one in left_out[:FAULTS_SHOWN])
        lines.append(POOR_MODEL(covered=places + _more(left_out)))
    far = sorted((one for one in found if one.error > MOST_ERROR), key=lambda one: -one.error)
    if far:
        places = "; ".join(f"{one.error:.3f} at {_where(one)}" for one in far[:FAULTS_SHOWN])
        lines.append(POOR_MODEL(missed=places + _more(far)))
    return lines


def relevant_quality(found: Sequence[QualityData], ranges: Mapping[str, Range]) -> list[QualityData]:
    """The figures that say something about a request: of the labels that it names, within its ranges, or the nearest
    where none is."""
    same = [one for one in found if set(one.wanted) == set(ranges)]
    same = same or [one for one in found if set(one.wanted) <= set(ranges)] or (list(found) if not ranges else [])
    inside = [one for one in same if _distance(one, ranges) == 0.0]
    return inside or sorted(same, key=lambda one: _distance(one, ranges))[:1]


def covers_request(card: ModelCard, regions: Sequence[Array], ranges: Mapping[str, Range]) -> bool:
    """Whether the figures of a card say anything about a request: some were taken within its ranges, or of ranges of
    whose scenes it has a good part. `regions` tell how phi is distributed (TrainedModel)."""
    if any(set(one.wanted) == set(ranges) and _distance(one, ranges) == 0.0 for one in card.quality):
        return True
    return any(_share(card, regions, one, ranges) >= GOOD_PART for one in overlapping(card, ranges))


def _share(card: ModelCard, regions: Sequence[Array], one: RangeData, ranges: Mapping[str, Range]) -> float:
    """The share of the scenes of a measured range that a request has; 0 where that is not known."""
    phi = occurring(regions, *_ends(card, _ranges(one)))
    low, high = _ends(card, ranges)
    inside = ((phi >= low[:, None]) & (phi <= high[:, None])).all(axis=0)
    return float(inside.mean()) if inside.size else 0.0


def _ends(card: ModelCard, ranges: Mapping[str, Range]) -> tuple[Array, Array]:
    """The lowest and the highest phi of each label of a card, (L,) each; infinite where there is no end."""
    low, high = np.array([ranges.get(label.name, Range()).ends for label in card.labels]).T
    return low, high


def overlapping(card: ModelCard, ranges: Mapping[str, Range]) -> list[RangeData]:
    """The measured ranges of the same labels that have values in common with a request."""
    same = [one for one in card.ranges or () if set(one.wanted) == set(ranges)]
    return [one for one in same if _overlap(card, one, ranges) > 0.0]


def _overlap(card: ModelCard, one: RangeData, ranges: Mapping[str, Range]) -> float:
    """How much of a measured range a request has, as a share of its width, of the label where that is least."""
    shares = []
    for label in card.labels:
        if label.name in ranges:
            (low, high), (least, most) = (
                (label.lowest if ends.low is None else ends.low, label.highest if ends.high is None else ends.high)
                for ends in (_ranges(one)[label.name], ranges[label.name])
            )
            shares.append((min(high, most) - max(low, least)) / (high - low) if high > low else 0.0)
    return min(shares, default=0.0)


def describe_range(one: RangeData) -> str:
    """The ranges in words: `task 0:`."""
    return ", ".join(f"{label} {ends}" for label, ends in _ranges(one).items())


def _ranges(one: RangeData) -> dict[str, Range]:
    return {label: Range(*ends) for label, ends in one.wanted.items()}


def _distance(one: QualityData, ranges: Mapping[str, Range]) -> float:
    far = [0.0]
    for label, value in one.wanted.items():
        low, high = ranges.get(label, Range()).ends
        far += [low - value, value - high]
    return max(far)


def _where(one: QualityData) -> str:
    return ", ".join(f"{label} {value:.3g}" for label, value in one.wanted.items())


def _more(found: Sequence[object]) -> str:
    return f"; {len(found) - FAULTS_SHOWN} more" if len(found) > FAULTS_SHOWN else ""
