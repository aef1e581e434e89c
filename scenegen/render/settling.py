"""A sampler's pieces, less the scenes that do not settle.

Standing between a sampler and whoever spreads its candidates over cells, it makes settling part of the target: within a
cell, scenes follow the sampler's distribution given that they settle, and all n asked for are found.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from scenegen.formats.blocks import BLOCK
from scenegen.render.settle import Refusals, Settler
from scenegen.sampling.cells import Cells
from scenegen.sampling.pieces import Account, Candidates, Plan, Tally
from scenegen.sampling.problem import Problem

Array = npt.NDArray[np.float64]

MOST = 256  # scenes of a piece that are dropped, about: some seconds of one core
AT_LEAST = 2  # of each cell


class Settling:
    """A plan with what does not settle left out; `refusals` counts it.

    It lives in one process, whose settler has the workers (drawing takes a thousandth of the time of dropping): give it
    to a runner with `workers=1`. A piece takes the first few candidates of every cell. Cells that have got all that
    they can take are passed over; this only leaves out what the runner would drop, as long as it starts with the first
    piece, or goes on after a break with the cells as full as it left them.
    """

    def __init__(self, plan: Plan, settler: Settler, refusals: Refusals) -> None:
        self._plan, self._settler, self._refusals = plan, settler, refusals
        cells = len(plan.reached)
        # Half as many again as are wanted, since some will not settle.
        self._at_once = max(AT_LEAST, min(math.ceil(1.5 * plan.wanted / cells), MOST // cells))
        # Where not all scenes fit into the runner's memory at once, it drops some and takes others later.
        self._enough = math.ceil(plan.wanted / cells) if plan.wanted <= BLOCK else np.inf
        self._found = np.zeros(max(plan.reached) + 1)

    @property
    def plan_digest(self) -> str:
        return hashlib.sha256(f"settling {self._at_once} {self._plan.plan_digest}".encode()).hexdigest()

    @property
    def wanted(self) -> int:
        return self._plan.wanted

    @property
    def seed(self) -> int:
        return self._plan.seed

    @property
    def cells(self) -> Cells:
        return self._plan.cells

    @property
    def reached(self) -> Sequence[int]:
        return self._plan.reached

    @property
    def fewest(self) -> int:
        return self._plan.fewest

    @property
    def shared_by(self) -> int:
        return self._plan.shared_by

    @property
    def patience(self) -> int | None:
        return self._plan.patience

    @property
    def name(self) -> str:
        return self._plan.name

    @property
    def problem(self) -> Problem:
        return self._plan.problem

    @property
    def ruled_out(self) -> frozenset[int]:
        return self._plan.ruled_out

    @property
    def evaluations(self) -> float:
        return self._plan.evaluations

    def account(self, tally: Tally) -> Account:
        """What the plan itself says, of scenes before they are dropped. What was refused is no part of the file: after
        a break it is not known any more."""
        account = self._plan.account(tally)
        return replace(account, info={**account.info, "settled": True})

    def misses(self) -> tuple[Array, Array]:
        return self._plan.misses()

    def piece(self, k: int) -> Candidates:
        """Those of the first candidates of piece k in each cell that settle."""
        found = self._plan.piece(k)
        open_ = [one for one in self.reached if self._found[one] < self._enough]
        first = [np.flatnonzero(found.cell == one)[: self._at_once] for one in open_]
        taken = np.sort(np.concatenate([np.empty(0, dtype=np.intp), *first]))
        settled = self._settler.settle(found.rows[:, taken].T.reshape(len(taken), -1, 3))
        self._refusals.add(settled)
        kept = taken[settled.kept]
        self._found += np.bincount(found.cell[kept], minlength=len(self._found))
        return Candidates(found.rows[:, kept], found.phi[:, kept], found.cell[kept], found.facts)
