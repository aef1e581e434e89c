"""What phi can be reached, and how rare each value is: what to know before asking for scenes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from scenegen.api.spec import Spec, check_spec, refuse_choices
from scenegen.errors import Diagnostic, RequestError
from scenegen.errors.declarations import (
    NEVER_SATISFIED,
    NUMBER_LEFT_OUT,
    REQUIREMENT_CANNOT_BE_MET,
    REQUIREMENT_HARDLY_MET,
)
from scenegen.errors.requests import (
    ALL_HELD,
    CUT_SHORT,
    NO_TIME_TO_CHECK,
    OUT_OF_RANGE,
    REQUIREMENT_NOT_FOUND,
    UNKNOWN_LABEL,
)
from scenegen.lang.spec import member_weights, numbers_text
from scenegen.sampling.prior import pull_back
from scenegen.sampling.rarity import (
    RARITY_VISITS,
    PhiDistribution,
    Rarity,
    RequirementUnmet,
    measure,
    mix_rarities,
    needs_growth,
)
from scenegen.sampling.report import Estimate
from scenegen.sampling.request import MAX_SEED
from scenegen.search.contract import Bounds
from scenegen.search.effort import Budget, Effort, StoppedError
from scenegen.validation import as_int, as_seconds

# values of phi that are tabled, as shares of the way from 0 to either end, or from end to end where 0 is not between
SHARES_BELOW, SHARES_ABOVE = (0.97, 0.8, 0.6, 0.4, 0.2, 0.05), (0.1, 0.3, 0.5, 0.7, 0.85, 0.95)
SHARES_ACROSS = (0.03, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98)
RARITY_CURVE_POINTS = 64  # values of phi of a curve, evenly apart; the levels of the runs come on top
HARD, MIDDLE, EASY = (0.001, 0.1), (0.4, 0.6), (0.1, 0.001)  # of the scenes: how many lie below (easy: above)
SATISFIED_SHARE = 0.9  # of the way from 0 to the top: the last part is the rarest, and no use as a goal
CROWDED = 0.5  # unless so much of what is satisfied lies there, as where a body rests on another: then all of it,
BEYOND_TOP = 1.02  # and a little more, for rounding
MOST_SHARES = 8  # of the effort that numbers of things get: more of them take longer in all


@dataclass(frozen=True, slots=True)
class _Until:
    """Says stop once the time limit is over."""

    budget: Budget

    def check(self) -> None:
        if self.budget.is_spent:
            raise StoppedError


@dataclass(frozen=True, slots=True)
class RarityLevel:
    """A value of phi, and how rare it is to be at it or above, and at it or below; None where too few scenes tell."""

    phi: float
    above: Estimate | None
    below: Estimate | None


@dataclass(frozen=True, slots=True)
class Band:
    """A range of phi that is worth asking for. `log10` is the probability of it among all scenes, roughly; None where
    it is too rare to tell."""

    name: str
    low: float
    high: float
    log10: float | None


@dataclass(frozen=True, slots=True)
class LabelRarity:
    """phi of one label among the scenes that meet the requirement.

    `bounds` are interval bounds: no scene lies beyond them. `reached` is the lowest and highest phi that was met.
    `levels` are about a dozen values over what was reached, `curve` many; `whole` tells whether they go
    all the way down and up, or the search's effort ended before. `bands` are what to ask for.
    """

    label: str
    bounds: Bounds
    reached: Bounds
    levels: tuple[RarityLevel, ...] = field(repr=False)
    curve: tuple[RarityLevel, ...] = field(repr=False)
    bands: tuple[Band, ...] = field(repr=False)
    whole: tuple[bool, bool] = field(repr=False)


@dataclass(frozen=True, slots=True)
class SpecRarity:
    """What `rarity` finds out. `requirement` is how rare scenes are that meet what the spec requires (None:
    it requires nothing); `warnings` are about labels that cannot be satisfied."""

    labels: tuple[LabelRarity, ...]
    requirement: Estimate | None
    seed: int
    evaluations: int
    warnings: tuple[Diagnostic, ...] = field(repr=False)


def rarity(spec: Spec, label: str | None = None, *, seed: int = 0, timeout: float | None = None) -> SpecRarity:
    """The range of phi of every label (or one) that can be reached, and how rare each part of it is.

    Probabilities are those of the base distribution, among the scenes (of a spec over time: the motions) that meet what
    the spec requires; errors are half of a 95 % interval of log10. The same arguments give the same numbers. After
    `timeout` seconds the search ends with what it has, and a warning says so. Raises RequestError for an unknown label,
    where nothing is found that meets the requirement, and where that is not known in time.
    """
    check_spec(spec)
    seed = as_int("seed", seed)
    if label is not None and label not in spec.labels:
        raise RequestError(UNKNOWN_LABEL(name=label, known=spec.labels))
    if not 0 <= seed <= MAX_SEED:
        raise RequestError(OUT_OF_RANGE(argument="seed", value=seed, wanted=f"from 0 to {MAX_SEED}"))
    budget = Budget(math.inf if timeout is None else as_seconds("timeout", timeout))
    lowest, highest = spec.definition.box()
    if not (lowest < highest).any():
        raise RequestError(ALL_HELD(consequence="phi has one value"))
    labels = spec.labels if label is None else (label,)
    try:
        return _of_motions(spec, labels, seed, budget) if spec.over_time else _of_scenes(spec, labels, seed, budget)
    except StoppedError:
        raise RequestError(NO_TIME_TO_CHECK()) from None


def _of_scenes(spec: Spec, labels: Sequence[str], seed: int, budget: Budget) -> SpecRarity:
    bounds = spec.bounds()
    left_out: list[Diagnostic] = []
    if spec.counts:
        found = _of_numbers(spec, labels, seed, left_out, budget)
    else:
        found = _measure(spec, labels, bounds, seed, budget)
    reports = tuple(_report(name, bounds[name], found.reaches[name]) for name in labels if name in found.reaches)
    never = {one.label for one in reports if one.reached[1] < 0.0}
    warnings = _cut_short(budget, found, labels) or (tuple(_clashes(spec, never)) if never else ())
    return SpecRarity(reports, found.requirement, seed, found.evaluations, (*left_out, *warnings))


def _cut_short(budget: Budget, found: Rarity, labels: Sequence[str]) -> tuple[Diagnostic, ...]:
    """A warning where time was up; others would be about what was not searched."""
    missing = [f"`{name}`" for name in labels if name not in found.reaches]
    return (CUT_SHORT(left_out=", ".join(missing) or None),) if budget.is_spent else ()


def _of_numbers(spec: Spec, labels: Sequence[str], seed: int, left_out: list[Diagnostic], budget: Budget) -> Rarity:
    """Over all numbers of things by their weights; those with which nothing meets the requirement are left out. Raises
    RequestError where all are."""
    found: list[Rarity] = []
    weights: list[int] = []
    share = RARITY_VISITS // min(len(spec.definition.members), MOST_SHARES)
    for (numbers, member), weight in zip(spec.members, member_weights(spec.definition.counts), strict=True):
        try:
            found.append(_measure(member, labels, member.bounds(), seed, budget, share))
        except RequestError as error:
            first = error.diagnostics[0]
            left_out.append(NUMBER_LEFT_OUT(counted=numbers_text(numbers), why=first.title))
            if len(left_out) == len(spec.definition.members):
                raise
        else:
            weights.append(weight)
    if any(len(one.reaches) < len(labels) for one in found):
        raise StoppedError  # a mixture needs all of them
    return mix_rarities(found, weights)


def _of_motions(spec: Spec, labels: Sequence[str], seed: int, budget: Budget) -> SpecRarity:
    from scenegen.sampling.motions.bounds import phi_bounds
    from scenegen.sampling.motions.rarity import measure

    timed = spec.over_time
    assert timed is not None
    lowest, highest = spec.definition.box()
    refuse_choices(spec, "a motion")
    found = measure(spec.definition, labels, seed, stop=_Until(budget))
    if isinstance(found, RequirementUnmet):
        misses = -found.best if math.isfinite(found.best) else None
        raise RequestError(REQUIREMENT_NOT_FOUND(motion="motion", evaluations=found.evaluations, misses=misses))
    bounds = phi_bounds(timed, lowest, highest, Effort(lambda: budget.overdrawn))
    reports = tuple(_report(name, bounds[name], found.reaches[name]) for name in labels)
    warnings = _cut_short(budget, found, labels) or tuple(
        NEVER_SATISFIED(name=one.label, motion="motion") for one in reports if one.reached[1] < 0.0
    )
    return SpecRarity(reports, found.requirement, seed, found.evaluations, warnings)


def _measure(
    spec: Spec,
    labels: Sequence[str],
    bounds: Mapping[str, Bounds],
    seed: int,
    budget: Budget,
    work: int = RARITY_VISITS,
) -> Rarity:
    """By splitting, or by growth where splitting does not serve. Raises RequestError where no scene is found that meets
    the requirement."""
    from scenegen.sampling.growth.rarity import measure_by_growth

    checked = spec.checked
    lowest, highest = checked.box()
    checked, _ = pull_back(checked, lowest, highest)
    if needs_growth(checked, labels):
        try:
            return measure_by_growth(checked, labels, seed, deadline=budget.ends)
        except RequestError as error:
            raise _clash(spec, budget) or error from None
    found = measure(checked.core, lowest, highest, labels, seed, work=work, stop=_Until(budget))
    excess = checked.log_excess(lowest, highest)
    if isinstance(found, RequirementUnmet):
        try:
            return measure_by_growth(checked, labels, seed, deadline=budget.ends)
        except RequestError:
            raise _clash(spec, budget) or _out_of_reach(found) from None
    if found.requirement is not None and excess:
        mine = replace(found.requirement, log10=found.requirement.log10 + excess / math.log(10.0))
        found = replace(found, requirement=mine)
    known = [name for name in labels if name in found.reaches]
    untold = [name for name in known if bounds[name][1] > 0.0 and found.reaches[name].up(0.0) is None]
    if not untold:
        return found
    try:
        grown = measure_by_growth(checked, untold, seed, up_only=True, deadline=budget.ends)
    except StoppedError:
        return found
    told = {name: reach.up for name, reach in grown.reaches.items() if reach.up(0.0) is not None}
    reaches = {name: replace(reach, up=told.get(name, reach.up)) for name, reach in found.reaches.items()}
    return replace(found, reaches=reaches, evaluations=found.evaluations + grown.evaluations)


def _clash(spec: Spec, budget: Budget) -> RequestError | None:
    """Which parts of what the spec requires clash, where that is known, and time is not up."""
    if budget.is_spent:
        return None
    for one in spec.infeasible():
        if one.kind in (REQUIREMENT_CANNOT_BE_MET, REQUIREMENT_HARDLY_MET):
            return RequestError(replace(one, severity="error"))
    return None


def _out_of_reach(found: RequirementUnmet) -> RequestError:
    """No scene meets what the spec requires, as far as splitting and growth can tell."""
    misses = -found.best if math.isfinite(found.best) else None
    return RequestError(REQUIREMENT_NOT_FOUND(evaluations=found.evaluations, misses=misses))


def _clashes(spec: Spec, labels: set[str]) -> list[Diagnostic]:
    """A warning for each label that was never satisfied: with the clash, where one is found."""
    clashes = {one.facts["name"]: one for one in spec.infeasible() if "name" in one.facts}
    return [clashes.get(name) or NEVER_SATISFIED(name=name) for name in spec.labels if name in labels]


def _report(label: str, bounds: Bounds, reach: PhiDistribution) -> LabelRarity:
    low, high = reach.down.end, reach.up.end
    curve = [_level(phi, reach) for phi in _places(reach)] if low < high else []
    levels = [_level(phi, reach) for phi in spread(low, high)]
    whole = (reach.down.whole, reach.up.whole)
    return LabelRarity(label, bounds, (low, high), tuple(levels), tuple(curve), tuple(_bands(reach)), whole)


def _places(reach: PhiDistribution) -> list[float]:
    """Where a curve has points: evenly over what was reached, and where each run had its levels."""
    even = np.linspace(reach.down.end, reach.up.end, RARITY_CURVE_POINTS)
    places = np.unique(np.concatenate([even, reach.up.levels[1:], -reach.down.levels[1:]]))
    return [float(phi) for phi in places]


def _level(phi: float, reach: PhiDistribution) -> RarityLevel:
    return RarityLevel(phi, reach.up(phi), reach.down(phi))


def spread(low: float, high: float) -> list[float]:
    """About a dozen round values between two ends: half of them below 0 and half above, where 0 lies between, and 0
    itself; closer together towards the ends."""
    if not low < high:
        return [low]
    if not low < 0.0 < high:
        return round_values([low + (high - low) * share for share in SHARES_ACROSS], high - low)
    return [
        *round_values([low * share for share in SHARES_BELOW], -low),
        0.0,
        *round_values([high * share for share in SHARES_ABOVE], high),
    ]


def round_values(values: Sequence[float], width: float) -> list[float]:
    """Values to about two hundredths of a width, as decimals that people read; each once."""
    digits = max(0, math.ceil(-math.log10(width / 100.0)))
    return list(dict.fromkeys(round(value, digits) + 0.0 for value in values))


def _bands(reach: PhiDistribution) -> list[Band]:
    """Hard, medium and easy parts of what occurs, by how many scenes lie there; and what is satisfied, where that is
    not what occurs anyway. The easiest part is only called easy where its scenes satisfy the label."""
    low, high = reach.down.end, reach.up.end
    below, above = reach.down.quantile, reach.up.quantile
    top = above(EASY[0]), above(EASY[1])
    found = [
        ("hard", below(HARD[0]), below(HARD[1])),
        ("medium", below(MIDDLE[0]), below(MIDDLE[1])),
        ("easy" if top[0] >= 0.0 else "easier", *top),
    ]
    if high > 0.0:
        crowded = _share(reach.up(SATISFIED_SHARE * high)) >= CROWDED * _share(reach.up(max(0.0, low)))
        found.append(("satisfied", max(0.0, low), (BEYOND_TOP if crowded else SATISFIED_SHARE) * high))
    bands = []
    for name, least, most in found:
        if not least < most:
            continue
        ends = round_values([least, most], 5.0 * (most - least))
        probability = _probability_between(reach, *ends) if len(ends) == 2 else 0.0
        if probability > 0.0:
            bands.append(Band(name, ends[0], ends[1], math.log10(probability)))
        elif len(ends) == 2 and name == "satisfied":  # scenes were met there, too few to count
            bands.append(Band(name, ends[0], ends[1], None))
    return bands


def _probability_between(reach: PhiDistribution, low: float, high: float) -> float:
    """P(low <= phi <= high), from the tail that is the smaller one."""

    up = _share(reach.up(low)), _share(reach.up(high))
    down = _share(reach.down(low)), _share(reach.down(high))
    return up[0] - up[1] if up[0] <= down[1] else down[1] - down[0]


def _share(estimate: Estimate | None) -> float:
    return 0.0 if estimate is None else 10.0**estimate.log10
