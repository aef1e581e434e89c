"""Trained models: a model together with its spec, read from a file."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from scenegen.api.spec import Spec
from scenegen.errors import DataError
from scenegen.errors.models import MODEL_CONTRADICTS_ITSELF
from scenegen.lang.check import check_text
from scenegen.lang.spec import CheckedSpec
from scenegen.needs import need
from scenegen.scene.workspace import Workspace

if TYPE_CHECKING:
    from scenegen.models.proposer import ModelProposer
    from scenegen.models.trained import TrainedModel


class Model:
    """A trained model together with the spec that it was trained on (the model file carries both)."""

    def __init__(self, trained: TrainedModel) -> None:
        self.trained = trained
        made_from = trained.card.spec
        # the canonical text has no comments, so the title comes from the card
        self.spec = Spec(replace(check_text(made_from.source, made_from.name), title=made_from.title))
        self._refuse_contradictions()
        self.trained = trained.corrected(self.spec.checked)

    def __repr__(self) -> str:
        card = self.trained.card
        return f"<Model {card.model} of {card.spec.name}, {card.epochs_done} epochs>"

    def _refuse_contradictions(self) -> None:
        """Objects, labels and workspace of the card are the spec's. Raises DataError for a file that was put together
        by hand."""
        card, area = self.trained.card, self.spec.workspace
        pairs = {
            "objects": (tuple(card.objects), self.spec.objects),
            "layout": (card.sizes.objects, len(self.spec.checked.core.objects)),
            "labels": (tuple(label.name for label in card.labels), self.spec.labels),
            "workspace": (card.area, Workspace(area.x, area.y)),
        }
        for what, (told, true) in pairs.items():
            if told != true:
                raise DataError(MODEL_CONTRADICTS_ITSELF(what=what))

    @property
    def each(self) -> tuple[tuple[dict[str, int], Model], ...]:
        """The model for each combination of numbers of things, where its spec draws any; else itself, of no numbers."""
        return (({}, self),)

    def of(self, checked: CheckedSpec) -> Model:
        """The model of a spec with these numbers of things, one of `each`."""
        return self

    @property
    def name(self) -> str:
        """What kind of model it is, e.g. "gan"."""
        return self.trained.name

    @property
    def proposer(self) -> ModelProposer:
        """What draws its scenes: it holds the bytes of the model file, and goes to other processes."""
        from scenegen.models.proposer import make_proposer

        return make_proposer(self.trained)

    def with_counts(self, counts: Mapping[str, int | str]) -> Model:
        """The model of these numbers of things, by name. Raises RequestError as `Spec.with_counts` does: a model of
        fixed numbers draws none."""
        self.spec.with_counts(counts)
        return self

    def with_spec(self, spec: Spec) -> Model:
        """The same model, to draw scenes of its spec with labels added after its own."""
        other = copy.copy(self)
        other.spec = spec
        return other

    def in_steps(self, steps: int) -> Model:
        """The same model, taking `steps` evaluations of its network for a scene: for a flow, which is trained once and
        taken in any number. Raises RequestError for models that have no such choice, and beyond 1 to 1,000."""
        other = copy.copy(self)
        other.trained = self.trained.in_steps(steps)
        return other


def read_model(path: Path, spec: Spec | None = None) -> Model:
    """Read a model file. Raises DataError for anything but a whole one, and for one of another spec than `spec`."""
    need("torch", "to read a model file")
    from scenegen.models.checkpoint import load_model

    return Model(load_model(path, None if spec is None else spec.checked))
