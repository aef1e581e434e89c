"""Scenes as the models see them: all coordinates in [0, 1].

A position is its share of the width or height of the workspace (or of the object's own box), theta is in turns, as the
published code has it (theta then has a seam: 0 and 1 are the same heading, far apart to the published networks;
scenegen.learn.models.conditioned has none). Storage rows (3N, B) in metres and radians <-> x (B, 3N), one scene per
row.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import torch
from torch import Tensor

from scenegen.geometry.workspace import Workspace
from scenegen.lang.spec import CheckedSpec
from scenegen.learn.robustness.deciding import deciding_atoms
from scenegen.pose import LENGTHS, THETA, TWO_PI, X, row_of, rows_along


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
        turns = rows[rows_along(THETA)] / TWO_PI
        unit[rows_along(THETA)] = _wrap(turns - turns.floor(), 1.0)
        return unit.clamp_(0.0, 1.0).T.contiguous()

    def decode(self, x: Tensor) -> Tensor:
        """(B, 3N) in [0, 1] -> (3N, B): positions within the workspace, theta in [0, 2 pi), also when read as float64.

        Keeps dtype (float32 or float64) and device.
        """
        rows = x.T.clone(memory_format=torch.contiguous_format)
        for axis in LENGTHS:
            for low, high, part, _ in self._groups(axis, rows, rows):
                part.mul_(high - low).add_(low)
                part.clamp_(*float_bounds(low, high, x.dtype))
        rows[rows_along(THETA)] = _wrap(rows[rows_along(THETA)] * TWO_PI, TWO_PI)
        return rows

    def _groups(self, axis: int, rows: Tensor, other: Tensor) -> Iterator[tuple[float, float, Tensor, Tensor]]:
        """The range along an axis with the rows in it: all at once, or object by object where some have their own."""
        if not self.workspace.own:
            low, high = self.workspace.ranges[axis]
            yield low, high, rows[rows_along(axis)], other[rows_along(axis)]
            return
        lowest, highest = self.workspace.ends(axis, self.objects)
        for which, (low, high) in enumerate(zip(lowest.tolist(), highest.tolist(), strict=True)):
            row = row_of(which, axis)
            yield low, high, rows[row], other[row]


def float_bounds(low: float, high: float, dtype: torch.dtype) -> tuple[float, float]:
    """The lowest and highest number of `dtype` in [low, high]: float32(0.1) is above 0.1, so round inwards."""
    lowest, highest, infinity = torch.tensor([low, high, math.inf], dtype=dtype)
    if float(lowest) < low:
        lowest = torch.nextafter(lowest, infinity)
    if float(highest) > high:
        highest = torch.nextafter(highest, -infinity)
    return float(lowest), float(highest)


def _wrap(values: Tensor, period: float) -> Tensor:
    """Values in [0, period] with period, reached by rounding, made 0."""
    return torch.where(values >= period, torch.zeros_like(values), values)


# Labelled scenes as models take them: a training set, or a batch of it.


NONE, EVERY = -1, -2
"""Of `balanced`: no label, and all of them."""


@dataclass(frozen=True, slots=True)
class Examples:
    """M scenes: x (M, 3N) unit coordinates (scenegen.learn.models.codec), phi (M, L) in metres and radians, and the
    branch (M,) int64 in which phi is decided (scenegen.learn.models.codec; all 0 where a model does without).
    `balanced` (M,) is that of the data set (scenegen.learn.training.dataset): which labels may not be left
    out."""

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


# Branches: which atom decides phi of each label.
#
# phi is a tree of min and max over atoms, so on a level set exactly one atom of each label has the wanted value: the
# set is a union of faces, one for each atom that can decide. A network that knows which face to draw from has a
# simple piece to learn, with one atom to hold at the value and the others on the right side of it; which face is
# drawn, and how often, is a table of its own that no adversary and no regression can collapse. For disjunctions
# (experiment 3) a face lies in one disjunct, so none is lost. Where objects stand on one of several surfaces, which
# ones these are is part of the branch: the choice is drawn from the table, and is an input of the network.


MAX_BRANCHES = 96  # branches of a model; rarer ones share the last
OTHER = -1  # in a table of branches: no atom is known to decide


def ways_of(spec: CheckedSpec, rows: Tensor) -> Tensor:
    """What makes the branch of each scene of (3N, M) storage, (W, M) int64: of each label the node of the atom that
    decides it, and of each choice of the spec which surface it is."""
    found = [deciding_atoms(spec.core, rows)]
    for choice in spec.choices.values():
        ends = torch.tensor(choice.ends[:-1], dtype=rows.dtype)
        found.append(torch.bucketize(rows[row_of(choice.switch, X)].contiguous(), ends, right=True)[None])
    return torch.cat(found)


def survey(spec: CheckedSpec, rows: Tensor) -> tuple[Tensor, Tensor]:
    """The branch of each scene and what the branches are: (M,) int64 and (K, W) int64, most frequent first. Where there
    are more than MAX_BRANCHES, the last stands for all the rest and holds OTHER."""
    ways, index, counts = torch.unique(ways_of(spec, rows).T, dim=0, return_inverse=True, return_counts=True)
    order = torch.sort(counts, descending=True, stable=True).indices
    place = torch.empty_like(order)
    place[order] = torch.arange(len(order), device=order.device)
    branch, table = place[index], ways[order]
    if len(table) > MAX_BRANCHES:
        branch = branch.clamp_max(MAX_BRANCHES - 1)
        table = torch.cat([table[: MAX_BRANCHES - 1], torch.full_like(table[:1], OTHER)])
    return branch, table
