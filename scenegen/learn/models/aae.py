"""The default adversarial autoencoder: the game is played over codes, where both sides fill the same box.

An encoder turns scene, labels, branch and some noise into a code, the decoder (scenegen.learn.models.energy, with the
code for its noise) turns the code back into the scene, and a critic (scenegen.learn.models.gan) sees to it that codes
of every phi and branch are distributed as the decoder's own noise is: uniformly. Then noise decodes to scenes as they
are distributed in truth. So that what lies between the codes of true scenes hits phi too, the inconsistency of phi is
taken on decoded noise, not on copies. Labels and branch are inputs of all three: the published encoder lacks them, and
its code had to carry phi, which the decoder then read off it instead of its label.
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
from scenegen.learn.models.energy import FIRST_GATE, INSIDE, SLOPE, Generator, directions, noise
from scenegen.learn.models.gan import BETAS, Critic, contest


class AAEHyper(Hyper):
    """`width` and `depth` of the hidden layers of the decoder, `encoder_width` and `encoder_depth` of the encoder's,
    `critic_width` and `critic_depth` of the critic's; `consistency`: weight of the error of phi; `match`: weight of the
    game; `penalty`: of the critic's squared slope."""

    width: int = Field(default=256, ge=1, le=8192)
    depth: int = Field(default=4, ge=1, le=64)
    encoder_width: int = Field(default=192, ge=1, le=8192)
    encoder_depth: int = Field(default=3, ge=1, le=64)
    critic_width: int = Field(default=192, ge=1, le=8192)
    critic_depth: int = Field(default=3, ge=1, le=64)
    consistency: float = Field(default=2.0, ge=0.0, le=1e6)
    match: float = Field(default=1.0, ge=0.0, le=1e6)
    penalty: float = Field(default=0.03, ge=0.0, le=1e6)


class Encoder(nn.Module):
    """`forward(u, z, features, branch)`: scenes (B, C), noise (B, P + A) in (-1, 1), label features (B, 2L) and branch
    (B,) -> codes (B, C): positions in (-1, 1), and directions.

    The mirror image of the decoder: a code is the scene itself, mixed with noise, stretched and shifted by what the
    network makes of both. The noise fills what the scene leaves empty: scenes of one phi have a dimension less than
    their codes.
    """

    def __init__(self, layout: Layout, width: int, depth: int) -> None:
        super().__init__()
        self.positions, self.angles = len(layout.positions), len(layout.angles)
        self.branches = layout.branches
        inputs = layout.coordinates + layout.noise + layout.told + layout.branches
        self.body = Mlp((inputs, *[width] * depth, layout.coordinates + 2 * layout.noise), SLOPE)

    def initialise(self, generator: torch.Generator) -> None:
        """Fresh weights; gates start half open for the scene and closed for the noise."""
        self.body.initialise(generator)
        count = self.positions + self.angles
        with torch.no_grad():
            self.body.linear()[-1].bias[-2 * count : -count] = FIRST_GATE

    def forward(self, u: Tensor, z: Tensor, features: Tensor, branch: Tensor) -> Tensor:
        positions, angles = self.positions, self.angles
        told = torch.cat([u, z, features, one_hot(branch, self.branches)], dim=1)
        shift, own, other = self.body(told).split(
            [positions + 2 * angles, positions + angles, positions + angles], dim=1
        )
        spread = torch.tanh(
            torch.atanh(u[:, :positions].clamp(-1.0, 1.0) * INSIDE) * own[:, :positions]
            + torch.atanh(z[:, :positions] * INSIDE) * other[:, :positions]
            + shift[:, :positions]
        )
        if not angles:
            return spread
        own, other = own[:, positions:].repeat(1, 2), other[:, positions:].repeat(1, 2)
        heading = own * u[:, positions:] + other * directions(z[:, positions:]) + shift[:, positions:]
        length = (heading[:, :angles].square() + heading[:, angles:].square() + 1e-6).sqrt()
        return torch.cat([spread, heading / length.repeat(1, 2)], dim=1)


class AAE(ConditionedModel):
    """See the module's text. Losses: `reconstruction` (distance of a scene from its copy), `critic` (its surprise,
    nats), `phi` (the inconsistency of decoded noise), `branch` (nats)."""

    hyper_class = AAEHyper
    betas = BETAS
    TRAINING_ONLY = ("encoder", "critic")

    def __init__(self, layout: Layout, hyper: AAEHyper) -> None:
        super().__init__(layout, hyper)
        self.weight, self.match, self.penalty = hyper.consistency, hyper.match, hyper.penalty
        self.encoder = Encoder(layout, hyper.encoder_width, hyper.encoder_depth)
        self.decoder = Generator(layout, hyper.width, hyper.depth)
        self.critic = Critic(layout, layout.coordinates, hyper.critic_width, hyper.critic_depth)

    def make(self, features: Tensor, branch: Tensor, generator: torch.Generator) -> Tensor:
        made: Tensor = self.decoder(self._noise(features, generator), features, branch)
        return made

    def _noise(self, features: Tensor, generator: torch.Generator) -> Tensor:
        return noise(len(features), self.layout, generator, features.device)

    def update(self, batch: Examples, generator: torch.Generator) -> dict[str, Tensor]:
        wanted = self.wanted(batch, generator)
        features, branch, positions = self.view.features(wanted), batch.branch, len(self.layout.positions)
        x = self.view.encode(batch.x)
        code = self.encoder(x, self._noise(features, generator), features, branch)
        angles = code[:, positions:].chunk(2, dim=1)
        turned = torch.atan2(angles[1], angles[0]) / math.pi
        copy = self.decoder(torch.cat([code[:, :positions], turned], dim=1), features, branch)
        apart: Tensor = ((copy - x).square().sum(1) + 1e-8).sqrt().mean()

        prior = self._noise(features, generator)
        aim = torch.cat([prior[:, :positions], directions(prior[:, positions:])], dim=1)
        critic, ruling, deceit = contest(self.critic, aim, code, features, branch, self.penalty)
        off = self.inconsistency(self.decoder(prior, features, branch), wanted, branch)
        surprise = self.selector.loss(features, branch)
        self.descend(apart + ruling + self.match * deceit + self.weight * off + surprise)
        return detached(reconstruction=apart, critic=critic, phi=off, branch=surprise)
