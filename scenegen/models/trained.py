"""A trained model with everything needed to use it: what sampling takes as a proposer of scenes."""

from __future__ import annotations

import copy
from dataclasses import dataclass, replace
from typing import Any

import torch
from torch import Tensor

from scenegen.errors import DataError, Diagnostic, RequestError
from scenegen.given import whole
from scenegen.models.base import SceneModel
from scenegen.models.card import ModelCard
from scenegen.models.codec import Codec

MOST_STEPS = 1000


@dataclass(frozen=True, slots=True)
class TrainedModel:
    """The network, the map to poses, and the model file's metadata."""

    model: SceneModel
    codec: Codec
    card: ModelCard

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
            title = f"a scene of the {self.name} is one evaluation of its network: there are no steps to choose"
            raise RequestError(Diagnostic(title, help="leave the steps out, or take a flow"))
        steps = whole("steps", steps)
        if not 1 <= steps <= MOST_STEPS:
            title = f"{steps} is no number of steps"
            raise RequestError(Diagnostic(title, help=f"choose 1 to {MOST_STEPS:,}; 1 is the fastest"))
        model: Any = copy.copy(self.model)  # shares the weights
        model.steps = steps
        return replace(self, model=model)

    @torch.no_grad()
    def propose(self, phi: Tensor, generator: torch.Generator) -> Tensor:
        """One scene per column of `phi` (L, n), labels in order, in metres and radians -> rows (3N, n) float32.

        Centres lie in the workspace, theta in [0, 2 pi), phi only roughly where it was wanted. Labels outside
        `label_ranges` reach the network as they are; what it makes of them is extrapolation. `generator` lives on the
        model's device, and alone decides the outcome.
        """
        if phi.ndim != 2 or phi.shape[0] != len(self.card.labels):
            raise DataError(
                Diagnostic(
                    f"phi has the shape {tuple(phi.shape)}; expected ({len(self.card.labels)}, n), one row a label"
                )
            )
        rows = self.codec.decode(self.model.sample(phi.shape[1], phi.T, generator))
        if not bool(torch.isfinite(rows.sum())):
            raise DataError(
                Diagnostic("the model's output is not finite", help="the model file is damaged; train anew")
            )
        return rows
