"""The adversarial game of the default GAN and AAE: a critic that knows phi and the branch, and what keeps it fair.

Made rows are paired with true rows of the same (phi, branch), and the critic says which of the two is the true one: it
compares a made row with its like instead of with a threshold, so that no part of the truth can be left out at no cost
(relativistic pairing: Jolicoeur-Martineau, "The relativistic discriminator", 2018). Its slope is penalised on true and
on made rows (R1 and R2: Mescheder et al., "Which training methods for GANs do actually converge?", 2018; both together:
Huang et al., "The GAN is dead; long live the GAN!", 2024). The slopes that the penalty needs are also all that the
other side needs, so both play at once on one pass of the critic.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn.functional import leaky_relu, softplus

from scenegen.models.layout import Layout
from scenegen.models.mlp import Mlp, one_hot

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
