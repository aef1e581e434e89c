"""The models that scenes are taken from, one per task, kept beside the reports."""

from __future__ import annotations

import contextlib
import hashlib
from dataclasses import asdict
from pathlib import Path
from typing import Any

from scenegen.api.train import Model, load_model, train
from scenegen.errors import DataError
from scenegen.experiments.deep.tasks import Effort, Task
from scenegen.models.table import parse_hyper
from scenegen.training.config import TrainConfig, make_config
from scenegen.training.state import state_path

KIND = "energy"


def model_path(folder: Path, task: Task, quick: bool) -> Path:
    """Where the model of a task is kept."""
    return folder / f"{'quick-' * quick}deep-{task.key}.safetensors"


def ensure_model(path: Path, task: Task, effort: Effort) -> bool:
    """Train the model of a task, unless it is there, whole and trained by these settings; whether it was trained now.
    Raises ScenegenError."""
    options: dict[str, Any] = {"epochs": effort.epochs, "scenes": effort.scenes, "data": effort.data}
    config = make_config(KIND, seed=0, **options)
    if _kept(path, task, config):
        return False
    train(task.load(), out=path, **asdict(config))
    with contextlib.suppress(OSError):
        state_path(path).unlink()  # a finished training is not resumed
    return True


def digest(path: Path) -> str:
    """The SHA-256 of a model file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _kept(path: Path, task: Task, config: TrainConfig) -> Model | None:
    try:
        model = load_model(path, task.load())
    except (OSError, DataError):
        return None
    card = model.trained.card
    hyper = parse_hyper(config.model, config.hyper, config.recipe).model_dump()
    same = dict(card.training) == asdict(config) and dict(card.hyper) == hyper and card.epochs_done == config.epochs
    return model if same else None
