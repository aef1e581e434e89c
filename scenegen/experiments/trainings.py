"""Trainings that are kept: a model file whose card says what is asked for is not trained again.

Beside the model stands a record of what the card does not hold, written last: a training that was broken off is begun
anew.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

from pydantic import BaseModel, ConfigDict, FiniteFloat, ValidationError

from scenegen.api.train import Model
from scenegen.experiments.kept import digest, kept_model, train_anew
from scenegen.experiments.plan import FULL, QUICK
from scenegen.experiments.problems import PROBLEMS
from scenegen.experiments.variants import VARIANTS, Variant
from scenegen.formats.files import write_whole
from scenegen.training.config import TrainConfig


class Record(BaseModel):
    """The SHA-256 of a finished model file, and the CPU seconds that its training took, data included."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    model: str
    cpu_seconds: FiniteFloat


@dataclass(frozen=True, slots=True)
class Job:
    """A training: the key of a problem, the place of a variant in VARIANTS, a seed."""

    problem: str
    variant: int
    seed: int
    quick: bool
    folder: str

    @property
    def what(self) -> Variant:
        return VARIANTS[self.variant]

    @property
    def path(self) -> Path:
        """The model file; variants that differ in their steps share it."""
        size = "quick-" if self.quick else ""
        return Path(self.folder) / f"{size}{self.problem}-{self.what.family}-{self.what.recipe}-{self.seed}.safetensors"

    @property
    def config(self) -> TrainConfig:
        return self.what.config(PROBLEMS[self.problem], QUICK if self.quick else FULL, self.seed)

    def __str__(self) -> str:
        return f"{PROBLEMS[self.problem].title}: {self.what.name}, seed {self.seed}"


@dataclass(frozen=True, slots=True)
class Trained:
    """A model, the size of its file, and what its training cost."""

    model: Model
    size: int
    cpu_seconds: float


def kept(job: Job) -> Trained | None:
    """What an earlier run left, if it is whole and was trained on this spec, by this recipe, with these settings."""
    model = kept_model(job.path, PROBLEMS[job.problem].load(), job.config)
    try:
        record = Record.model_validate_json(_record(job.path).read_bytes())
        if model is None or record.model != digest(job.path):
            return None
        size = job.path.stat().st_size
    except (OSError, ValidationError):
        return None
    if job.what.steps is not None:
        model = model.in_steps(job.what.steps)
    return Trained(model, size, record.cpu_seconds)


def perform(job: Job) -> float:
    """Train, and keep the model with its record; returns CPU seconds. Raises ScenegenError."""
    _record(job.path).unlink(missing_ok=True)
    began = time.process_time()
    train_anew(job.path, PROBLEMS[job.problem].load(), job.config)
    record = Record(model=digest(job.path), cpu_seconds=time.process_time() - began)
    write_whole(_record(job.path), record.model_dump_json(indent=1).encode())
    return record.cpu_seconds


def _record(path: Path) -> Path:
    return path.with_suffix(".json")
