"""Flow matching, taken in a few steps.

For a scene x of the training data, a point z of the base distribution and a time s, the point (1 - s) z + s x lies on a
straight path between them. The mean direction of all such paths through a point is a velocity field that carries the
base distribution over into that of the scenes (Lipman et al., "Flow matching for generative modeling", ICLR 2023).
Following it exactly takes many small steps, because straight paths cross and the field is curved; three by the midpoint
rule are enough to land near the scenes of the wanted phi, and the correction (scenegen.learn.models.correction) does
the rest. Losses:

* `velocity`: |goal(x_s, s, s) - x|^2, weighted by 1 / (1 - s)^2, that is the squared error of the velocity;
* `branch`: the selector's cross-entropy.

With the setting `jumps` the same network learns long jumps as well, to be taken in one (the semigroup condition of flow
maps; Frans et al., "One step diffusion via shortcut models", ICLR 2025; Boffi et al., "How to build a consistency
model", 2025): a jump from s to t must land where two jumps, from s to a random time between and on to t, land. That
takes three times as long for each step of training, and of several pieces of a level set it blurs the edges:

* `jumps`: |jump(x_s, s, t) - jump(jump(x_s, s, m), m, t)|^2 with no gradient through the two, weighted alike;
* `phi`: the inconsistency (scenegen.learn.models.conditioned) of the scenes that jumps to t = 1 arrive at.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import ClassVar

import torch
from pydantic import Field
from torch import Tensor, nn

from scenegen.learn.models.base import Hyper, Mlp, one_hot
from scenegen.learn.models.card import Layout
from scenegen.learn.models.codec import Examples
from scenegen.learn.models.conditioned import ConditionedModel, detach_losses
from scenegen.learn.models.generator import ATANH_BOUND, FIRST_GATE, SLOPE, directions, noise

# The network of the flow: where the path through a scene at one time will be at another.
#
# Paths lead from the base distribution at time 0 to the scenes of the wanted phi and branch at time 1. The network
# says for a point x at time s which *goal* it heads for, and the point at time t >= s lies on the straight line
# there:
#
#     jump(x, s, t) = x + (t - s) / (1 - s) * (goal(x, s, t) - x)
#
# so jump(x, s, 1) is the goal itself, and for t = s the goal stands for the velocity (goal - x) / (1 - s). Goals are
# made as in scenegen.learn.models.generator, from x by a gate and a shift for each coordinate: a position is
# tanh(gate * atanh(x) + shift), an angle gate * (cos, sin) + shift. A gate of 1 and a shift of 0 leave a coordinate
# where it is, and no position leaves the box on the way, whatever the number of jumps.


ZERO_TIME_GUARD = 1e-6  # of what is left of time: keeps 0 / 0 out where rounding puts s at 1


class FlowMap(nn.Module):
    """Points are coordinates of a view, (B, C); times (B, 1) in [0, 1]; `context` (B, 2L + K) is of `context`."""

    def __init__(self, layout: Layout, width: int, depth: int) -> None:
        super().__init__()
        self.positions, self.angles, self.branches = len(layout.positions), len(layout.angles), layout.branches
        self.coordinates = layout.coordinates
        inputs = layout.coordinates + 2 + layout.condition_size + layout.branches
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
        still = torch.atanh(x[:, :positions].clamp(-ATANH_BOUND, ATANH_BOUND))
        spread = torch.tanh(still * gate[:, :positions] + shift[:, :positions])
        if not angles:
            return spread
        lever = gate[:, positions:].repeat(1, 2)
        return torch.cat([spread, lever * x[:, positions:] + shift[:, positions:]], dim=1)

    def jump(self, x: Tensor, start: Tensor, end: Tensor, context: Tensor, *, velocity: bool = False) -> Tensor:
        """The place at `end` of the path that leads through x at `start`, (B, C); with `velocity`, along the straight
        line in which it leaves."""
        part = (end - start) / (1.0 - start).clamp_min(ZERO_TIME_GUARD)
        return torch.lerp(x, self.goal(x, start, start if velocity else end, context), part)


def departure(count: int, layout: Layout, generator: torch.Generator, device: torch.device) -> Tensor:
    """(count, C) points of the base distribution: positions uniform over their range, angles over the circle."""
    z = noise(count, layout, generator, device)
    positions = len(layout.positions)
    return torch.cat([z[:, :positions], directions(z[:, positions:])], dim=1)


MIN_TIME_LEFT = 0.2  # of time left that weights count: later errors would outweigh all else


class FlowHyper(Hyper):
    """`width` and `depth` of the hidden layers; `jumps`: weight of the loss of long jumps, 0 to do without it;
    `consistency`: weight of the error of phi, beside `jumps` only; `steps` that a scene takes when it is made (training
    does not depend on it): each is one evaluation of the network with `jumps`, two without."""

    width: int = Field(default=160, ge=1, le=8192)
    depth: int = Field(default=3, ge=1, le=64)
    jumps: float = Field(default=0.0, ge=0.0, le=1e6)
    consistency: float = Field(default=2.5, ge=0.0, le=1e6)
    steps: int = Field(default=3, ge=1, le=1000)


class Flow(ConditionedModel):
    """See the module's text."""

    hyper_class = FlowHyper
    before: ClassVar[Mapping[str, float]] = {"jumps": 5.0}

    def __init__(self, layout: Layout, hyper: FlowHyper) -> None:
        super().__init__(layout, hyper)
        self.weight, self.jumps = hyper.consistency, hyper.jumps
        self.steps = hyper.steps
        self.flow = FlowMap(layout, hyper.width, hyper.depth)

    def make(self, features: Tensor, branch: Tensor, generator: torch.Generator) -> Tensor:
        context = self.flow.context(features, branch)
        x = departure(len(features), self.layout, generator, features.device)
        time = torch.linspace(0.0, 1.0, self.steps + 1, device=x.device)[:, None, None].expand(-1, len(x), 1)
        for start, end in pairwise(time):
            x = self.flow.jump(x, start, end, context) if self.jumps else self._halfway(x, start, end, context)
        return x

    def _halfway(self, x: Tensor, start: Tensor, end: Tensor, context: Tensor) -> Tensor:
        """A step with the velocity of its middle (the midpoint rule): two evaluations, an error of second order."""
        middle = 0.5 * (start + end)
        there = self.flow.jump(x, start, middle, context, velocity=True)
        velocity = (self.flow.goal(there, middle, middle, context) - there) / (1.0 - middle)
        return x + (end - start) * velocity

    def update(self, batch: Examples, generator: torch.Generator) -> dict[str, Tensor]:
        wanted = self.visible_phi(batch, generator)
        features = self.view.features(wanted)
        context = self.flow.context(features, batch.branch)
        x = self.view.encode(batch.x)
        z = departure(len(x), self.layout, generator, x.device)
        surprise = self.selector.loss(features, batch.branch)
        if not self.jumps:
            velocity = self._velocity(z, x, context, generator)
            self.descend(velocity + surprise)
            return detach_losses(velocity=velocity, branch=surprise)
        rest = len(x) // 2  # half as many velocities as jumps do, and save a fifth of the time
        velocity = self._velocity(z[rest:], x[rest:], context[rest:], generator)
        jumps, off = self._jumps(z, x, context, wanted, batch.branch, generator)
        self.descend(velocity + self.jumps * jumps + self.weight * off + surprise)
        return detach_losses(velocity=velocity, jumps=jumps, phi=off, branch=surprise)

    def _velocity(self, z: Tensor, x: Tensor, context: Tensor, generator: torch.Generator) -> Tensor:
        """The error of the velocity at a random time of each path."""
        time = _uniform(len(x), generator, x.device)
        goal = self.flow.goal(torch.lerp(z, x, time), time, time, context)
        return _mean_square(goal - x, time)

    def _jumps(
        self, z: Tensor, x: Tensor, context: Tensor, wanted: Tensor, branch: Tensor, generator: torch.Generator
    ) -> tuple[Tensor, Tensor]:
        """How far long jumps land from where two shorter ones do, and the inconsistency of phi where they arrive.

        Half of the jumps, every second, start at 0, as all do when scenes are made in one; the first half of the
        batch, which is in random order, jumps to 1.
        """
        count = len(x)
        start, end = torch.stack([_uniform(count, generator, x.device) for _ in range(2)]).sort(dim=0).values
        start[::2] = 0.0
        arriving = (count + 1) // 2
        end[:arriving] = 1.0
        middle = torch.lerp(start, end, _uniform(count, generator, x.device))
        x = torch.lerp(z, x, start)
        with torch.no_grad():
            target = self.flow.jump(self.flow.jump(x, start, middle, context), middle, end, context)
        landed = self.flow.jump(x, start, end, context)
        off = self.inconsistency(landed[:arriving], wanted[:arriving], branch[:arriving])
        return _mean_square(landed - target, start), off


def _uniform(count: int, generator: torch.Generator, device: torch.device) -> Tensor:
    """(count, 1) times in [0, 1)."""
    return torch.rand(count, 1, generator=generator, device=device)


def _mean_square(error: Tensor, time: Tensor) -> Tensor:
    """Mean squared length of errors (B, C) of goals at times (B, 1), as those of velocities."""
    return (error / (1.0 - time).clamp_min(MIN_TIME_LEFT)).square().sum(1).mean()
