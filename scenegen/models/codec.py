"""Scenes as the models see them: all coordinates in [0, 1].

A position is its share of the workspace's width or height, theta is in turns, as the published code has it (theta then
has a seam: 0 and 1 are the same heading, far apart to the published networks; scenegen.models.view has none). Storage
rows (3N, B) in metres and radians <-> x (B, 3N), one scene per row.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from scenegen.scene.workspace import TWO_PI, Workspace


@dataclass(frozen=True, slots=True)
class Codec:
    """The map between storage and unit coordinates for N objects in a workspace."""

    workspace: Workspace
    objects: int

    def affine(self) -> tuple[Tensor, Tensor]:
        """Scale and offset (3N, 1) float32 of storage = unit coordinates * scale + offset, without any wrapping."""
        space = self.workspace
        scale = torch.tensor([space.width, space.height, TWO_PI]).repeat(self.objects)[:, None]
        return scale, torch.tensor([space.x[0], space.y[0], 0.0]).repeat(self.objects)[:, None]

    def encode(self, rows: Tensor) -> Tensor:
        """(3N, B) metres and radians -> (B, 3N) in [0, 1], theta in [0, 1). Keeps dtype and device."""
        space = self.workspace
        unit = torch.empty_like(rows)
        torch.sub(rows[0::3], space.x[0], out=unit[0::3])
        torch.sub(rows[1::3], space.y[0], out=unit[1::3])
        unit[0::3] /= space.width
        unit[1::3] /= space.height
        turns = rows[2::3] / TWO_PI
        unit[2::3] = _wrapped(turns - turns.floor(), 1.0)
        return unit.clamp_(0.0, 1.0).T.contiguous()

    def decode(self, x: Tensor) -> Tensor:
        """(B, 3N) in [0, 1] -> (3N, B): positions within the workspace, theta in [0, 2 pi), also when read as float64.

        Keeps dtype (float32 or float64) and device.
        """
        space = self.workspace
        rows = x.T.clone(memory_format=torch.contiguous_format)
        for axis, (low, high) in enumerate((space.x, space.y)):
            part = rows[axis::3]
            part.mul_(high - low).add_(low)
            part.clamp_(*within(low, high, x.dtype))
        rows[2::3] = _wrapped(rows[2::3] * TWO_PI, TWO_PI)
        return rows


def within(low: float, high: float, dtype: torch.dtype) -> tuple[float, float]:
    """The lowest and highest number of `dtype` in [low, high]: float32(0.1) is above 0.1, so round inwards."""
    lowest, highest, infinity = torch.tensor([low, high, math.inf], dtype=dtype)
    if float(lowest) < low:
        lowest = torch.nextafter(lowest, infinity)
    if float(highest) > high:
        highest = torch.nextafter(highest, -infinity)
    return float(lowest), float(highest)


def _wrapped(values: Tensor, period: float) -> Tensor:
    """Values in [0, period] with period, reached by rounding, made 0."""
    return torch.where(values >= period, torch.zeros_like(values), values)
