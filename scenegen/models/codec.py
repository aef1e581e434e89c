"""Scenes as the models see them: all coordinates in [0, 1].

A position is its share of the width or height of the workspace (or of the object's own box), theta is in turns, as the
published code has it (theta then has a seam: 0 and 1 are the same heading, far apart to the published networks;
scenegen.models.view has none). Storage rows (3N, B) in metres and radians <-> x (B, 3N), one scene per row.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import torch
from torch import Tensor

from scenegen.pose import LENGTHS, THETA, TWO_PI, along, row_of
from scenegen.scene.workspace import Workspace


@dataclass(frozen=True, slots=True)
class Codec:
    """The map between storage and unit coordinates for N objects in a workspace."""

    workspace: Workspace
    objects: int

    def affine(self) -> tuple[Tensor, Tensor]:
        """Scale and offset (3N, 1) float32 of storage = unit coordinates * scale + offset, without any wrapping."""
        low, high = self.workspace.box(self.objects)
        scale, offset = torch.from_numpy(high - low), torch.from_numpy(low)
        return scale.to(torch.float32)[:, None], offset.to(torch.float32)[:, None]

    def encode(self, rows: Tensor) -> Tensor:
        """(3N, B) metres and radians -> (B, 3N) in [0, 1], theta in [0, 1). Keeps dtype and device."""
        unit = torch.empty_like(rows)
        for axis in LENGTHS:
            for low, high, part, share in self._groups(axis, rows, unit):
                torch.sub(part, low, out=share)
                share /= high - low
        turns = rows[along(THETA)] / TWO_PI
        unit[along(THETA)] = _wrapped(turns - turns.floor(), 1.0)
        return unit.clamp_(0.0, 1.0).T.contiguous()

    def decode(self, x: Tensor) -> Tensor:
        """(B, 3N) in [0, 1] -> (3N, B): positions within the workspace, theta in [0, 2 pi), also when read as float64.

        Keeps dtype (float32 or float64) and device.
        """
        rows = x.T.clone(memory_format=torch.contiguous_format)
        for axis in LENGTHS:
            for low, high, part, _ in self._groups(axis, rows, rows):
                part.mul_(high - low).add_(low)
                part.clamp_(*within(low, high, x.dtype))
        rows[along(THETA)] = _wrapped(rows[along(THETA)] * TWO_PI, TWO_PI)
        return rows

    def _groups(self, axis: int, rows: Tensor, other: Tensor) -> Iterator[tuple[float, float, Tensor, Tensor]]:
        """The range along an axis with the rows in it: all at once, or object by object where some have their own."""
        if not self.workspace.own:
            low, high = self.workspace.ranges[axis]
            yield low, high, rows[along(axis)], other[along(axis)]
            return
        lowest, highest = self.workspace.ends(axis, self.objects)
        for which, (low, high) in enumerate(zip(lowest.tolist(), highest.tolist(), strict=True)):
            row = row_of(which, axis)
            yield low, high, rows[row], other[row]


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
