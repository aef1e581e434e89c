"""Trainings that are kept: a model file and a record of how it came about; what is there is not trained again.

A model file stands only with its record, which is written last: a training that was broken off is begun anew.
"""

from __future__ import annotations

import contextlib
import hashlib
import time
from dataclasses import dataclass
from pathlib import Path

from pydantic import BaseModel, ConfigDict, FiniteFloat, ValidationError

from scenegen.api.train import Model, load_model, train
from scenegen.errors import DataError
from scenegen.experiments.plan import FULL, QUICK
from scenegen.experiments.problems import PROBLEMS
from scenegen.experiments.variants import VARIANTS, Variant
from scenegen.formats.files import write_whole
from scenegen.training.state import state_path

FOLDER = "trained"


class Record(BaseModel):
    """How a model file came about: what was asked for, which file that made, and the CPU seconds that it took."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    spec: str
    family: str
    seed: int
    options: dict[str, int | str]
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
        """The model file."""
        size = "quick-" if self.quick else ""
        return Path(self.folder) / f"{size}{self.problem}-{self.what.family}-{self.what.recipe}-{self.seed}.safetensors"

    @property
    def options(self) -> dict[str, int | str]:
        return self.what.options(PROBLEMS[self.problem], QUICK if self.quick else FULL)

    def __str__(self) -> str:
        return f"{PROBLEMS[self.problem].title}: {self.what.name}, seed {self.seed}"


@dataclass(frozen=True, slots=True)
class Trained:
    """A model, the size of its file, and what its training cost."""

    model: Model
    size: int
    cpu_seconds: float


def kept(job: Job) -> Trained | None:
    """What an earlier run left, if it is whole and came about in just this way."""
    spec = PROBLEMS[job.problem].load()
    try:
        record = Record.model_validate_json(_record(job.path).read_bytes())
        data = job.path.read_bytes()
        asked = (spec.checked.sha256, job.what.family, job.seed, job.options)
        if (record.spec, record.family, record.seed, record.options) != asked or record.model != _digest(data):
            return None
        return Trained(load_model(job.path, spec), len(data), record.cpu_seconds)
    except (OSError, ValidationError, DataError):
        return None


def perform(job: Job) -> float:
    """Train, and keep the model with its record; returns CPU seconds. Raises ScenegenError."""
    spec = PROBLEMS[job.problem].load()
    _record(job.path).unlink(missing_ok=True)
    began = time.process_time()
    train(
        spec, job.what.family, out=job.path, seed=job.seed, **{k: v for k, v in job.options.items() if k != "recipe"}
    )  # TEMP
    seconds = time.process_time() - began
    with contextlib.suppress(OSError):
        state_path(job.path).unlink()  # a finished training is not resumed
    record = Record(
        spec=spec.checked.sha256,
        family=job.what.family,
        seed=job.seed,
        options=job.options,
        model=_digest(job.path.read_bytes()),
        cpu_seconds=seconds,
    )
    write_whole(_record(job.path), record.model_dump_json(indent=1).encode())
    return seconds


def _record(path: Path) -> Path:
    return path.with_suffix(".json")


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()
