"""Plain rejection from a spec, as pieces: how a real sampler is put to work."""

from __future__ import annotations

from dataclasses import dataclass

from scenegen.sampling.problem import Problem


@dataclass(frozen=True)
class Rejected:
    problem: Problem
    plan_digest: str = "rejection"

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
        return rows.numpy(), self.problem.score(rows)
