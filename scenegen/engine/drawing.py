"""The job of whatever draws pieces: a piece without what the request does not want."""

from __future__ import annotations

from collections.abc import Generator, Iterable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from scenegen.formats.blocks import Array, Block
from scenegen.processes.pool import Underway, run_pieces
from scenegen.processes.reserve import Reserve
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


def draw_pieces(
    drawing: Drawing, numbers: Iterable[int], workers: int, reserve: Reserve | None
) -> Generator[tuple[Block, Cells, Array], None, None]:
    """The pieces of these numbers, in their order: see `run_pieces`. Those that other processes draw already are left
    to them."""
    if workers == 1:
        return run_pieces(drawing, numbers)
    job = replace(drawing, plan=drawing.plan.alone())
    underway = {k: Underway(beside, partial(drawing, k)) for k, beside in drawing.plan.underway().items()}
    return run_pieces(job, numbers, workers, reserve, underway)
