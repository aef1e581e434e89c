"""How rare each phi is, label by label: what the handles are laid over."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

from scenegen.api.rarity import LabelRarity, RarityLevel, rarity
from scenegen.show.view.jobs.describe import plain
from scenegen.show.view.jobs.source import give_way, spec_of


def range_(message: dict[str, Any]) -> Iterator[Any]:
    """One part per label, in the order of the spec. The labels of a spec over time share most of the work."""
    give_way()
    spec = spec_of(message)
    if spec.over_time is not None:
        yield from map(rarity_data, rarity(spec).labels)
        return
    for label in spec.labels:
        found = rarity(spec, label)
        yield rarity_data(found.labels[0])


def rarity_data(one: LabelRarity) -> dict[str, Any]:
    """The rarity of one label as plain data; logarithms to base 10, None where too few scenes tell."""
    return {
        "label": one.label,
        "bounds": plain(one.bounds),
        "reached": list(one.reached),
        "curve": [_point(level) for level in one.curve],
        "bands": [asdict(band) for band in one.bands],
        "whole": list(one.whole),
    }


def _point(level: RarityLevel) -> list[float | None]:
    return [
        level.phi,
        None if level.above is None else level.above.log10,
        None if level.below is None else level.below.log10,
    ]
