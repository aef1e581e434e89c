"""A one-step generator trained with the energy score: no discriminator, nothing to collapse.

For a scene x of the training data with labels phi and branch k, and two scenes g, g' made for the same (phi, k), the
loss is (d(x, g) + d(x, g')) / 2 - d(g, g') / 2: with Euclidean d the energy score, a strictly proper scoring rule
(Gneiting and Raftery, "Strictly proper scoring rules, prediction, and estimation", 2007, section 4.3), least in
expectation where the made scenes have the distribution of the true ones given (phi, k). Ours adds to d the distances of
every coordinate by itself and of the differences of random pairs of coordinates, which makes it the energy score plus
the continuous ranked probability scores of both: all proper. The Euclidean distance alone hardly feels a coordinate
that has little room, nor that two objects are too seldom far apart, and the error of phi squeezes both. To it come the
inconsistency of phi (scenegen.models.conditioned) and the selector's cross-entropy.
"""

from __future__ import annotations

import math

import torch
from pydantic import Field
from torch import Tensor

from scenegen.models.base import Hyper
from scenegen.models.conditioned import ConditionedModel, detached
from scenegen.models.examples import Examples
from scenegen.models.generator import Generator, noise
from scenegen.models.layout import Layout

PAIRS = 64
"""Of coordinates, redrawn for each step: enough for the few objects of most specs to be compared all with all."""


class EnergyHyper(Hyper):
    """`width` and `depth` of the generator's hidden layers; `consistency`: weight of the error of phi."""

    width: int = Field(default=256, ge=1, le=8192)
    depth: int = Field(default=4, ge=1, le=64)
    consistency: float = Field(default=1.0, ge=0.0, le=1e6)


class Energy(ConditionedModel):
    """See the module's text. Losses: `energy` (of the score), `phi` (the inconsistency), `branch` (nats)."""

    hyper_class = EnergyHyper

    def __init__(self, layout: Layout, hyper: EnergyHyper) -> None:
        super().__init__(layout, hyper)
        self.weight = hyper.consistency
        self.generator = Generator(layout, hyper.width, hyper.depth)

    def make(self, features: Tensor, branch: Tensor, generator: torch.Generator) -> Tensor:
        made: Tensor = self.generator(noise(len(features), self.layout, generator, features.device), features, branch)
        return made

    def update(self, batch: Examples, generator: torch.Generator) -> dict[str, Tensor]:
        wanted = self.wanted(batch, generator)
        features = self.view.features(wanted)
        x = self.view.encode(batch.x)
        one, two = (self.make(features, batch.branch, generator) for _ in range(2))
        pairs = torch.randint(x.shape[1], (2, PAIRS), generator=generator, device=x.device)
        score = 0.5 * (_distance(x, one, pairs) + _distance(x, two, pairs) - _distance(one, two, pairs)).mean()
        off = self.inconsistency(one, wanted, batch.branch)
        surprise = self.selector.loss(features, batch.branch)
        self.descend(score + self.weight * off + surprise)
        return detached(energy=score, phi=off, branch=surprise)


def _distance(a: Tensor, b: Tensor, pairs: Tensor) -> Tensor:
    """(B, C) and (B, C) -> (B,): the Euclidean distance, that of every coordinate by itself, and that of the difference
    of each of the `pairs` (2, K) of coordinates; each as large as the others where coordinates differ independently."""
    difference = a - b
    scale = math.sqrt(difference.shape[1])
    together = (difference.square().sum(1) + 1e-8).sqrt()  # the root of 0 would have no gradient
    apart = difference.abs().mean(1) * scale
    between = (difference[:, pairs[0]] - difference[:, pairs[1]]).abs().mean(1) * scale
    return together + apart + between
