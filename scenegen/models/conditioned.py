"""What the models of the default recipe share: view of scenes and labels, branches, and the consistency of phi."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable
from typing import ClassVar

import torch
from torch import Tensor

from scenegen.models.base import Hyper, SceneModel
from scenegen.models.examples import EVERY, Examples
from scenegen.models.layout import Layout
from scenegen.models.selector import Selector
from scenegen.models.spec_loss import SpecLoss
from scenegen.models.view import View


class ConditionedModel(SceneModel):
    """A model that sees scenes through a View and knows the branch, which a Selector draws when it samples.

    Subclasses make their networks in __init__ and say in `make` how noise becomes a scene.
    """

    branched = True
    betas: ClassVar[tuple[float, float]] = (0.9, 0.99)
    """Of Adam."""

    label_scale: Tensor

    def __init__(self, layout: Layout, hyper: Hyper) -> None:
        super().__init__(layout, hyper)
        self.view = View(layout)
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
        self.selector.learn(told, lambda batch: self.view.features(self.wanted(batch, generator)), generator, check)

    def start(self, lr: float, spec_loss: SpecLoss) -> None:
        self.spec_loss = spec_loss
        self.optimisers = {"all": torch.optim.Adam(self.parameters(), lr=lr, betas=self.betas, fused=True)}

    def descend(self, loss: Tensor) -> None:
        """One step of Adam down the gradient of a loss ()."""
        optimiser = self.optimisers["all"]
        optimiser.zero_grad()
        torch.autograd.backward(loss)
        optimiser.step()

    def wanted(self, batch: Examples, generator: torch.Generator) -> Tensor:
        """phi of a batch (B, L) with NaN for the labels that the networks are not told this time."""
        if not self.layout.partial:
            return batch.phi
        return torch.where(given(batch, generator), batch.phi, torch.full_like(batch.phi, math.nan))

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
        self, n: int, phi: Tensor, generator: torch.Generator, branch: Tensor | None = None
    ) -> tuple[Tensor, Tensor]:
        """As `sample`, in branches (n,), which are drawn where they are not given: the scenes and their branches."""
        phi = phi.to(self.label_lowest)
        alike = phi.ndim == 1 or phi.stride(0) == 0
        features = self.view.features(phi[None] if phi.ndim == 1 else phi[:1] if alike else phi)
        features = features.expand(n, -1)
        branch = self.selector.draw(features, generator) if branch is None else branch
        return self.view.scenes(self.make(features, branch, generator), generator), branch


ALONE, PAIR = 0.4, 0.4  # shares of scenes with one label given, and with two; the others have all


def given(batch: Examples, generator: torch.Generator) -> Tensor:
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


def detached(**losses: Tensor) -> dict[str, Tensor]:
    """The losses by name, as `update` returns them."""
    return {name: loss.detach() for name, loss in losses.items()}
