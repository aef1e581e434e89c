"""Which branch to draw from: P(branch | phi), learnt by cross-entropy and nothing else."""

from __future__ import annotations

import math
from collections.abc import Callable

import torch
from torch import Tensor, nn
from torch.nn.functional import cross_entropy

from scenegen.models.examples import Examples
from scenegen.models.layout import Layout
from scenegen.models.mlp import Mlp

WIDTH = 64
PASSES, STEPS, BATCH, RATE = 30, 3000, 512, 6e-3  # of learning it by itself


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

    def learn(
        self,
        examples: Examples,
        features: Callable[[Examples], Tensor],
        generator: torch.Generator,
        check: Callable[[], None],
    ) -> None:
        """Learn the branches of examples (M scenes) by Adam at a rate that falls along a cosine, in PASSES through all
        of them, or STEPS batches if that is less."""
        steps = min(STEPS, PASSES * -(-len(examples) // BATCH))
        optimiser = torch.optim.Adam(self.parameters(), lr=RATE, betas=(0.9, 0.99), fused=True)
        step = 0
        while step < steps:
            check()
            for index in torch.split(torch.randperm(len(examples), generator=generator), BATCH)[: steps - step]:
                for group in optimiser.param_groups:
                    group["lr"] = RATE * 0.5 * (1.0 + math.cos(math.pi * step / steps))
                batch = examples.take(index)
                loss = self.loss(features(batch), batch.branch)
                optimiser.zero_grad()
                torch.autograd.backward(loss)
                optimiser.step()
                step += 1

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
