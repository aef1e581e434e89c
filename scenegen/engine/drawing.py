"""The job of whatever draws pieces: a piece without what the request does not want."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenegen.formats.blocks import Array, Block
from scenegen.sampling.plan import Index, Plan


@dataclass(frozen=True, slots=True)
class Drawing:
    """Piece k of a plan: its candidates in range, the cell of each, and the piece's facts. The requirement's margin,
    the last row of phi if there is one, is no longer needed then."""

    plan: Plan
    labels: int

    def __call__(self, k: int) -> tuple[Block, Index, Array]:
        made = self.plan.draw(k)
        rows, phi, cell = made.rows, made.phi[: self.labels], made.cell
        if len(cell) and cell.min() < 0:
            inside = np.flatnonzero(cell >= 0)
            rows, phi, cell = rows.take(inside, axis=1), phi.take(inside, axis=1), cell[inside]
        return Block(rows, phi), cell, made.facts
