"""The training loop, one for every model."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import torch

from scenegen.data.table import dataset_maker
from scenegen.engine.interrupt import stop_signals
from scenegen.errors import Diagnostic, RequestError
from scenegen.formats.files import check_writable
from scenegen.lang.spec import CheckedSpec
from scenegen.models.checkpoint import load_model
from scenegen.models.table import parse_hyper
from scenegen.models.trained import TrainedModel
from scenegen.training.config import TrainConfig
from scenegen.training.interrupt import Interrupted
from scenegen.training.seeds import Stream, stream
from scenegen.training.session import Session
from scenegen.training.state import load_state, state_path


@dataclass(frozen=True, slots=True)
class EpochReport:
    """An epoch that is done: its number (from 1) of how many, the mean of each loss, and the seconds that its steps
    took in this process."""

    epoch: int
    epochs: int
    losses: Mapping[str, float]
    seconds: float


def train(
    spec: CheckedSpec,
    config: TrainConfig,
    out: Path,
    *,
    resume: bool = False,
    on_epoch: Callable[[EpochReport], None] | None = None,
    on_note: Callable[[str], None] | None = None,
) -> TrainedModel:
    """Train a model and write it to `out`, with the training state beside it in `out`.train.

    `resume` goes on from that state; on one CPU the result is then bit-equal to that of a run without a break, wherever
    the break was, more epochs than planned at first included. On Ctrl-C and SIGTERM the step under way is finished, the
    exact state (weights, moments, noise generator, place in the epoch) is saved and Interrupted raised. Checkpoints are
    also written every few seconds, at the end of an epoch. `on_note` is told what else is worth knowing.

    Raises OutputError where `out` cannot be written (before the work starts), RequestError for options that cannot be
    and for training that diverges, DataError where the state to resume from is missing, damaged or another spec's.
    """
    check_writable(out)
    check_writable(state_path(out))
    _check_device(config.device)
    parse_hyper(config.model, config.hyper, config.recipe)  # refuses bad settings before any work is done
    saved = load_state(state_path(out), spec, config) if resume else None
    with _one_thread():
        data = dataset_maker(config.data)(spec, config.scenes, stream(config.seed, Stream.DATA))
        session = Session(spec, config, data, saved)
        if session.epoch >= config.epochs:
            if on_note is not None:
                on_note(f"{session.epoch} epochs are already done; to train on, ask for more with --epochs")
            if not out.exists():
                session.save(out)
        else:
            _run(session, out, on_epoch)
    return load_model(out, spec)


def _run(session: Session, out: Path, on_epoch: Callable[[EpochReport], None] | None) -> None:
    epochs, size = session.config.epochs, session.config.batch_size
    with stop_signals() as stop:
        while session.epoch < epochs:
            began = time.perf_counter()
            examples = session.shuffled()
            while session.step < session.steps:
                if stop.asked:
                    session.save(out)
                    raise Interrupted(session.epoch, epochs, out)
                session.update(examples.take(slice(session.step * size, (session.step + 1) * size)))
            losses = session.end_epoch()
            if on_epoch is not None:
                on_epoch(EpochReport(session.epoch, epochs, losses, time.perf_counter() - began))
            if session.epoch < epochs and session.save_is_due():
                session.save(out)
        session.save(out)
        if stop.asked:
            raise Interrupted(session.epoch, epochs, out)


def _check_device(name: str) -> None:
    device = torch.device(name)
    if device.type == "cuda" and (device.index or 0) >= torch.cuda.device_count():
        raise RequestError(Diagnostic(f"there is no device `{name}` here", help="write `--device cpu`"))


@contextlib.contextmanager
def _one_thread() -> Iterator[None]:
    """torch on one thread: at batch 32 a second one costs more than it brings, and sums keep their order."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)
