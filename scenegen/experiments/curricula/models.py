"""The small models whose scenes a learner begins with: trained once, and kept."""

from __future__ import annotations

from pathlib import Path

from scenegen.api.train import Model, load_model, train
from scenegen.errors import DataError
from scenegen.experiments.curricula.runs import spec_of
from scenegen.experiments.plan import FOLDER, Plan

STEPS = {"epochs": 3, "scenes": 100_000, "data": "balanced", "seed": 0}
QUICK_STEPS = {"epochs": 1, "scenes": 2_000, "data": "balanced", "seed": 0}


def model_of(plan: Plan, task: str) -> Model:
    """An energy model of a task: from an earlier run if it is there, else trained now. Raises ScenegenError."""
    path = path_of(plan, task)
    try:
        return load_model(path, spec_of(task))
    except (OSError, DataError):
        plan.tell(f"curriculum: training a model of task {task}")
        path.with_suffix(".safetensors.train").unlink(missing_ok=True)
        settings = QUICK_STEPS if plan.quick else STEPS
        return train(spec_of(task), "energy", out=path, **settings)


def path_of(plan: Plan, task: str) -> Path:
    size = "quick-" if plan.quick else ""
    return plan.out / FOLDER / f"{size}curriculum-{task}.safetensors"
