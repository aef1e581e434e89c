"""What `flow`, `gan` and `aae` share: view of scenes and labels, branches, and the consistency of phi."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable
from typing import ClassVar

import torch
from torch import Tensor, nn
from torch.nn.functional import cross_entropy

from scenegen.learn.models.base import Hyper, Mlp, SceneModel, SpecLoss
from scenegen.learn.models.card import Layout
from scenegen.learn.models.codec import EVERY, Examples
from scenegen.pose import TWO_PI, row_count
from scenegen.search.effort import NEVER, Stop

# Which branch to draw from: P(branch | phi), learnt by cross-entropy and nothing else.


SELECTOR_WIDTH = 64
PASSES, STEPS, BATCH, RATE = 30, 3000, 512, 6e-3  # of learning it by itself


class Selector(nn.Module):
    """A small network from label features (B, 2L) to a distribution over K branches."""

    def __init__(self, layout: Layout) -> None:
        super().__init__()
        self.branches = layout.branches
        self.body = Mlp((layout.condition_size, SELECTOR_WIDTH, SELECTOR_WIDTH, layout.branches), 0.1)

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


# What the networks see of scenes and labels, and the way back.
#
# A scene becomes the C coordinates that phi depends on (scenegen.learn.models.card): positions stretched so that the
# training data spans [-1, 1], angles as (cos, sin), which has no seam. Free coordinates are left out and drawn
# uniformly when a scene is made. A label becomes two numbers: its rank in the training data, which gives rare and
# crowded values equal room, and its place in the range; both span [-1, 1]. Of several labels any may be free: then
# both numbers are 0, and a third, 1 where the label is given, is 0 as well.


KNOTS = 65  # quantiles of a label that are kept
MIN_SPREAD = 1e-6  # of the workspace: a coordinate that varies less is as good as constant


class DataScaling(nn.Module):
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
        self.high = torch.maximum(self.high, self.low + MIN_SPREAD)
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


class ConditionedModel(SceneModel):
    """A model that sees scenes through its DataScaling and knows the branch, which a Selector draws when it samples.

    Subclasses make their networks in __init__ and say in `make` how noise becomes a scene.
    """

    betas: ClassVar[tuple[float, float]] = (0.9, 0.99)
    """Of Adam."""

    label_scale: Tensor

    def __init__(self, layout: Layout, hyper: Hyper) -> None:
        super().__init__(layout, hyper)
        self.view = DataScaling(layout)
        self.selector = Selector(layout)
        self.register_buffer("label_scale", torch.empty(layout.labels, device="meta"))

    def fit(self, examples: Examples) -> None:
        super().fit(examples)
        self.view.fit(examples)
        # In units of its own spread, an error of phi counts alike on tables of any size, in metres and in radians.
        spread = examples.phi.std(0, unbiased=False)
        self.label_scale = torch.where(spread > 0.0, spread, torch.ones_like(spread))

    def prepare(self, examples: Examples, generator: torch.Generator, check: Callable[[], None]) -> None:
        """The selector learns by itself how often each branch occurs: among the many scenes of a batch of the other
        networks it would still be far off when they are done, and scenes of the wrong branch are right in all but their
        number."""
        if self.layout.branches < 2:
            return
        empty = examples.x.new_empty(len(examples), 0)  # scenes are not looked at
        told = Examples(empty, examples.phi, examples.branch, examples.balanced)
        self.selector.learn(
            told, lambda batch: self.view.features(self.visible_phi(batch, generator)), generator, check
        )

    def start(self, lr: float, spec_loss: SpecLoss) -> None:
        self.spec_loss = spec_loss
        self.optimisers = {"all": torch.optim.Adam(self.parameters(), lr=lr, betas=self.betas, fused=True)}

    def descend(self, loss: Tensor) -> None:
        """One step of Adam down the gradient of a loss ()."""
        optimiser = self.optimisers["all"]
        optimiser.zero_grad()
        torch.autograd.backward(loss)
        optimiser.step()

    def visible_phi(self, batch: Examples, generator: torch.Generator) -> Tensor:
        """phi of a batch (B, L) with NaN for the labels that the networks are not told this time."""
        if not self.layout.partial:
            return batch.phi
        return torch.where(visible_labels(batch, generator), batch.phi, torch.full_like(batch.phi, math.nan))

    def inconsistency(self, u: Tensor, phi: Tensor, branch: Tensor) -> Tensor:
        """How far phi of made scenes u (B, C) is from what was wanted, and the branch's atom from deciding it: the mean
        of both absolute errors, summed over labels, in standard deviations of the label. The second term pulls where
        another atom has taken over, and the first is then silent about the one that ought to decide. Labels that are
        NaN are free."""
        reached, atoms = self.spec_loss(self.view.unit(u), branch)
        off = ((reached - phi).abs() + (atoms - phi).abs()) / self.label_scale
        if self.layout.partial:
            off = torch.where(torch.isnan(phi), torch.zeros_like(off), off)
        return off.sum(1).mean()

    @abstractmethod
    def make(self, features: Tensor, branch: Tensor, generator: torch.Generator) -> Tensor:
        """Scenes (B, C) for label features (B, 2L) and branches (B,)."""

    def sample(self, n: int, phi: Tensor, generator: torch.Generator) -> Tensor:
        return self.sample_in(n, phi, generator)[0]

    @torch.no_grad()
    def sample_in(
        self, n: int, phi: Tensor, generator: torch.Generator, branch: Tensor | None = None, stop: Stop = NEVER
    ) -> tuple[Tensor, Tensor]:
        """As `sample`, in branches (n,), which are drawn where they are not given: the scenes and their branches."""
        stop.check()
        phi = phi.to(self.label_lowest)
        alike = phi.ndim == 1 or phi.stride(0) == 0
        features = self.view.features(phi[None] if phi.ndim == 1 else phi[:1] if alike else phi)
        features = features.expand(n, -1)
        branch = self.selector.draw(features, generator) if branch is None else branch
        return self.view.scenes(self.make(features, branch, generator), generator), branch


ALONE, PAIR = 0.4, 0.4  # shares of scenes with one label given, and with two; the others have all


def visible_labels(batch: Examples, generator: torch.Generator) -> Tensor:
    """Which labels of each scene a network sees, (B, L) bool: the one by which the scenes were balanced, and at
    random none, one or all of the others; all, where the scenes were balanced by all."""
    count, labels = batch.phi.shape
    device = batch.phi.device
    first, other = (torch.randint(labels, (count,), generator=generator, device=device) for _ in range(2))
    fate = torch.rand(count, generator=generator, device=device)
    if batch.balanced is not None:
        first = torch.where(batch.balanced >= 0, batch.balanced, first)
        fate = torch.where(batch.balanced == EVERY, torch.ones_like(fate), fate)
    place = torch.arange(labels, device=device)
    some = (place == first[:, None]) | ((place == other[:, None]) & (fate >= ALONE)[:, None])
    return some | (fate >= ALONE + PAIR)[:, None]


def detach_losses(**losses: Tensor) -> dict[str, Tensor]:
    """The losses by name, as `update` returns them."""
    return {name: loss.detach() for name, loss in losses.items()}
