"""A sampler's pieces, less the scenes that do not settle.

Standing between a sampler and whoever spreads its candidates over cells, it makes settling part of the target: within a
cell, scenes follow the sampler's distribution given that they settle, and all n asked for are found.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from scenegen.formats.blocks import BLOCK
from scenegen.render.settle import Refusals, Settler
from scenegen.sampling.cells import Cells
from scenegen.sampling.pieces import Pieces

Array = npt.NDArray[np.float64]

MOST = 256  # scenes of a piece that are dropped, about: some seconds of one core
AT_LEAST = 2  # of each cell


class Settling:
    """The pieces of `pieces` with what does not settle left out; `refusals` counts it.

    It lives in one process, whose settler has the workers (drawing takes a thousandth of the time of dropping): give it
    to a runner with `workers=1`. A piece takes the first few candidates of every cell. Cells that have got all that
    they can take are passed over; this only leaves out what the runner would drop, as long as it starts with the first
    piece, or goes on after a break with the cells as full as it left them.
    """

    def __init__(self, pieces: Pieces, settler: Settler, refusals: Refusals) -> None:
        self._pieces, self._settler, self._refusals = pieces, settler, refusals
        cells = len(pieces.reached)
        # Half as many again as are wanted, since some will not settle.
        self._at_once = max(AT_LEAST, min(math.ceil(1.5 * pieces.wanted / cells), MOST // cells))
        # Where not all scenes fit into the runner's memory at once, it drops some and takes others later.
        self._enough = math.ceil(pieces.wanted / cells) if pieces.wanted <= BLOCK else np.inf
        self._found = np.zeros(max(pieces.reached) + 1)

    @property
    def plan_digest(self) -> str:
        return hashlib.sha256(f"settling {self._at_once} {self._pieces.plan_digest}".encode()).hexdigest()

    @property
    def wanted(self) -> int:
        return self._pieces.wanted

    @property
    def seed(self) -> int:
        return self._pieces.seed

    @property
    def cells(self) -> Cells:
        return self._pieces.cells

    @property
    def reached(self) -> Sequence[int]:
        return self._pieces.reached

    def piece(self, k: int) -> tuple[Array, Array]:
        """Those of the first candidates of piece k in each cell that settle: rows (3N, m) and phi (L, m)."""
        rows, phi = self._pieces.piece(k)
        cell = self.cells.find(phi)
        open_ = [one for one in self.reached if self._found[one] < self._enough]
        first = [np.flatnonzero(cell == one)[: self._at_once] for one in open_]
        taken = np.sort(np.concatenate([np.empty(0, dtype=np.intp), *first]))
        found = self._settler.settle(rows[:, taken].T.reshape(len(taken), -1, 3))
        self._refusals.add(found)
        kept = taken[found.kept]
        self._found += np.bincount(cell[kept], minlength=len(self._found))
        return rows[:, kept], phi[:, kept]
