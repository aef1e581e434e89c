"""How good a model is at this moment, on labels that it has never trained on.

For every held-out scene the model makes two scenes with that scene's phi. `errors` is how far their phi is from what
was wanted. `score` is the energy score of the made scenes against the held-out one (Gneiting and Raftery, "Strictly
proper scoring rules, prediction, and estimation", 2007, section 4.3): the lower, the closer the two distributions.
The error alone does not see a model that makes one and the same good scene again and again; the score does.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import torch
from torch import Tensor

from scenegen.learn.models.base import SceneModel, SpecLoss
from scenegen.learn.models.codec import Examples
from scenegen.pose import ANGLES, LENGTHS, TWO_PI, along


@dataclass(frozen=True, slots=True)
class Validation:
    """`errors`: mean of |phi - wanted phi| for each label, in the unit of phi; `score`: see the module's text."""

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
    score = 0.5 * (_apart(truth, one) + _apart(truth, two) - _apart(one, two))
    values = torch.cat([errors.double(), score[None].double()]).tolist()
    return Validation(dict(zip(labels, values, strict=False)), values[-1])


def _points(x: Tensor) -> Tensor:
    """Unit coordinates (B, 3N) -> (B, 4N): positions, and headings on a circle with the circumference 1."""
    turns = [x[:, along(axis)] * TWO_PI for axis in ANGLES]
    places = [x[:, along(axis)] for axis in LENGTHS]
    return torch.cat([*places, *(function(turn) / TWO_PI for function in (torch.cos, torch.sin) for turn in turns)], 1)


def _apart(a: Tensor, b: Tensor) -> Tensor:
    """The mean Euclidean distance of rows."""
    return (a - b).square().sum(1).sqrt().mean()


# --------------------------------------------------------------------------------------------------------------------
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
