"""The network of the flow: where the path through a scene at one time will be at another.

Paths lead from the base distribution at time 0 to the scenes of the wanted phi and branch at time 1. The network says
for a point x at time s which *goal* it heads for, and the point at time t >= s lies on the straight line there:

    jump(x, s, t) = x + (t - s) / (1 - s) * (goal(x, s, t) - x)

so jump(x, s, 1) is the goal itself, and for t = s the goal stands for the velocity (goal - x) / (1 - s). Goals are made
as in scenegen.models.generator, from x by a gate and a shift for each coordinate: a position is tanh(gate * atanh(x) +
shift), an angle gate * (cos, sin) + shift. A gate of 1 and a shift of 0 leave a coordinate where it is, and no position
leaves the box on the way, whatever the number of jumps.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from scenegen.models.generator import FIRST_GATE, INSIDE, SLOPE, directions, noise
from scenegen.models.layout import Layout
from scenegen.models.mlp import Mlp, one_hot

SMALLEST = 1e-6  # of what is left of time: keeps 0 / 0 out where rounding puts s at 1


class FlowMap(nn.Module):
    """Points are coordinates of a view, (B, C); times (B, 1) in [0, 1]; `context` (B, 2L + K) is of `context`."""

    def __init__(self, layout: Layout, width: int, depth: int) -> None:
        super().__init__()
        self.positions, self.angles, self.branches = len(layout.positions), len(layout.angles), layout.branches
        self.coordinates = layout.coordinates
        inputs = layout.coordinates + 2 + layout.told + layout.branches
        self.body = Mlp((inputs, *[width] * depth, layout.coordinates + layout.noise), SLOPE)

    def initialise(self, generator: torch.Generator) -> None:
        """Fresh weights; gates start half open."""
        self.body.initialise(generator)
        with torch.no_grad():
            self.body.linear()[-1].bias[self.coordinates :] = FIRST_GATE

    def context(self, features: Tensor, branch: Tensor) -> Tensor:
        """Label features (B, 2L) and branch (B,) as the network takes them."""
        return torch.cat([features, one_hot(branch, self.branches)], dim=1)

    def goal(self, x: Tensor, start: Tensor, end: Tensor, context: Tensor) -> Tensor:
        """Where x at `start` heads for on its way to its place at `end`, (B, C)."""
        positions, angles = self.positions, self.angles
        made: Tensor = self.body(torch.cat([x, start, end, context], dim=1))
        shift, gate = made[:, : self.coordinates], made[:, self.coordinates :]
        still = torch.atanh(x[:, :positions].clamp(-INSIDE, INSIDE))
        spread = torch.tanh(still * gate[:, :positions] + shift[:, :positions])
        if not angles:
            return spread
        lever = gate[:, positions:].repeat(1, 2)
        return torch.cat([spread, lever * x[:, positions:] + shift[:, positions:]], dim=1)

    def jump(self, x: Tensor, start: Tensor, end: Tensor, context: Tensor, *, velocity: bool = False) -> Tensor:
        """The place at `end` of the path that leads through x at `start`, (B, C); with `velocity`, along the straight
        line in which it leaves."""
        part = (end - start) / (1.0 - start).clamp_min(SMALLEST)
        return torch.lerp(x, self.goal(x, start, start if velocity else end, context), part)


def departure(count: int, layout: Layout, generator: torch.Generator, device: torch.device) -> Tensor:
    """(count, C) points of the base distribution: positions uniform over their range, angles over the circle."""
    z = noise(count, layout, generator, device)
    positions = len(layout.positions)
    return torch.cat([z[:, :positions], directions(z[:, positions:])], dim=1)
