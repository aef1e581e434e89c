"""Models that an earlier run left beside the reports: taken if they are what would be trained now."""

from __future__ import annotations

import contextlib
import hashlib
from dataclasses import asdict
from pathlib import Path

from scenegen.api.spec import Spec
from scenegen.api.train import Model, load_model, train
from scenegen.errors import DataError
from scenegen.models.table import parse_hyper
from scenegen.training.config import TrainConfig
from scenegen.training.state import state_path


def kept_model(path: Path, spec: Spec, config: TrainConfig) -> Model | None:
    """The model of a file, if it is whole, and was trained on this spec, by this recipe, with these settings."""
    try:
        model = load_model(path, spec)
    except (OSError, DataError):
        return None
    card = model.trained.card
    hyper = parse_hyper(config.model, config.hyper, config.recipe).model_dump()
    same = dict(card.training) == asdict(config) and dict(card.hyper) == hyper and card.epochs_done == config.epochs
    return model if same else None


def train_anew(path: Path, spec: Spec, config: TrainConfig) -> Model:
    """Train a model into a file, whatever is there. Raises ScenegenError."""
    _forget(path)
    model = train(spec, out=path, **asdict(config))
    _forget(path)
    return model


def digest(path: Path) -> str:
    """The SHA-256 of a model file. Raises OSError."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _forget(path: Path) -> None:
    """What a training that was broken off, or is finished, would be resumed from."""
    with contextlib.suppress(OSError):
        state_path(path).unlink()
