"""What the networks see of scenes and labels, and the way back.

A scene becomes the C coordinates that phi depends on (scenegen.models.layout): positions stretched so that the training
data spans [-1, 1], angles as (cos, sin), which has no seam. Free coordinates are left out and drawn uniformly when a
scene is made. A label becomes two numbers: its rank in the training data, which gives rare and crowded values equal
room, and its place in the range; both span [-1, 1]. Of several labels any may be free: then both numbers are 0, and a
third, 1 where the label is given, is 0 as well.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from scenegen.models.examples import Examples
from scenegen.models.layout import Layout
from scenegen.pose import TWO_PI, row_count

KNOTS = 65  # quantiles of a label that are kept
NARROW = 1e-6  # of the workspace: a coordinate that varies less is as good as constant


class View(nn.Module):
    """Buffers only. `fit` sets them from training data; they travel in the model file."""

    low: Tensor
    high: Tensor
    free_low: Tensor
    free_high: Tensor
    knots: Tensor
    _learnt: Tensor
    _free: Tensor
    _order: Tensor

    def __init__(self, layout: Layout) -> None:
        super().__init__()
        self.positions, self.angles, self.partial = len(layout.positions), len(layout.angles), layout.partial
        learnt = [*layout.positions, *layout.angles]
        free = [row for row in range(row_count(layout.objects)) if row not in set(learnt)]
        for name, size in (("low", len(layout.positions)), ("high", len(layout.positions))):
            self.register_buffer(name, torch.empty(size, device="meta"))
        for name in ("free_low", "free_high"):
            self.register_buffer(name, torch.empty(len(free), device="meta"))
        self.register_buffer("knots", torch.empty(layout.labels, KNOTS, device="meta"))
        for name, rows in (("_learnt", learnt), ("_free", free), ("_order", _inverse([*learnt, *free]))):
            self.register_buffer(name, torch.tensor(rows, dtype=torch.int64), persistent=False)

    def fit(self, examples: Examples) -> None:
        """Take ranges and ranks from the training data, on its device."""
        x, phi = examples.x, examples.phi
        learnt, free = x[:, self._learnt[: self.positions]], x[:, self._free]
        self.low, self.high = learnt.amin(0), learnt.amax(0)
        self.high = torch.maximum(self.high, self.low + NARROW)
        # A free coordinate varies over all of its range, or an object is held in place and it does not vary at all.
        held = free.amax(0) == free.amin(0)
        self.free_low = torch.where(held, free[0], torch.zeros_like(free[0]))
        self.free_high = torch.where(held, free[0], torch.ones_like(free[0]))
        places = torch.linspace(0, len(phi) - 1, KNOTS, dtype=torch.float64).round().long()
        self.knots = phi.sort(dim=0).values[places].T.contiguous()

    def features(self, phi: Tensor) -> Tensor:
        """Labels (B, L), NaN where one is free, -> (B, told). Beyond the training data the numbers go on linearly."""
        values = phi.T.contiguous()
        given = ~torch.isnan(values)
        if self.partial:
            values = torch.where(given, values, self.knots[:, :1])
        upper = torch.searchsorted(self.knots, values).clamp(1, KNOTS - 1)
        below, above = self.knots.gather(1, upper - 1), self.knots.gather(1, upper)
        rank = (upper - 1 + (values - below) / (above - below).clamp_min(1e-9)) * (2.0 / (KNOTS - 1)) - 1.0
        lowest, highest = self.knots[:, :1], self.knots[:, -1:]
        place = (values - lowest) * 2.0 / (highest - lowest).clamp_min(1e-9) - 1.0
        # Between equal knots, as of a label that hardly varies, the quotient may be huge.
        rank, place = rank.clamp(-3.0, 3.0), place.clamp(-9.0, 9.0)
        if not self.partial:
            return torch.cat([rank, place]).T
        return torch.cat([rank * given, place * given, given.to(rank)]).T

    def encode(self, x: Tensor) -> Tensor:
        """Unit coordinates (B, 3N) -> (B, C)."""
        learnt = x[:, self._learnt]
        spread = (learnt[:, : self.positions] - self.low) / (self.high - self.low) * 2.0 - 1.0
        turns = learnt[:, self.positions :] * TWO_PI
        return torch.cat([spread, torch.cos(turns), torch.sin(turns)], dim=1)

    def unit(self, u: Tensor, free: Tensor | None = None) -> Tensor:
        """(B, C) -> unit coordinates (B, 3N), differentiable; [0, 1] up to rounding where u is in [-1, 1].

        `free` (B, F) in [0, 1] places the free coordinates; without it they are 0: phi does not depend on them.
        """
        count, angles = len(u), self.angles
        x = (u[:, : self.positions] + 1.0) * (0.5 * (self.high - self.low)) + self.low
        cosine, sine = u[:, self.positions : self.positions + angles], u[:, self.positions + angles :]
        turns = torch.atan2(sine, cosine) / TWO_PI
        turns = turns + (turns < 0.0)
        rest = (
            u.new_zeros(count, len(self.free_low)) if free is None else torch.lerp(self.free_low, self.free_high, free)
        )
        return torch.cat([x, turns, rest], dim=1)[:, self._order]

    def scenes(self, u: Tensor, generator: torch.Generator) -> Tensor:
        """(B, C) -> unit coordinates (B, 3N) in [0, 1], the free ones drawn uniformly."""
        free = torch.rand(len(u), len(self.free_low), generator=generator, device=u.device)
        return self.unit(u, free).clamp_(0.0, 1.0)


def _inverse(rows: list[int]) -> list[int]:
    place = [0] * len(rows)
    for index, row in enumerate(rows):
        place[row] = index
    return place
