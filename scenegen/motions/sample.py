"""From a problem to motions: in this process or several, with the same result."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from scenegen.bounds.effort import StoppedError
from scenegen.engine.stream import run_blocks
from scenegen.errors import RequestError
from scenegen.errors.requests import NO_TIME_TO_TELL
from scenegen.motions.plan import make_plan
from scenegen.motions.problem import Array, Index, MotionProblem
from scenegen.motions.schedule import Watch
from scenegen.motions.stages import generator
from scenegen.motions.variables import draw, poses_of, within_a_turn
from scenegen.sampling.problem import Budget


@dataclass(frozen=True, slots=True)
class Sampled:
    """Motions: `poses` (n, T + 1, N, 3) in metres and radians, `movers` (n, T), an object's index or -1 where all
    move, and `phi` (n, L). `info` says how they were drawn; `complete` is False if time, or the search, ended with
    fewer than the request's n."""

    poses: Array
    movers: Index
    phi: Array
    info: Mapping[str, object]
    complete: bool

    @property
    def count(self) -> int:
        return len(self.poses)


def sample(
    problem: MotionProblem, budget: Budget | None = None, *, method: str = "auto", watch: Watch | None = None
) -> Sampled:
    """The request's motions. `method` is "auto", "rejection" or "splitting". Motions do not depend on the request's
    `workers`. If the range is not reached there are none. `watch` is shown motions until they are there: at first any.
    Raises RequestError if time is up before the plan is made, AssertionError for a motion that fails the check."""
    budget = Budget(problem.request.timeout) if budget is None else budget
    labels, cells, workers = len(problem.labels), problem.cells, problem.request.workers or 1
    with np.errstate(all="ignore"):
        if watch is not None:
            poses = within_a_turn(
                poses_of(problem, draw(problem, problem.request.n, generator(problem.request.seed, -1)))
            )
            watch(np.ascontiguousarray(poses.transpose(3, 2, 0, 1)), 0)
        try:
            plan = make_plan(problem, budget, method, watch)
        except StoppedError:
            raise RequestError(
                NO_TIME_TO_TELL(
                    tried="levels of motions", undecided=cells.count, cells=cells.count if cells.count > 1 else None
                )
            ) from None
        columns, info = [np.empty((problem.rows, 0))], dict[str, object]()
        if plan is not None:
            run = run_blocks(plan, labels, workers=workers, reserve=budget.reserve, spent=lambda: budget.spent)
            while True:
                try:
                    columns.append(next(run).rows)
                except StopIteration as end:
                    info = dict(plan.account(end.value).info)
                    break
            info["cells"] = {"asked": cells.count, "reached": len(plan.reached)}
        rows = np.concatenate(columns, axis=1)
        poses, movers = _split(problem, rows)
        scores = problem.scores(poses)
    assert (cells.find(scores) >= 0).all(), "a motion is out of range"
    motions = np.ascontiguousarray(poses.transpose(3, 2, 0, 1))
    return Sampled(motions, movers, scores[:labels].T, info, len(motions) >= problem.request.n)


def _split(problem: MotionProblem, rows: Array) -> tuple[Array, Index]:
    poses, movers = rows[: len(rows) - problem.steps], rows[len(rows) - problem.steps :]
    shape = (len(problem.names), 3, problem.steps + 1, rows.shape[1])
    return poses.reshape(shape), movers.T.astype(np.intp)
