"""A plan without the scenes in which a policy is predicted to succeed too rarely or too often."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from scenegen.arrays import Array
from scenegen.errors import RequestError
from scenegen.errors.requests import OUT_OF_RANGE
from scenegen.learn.success.fit import Fit, TaskFit
from scenegen.sampling.plan import PHI_TOLERANCE, Account, Piece, Plan, Selection, Tally, digest
from scenegen.sampling.request import Range
from scenegen.search.effort import Budget

OWN_FACTS = 3  # of a piece: scenes looked at, scenes kept, and the sum of the predictions; then the plan's own


@dataclass(frozen=True, slots=True, eq=False)
class Predicted(Selection):
    """The scenes of `plan` whose success, by the fit of `policy` in a task, is predicted from `low` to `high`."""

    fit: TaskFit
    policy: str
    low: float
    high: float

    @property
    def plan_digest(self) -> str:
        facts = self.fit.model_dump_json(), self.low, self.high, self.found
        return digest("predicted", *facts, self.plan.plan_digest)

    @property
    def fact_count(self) -> int:
        return OWN_FACTS + self.plan.fact_count

    def draw(self, k: int) -> Piece:
        piece = self.plan.draw(k)
        inside = np.flatnonzero(piece.cell >= 0)
        rate = self.fit.predict(self.problem.spec, piece.rows[:, inside])
        kept = inside[(rate >= self.low) & (rate <= self.high)]
        facts = np.concatenate([[len(inside), len(kept), rate.sum()], piece.facts])
        return Piece(piece.rows[:, kept], piece.phi[:, kept], piece.cell[kept], facts)

    def account(self, tally: Tally) -> Account:
        """The plan's own account, of all its scenes, and how many of them were kept."""
        looked, kept, total = tally.facts[:OWN_FACTS] or (0.0, 0.0, 0.0)
        own = self.plan.account(replace(tally, facts=tally.facts[OWN_FACTS:]))
        request = {"range": [self.low, self.high], "policy": self.policy, "task": self.fit.name}
        note = f"of {looked:,.0f} scenes {kept:,.0f} have a predicted success of {self.low:g}:{self.high:g}"
        note += f"; it is {total / looked:.3g} on the average" if looked else ""
        return replace(own, info={**own.info, "success": {**request, "kept": kept / max(looked, 1.0)}}, note=note)

    def misses(self) -> tuple[Array, Array]:
        return Plan.misses(self)  # none: where scenes are missing, few have such a prediction

    def check(self, rows: Array, phi: Array) -> None:
        self.plan.check(rows, phi)
        rate = self.fit.predict(self.problem.spec, rows)
        if not ((rate >= self.low - PHI_TOLERANCE) & (rate <= self.high + PHI_TOLERANCE)).all():
            raise AssertionError("a sampler returned a scene whose predicted success is out of the range")


def select(plan: Plan, budget: Budget) -> Predicted:
    """As `success` and `under` of the plan's request want it. Raises DataError for a file that is no fit, and
    RequestError for a fit of other tasks, and where it never predicts such a rate."""
    problem, ends = plan.problem, plan.problem.request.success
    assert problem.request.under is not None and isinstance(ends, Range)
    fit = Fit.load(problem.request.under)
    task = fit.task_of(problem.spec)
    low, high = 0.0 if ends.low is None else ends.low, 1.0 if ends.high is None else ends.high
    least, most = task.model.bounds
    if low > most or high < least:
        wanted = f"a range of what the fit predicts in {task.name}: from {least:.3g} to {most:.3g}"
        raise RequestError(OUT_OF_RANGE(argument="success", value=str(ends), wanted=wanted))
    return Predicted(problem, plan, task, fit.run.policy, low, high, why=plan.why).probe()
