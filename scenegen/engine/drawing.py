"""The job of whatever draws pieces: a piece without what the request does not want."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from scenegen.formats.blocks import Array, Block
from scenegen.sampling.plan import Plan

Cells = npt.NDArray[np.integer[Any]]


@dataclass(frozen=True, slots=True)
class Drawing:
    """Piece k of a plan: its candidates in range, the cell of each as a small integer, and the piece's facts. The
    requirement's margin, the last row of phi if there is one, is no longer needed then."""

    plan: Plan
    labels: int

    def __call__(self, k: int) -> tuple[Block, Cells, Array]:
        made = self.plan.draw(k)
        block, cell = Block(made.rows, made.phi[: self.labels]), made.cell
        if len(cell) and cell.min() < 0:
            inside = np.flatnonzero(cell >= 0)
            block, cell = block.take(inside), cell[inside]
        small = np.min_scalar_type(-int(cell.max(initial=0)) - 1)  # cells often need a byte each, not eight
        return block, cell.astype(small), made.facts
