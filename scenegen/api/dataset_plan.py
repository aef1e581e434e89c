"""What a data set has of a spec: parts of phi, satisfied and not, and how rare each value of phi is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from scenegen.api.rarity import SATISFIED, LabelRarity, rarity
from scenegen.api.spec import Spec
from scenegen.formats.made import Made, Rareness
from scenegen.formats.sets import Manifest

STREAM = 13  # the stream of random numbers of shards' seeds
RAREST = 2.0  # satisfied scenes up to the phi that is a hundred times as rare as phi >= 0
FARTHEST = -3.0  # and scenes that are not, down to the phi that one scene in a thousand is below
DIGITS = 4  # of the ends of parts


@dataclass(frozen=True, slots=True)
class Part:
    """A range of phi of one label; the others are free."""

    label: str
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.label}={self.low:g}:{self.high:g}"


@dataclass(frozen=True, slots=True)
class SpecPlan:
    """The parts of a spec's scenes, which get equal shares; `missing` names those that there are not."""

    parts: tuple[Part, ...]
    missing: tuple[str, ...]
    rarity: dict[str, Rareness]


def plan_spec(spec: Spec, seed: int) -> SpecPlan:
    """For each label the scenes with phi >= 0 and those with phi <= 0, as far as `scenegen range` finds any. Raises
    what `rarity` raises."""
    found = rarity(spec, seed=seed)
    parts: list[Part] = []
    missing: list[str] = []
    for one in found.labels:
        for side, name in ((_satisfied(one), "phi > 0"), (_violated(one), "phi < 0")):
            if side is None:
                missing.append(f"{one.label}: no scene with {name} was found")
            else:
                parts.append(side)
    return SpecPlan(tuple(parts), tuple(missing), {one.label: rareness(one) for one in found.labels})


def rareness(one: LabelRarity) -> Rareness:
    """The smaller tail of phi at the places of the curve of `scenegen range`. Where too few scenes tell, the last
    value that can be told stands: there, the share is at most that."""
    if not one.curve:  # phi is the same in every scene
        return Rareness(phi=[one.reached[0]], log10p=[0.0])
    smaller = np.minimum(*_tails(one))
    places = [level.phi for level in one.curve]
    return Rareness(phi=[float(phi) for phi in places], log10p=[round(float(value), 4) + 0.0 for value in smaller])


def _tails(one: LabelRarity) -> tuple[Any, Any]:
    """log10 P(>= phi), falling, and log10 P(<= phi), rising, at the curve's places."""
    above = [np.inf if level.above is None else level.above.log10 for level in one.curve]
    below = [np.inf if level.below is None else level.below.log10 for level in one.curve]
    falling = np.minimum.accumulate(np.minimum(above, 0.0))
    rising = np.minimum.accumulate(np.minimum(below, 0.0)[::-1])[::-1]
    return falling, rising


def _satisfied(one: LabelRarity) -> Part | None:
    low, high = max(0.0, one.reached[0]), SATISFIED * one.reached[1]
    if not one.reached[1] > 0.0 or not low < high:
        return None
    if one.curve:
        places = [level.phi for level in one.curve]
        above = _tails(one)[0]
        least = float(np.interp(low, places, above)) - RAREST
        beyond = [phi for phi, value in zip(places, above, strict=True) if value < least and phi > low]
        high = min([high, *beyond[:1]])
        if one.curve[-1].above is not None and not beyond:  # many scenes have the highest phi, as where a body rests
            return Part(one.label, _rounded(low), one.reached[1])
    return Part(one.label, _rounded(low), _rounded(high))


def _violated(one: LabelRarity) -> Part | None:
    low, high = one.reached[0], min(0.0, one.reached[1])
    if not low < high:
        return None
    places = [level.phi for level in one.curve]
    below = _tails(one)[1]
    within = [phi for phi, value in zip(places, below, strict=True) if value >= FARTHEST and phi < high]
    low = max([low, *within[:1]])
    return Part(one.label, _rounded(low), _rounded(high))


def _rounded(value: float) -> float:
    return float(f"{value:.{DIGITS}g}") + 0.0


def requests(spec: Spec, parts: Sequence[Part], n: int, size: int, seed: int) -> list[Made]:
    """The requests of the shards, at most `size` scenes each: n scenes, as many of each part as of the others. Each
    has a seed of its own, which follows from `seed`, the spec and the shard's number alone."""
    found: list[Made] = []
    for which, part in enumerate(parts):
        count = _share(n, which, len(parts))
        files = -(-count // size)
        for number in range(files):
            words = np.random.SeedSequence([seed, STREAM, int(spec.checked.sha256[:12], 16), len(found)])
            drawn = int(words.generate_state(1, np.uint64)[0]) >> 11  # any program reads 53 bits exactly
            of = {part.label: (part.low, part.high)}
            found.append(Made(phi=of, n=_share(count, number, files), seed=drawn))
    return found


def _share(n: int, which: int, count: int) -> int:
    return n * (which + 1) // count - n * which // count


def shares(n: int, count: int) -> list[int]:
    """n in `count` numbers that differ by 1 at most."""
    return [_share(n, which, count) for which in range(count)]


def plan_data(plan: SpecPlan) -> list[dict[str, Any]]:
    """The parts as a manifest has them."""
    return [{"label": part.label, "phi": [part.low, part.high]} for part in plan.parts]


def plan_from(manifest: Manifest) -> SpecPlan:
    """The plan that a manifest was begun with."""
    parts: list[Mapping[str, Any]] = manifest.request["parts"]
    return SpecPlan(
        tuple(Part(part["label"], *part["phi"]) for part in parts),
        tuple(manifest.missing or ()),
        manifest.rarity or {},
    )
