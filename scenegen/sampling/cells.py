"""The requested range of phi, cut into cells that get equal shares of the scenes (docs/sampling.md)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scenegen.arrays import Array, Index
from scenegen.sampling.request import Range, SampleRequest

CELLS_PER_LABEL = {0: 1, 1: 32, 2: 16}  # cells along each bounded label; 8 for three or more


@dataclass(frozen=True, slots=True)
class Cells:
    """The product of the bounded ranges, cut into equal cells, plus the constraints of all labels.

    `edges[k]` are the borders along bounded label `bounded[k]` (an index into the labels); `low` and `high` are (L,)
    with infinities for open ends.
    """

    labels: tuple[str, ...]
    bounded: tuple[int, ...]
    edges: tuple[Array, ...]
    low: Array
    high: Array

    @property
    def count(self) -> int:
        return math.prod(len(edge) - 1 for edge in self.edges)

    def find(self, phi: Array) -> Index:
        """The cell of each of B scenes from their phi, (L, B) -> (B,); -1 if a label is out of its range."""
        inside = ((phi >= self.low[:, None]) & (phi <= self.high[:, None])).all(axis=0)
        cell = np.zeros(phi.shape[1], dtype=np.intp)
        for label, edge in zip(self.bounded, self.edges, strict=True):
            along = np.searchsorted(edge, phi[label], side="right") - 1
            cell = cell * (len(edge) - 1) + np.clip(along, 0, len(edge) - 2)
        return np.where(inside, cell, -1)

    def limits(self, cell: int) -> tuple[Array, Array]:
        """Lowest and highest phi of every label in a cell, each (L,)."""
        low, high = self.low.copy(), self.high.copy()
        for label, edge in zip(reversed(self.bounded), reversed(self.edges), strict=True):
            cell, along = divmod(cell, len(edge) - 1)
            low[label], high[label] = edge[along], edge[along + 1]
        return low, high

    def describe(self, cell: int) -> str:
        """The cell as ranges of phi: `task 0.05:0.054`."""
        low, high = self.limits(cell)
        return ", ".join(f"{self.labels[k]} {low[k]:.4g}:{high[k]:.4g}" for k in self.bounded) or "the whole range"


def cut(request: SampleRequest, labels: Sequence[str], most: float = math.inf) -> Cells:
    """The cells of a request; a single one for `--spread base`, or if no range is bounded. About `most` at most: what
    wants a few scenes needs no more."""
    ranges = [request.phi.get(label, Range()) for label in labels]
    low, high = np.array([wanted.ends for wanted in ranges]).reshape(-1, 2).T.copy()
    bounded = tuple(k for k, wanted in enumerate(ranges) if wanted.is_bounded) if request.spread != "base" else ()
    pieces = CELLS_PER_LABEL.get(len(bounded), 8)
    if most < pieces ** len(bounded):
        pieces = math.ceil(most ** (1 / len(bounded)))
    edges = tuple(np.linspace(low[k], high[k], pieces + 1) for k in bounded)
    return Cells(tuple(labels), bounded, edges, low, high)
