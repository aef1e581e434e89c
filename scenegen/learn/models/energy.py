"""A one-step generator trained with the energy score: no discriminator, nothing to collapse.

For a scene x of the training data with labels phi and branch k, and two scenes g, g' made for the same (phi, k), the
loss is (d(x, g) + d(x, g')) / 2 - d(g, g') / 2: with Euclidean d the energy score, a strictly proper scoring rule
(Gneiting and Raftery, "Strictly proper scoring rules, prediction, and estimation", 2007, section 4.3), least in
expectation where the made scenes have the distribution of the true ones given (phi, k). Ours adds to d the distances of
every coordinate by itself and of the differences of random pairs of coordinates, which makes it the energy score plus
the continuous ranked probability scores of both: all proper. The Euclidean distance alone hardly feels a coordinate
that has little room, nor that two objects are too seldom far apart, and the error of phi squeezes both. To it come the
inconsistency of phi (scenegen.learn.models.conditioned) and the selector's cross-entropy.
"""

from __future__ import annotations

import math

import torch
from pydantic import Field
from torch import Tensor, nn

from scenegen.learn.models.base import Hyper, Mlp, one_hot
from scenegen.learn.models.card import Layout
from scenegen.learn.models.codec import Examples
from scenegen.learn.models.conditioned import ConditionedModel, detached

# The one-step generator of the default recipes: noise, wanted phi and branch -> a scene.
#
# Each learnt coordinate is its own noise, stretched and shifted by what the network makes of all of them: a position
# is tanh(gate * atanh(z) + shift) with z uniform in (-1, 1), an angle the direction of gate * (cos pi z, sin pi z) +
# shift. A gate of 1 and a shift of 0 give the base distribution itself, a gate of 0 a value that is computed. So what
# phi leaves alone stays exactly as spread out as it is in truth, however many coordinates there are, and the network
# has only the constraint to learn. (Without the gates, experiment 3 with N = 7 was covered to 0.58 instead of 0.95.)


SLOPE = 0.1  # of the LeakyReLU; SiLU took a fifth longer and left twice the error
INSIDE = 0.999  # keeps atanh finite
FIRST_GATE = 0.5


class Generator(nn.Module):
    """`forward(z, features, branch)`: noise (B, P + A) in (-1, 1), label features (B, 2L), branch (B,) -> (B, C)."""

    def __init__(self, layout: Layout, width: int, depth: int) -> None:
        super().__init__()
        self.positions, self.angles = len(layout.positions), len(layout.angles)
        inputs = layout.noise + layout.told + layout.branches
        self.branches = layout.branches
        self.body = Mlp((inputs, *[width] * depth, layout.coordinates + layout.noise), SLOPE)

    def initialise(self, generator: torch.Generator) -> None:
        """Fresh weights; gates start half open."""
        self.body.initialise(generator)
        with torch.no_grad():
            self.body.linear()[-1].bias[-(self.positions + self.angles) :] = FIRST_GATE

    def forward(self, z: Tensor, features: Tensor, branch: Tensor) -> Tensor:
        positions, angles = self.positions, self.angles
        shift, gate = self.body(torch.cat([z, features, one_hot(branch, self.branches)], dim=1)).split(
            [positions + 2 * angles, positions + angles], dim=1
        )
        spread = torch.tanh(torch.atanh(z[:, :positions] * INSIDE) * gate[:, :positions] + shift[:, :positions])
        if not angles:
            return spread
        heading, lever = z[:, positions:] * math.pi, gate[:, positions:]
        cosine = lever * torch.cos(heading) + shift[:, positions : positions + angles]
        sine = lever * torch.sin(heading) + shift[:, positions + angles :]
        length = (cosine.square() + sine.square() + 1e-6).sqrt()
        return torch.cat([spread, cosine / length, sine / length], dim=1)


def noise(count: int, layout: Layout, generator: torch.Generator, device: torch.device) -> Tensor:
    """(count, P + A), uniform in (-1, 1)."""
    return torch.rand(count, layout.noise, generator=generator, device=device).mul_(2.0).sub_(1.0)


def directions(turned: Tensor) -> Tensor:
    """Half turns (B, A) in (-1, 1) -> cosines and sines (B, 2A)."""
    heading = turned * math.pi
    return torch.cat([torch.cos(heading), torch.sin(heading)], dim=1)


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
