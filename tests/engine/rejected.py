"""Plain rejection from a spec, as pieces: how a real sampler is put to work."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenegen.sampling.pieces import Candidates
from scenegen.sampling.problem import Problem


@dataclass(frozen=True)
class Rejected:
    problem: Problem
    plan_digest: str = "rejection"
    fewest: int = 1
    patience: int | None = None

    @property
    def wanted(self):
        return self.problem.request.n

    @property
    def seed(self):
        return self.problem.request.seed

    @property
    def cells(self):
        return self.problem.cells

    @property
    def reached(self):
        return sorted(self.problem.possible)

    def piece(self, k):
        rows = self.problem.base(k)
        phi = self.problem.score(rows)
        return Candidates(rows.numpy(), phi, self.cells.find(phi), np.empty(0))
