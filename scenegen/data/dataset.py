"""Scenes labelled with phi."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import torch
from torch import Tensor

from scenegen.lang.spec import CheckedSpec
from scenegen.models.codec import Codec
from scenegen.robustness import Robustness


@dataclass(frozen=True, slots=True)
class Dataset:
    """M scenes: `rows` (3N, M) float32, metres and radians, in the workspace; `phi` (L, M) float32, a row per label."""

    objects: tuple[str, ...]
    labels: tuple[str, ...]
    rows: Tensor
    phi: Tensor

    def __len__(self) -> int:
        return self.rows.shape[1]

    def take(self, which: Tensor | slice) -> Dataset:
        """Some of the scenes."""
        return Dataset(self.objects, self.labels, self.rows[:, which].contiguous(), self.phi[:, which].contiguous())

    @property
    def positives(self) -> float:
        """Share of the scenes that satisfy every label (phi >= 0)."""
        return float((self.phi >= 0.0).all(dim=0).double().mean())

    @property
    def sha256(self) -> str:
        """Checksum of poses and labels: two data sets with the same one are bit-equal."""
        digest = hashlib.sha256(self.rows.numpy().tobytes())
        digest.update(self.phi.numpy().tobytes())
        return digest.hexdigest()


def base_draw(spec: CheckedSpec, scenes: int, generator: torch.Generator) -> Tensor:
    """(3N, scenes) float32 from the base distribution: uniform over workspace and circle."""
    unit = torch.rand(scenes, 3 * len(spec.objects), generator=generator)
    return Codec(spec.workspace, len(spec.objects)).decode(unit)


def labelled(spec: CheckedSpec, rows: Tensor) -> Dataset:
    """The scenes with their phi."""
    return Dataset(spec.objects, spec.labels, rows, Robustness(spec.core).rows(rows))
