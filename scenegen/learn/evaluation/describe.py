"""The description of a model file, for `scenegen info` and the model card."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenegen.errors import quote_names

if TYPE_CHECKING:
    from scenegen.learn.model import Model


# What a model file is.


MAX_LISTED = 12  # maximum number of objects and labels that are listed
TIMED_SCENES = 8192  # scenes for measuring the speed
DATA = {"balanced": "exact scenes, flat in phi", "uniform": "uniform scenes"}
SHOWN_ELSEWHERE = ("model", "recipe", "data", "scenes", "epochs", "hyper", "phi")  # training settings


def describe(model: Model, path: Path) -> list[tuple[str, str]]:
    """(what, value) pairs of a model whose file is `path`. Nothing in them depends on the machine."""
    card = model.trained.card
    facts = [
        ("model", f"{card.model}{_settings(card.hyper)}"),
        ("file", f"{path.stat().st_size:,} bytes, {weights(model):,} weights"),
        ("spec", f"{Path(card.spec.name).name} (SHA-256 {card.spec.sha256[:12]})"),
        ("objects", _name_list(card.objects)),
    ]
    for label in card.labels[:MAX_LISTED]:
        facts.append((f"phi of {label.name}", f"trained on {label.lowest:.4g} .. {label.highest:.4g}"))
    if len(card.labels) > MAX_LISTED:
        facts.append(("labels", f"{len(card.labels) - MAX_LISTED} more"))
    training = card.training
    name = str(training.get("data", ""))
    scenes = card.data.scenes if card.data is not None else training.get("scenes")
    held = f", {card.data.held_out:,} more held out (SHA-256 {card.data.sha256[:12]})" if card.data is not None else ""
    count = f"{scenes:,}" if isinstance(scenes, int) else "an unknown number of"
    facts.append(("data", f"{count} {DATA.get(name, f'scenes of {name}')}{held}"))
    where = training.get("phi")
    if isinstance(where, dict) and where:
        facts.append(("trained at", "most scenes at " + ", ".join(f"{label}={one}" for label, one in where.items())))
    rest = {key: value for key, value in training.items() if key not in SHOWN_ELSEWHERE and value is not None}
    kept = "" if card.kept_epoch is None else f", epoch {card.kept_epoch} kept"
    facts.append(("training", f"{card.epochs_done} of {training.get('epochs')} epochs{kept}{_settings(rest)}"))
    last = {name: means[-1] for name, means in card.losses.means.items() if means}
    if last:
        facts.append(("losses", ", ".join(f"{name} {value:.4g}" for name, value in last.items())))
    errors = held_out(model)
    if errors:
        shown = ", ".join(f"{name} {value:.4g}" for name, value in list(errors.items())[:MAX_LISTED])
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
    wanted, generator = middle[:, None].expand(-1, TIMED_SCENES), torch.Generator().manual_seed(0)
    took = []
    with one_thread():
        for _ in range(3):
            began = time.perf_counter()
            model.trained.propose(wanted, generator)
            took.append(time.perf_counter() - began)
    return TIMED_SCENES / min(took)


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


def _name_list(names: list[str]) -> str:
    more = f" and {len(names) - MAX_LISTED} more" if len(names) > MAX_LISTED else ""
    return (
        f"{quote_names(names[:MAX_LISTED])}{more}"
        if not more
        else ", ".join(f"`{name}`" for name in names[:MAX_LISTED]) + more
    )
