"""The training loop, one for every model."""

from __future__ import annotations

import contextlib
import importlib.util
import math
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import torch

from scenegen.errors import DataError, Diagnostic, RequestError
from scenegen.errors.learning import NO_TIME_TO_TRAIN, UNKNOWN_DEVICE
from scenegen.errors.program import NEW_RATE, TRAINING_DONE, TRAINING_INTERRUPTED
from scenegen.errors.requests import NOT_INSTALLED
from scenegen.lang.spec import CheckedSpec
from scenegen.learn.models.checkpoint import TrainedModel, load_model
from scenegen.learn.models.registry import parse_hyper
from scenegen.learn.training.config import TrainConfig, is_file
from scenegen.learn.training.feed import make_feed
from scenegen.learn.training.gathering import Gathering, Tell
from scenegen.learn.training.session import EpochReport, TrainingSession
from scenegen.learn.training.state import (
    TrainingState,
    can_resume,
    gathered_path,
    load_state,
    state_path,
)
from scenegen.processes.pool import one_thread
from scenegen.processes.process import stop_signals
from scenegen.resources import __version__
from scenegen.scenes.files import check_folder, check_writable, report_write_errors

if TYPE_CHECKING:
    from torch.utils.tensorboard import SummaryWriter


# TensorBoard event files: `--log-dir DIR`, then `tensorboard --logdir DIR`.
#
# Written with TensorBoard's own writer (`pip install "scenegen-dsl[tensorboard]"`, which brings the viewer as well).
# Steps are the optimiser's. A resumed run may write into the folder of the earlier one: of steps that occur twice,
# TensorBoard shows the later ones.


def figures(report: EpochReport) -> dict[str, float]:
    """What a report says, by TensorBoard's tags: `loss/NAME`, `error/LABEL` (mean of |phi - wanted phi| at held-out
    labels), `error` (the mean of these), `score`, `learning_rate` and `scenes_per_second`."""
    found = {f"loss/{name}": value for name, value in report.losses.items()}
    if report.validation is not None:
        found |= {f"error/{label}": value for label, value in report.validation.errors.items()}
        found |= {"error": report.validation.error, "score": report.validation.score}
    return {**found, "learning_rate": report.rate, "scenes_per_second": report.scenes / max(report.seconds, 1e-9)}


@contextlib.contextmanager
def event_log(folder: Path) -> Iterator[Callable[[EpochReport], None]]:
    """A function that writes the figures of each epoch's report into the folder, which is made where it is missing.

    Raises RequestError where TensorBoard is not installed, OutputError where the folder cannot be written to.
    """
    if importlib.util.find_spec("tensorboard") is None:  # told before the work starts
        command = 'pip install "scenegen-dsl[tensorboard]"'
        raise RequestError(NOT_INSTALLED(package="tensorboard", purpose="for event files", command=command))
    with report_write_errors(folder):
        made = [path for path in (folder, *folder.parents) if not path.exists()]
        folder.mkdir(parents=True, exist_ok=True)
    check_folder(folder)
    writer: SummaryWriter | None = None

    def write(report: EpochReport) -> None:
        nonlocal writer
        with report_write_errors(folder):
            if writer is None:
                from torch.utils.tensorboard import SummaryWriter

                # whatever an earlier run wrote from this step on is superseded
                writer = SummaryWriter(str(folder), purge_step=report.step)
            for name, value in figures(report).items():
                writer.add_scalar(name, value, report.step)
            writer.flush()

    try:
        yield write
    finally:
        if writer is not None:
            writer.close()
        for path in made:  # what holds no events is not left behind
            with contextlib.suppress(OSError):
                path.rmdir()


# What a training run that was stopped says.


class Interrupted(KeyboardInterrupt):
    """Training was stopped from outside; the state to go on from is saved beside the model file `path`."""

    def __init__(self, epochs_done: int, epochs: int, path: Path) -> None:
        super().__init__(TRAINING_INTERRUPTED(done=epochs_done, epochs=epochs, path=path))
        self.epochs_done = epochs_done
        self.epochs = epochs
        self.path = path


def train(
    spec: CheckedSpec,
    config: TrainConfig,
    out: Path,
    *,
    resume: bool = False,
    log_dir: Path | None = None,
    on_epoch: Callable[[EpochReport], None] | None = None,
    on_step: Callable[[int, int], None] | None = None,
    on_note: Callable[[Diagnostic], None] | None = None,
    on_gather: Tell | None = None,
    timeout: float = math.inf,
    until: float | None = None,
) -> TrainedModel:
    """Train a model and write it to `out`, with the training state beside it in `out`.train.

    `resume` goes on from that state; on one CPU the result is then bit-equal to that of a run without a break, wherever
    the break was. With more epochs than planned at first, the learning rate, which falls over the plan, follows the
    new plan from there on, and `on_note` says so. On Ctrl-C,
    SIGTERM and SIGHUP the step under way is finished, the exact state (weights, moments, noise generator, place in the
    epoch) is saved and Interrupted raised. Checkpoints are also written every few seconds, at the end of an epoch.

    `on_step` is called after each step with how many are done and planned; `log_dir` gets TensorBoard event files.
    Neither they nor validation change the model by a bit, but for `config.patience`. `on_gather` is called, while the
    training scenes are gathered, with what is being done and how many of how many are there (0 of 0 where that is not
    counted).

    After `timeout` seconds, or at `until` by the monotonic clock, the gathering is given up, with RequestError and
    nothing written; training stops as on Ctrl-C, with the state saved, and what it has come to is the model.
    RequestError where that is not one epoch.

    Raises OutputError where `out` cannot be written (before the work starts), RequestError for options that cannot be
    and for training that diverges, DataError where the state to resume from is missing, damaged or another spec's.
    """
    inputs = [Path(config.data)] if is_file(config.data) else []
    check_writable(out, *inputs)
    check_writable(state_path(out), *inputs)
    check_writable(gathered_path(out), *inputs)
    _check_device(config.device)
    parse_hyper(config.model, config.hyper)  # refuses bad settings before any work is done
    gathering_only = resume and can_resume(out) and not state_path(out).exists()
    saved = load_state(state_path(out), spec, config) if resume and not gathering_only else None
    say = on_note or _silent
    with contextlib.ExitStack() as open_things:
        log = None if log_dir is None else open_things.enter_context(event_log(log_dir))
        open_things.enter_context(one_thread())
        with stop_signals() as stop:
            gathering = Gathering(timeout, on_gather, say, stop, until)
            gathering.keep_in(gathered_path(out), _run_of(spec, config), resume)
            session = _begin_session(spec, config, gathering, saved)
        if saved is not None and not session.model.constant_rate and 0 < saved.config.epochs != config.epochs:
            before = saved.config.epochs
            say(NEW_RATE(epochs=config.epochs, before=before))
        if session.is_done:
            if session.epoch >= config.epochs:
                say(TRAINING_DONE(epochs=session.epoch))
            else:
                say(_stopped_early(session))
            found = _finished_model(out, spec, session.epoch)
            if found is not None:
                gathering.discard()
                return found
            session.save(out)  # a crash came between the state and the model
        else:
            listeners = [each for each in (on_epoch, log) if each is not None]
            if not _run(session, out, listeners, on_step or _silent, gathering.until):
                if not session.epoch:
                    raise RequestError(NO_TIME_TO_TRAIN(seconds=round(timeout, 2), out=out))
                say(TRAINING_INTERRUPTED(late=True, done=session.epoch, epochs=config.epochs, path=out))
            elif session.epoch < config.epochs:
                say(_stopped_early(session))
        if session.is_done:
            gathering.discard()
    return session.trained_model(out)


def _begin_session(
    spec: CheckedSpec, config: TrainConfig, gathering: Gathering, saved: TrainingState | None
) -> TrainingSession:
    """The training scenes, and what is learnt before the first step. An interrupt says how far that was."""
    try:
        feed = make_feed(spec, config, gathering)
        gathering.begin("preparing the model")
        return TrainingSession(spec, config, feed, saved, gathering.check)
    except KeyboardInterrupt as error:
        told = {"account": gathering.account, "kept": gathering.save() or None, "path": gathering.path}
        raise KeyboardInterrupt(TRAINING_INTERRUPTED(**told)) from error


def _run_of(spec: CheckedSpec, config: TrainConfig) -> str:
    """All that the gathered scenes follow from."""
    asked = sorted(config.phi.items())
    return repr((spec.sha256, config.data, config.scenes, config.seed, asked, __version__, np.__version__))


def _finished_model(out: Path, spec: CheckedSpec, epochs: int) -> TrainedModel | None:
    """The model of a file, if it is there after so many epochs."""
    try:
        found = load_model(out, spec)
    except DataError:
        return None
    return found if found.card.epochs_done == epochs else None


def _run(
    session: TrainingSession,
    out: Path,
    on_epoch: list[Callable[[EpochReport], None]],
    on_step: Callable[[int, int], None],
    until: float,
) -> bool:
    """Train; returns whether that came to its end before the time `until`."""
    epochs, steps = session.config.epochs, session.steps
    with stop_signals() as stop:
        while not session.is_done:
            began = time.perf_counter()
            rate = session.rate
            for batch in session.batches():
                if stop.asked is not None:
                    session.save(out)
                    raise Interrupted(session.epoch, epochs, out) from stop.asked
                if time.monotonic() >= until:
                    session.save(out)
                    return False
                rate = session.rate
                session.update(batch)
                on_step(session.epoch * steps + session.step, epochs * steps)
            losses, found = session.end_epoch()
            seconds = time.perf_counter() - began
            done, kept = session.epoch, session.watch.best_epoch if session.watch.best is not None else None
            report = EpochReport(
                done,
                epochs,
                losses,
                seconds,
                found,
                done * steps,
                rate,
                session.feed.scenes,
                done if kept is None else kept + 1,
            )
            for each in on_epoch:
                each(report)
            if not session.is_done and session.save_is_due():
                session.save(out)
        session.save(out)
        if stop.asked is not None:
            raise Interrupted(session.epoch, epochs, out) from stop.asked
    return True


def _stopped_early(session: TrainingSession) -> Diagnostic:
    kept = session.watch.best_epoch
    assert kept is not None
    best = float(session.watch.seen[kept][:-1].mean())
    return TRAINING_DONE(epochs=session.epoch, best=kept + 1, error=best)


def _silent(*_: object) -> None:
    """The default of callbacks: does nothing."""


def _check_device(name: str) -> None:
    device = torch.device(name)
    if device.type == "cuda" and (device.index or 0) >= torch.cuda.device_count():
        raise RequestError(UNKNOWN_DEVICE(name=name, missing=True))
