"""Plain rejection from a spec: how a real plan is put to work. torch draws and scores its scenes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenegen.learn.guided import score
from scenegen.learn.refine import draw, piece_generator
from scenegen.learn.robustness import Robustness
from scenegen.sampling.plan import Account, Piece, Plan


@dataclass(frozen=True, slots=True, eq=False)
class Rejected(Plan):
    method = "rejection"
    plan_digest = "rejection"
    evaluations = scenes_per_piece = 1.0
    fact_count = 0

    @property
    def reached_cells(self):
        return sorted(self.problem.possible)

    def draw(self, k):
        problem = self.problem
        rows = draw(problem.lowest, problem.highest, problem.piece_size, piece_generator(self.seed, k))
        phi = score(problem, Robustness(problem.core), rows)
        return Piece(rows.numpy(), phi, self.cells.find(phi), np.empty(0))

    def account(self, tally):
        return Account({}, "")
