"""The default GAN: a game between a generator and a critic, both told phi and the branch.

The generator (scenegen.models.generator) makes a scene for every true one of the batch, of the same labels and branch;
the critic says which is which (scenegen.models.adversary). Beside the critic's pull, the inconsistency of phi moves the
generator, and the selector learns how often each branch occurs. What keeps it from collapsing is measured one by one in
docs/models.md. Above all the game gets a start: the set of one phi is thin, and to bring scenes onto it the
inconsistency at full strength pulls the noise together before the critic has found out how far the set stretches. So
its weight rises over the first steps, and the penalty on the critic's slope stays light.
"""

from __future__ import annotations

import torch
from pydantic import Field
from torch import Tensor

from scenegen.models.adversary import BETAS, Critic, contest
from scenegen.models.base import Hyper
from scenegen.models.conditioned import ConditionedModel, detached
from scenegen.models.examples import Examples
from scenegen.models.generator import Generator, noise
from scenegen.models.layout import Layout

START = 0.05


class GANHyper(Hyper):
    """`width` and `depth` of the generator's hidden layers, `critic_width` and `critic_depth` of the critic's;
    `consistency`: weight of the error of phi, which rises from START of it over the first `ramp` steps; `penalty`: of
    the critic's squared slope."""

    width: int = Field(default=256, ge=1, le=8192)
    depth: int = Field(default=4, ge=1, le=64)
    critic_width: int = Field(default=192, ge=1, le=8192)
    critic_depth: int = Field(default=3, ge=1, le=64)
    consistency: float = Field(default=2.0, ge=0.0, le=1e6)
    ramp: int = Field(default=500, ge=1, le=1_000_000)
    penalty: float = Field(default=0.1, ge=0.0, le=1e6)


class GAN(ConditionedModel):
    """See the module's text. Losses: `critic` (its surprise, nats), `phi` (the inconsistency), `branch` (nats)."""

    hyper_class = GANHyper
    betas = BETAS
    TRAINING_ONLY = ("critic", "steps")

    steps: Tensor

    def __init__(self, layout: Layout, hyper: GANHyper) -> None:
        super().__init__(layout, hyper)
        self.weight, self.ramp, self.penalty = hyper.consistency, hyper.ramp, hyper.penalty
        self.generator = Generator(layout, hyper.width, hyper.depth)
        self.critic = Critic(layout, layout.coordinates, hyper.critic_width, hyper.critic_depth)
        self.register_buffer("steps", torch.empty((), device="meta"))

    def initialise(self, generator: torch.Generator) -> None:
        super().initialise(generator)
        self.steps = torch.zeros(())

    def make(self, features: Tensor, branch: Tensor, generator: torch.Generator) -> Tensor:
        made: Tensor = self.generator(noise(len(features), self.layout, generator, features.device), features, branch)
        return made

    def update(self, batch: Examples, generator: torch.Generator) -> dict[str, Tensor]:
        wanted = self.wanted(batch, generator)
        features = self.view.features(wanted)
        true, made = self.view.encode(batch.x), self.make(features, batch.branch, generator)
        critic, ruling, deceit = contest(self.critic, true, made, features, batch.branch, self.penalty)
        off = self.inconsistency(made, wanted, batch.branch)
        surprise = self.selector.loss(features, batch.branch)
        self.steps = self.steps + 1
        weight = self.weight * (self.steps / self.ramp).clamp(START, 1.0)
        # The three nets share no weights, and `deceit` and `ruling` reach only their own: one backward pass serves all.
        self.descend(ruling + deceit + weight * off + surprise)
        return detached(critic=critic, phi=off, branch=surprise)
