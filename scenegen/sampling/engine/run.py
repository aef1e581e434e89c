"""From a plan to scenes: one path for all methods, any number of processes, in memory or to a file.

A plan is made in the parent, its pieces are drawn here or by workers, and the same blocks come out of them in the same
order, into memory or into a file. Every scene is checked once more on its way.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass

import numpy as np

from scenegen.errors import Diagnostic
from scenegen.processes.pool import check_workers
from scenegen.processes.process import cores
from scenegen.sampling.engine.blocks import run_blocks
from scenegen.sampling.plan import Plan, Tally
from scenegen.sampling.problem import Problem
from scenegen.sampling.report import run_info, shortfall_of_run
from scenegen.sampling.request import Progress, Range
from scenegen.scenes.blocks import Block
from scenegen.search.effort import Budget

# evaluations of formula nodes below which processes cost more time than they save: a few seconds
SMALL_RUN_WORK = 1 << 29
MIN_PROCESS_WORK = 1 << 27  # of them for each process, for the same reason


@dataclass(frozen=True, slots=True, eq=False)
class SampledScenes(Block):
    """All scenes of a run, how they were made, and warnings.

    `info` goes into the scene file's `sampler` (no timings: the same seed gives the same bytes). `shortfall` is set if
    fewer than the requested n scenes were found.
    """

    info: Mapping[str, object]
    warnings: tuple[Diagnostic, ...] = ()
    shortfall: Diagnostic | None = None


def jobs(plan: Plan) -> int:
    """How many processes draw a plan: the request's number; else one if more would cost more time than they save, or
    one per core. The scenes do not depend on it. Raises RequestError for an invalid number."""
    workers = plan.problem.request.workers
    if workers is not None:
        return min(check_workers(workers), plan.shared_by)
    work = plan.evaluations * plan.problem.cost
    return 1 if work < SMALL_RUN_WORK else max(1, min(cores(), plan.shared_by, math.floor(work / MIN_PROCESS_WORK)))


def in_memory(plan: Plan, budget: Budget, progress: Progress | None = None) -> SampledScenes:
    """The scenes of a plan, or as many as the budget allows: `shortfall` then says why. Raises what `run_blocks`
    raises, and AssertionError for a scene that fails the check."""
    labels = len(plan.problem.labels)
    rows, phi = np.empty((plan.problem.rows, plan.scenes_wanted)), np.empty((labels, plan.scenes_wanted))
    count = 0
    with closing(plan):
        run = run_blocks(plan, labels, workers=jobs(plan), spent=lambda: budget.is_spent, progress=progress)
        while True:
            try:
                block = next(run)
            except StopIteration as end:
                tally: Tally = end.value
                break
            if plan.is_verified:
                plan.check(block.rows, block.phi)
            part = slice(count, count + block.count)
            rows[:, part], phi[:, part] = block.rows, block.phi
            count += block.count
        info, warnings = run_info(plan, tally)
        return SampledScenes(
            rows[:, :count], phi[:, :count], info, warnings, shortfall_of_run(plan, tally, budget.is_spent)
        )


def resume_record(problem: Problem, versions: Mapping[str, str]) -> dict[str, object]:
    """JSON that, together with a plan, determines the scenes."""
    request, rates = problem.request, problem.request.success
    return {
        **({"success": [rates.low, rates.high]} if isinstance(rates, Range) else {}),
        "spec": problem.spec.sha256,
        "phi": {label: [phi.low, phi.high] for label, phi in request.phi.items()},
        "spread": request.spread,
        "fix": {name: list(pose) for name, pose in problem.fixed_poses.items()},
        "numpy": np.__version__,
        **versions,
    }
