"""The description of a model file, for `scenegen info` and the model card."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from scenegen.errors import Diagnostic, quoted
from scenegen.errors.learning import POOR_MODEL
from scenegen.learn.guided import occurring
from scenegen.learn.models.card import ModelCard, QualityData, RangeData
from scenegen.sampling.request import Range

if TYPE_CHECKING:
    from scenegen.learn.model import Model


# --------------------------------------------------------------------------------------------------------------------
# What is wrong with a model, in plain words, from the figures that its file keeps.


LEAST_COVERAGE = 0.85
MOST_ERROR = 0.02
MOST_DISTANCE = 0.2  # KS, of a thousand scenes: exact ones have up to 0.09
GOOD_PART = 0.2
FAULTS_SHOWN = 3

Array = npt.NDArray[np.float64]
Ends = Mapping[str, tuple[float | None, float | None]]


def faults(found: Sequence[QualityData], returned: Sequence[RangeData] = ()) -> list[Diagnostic]:
    """A warning for each kind of fault, of raw scenes and of those that `sample` returns; none where the model is as
    good as it should be."""
    lines = []
    poor = [one for one in returned if one.coverage < LEAST_COVERAGE or max(one.phi, one.ks) > MOST_DISTANCE]
    if poor:
        worst = sorted(poor, key=lambda one: one.coverage - max(one.phi, one.ks))[:FAULTS_SHOWN]
        places = "; ".join(f"cover {one.coverage:.2f}, KS {max(one.phi, one.ks):.2f} at {told(one)}" for one in worst)
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


def concerned(found: Sequence[QualityData], ranges: Ends) -> list[QualityData]:
    """The figures that say something about a request: of the labels that it names, within its ranges, or the nearest
    where none is."""
    same = [one for one in found if set(one.wanted) == set(ranges)]
    same = same or [one for one in found if set(one.wanted) <= set(ranges)] or (list(found) if not ranges else [])
    inside = [one for one in same if _distance(one, ranges) == 0.0]
    return inside or sorted(same, key=lambda one: _distance(one, ranges))[:1]


def measured(card: ModelCard, regions: Sequence[Array], ranges: Ends) -> bool:
    """Whether the figures of a card say anything about a request: some were taken within its ranges, or of ranges of
    whose scenes it has a good part. `regions` tell how phi is distributed (TrainedModel)."""
    if any(set(one.wanted) == set(ranges) and _distance(one, ranges) == 0.0 for one in card.quality):
        return True
    return any(_share(card, regions, one, ranges) >= GOOD_PART for one in overlapping(card, ranges))


def _share(card: ModelCard, regions: Sequence[Array], one: RangeData, ranges: Ends) -> float:
    """The share of the scenes of a measured range that a request has; 0 where that is not known."""
    phi = occurring(regions, *_ends(card, one.wanted))
    low, high = _ends(card, ranges)
    inside = ((phi >= low[:, None]) & (phi <= high[:, None])).all(axis=0)
    return float(inside.mean()) if inside.size else 0.0


def _ends(card: ModelCard, ranges: Ends) -> tuple[Array, Array]:
    """The lowest and the highest phi of each label of a card, (L,) each; infinite where there is no end."""
    both = [ranges.get(label.name, (None, None)) for label in card.labels]
    low = [-np.inf if one is None else one for one, _ in both]
    high = [np.inf if one is None else one for _, one in both]
    return np.array(low), np.array(high)


def overlapping(card: ModelCard, ranges: Ends) -> list[RangeData]:
    """The measured ranges of the same labels that have values in common with a request."""
    same = [one for one in card.ranges or () if set(one.wanted) == set(ranges)]
    return [one for one in same if _overlap(card, one, ranges) > 0.0]


def _overlap(card: ModelCard, one: RangeData, ranges: Ends) -> float:
    """How much of a measured range a request has, as a share of its width, of the label where that is least."""
    shares = []
    for label in card.labels:
        if label.name in ranges:
            (low, high), (least, most) = (
                (label.lowest if a is None else a, label.highest if b is None else b)
                for a, b in (one.wanted[label.name], ranges[label.name])
            )
            shares.append((min(high, most) - max(low, least)) / (high - low) if high > low else 0.0)
    return min(shares, default=0.0)


def told(one: RangeData) -> str:
    """The ranges in words: `task 0:`."""
    return ", ".join(f"{label} {Range(*ends)}" for label, ends in one.wanted.items())


def _distance(one: QualityData, ranges: Ends) -> float:
    far = [0.0]
    for label, value in one.wanted.items():
        low, high = ranges.get(label, (None, None))
        far += [low - value] if low is not None else []
        far += [value - high] if high is not None else []
    return max(far)


def _where(one: QualityData) -> str:
    return ", ".join(f"{label} {value:.3g}" for label, value in one.wanted.items())


def _more(found: Sequence[object]) -> str:
    return f"; {len(found) - FAULTS_SHOWN} more" if len(found) > FAULTS_SHOWN else ""


# --------------------------------------------------------------------------------------------------------------------
# What a model file is.


SHOWN = 12  # maximum number of objects and labels that are listed
TRIED = 8192  # scenes for measuring the speed
DATA = {"balanced": "exact scenes, flat in phi", "uniform": "uniform scenes", "boosted": "uniform scenes, boosted"}
TOLD = ("model", "recipe", "data", "scenes", "epochs", "hyper", "phi")  # training settings that are shown elsewhere


def describe(model: Model, path: Path) -> list[tuple[str, str]]:
    """(what, value) pairs of a model whose file is `path`. Nothing in them depends on the machine."""
    card = model.trained.card
    facts = [
        ("model", f"{card.model}, recipe {card.recipe}{_settings(card.hyper)}"),
        ("file", f"{path.stat().st_size:,} bytes, {weights(model):,} weights"),
        ("spec", f"{Path(card.spec.name).name} (SHA-256 {card.spec.sha256[:12]})"),
        ("objects", _some(card.objects)),
    ]
    for label in card.labels[:SHOWN]:
        facts.append((f"phi of {label.name}", f"trained on {label.lowest:.4g} .. {label.highest:.4g}"))
    if len(card.labels) > SHOWN:
        facts.append(("labels", f"{len(card.labels) - SHOWN} more"))
    training = card.training
    name = str(training.get("data", ""))
    scenes = card.data.scenes if card.data is not None else training.get("scenes")
    held = f", {card.data.held_out:,} more held out (SHA-256 {card.data.sha256[:12]})" if card.data is not None else ""
    count = f"{scenes:,}" if isinstance(scenes, int) else "an unknown number of"
    facts.append(("data", f"{count} {DATA.get(name, f'scenes of {name}')}{held}"))
    where = training.get("phi")
    if isinstance(where, dict) and where:
        facts.append(("trained at", "most scenes at " + ", ".join(f"{label}={one}" for label, one in where.items())))
    rest = {key: value for key, value in training.items() if key not in TOLD and value is not None}
    kept = "" if card.kept_epoch is None else f", epoch {card.kept_epoch} kept"
    facts.append(("training", f"{card.epochs_done} of {training.get('epochs')} epochs{kept}{_settings(rest)}"))
    last = {name: means[-1] for name, means in card.losses.means.items() if means}
    if last:
        facts.append(("losses", ", ".join(f"{name} {value:.4g}" for name, value in last.items())))
    errors = held_out(model)
    if errors:
        shown = ", ".join(f"{name} {value:.4g}" for name, value in list(errors.items())[:SHOWN])
        facts.append(("held-out phi", f"off by {shown} on average"))
    return facts


def held_out(model: Model) -> dict[str, float]:
    """The mean of |phi - target phi| of each label for held-out targets, in the epoch of the file; empty if the file
    does not have it."""
    card = model.trained.card
    found = card.validation
    if found is None or not found.epochs:
        return {}
    epoch = card.kept_epoch or found.epochs[-1]
    place = found.epochs.index(epoch) if epoch in found.epochs else -1
    return {name: values[place] for name, values in found.errors.items()}


def weights(model: Model) -> int:
    """The number of trained parameters."""
    return sum(parameter.numel() for parameter in model.trained.model.parameters())


def speed(model: Model) -> float:
    """Scenes a second that the network makes on one core of this machine, unrefined; takes a moment."""
    import time

    import torch

    from scenegen.processes.pool import one_thread

    middle = torch.tensor([0.5 * (low + high) for low, high in model.trained.label_ranges.values()])
    wanted, generator = middle[:, None].expand(-1, TRIED), torch.Generator().manual_seed(0)
    took = []
    with one_thread():
        for _ in range(3):
            began = time.perf_counter()
            model.trained.propose(wanted, generator)
            took.append(time.perf_counter() - began)
    return TRIED / min(took)


def as_json(model: Model, path: Path) -> dict[str, Any]:
    """All metadata of the file, and its size, number of parameters and speed."""
    return {
        "file": str(path),
        "bytes": path.stat().st_size,
        "weights": weights(model),
        "scenes_per_second": round(speed(model)),
        **model.trained.card.model_dump(mode="json"),
    }


def _settings(values: Any) -> str:
    return "".join(
        f", {name} {value:g}" if isinstance(value, float) else f", {name} {value}" for name, value in values.items()
    )


def _some(names: list[str]) -> str:
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return f"{quoted(names[:SHOWN])}{more}" if not more else ", ".join(f"`{name}`" for name in names[:SHOWN]) + more
