"""Labelled scenes as models take them: a training set, or a batch of it."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

NONE, EVERY = -1, -2
"""Of `balanced`: no label, and all of them."""


@dataclass(frozen=True, slots=True)
class Examples:
    """M scenes: x (M, 3N) unit coordinates (scenegen.models.codec), phi (M, L) in metres and radians, and the branch
    (M,) int64 in which phi is decided (scenegen.models.branches; all 0 where a model does without). `balanced` (M,) is
    that of the data set (scenegen.training.datasets.dataset): which labels may not be left out."""

    x: Tensor
    phi: Tensor
    branch: Tensor
    balanced: Tensor | None = None

    def __len__(self) -> int:
        return len(self.x)

    def take(self, index: Tensor | slice) -> Examples:
        """Some of the scenes."""
        balanced = None if self.balanced is None else self.balanced[index]
        return Examples(self.x[index], self.phi[index], self.branch[index], balanced)

    def to(self, device: torch.device) -> Examples:
        balanced = None if self.balanced is None else self.balanced.to(device)
        return Examples(self.x.to(device), self.phi.to(device), self.branch.to(device), balanced)
