"""The models that scenes are taken from, one per task, kept beside the reports."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from scenegen.experiments.deep.tasks import Effort, Task
from scenegen.experiments.kept import kept_model, train_anew
from scenegen.training.config import make_config

KIND = "energy"


def model_path(folder: Path, task: Task, quick: bool) -> Path:
    """Where the model of a task is kept."""
    return folder / f"{'quick-' * quick}deep-{task.key}.safetensors"


def ensure_model(path: Path, task: Task, effort: Effort) -> bool:
    """Train the model of a task, unless it is there, whole and trained by these settings; whether it was trained now.
    Raises ScenegenError."""
    options: dict[str, Any] = {"epochs": effort.epochs, "scenes": effort.scenes, "data": effort.data}
    spec, config = task.load(), make_config(KIND, seed=0, **options)
    if kept_model(path, spec, config) is not None:
        return False
    train_anew(path, spec, config)
    return True
