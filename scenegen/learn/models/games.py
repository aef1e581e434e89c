"""The adversarial models: a GAN, which plays over scenes, and an AAE, which plays over codes."""

from __future__ import annotations

import math

import torch
from pydantic import Field
from torch import Tensor, nn
from torch.nn.functional import leaky_relu, softplus

from scenegen.learn.models.base import Hyper, Mlp, one_hot
from scenegen.learn.models.card import Layout
from scenegen.learn.models.codec import Examples
from scenegen.learn.models.conditioned import ConditionedModel, detach_losses
from scenegen.learn.models.generator import ATANH_BOUND, FIRST_GATE, SLOPE, Generator, directions, noise

# The adversarial game of the default GAN and AAE: a critic that knows phi and the branch, and what keeps it fair.
#
# Made rows are paired with true rows of the same (phi, branch), and the critic says which of the two is the true one:
# it compares a made row with its like instead of with a threshold, so that no part of the truth can be left out at no
# cost (relativistic pairing: Jolicoeur-Martineau, "The relativistic discriminator", 2018). Its slope is penalised on
# true and on made rows (R1 and R2: Mescheder et al., "Which training methods for GANs do actually converge?", 2018;
# both together: Huang et al., "The GAN is dead; long live the GAN!", 2024). The slopes that the penalty needs are
# also all that the other side needs, so both play at once on one pass of the critic.


CRITIC_SLOPE = 0.2
BETAS = (0.5, 0.99)  # of Adam: in a game, momentum overshoots


class Critic(nn.Module):
    """`forward(rows, features, branch)`: rows (B, R), label features (B, 2L), branch (B,) -> scores (B,), high where it
    believes them true."""

    def __init__(self, layout: Layout, rows: int, width: int, depth: int) -> None:
        super().__init__()
        self.branches = layout.branches
        self.body = Mlp((rows + layout.condition_size + layout.branches, *[width] * depth), CRITIC_SLOPE)
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
        hidden = leaky_relu(self.body(told), CRITIC_SLOPE)
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


FIRST_WEIGHT_SHARE = 0.05


# The default GAN: a game between a generator and a critic, both told phi and the branch.
#
# The generator (scenegen.learn.models.generator) makes a scene for every true one of the batch, of the same labels and
# branch; the critic says which is which. Beside the critic's pull, the inconsistency of phi moves the generator, and
# the selector learns how often each branch occurs. What keeps it from collapsing is measured one by one in
# docs/models-tried.md. Above all the inconsistency stays light: the set of one phi is thin, and to bring scenes onto it
# a strong one pulls the noise together, away from the edges and the smaller pieces of the set, while the correction
# brings them there anyhow. So its weight is small and rises over the first steps, and the penalty on the
# critic's slope is small, too.


class GANHyper(Hyper):
    """`width` and `depth` of the generator's hidden layers, `critic_width` and `critic_depth` of the critic's;
    `consistency`: weight of the error of phi, which rises from FIRST_WEIGHT_SHARE of it over the first `ramp` steps;
    `penalty`: of the critic's squared slope."""

    width: int = Field(default=256, ge=1, le=8192)
    depth: int = Field(default=4, ge=1, le=64)
    critic_width: int = Field(default=192, ge=1, le=8192)
    critic_depth: int = Field(default=3, ge=1, le=64)
    consistency: float = Field(default=0.02, ge=0.0, le=1e6)
    ramp: int = Field(default=500, ge=1, le=1_000_000)
    penalty: float = Field(default=0.1, ge=0.0, le=1e6)


class GAN(ConditionedModel):
    """See above. Losses: `critic` (its surprise, nats), `phi` (the inconsistency), `branch` (nats)."""

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
        wanted = self.visible_phi(batch, generator)
        features = self.view.features(wanted)
        true, made = self.view.encode(batch.x), self.make(features, batch.branch, generator)
        critic, ruling, deceit = contest(self.critic, true, made, features, batch.branch, self.penalty)
        off = self.inconsistency(made, wanted, batch.branch)
        surprise = self.selector.loss(features, batch.branch)
        self.steps = self.steps + 1
        weight = self.weight * (self.steps / self.ramp).clamp(FIRST_WEIGHT_SHARE, 1.0)
        # The three nets share no weights, and `deceit` and `ruling` reach only their own: one backward pass serves all.
        self.descend(ruling + deceit + weight * off + surprise)
        return detach_losses(critic=critic, phi=off, branch=surprise)


# The default adversarial autoencoder: the game is played over codes, where both sides fill the same box.
#
# An encoder turns scene, labels, branch and some noise into a code, the decoder (scenegen.learn.models.generator, with
# the code for its noise) turns the code back into the scene, and a critic sees to it that
# codes of every phi and branch are distributed as the decoder's own noise is: uniformly. Then noise decodes to scenes
# as they are distributed in truth. So that what lies between the codes of true scenes hits phi too, the inconsistency
# of phi is taken on decoded noise, not on copies. Labels and branch are inputs of all three: the published encoder
# lacks them, and its code had to carry phi, which the decoder then read off it instead of its label.


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
    consistency: float = Field(default=0.1, ge=0.0, le=1e6)
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
        inputs = layout.coordinates + layout.noise + layout.condition_size + layout.branches
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
            torch.atanh(u[:, :positions].clamp(-1.0, 1.0) * ATANH_BOUND) * own[:, :positions]
            + torch.atanh(z[:, :positions] * ATANH_BOUND) * other[:, :positions]
            + shift[:, :positions]
        )
        if not angles:
            return spread
        own, other = own[:, positions:].repeat(1, 2), other[:, positions:].repeat(1, 2)
        heading = own * u[:, positions:] + other * directions(z[:, positions:]) + shift[:, positions:]
        length = (heading[:, :angles].square() + heading[:, angles:].square() + 1e-6).sqrt()
        return torch.cat([spread, heading / length.repeat(1, 2)], dim=1)


class AAE(ConditionedModel):
    """See above. Losses: `reconstruction` (distance of a scene from its copy), `critic` (its surprise,
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
        wanted = self.visible_phi(batch, generator)
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
        return detach_losses(reconstruction=apart, critic=critic, phi=off, branch=surprise)
