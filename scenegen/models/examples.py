"""Labelled scenes as models take them: a training set, or a batch of it."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor


@dataclass(frozen=True, slots=True)
class Examples:
    """M scenes: x (M, 3N) unit coordinates (scenegen.models.codec), phi (M, L) in metres and radians, and the branch
    (M,) int64 in which phi is decided (scenegen.models.branches; all 0 where a model does without)."""

    x: Tensor
    phi: Tensor
    branch: Tensor

    def __len__(self) -> int:
        return len(self.x)

    def take(self, index: Tensor | slice) -> Examples:
        """Some of the scenes."""
        return Examples(self.x[index], self.phi[index], self.branch[index])

    def to(self, device: torch.device) -> Examples:
        return Examples(self.x.to(device), self.phi.to(device), self.branch.to(device))
