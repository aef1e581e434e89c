"""The small models whose scenes a learner begins with: trained once, and kept."""

from __future__ import annotations

from pathlib import Path

from scenegen.api.train import Model, load_model, train
from scenegen.errors import DataError
from scenegen.experiments.curricula.runs import spec_of
from scenegen.experiments.plan import FOLDER, Plan
from scenegen.training.state import state_path

EPOCHS, SCENES = 3, 30_000
QUICK_EPOCHS, QUICK_SCENES = 1, 2_000


def model_of(plan: Plan, task: str) -> Model:
    """An energy model of a task: from an earlier run if it is there, else trained now. Raises ScenegenError."""
    path = path_of(plan, task)
    try:
        return load_model(path, spec_of(task))
    except (OSError, DataError):
        plan.tell(f"curriculum: training a model of task {task}")
        state_path(path).unlink(missing_ok=True)
        epochs, scenes = (QUICK_EPOCHS, QUICK_SCENES) if plan.quick else (EPOCHS, SCENES)
        made = train(spec_of(task), "energy", out=path, epochs=epochs, scenes=scenes, data="balanced", seed=0)
        state_path(path).unlink(missing_ok=True)  # a finished training is not resumed
        return made


def path_of(plan: Plan, task: str) -> Path:
    size = "quick-" if plan.quick else ""
    return plan.out / FOLDER / f"{size}curriculum-{task}.safetensors"
