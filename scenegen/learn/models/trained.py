"""A trained model with everything needed to use it: what sampling takes as a proposer of scenes."""

from __future__ import annotations

import copy
from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Any

import torch
from torch import Tensor

from scenegen.errors import DataError, RequestError
from scenegen.errors.learning import ARRAY_NOT_FINITE, WRONG_SHAPE
from scenegen.errors.requests import OUT_OF_RANGE, STEPS_FIXED
from scenegen.lang.spec import CheckedSpec
from scenegen.learn.models.base import SceneModel
from scenegen.learn.models.card import ModelCard
from scenegen.learn.models.codec import Codec
from scenegen.learn.models.conditioned import ConditionedModel
from scenegen.learn.models.correction import Correction
from scenegen.validation import as_int

MOST_STEPS = 1000
BATCH = 2048  # scenes that a network makes at a time: its layers stay in cache


@dataclass(frozen=True, slots=True)
class TrainedModel:
    """The network, the map to poses, and the model file's metadata. `regions` say how phi is distributed: each is
    (L, 2 + m), the lowest and the highest phi of a part of all scenes, infinite where it has no end, and the phi of m
    scenes as they occur there. Files of earlier versions have none."""

    model: SceneModel
    codec: Codec
    card: ModelCard
    correction: Correction | None = None
    regions: tuple[Tensor, ...] = ()

    @property
    def name(self) -> str:
        """The model's name in MODELS."""
        return self.card.model

    @property
    def objects(self) -> tuple[str, ...]:
        return tuple(self.card.objects)

    @property
    def labels(self) -> tuple[str, ...]:
        return tuple(label.name for label in self.card.labels)

    @property
    def label_ranges(self) -> dict[str, tuple[float, float]]:
        """Lowest and highest phi of each label in the training data: what the model has seen."""
        return {label.name: (label.lowest, label.highest) for label in self.card.labels}

    @property
    def steps(self) -> int | None:
        """In how many evaluations of its network it makes a scene, where that can be chosen."""
        found: int | None = getattr(self.model, "steps", None)
        return found

    def in_steps(self, steps: int) -> TrainedModel:
        """The same network, taken in another number of steps. Raises RequestError where there is no such choice."""
        if self.steps is None:
            raise RequestError(STEPS_FIXED(model=self.name))
        steps = as_int("steps", steps)
        if not 1 <= steps <= MOST_STEPS:
            wanted, hint = f"from 1 to {MOST_STEPS:,}", "1 is the fastest"
            raise RequestError(OUT_OF_RANGE(argument="steps", value=steps, wanted=wanted, hint=hint))
        model: Any = copy.copy(self.model)  # shares the weights
        model.steps = steps
        return replace(self, model=model)

    @property
    def partial(self) -> bool:
        """Whether labels can be left free."""
        return self.card.sizes.partial

    def asked(self, phi: Tensor, labels: Collection[str]) -> Tensor:
        """Wanted phi (L, n) with all other labels left free, as far as the model can do that."""
        free = [place for place, label in enumerate(self.labels) if label not in labels]
        if not self.partial or len(free) == len(self.labels):
            return phi
        return phi.index_fill(0, torch.tensor(free, dtype=torch.int64), torch.nan)

    def corrected(self, spec: CheckedSpec) -> TrainedModel:
        """With the boxes of the spec that it was trained on (the card has the table alone), and with the correction
        that belongs to the model, where one does."""
        placed = replace(self, codec=Codec(spec.workspace, self.codec.objects))
        if not self.card.corrected:
            return placed
        spans = torch.tensor([high - low for low, high in self.label_ranges.values()])
        tops = torch.tensor([max(0.0, high) if low < 0.0 else 0.0 for low, high in self.label_ranges.values()])
        return replace(placed, correction=Correction(spec, spans, tops))

    @property
    def network(self) -> TrainedModel:
        """The network alone."""
        return replace(self, correction=None)

    def _made(
        self, phi: Tensor, generator: torch.Generator, branch: Tensor | None = None
    ) -> tuple[Tensor, Tensor | None]:
        """Scenes (3N, n), and the branches (n,) that they were made in, where the model has any: those that are given,
        or drawn."""
        alike = phi[:, :1].expand_as(phi) if phi.shape[1] > 1 and bool(_same(phi, phi[:, :1]).all()) else phi
        parts = torch.split(alike, BATCH, dim=1)
        if not isinstance(self.model, ConditionedModel):
            made = [self.model.sample(part.shape[1], part.T, generator) for part in parts]
            return self.codec.decode(torch.cat(made)).cpu(), None
        given = [None] * len(parts) if branch is None else torch.split(branch, BATCH)
        found = [
            self.model.sample_in(part.shape[1], part.T, generator, mine)
            for part, mine in zip(parts, given, strict=True)
        ]
        scenes = torch.cat([each for each, _ in found])
        return self.codec.decode(scenes).cpu(), torch.cat([each for _, each in found])

    @torch.no_grad()
    def propose(self, phi: Tensor, generator: torch.Generator) -> Tensor:
        """One scene per column of `phi` (L, n), labels in order, in metres and radians -> rows (3N, n) float32.

        NaN leaves a label free, where the model is `partial`. Centres lie in the workspace, theta in [0, 2 pi), phi
        only roughly where it was wanted, also after the correction. Labels outside `label_ranges` reach the network as
        they are; what it makes of them is extrapolation. `generator` lives on the model's device, and alone decides the
        outcome.
        """
        if phi.ndim != 2 or phi.shape[0] != len(self.card.labels):
            wanted = f"({len(self.card.labels)}, n), one row a label"
            raise DataError(WRONG_SHAPE(what="phi", found=str(tuple(phi.shape)), wanted=wanted))
        if not self.partial and bool(torch.isnan(phi).any()):
            raise DataError(ARRAY_NOT_FINITE(what=f"phi for a {self.name} that has to be told every label"))
        phi = phi.to(torch.float32)
        correction = self.correction
        rows = self._made(phi, generator)[0] if correction is None else correction(self._made, phi, generator)
        if not bool(torch.isfinite(rows.sum())):
            remedy = "the model file is damaged; train it again"
            raise DataError(ARRAY_NOT_FINITE(what="the model's output", remedy=remedy))
        return rows


def _same(a: Tensor, b: Tensor) -> Tensor:
    return (a == b) | (torch.isnan(a) & torch.isnan(b))
