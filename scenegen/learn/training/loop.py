"""The training loop, one for every model."""

from __future__ import annotations

import contextlib
import importlib.util
import math
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from scenegen.errors import DataError, Diagnostic, RequestError
from scenegen.errors.learning import DIVERGED, NO_DEVICE, NO_TIME_FOR_AN_EPOCH, OTHER_DATA_RESUMED, STATE_MISFIT
from scenegen.errors.program import ALREADY_DONE, NEW_RATE, STOPPED_EARLY, TRAINING_INTERRUPTED
from scenegen.errors.requests import NOT_INSTALLED
from scenegen.lang.spec import CheckedSpec
from scenegen.learn.models.base import SceneModel, SpecLoss
from scenegen.learn.models.card import DataData, LabelData, LossData, ModelCard, ValidationData, spec_data
from scenegen.learn.models.checkpoint import load_model, packed, save_model
from scenegen.learn.models.codec import Codec, Examples
from scenegen.learn.models.layout import Layout, layout_of
from scenegen.learn.models.registry import model_class, parse_hyper
from scenegen.learn.models.trained import TrainedModel
from scenegen.learn.training.config import TrainConfig
from scenegen.learn.training.datasets.gathering import Gathering, Tell
from scenegen.learn.training.datasets.registry import DATASETS, is_file
from scenegen.learn.training.feed import Feed, make_feed
from scenegen.learn.training.recipes import CONSTANT
from scenegen.learn.training.state import (
    Stream,
    TrainingState,
    begun,
    gathered_path,
    load_state,
    save_state,
    state_path,
    stream,
)
from scenegen.learn.training.validate import EpochReport, Validation, validate
from scenegen.processes.pool import one_thread
from scenegen.processes.process import stop_signals
from scenegen.scenes.data import WorkspaceData
from scenegen.scenes.files import check_folder, check_writable, reported, write_whole

if TYPE_CHECKING:
    from torch.utils.tensorboard import SummaryWriter


# --------------------------------------------------------------------------------------------------------------------
# One training run: its model, data and place in time, and how it goes to disk and comes back.


# --------------------------------------------------------------------------------------------------------------------
# Early stopping: the validations of a run, the best of them, and when patience ends.


class EarlyStopping:
    """Mutable. `seen` holds the errors and the score of each epoch, (L + 1,) float64. With a patience, `best` are the
    sampler's weights of the epoch `kept` (from 0) whose mean error was least, the first of equals."""

    def __init__(
        self, patience: int | None, seen: list[Tensor] | None = None, best: Mapping[str, Tensor] | None = None
    ) -> None:
        self.patience = patience
        self.seen = seen or []
        self.best = best

    @property
    def kept(self) -> int | None:
        """The epoch with the least error so far."""
        errors = [float(row[:-1].mean()) for row in self.seen]
        return errors.index(min(errors)) if errors else None

    @property
    def tired(self) -> bool:
        """Whether the last `patience` epochs brought nothing better."""
        kept = self.kept
        return self.patience is not None and kept is not None and len(self.seen) - 1 - kept >= self.patience

    def see(self, found: Validation, model: SceneModel) -> None:
        """Take note of an epoch that is done."""
        self.seen.append(torch.tensor([*found.errors.values(), found.score], dtype=torch.float64))
        if self.patience is not None and self.kept == len(self.seen) - 1:
            self.best = {name: tensor.cpu() for name, tensor in model.sampler_state().items()}

    def table(self, labels: int) -> Tensor:
        """(epochs, L + 1) float64."""
        return torch.stack(self.seen) if self.seen else torch.zeros(0, labels + 1, dtype=torch.float64)


SUMMARY = 100  # epochs whose losses a model file keeps
SAVE_EVERY = 5.0  # seconds between checkpoints, at least
SAVE_SHARE = 0.01  # of the time, at most, for writing them


class TrainingSession:
    """Mutable: `epoch` epochs are done and `step` steps of the next."""

    def __init__(
        self,
        spec: CheckedSpec,
        config: TrainConfig,
        feed: Feed,
        saved: TrainingState | None,
        check: Callable[[], None] = lambda: None,
    ) -> None:
        """`check` is called often while parts of the model learn by themselves, and may raise."""
        self.spec = spec
        self.config = config
        self.feed = feed
        self.device = torch.device(config.device)
        self.noise = stream(config.seed, Stream.NOISE, device=self.device)
        self.spec_loss = SpecLoss(spec.core, feed.table, Codec(spec.workspace, len(spec.core.objects)))
        self.model = new_model(spec, config, len(feed.table))
        self.steps = feed.steps
        self.epoch = self.step = 0
        self.losses: tuple[str, ...] = ()
        self.history: list[Tensor] = []
        self.sums: Tensor | None = None
        self.watch = EarlyStopping(config.patience)
        self._held = feed.held.to(self.device)
        if saved is None:
            self.model.initialise(stream(config.seed, Stream.WEIGHTS))
            self.model.fit(feed.fitting)
            self.model.prepare(feed.fitting, stream(config.seed, Stream.BRANCHES), check)
            self.model.to(self.device)
            self.model.start(config.lr, self.spec_loss)
        else:
            self._take_up(saved)
        self._saved_at = time.monotonic()
        self._save_cost = 0.0

    def _take_up(self, saved: TrainingState) -> None:
        if saved.data_sha256 != self.feed.sha256:
            made = "cannot be rebuilt as it was" if self.config.data in DATASETS else "is not what it was"
            raise DataError(OTHER_DATA_RESUMED(what=made))
        try:
            self.model.restore(saved.tensors, self.config.lr, self.spec_loss, self.device)
            self.noise.set_state(saved.noise)
            self.watch = EarlyStopping(self.config.patience, list(saved.watched), saved.best)
            if saved.best is not None:
                check_best(saved.best, self.model.sampler_state())
        except (RuntimeError, TypeError, ValueError) as error:
            raise DataError(STATE_MISFIT()) from error
        self.epoch, self.step, self.losses = saved.epoch, saved.step, saved.losses
        self.history = list(saved.history)
        self.sums = saved.sums.to(self.device) if saved.losses else None

    @property
    def done(self) -> bool:
        """Whether all epochs are done, or patience is at its end."""
        return self.epoch >= self.config.epochs or self.watch.tired

    @property
    def rate(self) -> float:
        """The learning rate of the next step."""
        return self.config.rate(self.epoch * self.steps + self.step, self.config.epochs * self.steps)

    def batches(self) -> Iterator[Examples]:
        """What is left of the epoch under way."""
        return self.feed.batches(self.epoch, self.step)

    def update(self, batch: Examples) -> None:
        """One step."""
        rate = self.rate
        for optimiser in self.model.optimisers.values():
            for group in optimiser.param_groups:
                group["lr"] = rate
        losses = self.model.update(batch, self.noise)
        values = torch.stack(list(losses.values()))
        if self.sums is None:
            self.losses = tuple(losses)
            self.sums = torch.zeros(len(losses), dtype=torch.float64, device=self.device)
        self.sums += values
        self.step += 1

    def end_epoch(self) -> tuple[dict[str, float], Validation]:
        """Close the epoch; its mean losses, and how good the model is now. Raises RequestError where the training has
        diverged."""
        self._check_finite()
        generator = stream(self.config.seed, Stream.VALIDATION, device=self.device)
        found = validate(self.model, self.spec_loss, self._held, self.spec.labels, generator)
        self._check_finite(found)
        means = torch.zeros(0) if self.sums is None else (self.sums / self.steps).cpu()
        self.history.append(means)
        self.watch.see(found, self.model)
        self.sums = None if self.sums is None else torch.zeros_like(self.sums)
        self.epoch, self.step = self.epoch + 1, 0
        return dict(zip(self.losses, means.tolist(), strict=True)), found

    def save(self, out: Path) -> None:
        """Write the training state and the model file. Raises OutputError; RequestError where training has diverged."""
        self._check_finite()
        began = time.monotonic()
        width = len(self.losses)
        state = TrainingState(
            self.config,
            self.feed.sha256,
            self.epoch,
            self.step,
            self.losses,
            torch.stack(self.history) if self.history else torch.zeros(0, width, dtype=torch.float64),
            torch.zeros(width, dtype=torch.float64) if self.sums is None else self.sums,
            self.watch.table(len(self.spec.labels)),
            self.noise.get_state(),
            self.model.training_state(),
            self.watch.best,
        )
        save_state(state_path(out), self.spec, state)
        card = self.card()
        if self.watch.best is None:
            save_model(out, self.model, card, self.feed.regions)
        else:
            write_whole(out, packed(self.model, card, self.feed.regions, self.watch.best))
        self._saved_at = time.monotonic()
        self._save_cost = self._saved_at - began

    def save_is_due(self) -> bool:
        """Whether a checkpoint now costs no more than its share of the time. When to write changes no result."""
        return time.monotonic() - self._saved_at >= max(SAVE_EVERY, self._save_cost / SAVE_SHARE)

    def card(self) -> ModelCard:
        """The metadata of the model file. It holds no time of day and no duration, so that runs can be compared."""
        every = -(-len(self.history) // SUMMARY) or 1
        chosen = sorted(range(len(self.history) - 1, -1, -every))
        kept = self.watch.kept if self.watch.best is not None else None
        shown = sorted({*chosen, kept}) if kept is not None else chosen  # the kept epoch's figures belong into the card
        watched = self.watch.seen
        space, model = self.spec.workspace, self.model
        ranges = zip(self.spec.labels, model.label_lowest.tolist(), model.label_highest.tolist(), strict=True)
        return ModelCard(
            scenegen=version("scenegen"),
            model=self.config.model,
            recipe=self.config.recipe,
            layout=model.layout,
            hyper=model.hyper.model_dump(),
            spec=spec_data(self.spec),
            workspace=WorkspaceData(x=space.x, y=space.y),
            objects=list(self.spec.objects),
            labels=[LabelData(name=name, lowest=low, highest=high) for name, low, high in ranges],
            training=asdict(self.config),
            epochs_done=self.epoch,
            losses=LossData(
                epochs=[index + 1 for index in chosen],
                means={
                    name: [float(self.history[index][column]) for index in chosen]
                    for column, name in enumerate(self.losses)
                },
            ),
            data=DataData(scenes=self.feed.scenes, held_out=len(self._held), sha256=self.feed.sha256),
            validation=ValidationData(
                epochs=[index + 1 for index in shown],
                errors={
                    name: [float(watched[index][column]) for index in shown]
                    for column, name in enumerate(self.spec.labels)
                },
                scores=[float(watched[index][-1]) for index in shown],
            ),
            kept_epoch=None if kept is None else kept + 1,
            corrected=model.branched,
        )

    def _check_finite(self, found: Validation | None = None) -> None:
        bad = [] if self.sums is None else (~torch.isfinite(self.sums)).nonzero().flatten().tolist()
        fine = all(bool(torch.isfinite(tensor).all()) for tensor in self.model.state_dict().values())
        if fine and not bad and (found is None or found.finite()):
            return
        what = f"the loss `{self.losses[bad[0]]}` is" if bad else "the model's output is" if fine else "the weights are"
        raise RequestError(DIVERGED(epoch=self.epoch + 1, what=what, lr=self.config.lr))


def new_model(spec: CheckedSpec, config: TrainConfig, branches: int = 1) -> SceneModel:
    """The model, without weights. Raises RequestError for settings it does not have."""
    hyper = parse_hyper(config.model, config.hyper, config.recipe)
    kind = model_class(config.model, config.recipe)
    plain = Layout(objects=len(spec.core.objects), labels=len(spec.labels))
    return kind(layout_of(spec.core, branches) if kind.branched else plain, hyper)


def check_best(best: Mapping[str, Tensor], like: Mapping[str, Tensor]) -> None:
    """Raises ValueError unless the weights of the best epoch are of the model at hand."""
    fit = best.keys() == like.keys() and all(
        best[name].shape == like[name].shape and bool(torch.isfinite(best[name]).all()) for name in like
    )
    if not fit:
        raise ValueError("the weights of the best epoch do not fit the model")


# --------------------------------------------------------------------------------------------------------------------
# TensorBoard event files: `--log-dir DIR`, then `tensorboard --logdir DIR`.
#
# Written with TensorBoard's own writer (`pip install "scenegen[tensorboard]"`, which brings the viewer as well).
# Steps are the optimiser's. A resumed run may write into the folder of the earlier one: of steps that occur twice,
# TensorBoard shows the later ones.


class EventLog:
    """Called with the report of each epoch, writes its figures: `loss/NAME`, `error/LABEL` (mean of |phi - wanted phi|
    at held-out labels), `error` (the mean of these), `score`, `learning_rate` and `scenes_per_second`."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._writer: SummaryWriter | None = None

    def __call__(self, report: EpochReport) -> None:
        with reported(self._folder):
            if self._writer is None:
                from torch.utils.tensorboard import SummaryWriter

                # whatever an earlier run wrote from this step on is superseded
                self._writer = SummaryWriter(str(self._folder), purge_step=report.step)
            for name, value in figures(report).items():
                self._writer.add_scalar(name, value, report.step)
            self._writer.flush()

    def close(self) -> None:
        if self._writer is not None:
            self._writer.close()


def figures(report: EpochReport) -> dict[str, float]:
    """What a report says, by TensorBoard's tags."""
    found = {f"loss/{name}": value for name, value in report.losses.items()}
    if report.validation is not None:
        found |= {f"error/{label}": value for label, value in report.validation.errors.items()}
        found |= {"error": report.validation.error, "score": report.validation.score}
    return {**found, "learning_rate": report.rate, "scenes_per_second": report.scenes / max(report.seconds, 1e-9)}


@contextlib.contextmanager
def event_log(folder: Path) -> Iterator[EventLog]:
    """A log that writes into the folder, which is made where it is missing.

    Raises RequestError where TensorBoard is not installed, OutputError where the folder cannot be written to.
    """
    if importlib.util.find_spec("tensorboard") is None:  # told before the work starts
        command = 'pip install "scenegen[tensorboard]"'
        raise RequestError(NOT_INSTALLED(package="tensorboard", purpose="for event files", command=command))
    with reported(folder):
        made = [path for path in (folder, *folder.parents) if not path.exists()]
        folder.mkdir(parents=True, exist_ok=True)
    check_folder(folder)
    log = EventLog(folder)
    try:
        yield log
    finally:
        log.close()
        for path in made:  # what holds no events is not left behind
            with contextlib.suppress(OSError):
                path.rmdir()


# --------------------------------------------------------------------------------------------------------------------
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
) -> TrainedModel:
    """Train a model and write it to `out`, with the training state beside it in `out`.train.

    `resume` goes on from that state; on one CPU the result is then bit-equal to that of a run without a break, wherever
    the break was. With more epochs than planned at first that holds for recipes with a constant rate alone (`paper`):
    a rate that falls over the plan follows the new plan from there on, and `on_note` says so. On Ctrl-C,
    SIGTERM and SIGHUP the step under way is finished, the exact state (weights, moments, noise generator, place in the
    epoch) is saved and Interrupted raised. Checkpoints are also written every few seconds, at the end of an epoch.

    `on_step` is called after each step with how many are done and planned; `log_dir` gets TensorBoard event files.
    Neither they nor validation change the model by a bit, but for `config.patience`. `on_gather` is called, while the
    training scenes are gathered, with what is being done and how many of how many are there (0 of 0 where that is not
    counted).

    After `timeout` seconds the gathering is given up, with RequestError and nothing written; training stops as on
    Ctrl-C, with the state saved, and what it has come to is the model. RequestError where that is not one epoch.

    Raises OutputError where `out` cannot be written (before the work starts), RequestError for options that cannot be
    and for training that diverges, DataError where the state to resume from is missing, damaged or another spec's.
    """
    inputs = [Path(config.data)] if is_file(config.data) else []
    check_writable(out, *inputs)
    check_writable(state_path(out), *inputs)
    check_writable(gathered_path(out), *inputs)
    _check_device(config.device)
    parse_hyper(config.model, config.hyper, config.recipe)  # refuses bad settings before any work is done
    gathering_only = resume and begun(out) and not state_path(out).exists()
    saved = load_state(state_path(out), spec, config) if resume and not gathering_only else None
    say = on_note or _silent
    with contextlib.ExitStack() as open_things:
        log = None if log_dir is None else open_things.enter_context(event_log(log_dir))
        open_things.enter_context(one_thread())
        with stop_signals() as stop:
            gathering = Gathering(timeout, on_gather, say, stop)
            gathering.keep_in(gathered_path(out), _run_of(spec, config), resume)
            session = _begun(spec, config, gathering, saved)
        if saved is not None and config.recipe not in CONSTANT and 0 < saved.config.epochs != config.epochs:
            before = saved.config.epochs
            say(NEW_RATE(epochs=config.epochs, before=before))
        if session.done:
            if session.epoch >= config.epochs:
                say(ALREADY_DONE(epochs=session.epoch))
            else:
                say(_stopped_early(session))
            if not _holds(out, spec, session.epoch):  # a crash came between the state and the model
                session.save(out)
        else:
            listeners = [each for each in (on_epoch, log) if each is not None]
            if not _run(session, out, listeners, on_step or _silent, gathering.until):
                if not session.epoch:
                    raise RequestError(NO_TIME_FOR_AN_EPOCH(seconds=timeout, path=out))
                say(TRAINING_INTERRUPTED(late=True, done=session.epoch, epochs=config.epochs, path=out))
            elif session.epoch < config.epochs:
                say(_stopped_early(session))
        if session.done:
            gathering.discard()
    return load_model(out, spec)


def _begun(
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
    return repr((spec.sha256, config.data, config.scenes, config.seed, asked, version("scenegen"), np.__version__))


def _holds(out: Path, spec: CheckedSpec, epochs: int) -> bool:
    """Whether a file is a model after so many epochs."""
    try:
        return load_model(out, spec).card.epochs_done == epochs
    except DataError:
        return False


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
        while not session.done:
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
            done, kept = session.epoch, session.watch.kept if session.watch.best is not None else None
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
            if not session.done and session.save_is_due():
                session.save(out)
        session.save(out)
        if stop.asked is not None:
            raise Interrupted(session.epoch, epochs, out) from stop.asked
    return True


def _stopped_early(session: TrainingSession) -> Diagnostic:
    kept = session.watch.kept
    assert kept is not None
    best = float(session.watch.seen[kept][:-1].mean())
    return STOPPED_EARLY(epochs=session.epoch, best=kept + 1, error=best)


def _silent(*_: object) -> None:
    """Whom it does not concern."""


def _check_device(name: str) -> None:
    device = torch.device(name)
    if device.type == "cuda" and (device.index or 0) >= torch.cuda.device_count():
        raise RequestError(NO_DEVICE(name=name))
