"""What training asks of the compiled spec: phi of a network's own scenes, with gradients."""

from __future__ import annotations

import dataclasses

import torch
from torch import Tensor

from scenegen.lang.core import Core
from scenegen.models.branches import OTHER
from scenegen.models.codec import Codec
from scenegen.robustness import Robustness


class SpecLoss:
    """phi of every label and the value of the atom that ought to decide it, for unit coordinates x (B, 3N).

    `table` (K, W) names the deciding atoms of each branch, and after them the surfaces of choices
    (scenegen.models.branches). One pass over the core formula gives both; gradients are those of hard min and max,
    exact away from ties.
    """

    def __init__(self, core: Core, table: Tensor, codec: Codec) -> None:
        table = table[:, : len(core.labels)]  # choices of surfaces are no atoms
        atoms = sorted({int(node) for node in table.flatten() if node != OTHER})
        labels = {**core.labels, **{f"#{node}": node for node in atoms}}
        self._robustness = Robustness(dataclasses.replace(core, labels=labels))
        self._labels = len(core.labels)
        # the row of Robustness' output to read for each branch and label; phi itself where the branch names no atom
        place = {node: self._labels + index for index, node in enumerate(atoms)}
        own = range(self._labels)
        self._rows = torch.tensor([[place.get(int(way[k]), k) for k in own] for way in table])

        self._scale, self._offset = codec.affine()

    def __call__(self, x: Tensor, branch: Tensor) -> tuple[Tensor, Tensor]:
        """x (B, 3N), branch (B,) -> phi (B, L) and the branch's atoms (B, L)."""
        values = self._values(x)
        return values[:, : self._labels], values.gather(1, self._rows[branch])

    def phi(self, x: Tensor) -> Tensor:
        """x (B, 3N) -> (B, L)."""
        return self._values(x)[:, : self._labels]

    def _values(self, x: Tensor) -> Tensor:
        if self._rows.device != x.device:
            self._rows, self._scale, self._offset = (t.to(x.device) for t in (self._rows, self._scale, self._offset))
        # one scene per row of x, one contiguous row per coordinate for the formula
        return self._robustness.rows(x.T.contiguous() * self._scale + self._offset, check=False).T
