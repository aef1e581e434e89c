"""The default GAN: a game between a generator and a critic, both told phi and the branch.

The generator (scenegen.learn.models.energy) makes a scene for every true one of the batch, of the same labels and
branch; the critic says which is which (scenegen.learn.models.gan). Beside the critic's pull, the inconsistency of phi
moves the generator, and the selector learns how often each branch occurs. What keeps it from collapsing is measured one
by one in docs/models.md. Above all the game gets a start: the set of one phi is thin, and to bring scenes onto it the
inconsistency at full strength pulls the noise together before the critic has found out how far the set stretches. So
its weight rises over the first steps, and the penalty on the critic's slope stays light.
"""

from __future__ import annotations

import torch
from pydantic import Field
from torch import Tensor, nn
from torch.nn.functional import leaky_relu, softplus

from scenegen.learn.models.base import Hyper, Mlp, one_hot
from scenegen.learn.models.card import Layout
from scenegen.learn.models.codec import Examples
from scenegen.learn.models.conditioned import ConditionedModel, detached
from scenegen.learn.models.energy import Generator, noise

# --------------------------------------------------------------------------------------------------------------------
# The adversarial game of the default GAN and AAE: a critic that knows phi and the branch, and what keeps it fair.
#
# Made rows are paired with true rows of the same (phi, branch), and the critic says which of the two is the true one:
# it compares a made row with its like instead of with a threshold, so that no part of the truth can be left out at no
# cost (relativistic pairing: Jolicoeur-Martineau, "The relativistic discriminator", 2018). Its slope is penalised on
# true and on made rows (R1 and R2: Mescheder et al., "Which training methods for GANs do actually converge?", 2018;
# both together: Huang et al., "The GAN is dead; long live the GAN!", 2024). The slopes that the penalty needs are
# also all that the other side needs, so both play at once on one pass of the critic.


SLOPE = 0.2
BETAS = (0.5, 0.99)  # of Adam: in a game, momentum overshoots


class Critic(nn.Module):
    """`forward(rows, features, branch)`: rows (B, R), label features (B, 2L), branch (B,) -> scores (B,), high where it
    believes them true."""

    def __init__(self, layout: Layout, rows: int, width: int, depth: int) -> None:
        super().__init__()
        self.branches = layout.branches
        self.body = Mlp((rows + layout.told + layout.branches, *[width] * depth), SLOPE)
        # no bias: only differences of scores count
        self.head = nn.Linear(width, 1, bias=False, device="meta")

    def initialise(self, generator: torch.Generator) -> None:
        """Fresh weights."""
        self.body.initialise(generator)
        self.head.to_empty(device=generator.device)
        bound = self.head.in_features**-0.5
        nn.init.uniform_(self.head.weight, -bound, bound, generator=generator)

    def forward(self, rows: Tensor, features: Tensor, branch: Tensor) -> Tensor:
        told = torch.cat([rows, features, one_hot(branch, self.branches)], dim=1)
        hidden = leaky_relu(self.body(told), SLOPE)
        scores: Tensor = self.head(hidden)[:, 0]
        return scores


def contest(
    critic: Critic, true: Tensor, made: Tensor, features: Tensor, branch: Tensor, penalty: float
) -> tuple[Tensor, Tensor, Tensor]:
    """One round over B pairs of true and made rows (B, R) of the same label features (B, 2L) and branch (B,).

    Returns three numbers: the critic's surprise (nats; ln 2 where it cannot tell), its loss, which is the surprise and
    `penalty` times half the mean squared slope on either side, and a loss for the maker of `made`. The value of the
    last means nothing; its gradient is that of the maker's own surprise, softplus(true score - made score).
    """
    count = len(true)
    rows = torch.cat([true.detach(), made.detach()]).requires_grad_()
    scores = critic(rows, features.repeat(2, 1), branch.repeat(2))
    (slopes,) = torch.autograd.grad(scores.sum(), rows, create_graph=True)
    lead = scores[:count] - scores[count:]
    surprise = softplus(-lead).mean()
    steepness = slopes.square().sum() / count
    with torch.no_grad():
        pull = slopes[count:] * (-torch.sigmoid(lead) / count)[:, None]
    return surprise, surprise + 0.5 * penalty * steepness, (made * pull).sum()


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
