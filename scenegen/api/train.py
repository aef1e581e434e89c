"""Trained models: fit one to a spec, load one from a file."""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenegen import given
from scenegen.api.spec import Spec, check_spec
from scenegen.errors import DataError, Diagnostic
from scenegen.lang.check import check_text
from scenegen.needs import need

if TYPE_CHECKING:
    from scenegen.models.trained import TrainedModel
    from scenegen.training.loop import EpochReport


class Model:
    """A trained model together with the spec that it was trained on (the model file carries both)."""

    def __init__(self, trained: TrainedModel) -> None:
        self.trained = trained
        made_from = trained.card.spec
        # the canonical text has no comments, so the title comes from the card
        self.spec = Spec(replace(check_text(made_from.source, made_from.name), title=made_from.title))
        self._refuse_contradictions()

    def __repr__(self) -> str:
        card = self.trained.card
        return f"<Model {card.model} of {card.spec.name}, {card.epochs_done} epochs>"

    def _refuse_contradictions(self) -> None:
        """Objects, labels and workspace of the card are the spec's. Raises DataError for a file that was put together
        by hand."""
        card, area = self.trained.card, self.spec.workspace
        pairs = {
            "objects": (tuple(card.objects), self.spec.objects),
            "labels": (tuple(label.name for label in card.labels), self.spec.labels),
            "workspace": (card.area, area),
        }
        for what, (told, true) in pairs.items():
            if told != true:
                title = f"the model file contradicts itself: its {what} are not those of the spec in it"
                raise DataError(Diagnostic(title, help="train anew"))

    @property
    def name(self) -> str:
        """What kind of model it is, e.g. "gan"."""
        return self.trained.name

    def in_steps(self, steps: int) -> Model:
        """The same model, taking `steps` evaluations of its network for a scene: for a flow, which is trained once and
        taken in any number. Raises RequestError for models that have no such choice, and beyond 1 to 1,000."""
        other = copy.copy(self)
        other.trained = self.trained.in_steps(steps)
        return other


def load_model(path: str | Path, spec: Spec | None = None) -> Model:
    """Read a model file. Raises DataError for anything but a whole one, and for one of another spec than `spec`."""
    need("torch", "to read a model file")
    from scenegen.models.checkpoint import load_model as load

    if spec is not None:
        check_spec(spec)
    return Model(load(given.path("path", path), None if spec is None else spec.checked))


def train(
    spec: Spec,
    model: str = "energy",
    *,
    recipe: str = "default",
    out: str | Path,
    resume: bool = False,
    log_dir: str | Path | None = None,
    card: bool = False,
    on_epoch: Callable[[EpochReport], None] | None = None,
    on_step: Callable[[int, int], None] | None = None,
    on_note: Callable[[str], None] | None = None,
    **options: Any,
) -> Model:
    """Train a model of the table (gan, aae, flow, energy) on a spec and write it to `out`.

    `recipe` is `default` or, for gan and aae, `paper`: the published networks and settings. `options` are the fields of
    `scenegen.training.config.TrainConfig`: epochs, batch_size, lr, seed, scenes, data, patience, device, hyper; the
    recipe's own where they are left out. `resume` goes on from the state that an earlier run left in `out`.train, to
    the same result as one run without a break. `log_dir` gets TensorBoard event files. `card` writes the model card,
    `out`.md and `out`.png, when training is done. `on_epoch` gets an EpochReport, `on_step` the steps that are done and
    planned. Raises RequestError, DataError, OutputError; Interrupted on Ctrl-C and SIGTERM.
    """
    from scenegen.training.config import make_config

    check_spec(spec)
    path = given.path("out", out)
    config = make_config(model, recipe, **options)
    need("torch", "to train a model")
    from scenegen.training.loop import train as run

    if card:
        from scenegen.api.card import check_card, write_card

        check_card(path)
    done = Model(
        run(
            spec.checked,
            config,
            path,
            resume=resume,
            log_dir=None if log_dir is None else Path(log_dir),
            on_epoch=on_epoch,
            on_step=on_step,
            on_note=on_note,
        )
    )
    if card:
        write_card(done, path)
    return done
