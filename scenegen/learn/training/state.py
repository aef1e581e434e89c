"""The training state: all that is needed to go on as if nothing had happened, in `NAME.safetensors.train`.

It holds all weights (the model file has the sampler's only), the optimisers' moments, the noise generator, the epoch,
the step within it, the losses and validations so far, and the best weights where these are to be kept. The order of an
epoch's scenes and the data follow from the seed; a checksum tells whether they still do. The file stands on its own: a
crash between writing it and the model file harms neither.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from enum import IntEnum
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import torch
from pydantic import BaseModel, ConfigDict, Field
from torch import Tensor

from scenegen.errors import DataError, RequestError
from scenegen.errors.learning import DAMAGED_MODEL, MODEL_OF_ANOTHER_SPEC, NOTHING_TO_RESUME, OTHER_OPTION_RESUMED
from scenegen.lang.spec import CheckedSpec
from scenegen.learn.models.card import SpecData, spec_data
from scenegen.learn.models.checkpoint import pack, read_card, unpack
from scenegen.learn.training.config import TrainConfig
from scenegen.scenes.files import write_whole

STATE_FORMAT = "scenegen/training"
STATE_FILE = "a training state"
_RUN = ("history", "sums", "watched", "noise")


class _Card(BaseModel):
    model_config = ConfigDict(extra="forbid")

    spec: SpecData
    config: dict[str, Any]
    data_sha256: str
    epoch: Annotated[int, Field(ge=0)]
    step: Annotated[int, Field(ge=0)]
    losses: list[str]


@dataclass(frozen=True, slots=True)
class TrainingState:
    """`epoch` epochs are done and `step` steps of the next. `history` (epochs, K) holds the mean of each loss, `sums`
    (K,) the sums of the epoch under way, `watched` (epochs, L + 1) the errors and the score of each validation, all
    float64; `noise` is a generator's state; `tensors` is the model's; `best` are the weights of the best epoch, None
    where the last is kept."""

    config: TrainConfig
    data_sha256: str
    epoch: int
    step: int
    losses: tuple[str, ...]
    history: Tensor
    sums: Tensor
    watched: Tensor
    noise: Tensor
    tensors: Mapping[str, Tensor]
    best: Mapping[str, Tensor] | None = None


def state_path(out: Path) -> Path:
    """Where the training state of a model file lies."""
    return out.with_name(f"{out.name}.train")


def gathered_path(out: Path) -> Path:
    """Where the scenes of a model file lie that are gathered for its training
    (scenegen.learn.training.gathering), until that is done."""
    return out.with_name(f"{out.name}.scenes")


def can_resume(out: Path) -> bool:
    """Whether there is anything to resume."""
    return state_path(out).exists() or gathered_path(out).exists()


def save_state(path: Path, spec: CheckedSpec, state: TrainingState) -> None:
    """Write a training state, whole or not at all. Raises OutputError."""
    card = _Card(
        spec=spec_data(spec),
        config=asdict(state.config),
        data_sha256=state.data_sha256,
        epoch=state.epoch,
        step=state.step,
        losses=list(state.losses),
    )
    extra = {f"run.{name}": getattr(state, name) for name in _RUN}
    extra |= {f"best.{name}": tensor for name, tensor in (state.best or {}).items()}
    write_whole(path, pack(STATE_FORMAT, card.model_dump_json(), {**state.tensors, **extra}))


def load_state(path: Path, spec: CheckedSpec, config: TrainConfig) -> TrainingState:
    """Read the state that a run with `config` on `spec` is to go on from.

    Raises DataError for a file that is missing, damaged or of another spec; RequestError where the options differ
    (only --epochs may).
    """
    if not path.exists():
        raise DataError(NOTHING_TO_RESUME(path=path))
    text, tensors = unpack(path, STATE_FORMAT, STATE_FILE)
    card = read_card(_Card, text, path, STATE_FILE)
    if card.spec.sha256 != spec.sha256:
        raise DataError(MODEL_OF_ANOTHER_SPEC(state=path, found=card.spec.name, wanted=spec.name))
    try:
        kept = {name: value for name, value in card.config.items() if name != "recipe"}  # of earlier versions
        before = TrainConfig(**kept)
        history, sums, watched, noise = (tensors.pop(f"run.{name}") for name in _RUN)
    except (TypeError, KeyError, RequestError) as error:
        raise DataError(DAMAGED_MODEL(path=path, what=STATE_FILE)) from error
    _check_same(before, config)
    width = len(card.losses)
    shapes_fit = history.shape == (card.epoch, width) and sums.shape == (width,)
    shapes_fit = shapes_fit and watched.shape == (card.epoch, len(spec.labels) + 1)
    types_fit = history.dtype == sums.dtype == watched.dtype == torch.float64 and noise.dtype == torch.uint8
    best = {name[5:]: tensors.pop(name) for name in sorted(tensors) if name.startswith("best.")}
    if not (shapes_fit and types_fit and bool(best) == (config.patience is not None and card.epoch > 0)):
        raise DataError(DAMAGED_MODEL(path=path, what=STATE_FILE))
    return TrainingState(
        before,
        card.data_sha256,
        card.epoch,
        card.step,
        tuple(card.losses),
        history,
        sums,
        watched,
        noise,
        tensors,
        best or None,
    )


def _check_same(before: TrainConfig, now: TrainConfig) -> None:
    found = [
        OTHER_OPTION_RESUMED(argument=name, before=repr(was), now=repr(asked))
        for name, was, asked in before.differences(now)
    ]
    if found:
        raise RequestError(*found)


# Independent streams of random numbers from one seed.


class Stream(IntEnum):
    """What a stream is for. The numbers are part of what a seed means: never change one."""

    DATA = 0
    WEIGHTS = 1
    ORDER = 2
    NOISE = 3
    VALIDATION = 4
    BRANCHES = 5


def stream(seed: int, *key: int, device: torch.device | str = "cpu") -> torch.Generator:
    """A generator that depends on the seed and the key alone."""
    words = np.random.SeedSequence((seed, *key)).generate_state(1, np.uint64)
    return torch.Generator(device).manual_seed(int(words[0]) >> 1)
