"""The models whose scenes a learner begins with: trained once, and kept."""

from __future__ import annotations

from pathlib import Path

from scenegen.api.train import Model
from scenegen.experiments.curricula.runs import spec_of
from scenegen.experiments.kept import kept_model, train_anew
from scenegen.experiments.plan import FOLDER, Plan
from scenegen.training.config import make_config

EPOCHS, SCENES = 4, 200_000
QUICK_EPOCHS, QUICK_SCENES = 1, 2_000


def model_of(plan: Plan, task: str) -> Model:
    """An energy model of a task: from an earlier run if it is there, else trained now. Raises ScenegenError."""
    path, spec = path_of(plan, task), spec_of(task)
    epochs, scenes = (QUICK_EPOCHS, QUICK_SCENES) if plan.quick else (EPOCHS, SCENES)
    config = make_config("energy", epochs=epochs, scenes=scenes, data="balanced", seed=0)
    found = kept_model(path, spec, config)
    if found is None:
        plan.tell(f"curriculum: training a model of task {task}")
        found = train_anew(path, spec, config)
    return found


def path_of(plan: Plan, task: str) -> Path:
    """Where the model of a task is kept."""
    size = "quick-" if plan.quick else ""
    return plan.out / FOLDER / f"{size}curriculum-{task}.safetensors"
