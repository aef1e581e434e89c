"""Models that are trained once and kept in the cache: whole files, trained on this spec with these settings."""

from __future__ import annotations

import contextlib
import hashlib
import time
from dataclasses import asdict, dataclass
from pathlib import Path

from pydantic import BaseModel, ConfigDict, FiniteFloat

from experiments.cache import Cache, Request
from scenegen.api.spec import Spec
from scenegen.errors import DataError
from scenegen.learn.model import Model, load_model
from scenegen.learn.models.registry import parse_hyper
from scenegen.learn.train import train
from scenegen.learn.training.config import TrainConfig
from scenegen.learn.training.state import state_path


class Record(BaseModel):
    """The SHA-256 of a finished model file, and the CPU seconds that its training took, data included."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    model: str
    cpu_seconds: FiniteFloat


@dataclass(frozen=True, slots=True)
class Training:
    """A model to train. `name` is the readable part of its files' names."""

    name: str
    spec: Spec
    config: TrainConfig

    @property
    def request(self) -> Request:
        """All that the model follows from."""
        hyper = parse_hyper(self.config.model, self.config.hyper).model_dump(mode="json")
        return {"spec": self.spec.checked.sha256, **asdict(self.config), "hyper": hyper}

    def path(self, cache: Cache) -> Path:
        """The model file."""
        return cache.path(self.name, self.request, ".safetensors")


@dataclass(frozen=True, slots=True)
class Trained:
    """A model, the size of its file in bytes, and what its training cost."""

    model: Model
    size: int
    cpu_seconds: float


def find(cache: Cache, training: Training) -> Trained | None:
    """The model that an earlier run trained, if its file is as it was written."""
    path = training.path(cache)
    record = cache.find(training.name, training.request, Record)
    try:
        if record is None or record.model != _digest(path):
            return None
        return Trained(load_model(path, training.spec), path.stat().st_size, record.cpu_seconds)
    except (OSError, DataError):
        return None


def train_now(cache: Cache, training: Training) -> float:
    """Train, and keep the model with its record, which is written last; returns CPU seconds. Raises ScenegenError."""
    path, began = training.path(cache), time.process_time()
    _forget(path)
    train(training.spec, out=path, **asdict(training.config))
    _forget(path)
    record = Record(model=_digest(path), cpu_seconds=time.process_time() - began)
    cache.keep(training.name, training.request, record)
    return record.cpu_seconds


def ensure(cache: Cache, training: Training) -> bool:
    """Train unless an earlier run did; whether it was trained now. Raises ScenegenError."""
    if find(cache, training) is not None:
        return False
    train_now(cache, training)
    return True


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _forget(path: Path) -> None:
    """Remove what an interrupted training would be resumed from; a finished one has no use for it."""
    with contextlib.suppress(OSError):
        state_path(path).unlink()
