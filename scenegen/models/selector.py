"""Which branch to draw from: P(branch | phi), learnt by cross-entropy and nothing else."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn.functional import cross_entropy

from scenegen.models.layout import Layout
from scenegen.models.mlp import Mlp

WIDTH = 64


class Selector(nn.Module):
    """A small network from label features (B, 2L) to a distribution over K branches."""

    def __init__(self, layout: Layout) -> None:
        super().__init__()
        self.branches = layout.branches
        self.body = Mlp((layout.told, WIDTH, WIDTH, layout.branches), 0.1)

    def initialise(self, generator: torch.Generator) -> None:
        self.body.initialise(generator)

    def loss(self, features: Tensor, branch: Tensor) -> Tensor:
        """Mean surprise (nats) at the branch of each scene."""
        return cross_entropy(self.body(features), branch)

    @torch.no_grad()
    def draw(self, features: Tensor, generator: torch.Generator) -> Tensor:
        """A branch for each row of features, (B,) int64."""
        place = torch.rand(len(features), 1, generator=generator, device=features.device)
        # One wanted phi for all is the usual request: then the network is asked once.
        one = len(features) > 1 and features.stride(0) == 0
        up_to = torch.softmax(self.body(features[:1] if one else features), dim=1).cumsum(dim=1)
        return torch.searchsorted(up_to.expand(len(features), -1).contiguous(), place)[:, 0].clamp_max(
            self.branches - 1
        )
