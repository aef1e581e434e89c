"""Exact sampling from plan to scenes: one path, however many processes there are and wherever the scenes go.

A plan is made in the parent, its pieces are run here or by workers, and the same blocks come out of them in the same
order, into memory or into a file. Every scene is looked at once more on its way.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from scenegen.engine.stream import Progress, run_blocks, stream_scenes
from scenegen.errors import Diagnostic
from scenegen.formats.blocks import Block
from scenegen.sampling.auto import Choice, choose
from scenegen.sampling.collect import Sampled
from scenegen.sampling.pieces import Plan, Tally
from scenegen.sampling.problem import Budget, Problem
from scenegen.sampling.report import fell_short, summed_up
from scenegen.sampling.verify import verify
from scenegen.scene.data import SceneFile

SMALL = 1 << 29  # evaluations of formula nodes below which processes cost more time than they save: some seconds
AT_LEAST = 1 << 27  # of them for each process, for the same reason
BESIDE = 16  # what drawing, sorting into cells and looking again costs, in nodes per evaluation (measured)

Header = Callable[[dict[str, object]], SceneFile]
"""From what `sampler` is to say to the scene file without its scenes."""


def crew(plan: Plan, workers: int | None) -> int:
    """How many processes a plan is worth, where that is not said: one where they would cost more than they save, else
    as many as there are cores. It changes no scene."""
    if workers is not None:
        return workers
    work = plan.evaluations * (len(plan.problem.core.nodes) + BESIDE)
    return 1 if work < SMALL else max(1, min(_cores(), plan.shared_by, math.floor(work / AT_LEAST)))


def _cores() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def in_memory(
    choice: Choice, budget: Budget, *, workers: int | None = None, progress: Progress | None = None
) -> Sampled:
    """The scenes of a plan, or as many as the budget allows: `shortfall` then says why. Raises what `run_blocks`
    raises, and AssertionError for a scene that should not have come out."""
    plan = choice.plan
    problem = plan.problem
    labels = len(problem.spec.labels)
    rows, phi = np.empty((len(problem.lowest), plan.wanted)), np.empty((labels, plan.wanted))
    count = 0
    run = run_blocks(plan, labels, workers=crew(plan, workers), spent=lambda: budget.spent, progress=progress)
    while True:
        try:
            block = next(run)
        except StopIteration as end:
            tally: Tally = end.value
            break
        verify(problem, block.rows, block.phi)
        part = slice(count, count + block.count)
        rows[:, part], phi[:, part] = block.rows, block.phi
        count += block.count
    info, warnings = facts(choice, tally)
    return Sampled(rows[:, :count], phi[:, :count], info, warnings, fell_short(plan, tally))


def to_file(
    path: Path,
    choice: Choice,
    header: Header,
    budget: Budget,
    *,
    versions: Mapping[str, str],
    workers: int | None = None,
    resume: bool = False,
    keep_partial: bool = False,
    joining: Callable[[Block], None] | None = None,
    progress: Progress | None = None,
) -> tuple[Tally, tuple[Diagnostic, ...]]:
    """The scenes of a plan in a file, block by block: see `stream_scenes`. Returns the tally and the warnings.

    A run is only resumed by the same `versions`, numpy's included. With fewer scenes than wanted there is no file, but
    where `keep_partial` says so.
    """
    plan = choice.plan
    problem = plan.problem
    tally = stream_scenes(
        path,
        plan,
        problem.spec.labels,
        lambda tally: header(facts(choice, tally)[0]),
        request=request_of(problem, versions),
        workers=crew(plan, workers),
        resume=resume,
        keep_partial=keep_partial,
        spent=lambda: budget.spent,
        inspect=lambda block: verify(problem, block.rows, block.phi),
        joining=joining,
        progress=progress,
    )
    return tally, summed_up(plan, tally)[1]


def facts(choice: Choice, tally: Tally) -> tuple[dict[str, object], tuple[Diagnostic, ...]]:
    """What the scene file's `sampler` says of a run, and the warnings."""
    info, warnings = summed_up(choice.plan, tally)
    if choice.reason is not None:
        info = {**info, "auto": True, "reason": choice.reason}
    return info, warnings


def request_of(problem: Problem, versions: Mapping[str, str]) -> dict[str, object]:
    """JSON that fixes, together with a plan, which scenes come out."""
    request = problem.request
    return {
        "spec": problem.spec.sha256,
        "phi": {label: [wanted.low, wanted.high] for label, wanted in request.ranges.items()},
        "spread": request.spread,
        "fix": {name: list(pose) for name, pose in request.fixed.items()},
        "numpy": np.__version__,
        **versions,
    }


def draw(
    problem: Problem,
    budget: Budget | None = None,
    progress: Progress | None = None,
    *,
    method: str = "auto",
    workers: int | None = 1,
) -> Sampled:
    """Scenes for a problem by a method of `sampling.auto.METHODS`, in this process unless told otherwise. Raises
    RequestError where it is known that there are none."""
    budget = Budget() if budget is None else budget
    return in_memory(choose(problem, method, budget), budget, workers=workers, progress=progress)
