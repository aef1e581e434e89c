"""One training run: its model, data and place in time; how good it is by now; and how it goes to disk and back."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import torch
from torch import Tensor

from scenegen.errors import DataError, RequestError
from scenegen.errors.learning import DATA_CHANGED, DIVERGED, STATE_MISFIT
from scenegen.lang.spec import CheckedSpec
from scenegen.learn.models.base import SceneModel, SpecLoss
from scenegen.learn.models.card import (
    MODEL_FORMAT,
    DataData,
    LabelData,
    LossData,
    ModelCard,
    ValidationData,
    layout_of,
    spec_data,
)
from scenegen.learn.models.checkpoint import TrainedModel, as_trained, pack, tensors_of
from scenegen.learn.models.codec import Codec, Examples
from scenegen.learn.models.registry import model_class, parse_hyper
from scenegen.learn.training.config import DATASETS, TrainConfig
from scenegen.learn.training.feed import Feed
from scenegen.learn.training.state import Stream, TrainingState, save_state, state_path, stream
from scenegen.pose import ANGLES, LENGTHS, TWO_PI, rows_along
from scenegen.resources import __version__
from scenegen.scenes.data import WorkspaceData
from scenegen.scenes.files import write_whole

# How good a model is at this moment, on labels that it has never trained on.
#
# For every held-out scene the model makes two scenes with that scene's phi. `errors` is how far their phi is from what
# was wanted. `score` is the energy score of the made scenes against the held-out one (Gneiting and Raftery, "Strictly
# proper scoring rules, prediction, and estimation", 2007, section 4.3): the lower, the closer the two distributions.
# The error alone does not see a model that makes one and the same good scene again and again; the score does.


@dataclass(frozen=True, slots=True)
class Validation:
    """`errors`: mean of |phi - wanted phi| for each label, in the unit of phi; `score`: see above."""

    errors: Mapping[str, float]
    score: float

    @property
    def error(self) -> float:
        """The mean of all errors: what early stopping goes by."""
        return sum(self.errors.values()) / len(self.errors)

    def finite(self) -> bool:
        return math.isfinite(self.error) and math.isfinite(self.score)


@torch.no_grad()
def validate(
    model: SceneModel, spec_loss: SpecLoss, held: Examples, labels: tuple[str, ...], generator: torch.Generator
) -> Validation:
    """Held-out scenes, model and generator on one device. The outcome depends on the generator alone: with a generator
    of the same seed each time, validations of a run use the same noise and can be compared."""
    made = [model.sample(len(held), held.phi, generator) for _ in range(2)]
    errors = torch.stack([(spec_loss.phi(x) - held.phi).abs().mean(0) for x in made]).mean(0)
    truth, one, two = (_points(x) for x in (held.x, *made))
    score = 0.5 * (_mean_distance(truth, one) + _mean_distance(truth, two) - _mean_distance(one, two))
    values = torch.cat([errors.double(), score[None].double()]).tolist()
    return Validation(dict(zip(labels, values, strict=False)), values[-1])


def _points(x: Tensor) -> Tensor:
    """Unit coordinates (B, 3N) -> (B, 4N): positions, and headings on a circle with the circumference 1."""
    turns = [x[:, rows_along(axis)] * TWO_PI for axis in ANGLES]
    places = [x[:, rows_along(axis)] for axis in LENGTHS]
    return torch.cat([*places, *(function(turn) / TWO_PI for function in (torch.cos, torch.sin) for turn in turns)], 1)


def _mean_distance(a: Tensor, b: Tensor) -> Tensor:
    """The mean Euclidean distance of rows."""
    return (a - b).square().sum(1).sqrt().mean()


# What training reports after each epoch.


@dataclass(frozen=True, slots=True)
class EpochReport:
    """An epoch that is done: its number (from 1) of how many, the mean of each loss, and the seconds that its steps
    took in this process; how good the model is now, the steps of all epochs so far, the learning rate of the last of
    them, the scenes of an epoch, and the last epoch (from 1) that the model file would hold."""

    epoch: int
    epochs: int
    losses: Mapping[str, float]
    seconds: float
    validation: Validation | None = None
    step: int = 0
    rate: float = 0.0
    scenes: int = 0
    kept: int = 0


# One training run: its model, data and place in time, and how it goes to disk and comes back.


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
    def best_epoch(self) -> int | None:
        """The epoch with the least error so far."""
        errors = [float(row[:-1].mean()) for row in self.seen]
        return errors.index(min(errors)) if errors else None

    @property
    def is_tired(self) -> bool:
        """Whether the last `patience` epochs brought nothing better."""
        kept = self.best_epoch
        return self.patience is not None and kept is not None and len(self.seen) - 1 - kept >= self.patience

    def see(self, found: Validation, model: SceneModel) -> None:
        """Take note of an epoch that is done."""
        self.seen.append(torch.tensor([*found.errors.values(), found.score], dtype=torch.float64))
        if self.patience is not None and self.best_epoch == len(self.seen) - 1:
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
            raise DataError(DATA_CHANGED(what=made))
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
    def is_done(self) -> bool:
        """Whether all epochs are done, or patience is at its end."""
        return self.epoch >= self.config.epochs or self.watch.is_tired

    @property
    def rate(self) -> float:
        """The learning rate of the next step."""
        if self.model.constant_rate:
            return self.config.lr
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
        text, tensors = self._contents()
        write_whole(out, pack(MODEL_FORMAT, text, tensors))
        self._saved_at = time.monotonic()
        self._save_cost = self._saved_at - began

    def _contents(self) -> tuple[str, dict[str, Tensor]]:
        """The card and the tensors of the model file."""
        found = tensors_of(self.model, self.feed.regions, self.watch.best)
        return self.card().model_dump_json(), {name: tensor.detach().cpu() for name, tensor in found.items()}

    def trained_model(self, out: Path) -> TrainedModel:
        """The model as it is in its file."""
        text, tensors = self._contents()
        return as_trained(ModelCard.model_validate_json(text), tensors, out)

    def save_is_due(self) -> bool:
        """Whether a checkpoint now costs no more than its share of the time. When to write changes no result."""
        return time.monotonic() - self._saved_at >= max(SAVE_EVERY, self._save_cost / SAVE_SHARE)

    def card(self) -> ModelCard:
        """The metadata of the model file. It holds no time of day and no duration, so that runs can be compared."""
        every = -(-len(self.history) // SUMMARY) or 1
        chosen = sorted(range(len(self.history) - 1, -1, -every))
        kept = self.watch.best_epoch if self.watch.best is not None else None
        shown = sorted({*chosen, kept}) if kept is not None else chosen  # the kept epoch's figures belong into the card
        watched = self.watch.seen
        space, model = self.spec.workspace, self.model
        ranges = zip(self.spec.labels, model.label_lowest.tolist(), model.label_highest.tolist(), strict=True)
        return ModelCard(
            scenegen=__version__,
            model=self.config.model,
            recipe="default",
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
            corrected=model.corrected,
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
    hyper = parse_hyper(config.model, config.hyper)
    model = model_class(config.model)(layout_of(spec.core, branches), hyper)
    model.bind(spec)
    return model


def check_best(best: Mapping[str, Tensor], like: Mapping[str, Tensor]) -> None:
    """Raises ValueError unless the weights of the best epoch are of the model at hand."""
    fit = best.keys() == like.keys() and all(
        best[name].shape == like[name].shape and bool(torch.isfinite(best[name]).all()) for name in like
    )
    if not fit:
        raise ValueError("the weights of the best epoch do not fit the model")
