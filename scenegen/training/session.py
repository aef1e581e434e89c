"""One training run: its model, data and place in time, and how it goes to disk and comes back."""

from __future__ import annotations

import time
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path

import torch
from torch import Tensor

from scenegen.data.dataset import Dataset
from scenegen.errors import DataError, Diagnostic, RequestError
from scenegen.lang.spec import CheckedSpec
from scenegen.models.base import SceneModel
from scenegen.models.branches import OTHER, survey
from scenegen.models.card import LabelData, LossData, ModelCard, spec_data
from scenegen.models.checkpoint import save_model
from scenegen.models.codec import Codec
from scenegen.models.examples import Examples
from scenegen.models.judge import Judge
from scenegen.models.layout import Layout, layout_of
from scenegen.models.table import model_class, parse_hyper
from scenegen.scene.data import WorkspaceData
from scenegen.training.config import TrainConfig
from scenegen.training.seeds import Stream, stream
from scenegen.training.state import TrainingState, save_state, state_path

SUMMARY = 100  # epochs whose losses a model file keeps
SAVE_EVERY = 5.0  # seconds between checkpoints, at least
SAVE_SHARE = 0.01  # of the time, at most, for writing them


class Session:
    """Mutable: `epoch` epochs are done and `step` steps of the next."""

    def __init__(self, spec: CheckedSpec, config: TrainConfig, data: Dataset, saved: TrainingState | None) -> None:
        self.spec = spec
        self.config = config
        self.device = torch.device(config.device)
        self.noise = stream(config.seed, Stream.NOISE, device=self.device)
        self.data_sha256 = data.sha256
        codec = Codec(spec.workspace, len(spec.objects))
        examples, judge, layout = _prepare(spec, config, data, codec)
        self._examples = examples.to(self.device)
        self.model = new_model(spec, config, layout)
        self.steps = -(-len(data) // config.batch_size)
        self.epoch = self.step = 0
        self.losses: tuple[str, ...] = ()
        self.history: list[Tensor] = []
        self.sums: Tensor | None = None
        if saved is None:
            self.model.initialise(stream(config.seed, Stream.WEIGHTS))
            self.model.fit(examples)
            self.model.to(self.device)
            self.model.start(config.lr, judge)
        else:
            self._take_up(saved, judge)
        self._saved_at = time.monotonic()
        self._save_cost = 0.0

    def _take_up(self, saved: TrainingState, judge: Judge) -> None:
        if saved.data_sha256 != self.data_sha256:
            raise DataError(
                Diagnostic(
                    "cannot resume: the training data cannot be rebuilt as it was",
                    help="the run was begun by another version of scenegen or torch; start anew without --resume",
                )
            )
        try:
            self.model.restore(saved.tensors, self.config.lr, judge, self.device)
            self.noise.set_state(saved.noise)
        except (RuntimeError, TypeError) as error:
            raise DataError(Diagnostic("the training state does not fit this run", help="start anew")) from error
        self.epoch, self.step, self.losses = saved.epoch, saved.step, saved.losses
        self.history = list(saved.history)
        self.sums = saved.sums.to(self.device) if saved.losses else None

    def shuffled(self) -> Examples:
        """The training set in the order of the epoch under way, which follows from the seed."""
        order = torch.randperm(len(self._examples), generator=stream(self.config.seed, Stream.ORDER, self.epoch))
        return self._examples.take(order.to(self.device))

    def update(self, batch: Examples) -> None:
        """One step."""
        rate = self.config.rate(self.epoch * self.steps + self.step, self.config.epochs * self.steps)
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

    def end_epoch(self) -> dict[str, float]:
        """Close the epoch and return its mean losses. Raises RequestError where the training has diverged."""
        self._check_finite()
        means = torch.zeros(0) if self.sums is None else (self.sums / self.steps).cpu()
        self.history.append(means)
        self.sums = None if self.sums is None else torch.zeros_like(self.sums)
        self.epoch, self.step = self.epoch + 1, 0
        return dict(zip(self.losses, means.tolist(), strict=True))

    def save(self, out: Path) -> None:
        """Write the training state and the model file. Raises OutputError; RequestError where training has diverged."""
        self._check_finite()
        began = time.monotonic()
        width = len(self.losses)
        state = TrainingState(
            self.config,
            self.data_sha256,
            self.epoch,
            self.step,
            self.losses,
            torch.stack(self.history) if self.history else torch.zeros(0, width, dtype=torch.float64),
            torch.zeros(width, dtype=torch.float64) if self.sums is None else self.sums,
            self.noise.get_state(),
            self.model.training_state(),
        )
        save_state(state_path(out), self.spec, state)
        save_model(out, self.model, self.card())
        self._saved_at = time.monotonic()
        self._save_cost = self._saved_at - began

    def save_is_due(self) -> bool:
        """Whether a checkpoint now costs no more than its share of the time. When to write changes no result."""
        return time.monotonic() - self._saved_at >= max(SAVE_EVERY, self._save_cost / SAVE_SHARE)

    def card(self) -> ModelCard:
        """The metadata of the model file. It holds no time of day and no duration, so that runs can be compared."""
        every = -(-len(self.history) // SUMMARY) or 1
        chosen = sorted(range(len(self.history) - 1, -1, -every))
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
        )

    def _check_finite(self) -> None:
        bad = [] if self.sums is None else (~torch.isfinite(self.sums)).nonzero().flatten().tolist()
        fine = all(bool(torch.isfinite(tensor).all()) for tensor in self.model.state_dict().values())
        if fine and not bad:
            return
        what = f"the loss `{self.losses[bad[0]]}` is" if bad else "the weights are"
        raise RequestError(
            Diagnostic(
                f"training diverged in epoch {self.epoch + 1}: {what} not finite",
                help=f"lower --lr (it was {self.config.lr:g}); the last good checkpoint, if there was one, is kept",
            )
        )


def _prepare(
    spec: CheckedSpec, config: TrainConfig, data: Dataset, codec: Codec
) -> tuple[Examples, Judge, Layout | None]:
    """The data as the model takes it, what judges the model's own scenes, and the layout of its networks."""
    x, phi = codec.encode(data.rows), data.phi.T.contiguous()
    if not model_class(config.model, config.recipe).branched:
        branch = torch.zeros(len(data), dtype=torch.int64)
        table = torch.full((1, len(spec.labels)), OTHER)
        return Examples(x, phi, branch), Judge(spec.core, table, codec), None
    branch, table = survey(spec.core, data.rows)
    return Examples(x, phi, branch), Judge(spec.core, table, codec), layout_of(spec.core, len(table))


def new_model(spec: CheckedSpec, config: TrainConfig, layout: Layout | None = None) -> SceneModel:
    """The model, without weights. Raises RequestError for settings it does not have."""
    hyper = parse_hyper(config.model, config.hyper, config.recipe)
    layout = layout or Layout(objects=len(spec.objects), labels=len(spec.labels))
    return model_class(config.model, config.recipe)(layout, hyper)
