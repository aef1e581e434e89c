"""From a plan to scenes: one path for all methods, any number of processes, in memory or to a file.

A plan is made in the parent, its pieces are drawn here or by workers, and the same blocks come out of them in the same
order, into memory or into a file. Every scene is checked once more on its way.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from scenegen.errors import Diagnostic
from scenegen.processes.ahead import IdleWorkers
from scenegen.processes.pool import check_workers
from scenegen.processes.process import cores
from scenegen.sampling.engine.stream import run_blocks, stream_scenes
from scenegen.sampling.methods import make_plan
from scenegen.sampling.plan import Plan, Tally
from scenegen.sampling.problem import Budget, Problem
from scenegen.sampling.report import fell_short, summed_up
from scenegen.sampling.request import Progress
from scenegen.scenes.blocks import Block
from scenegen.scenes.data import SceneFile

if TYPE_CHECKING:
    from scenegen.sampling.request import SampleRequest


Array = npt.NDArray[np.float64]

SMALL = 1 << 29  # evaluations of formula nodes below which processes cost more time than they save: a few seconds
AT_LEAST = 1 << 27  # of them for each process, for the same reason
BESIDE = 16  # cost of drawing, sorting into cells and verifying, in nodes per evaluation (measured)

Header = Callable[[dict[str, object]], SceneFile]
"""From the content of `sampler` to the scene file without its scenes."""


@dataclass(frozen=True, slots=True)
class SampledScenes:
    """Scenes: rows (3N, n) and phi (L, n) in float64, how they were made, and warnings.

    `info` goes into the scene file's `sampler` (no timings: the same seed gives the same bytes). `shortfall` is set if
    fewer than the requested n scenes were found.
    """

    rows: Array
    phi: Array
    info: Mapping[str, object]
    warnings: tuple[Diagnostic, ...] = ()
    shortfall: Diagnostic | None = None

    @property
    def count(self) -> int:
        return int(self.rows.shape[1])


def jobs(plan: Plan) -> int:
    """How many processes draw a plan: the request's number; else one if more would cost more time than they save, or
    one per core. The scenes do not depend on it. Raises RequestError for an invalid number."""
    workers = plan.problem.request.workers
    if workers is not None:
        return min(check_workers(workers), plan.shared_by)
    work = plan.evaluations * (len(plan.problem.core.nodes) + BESIDE)
    return 1 if work < SMALL else max(1, min(cores(), plan.shared_by, math.floor(work / AT_LEAST)))


def in_memory(plan: Plan, budget: Budget, progress: Progress | None = None) -> SampledScenes:
    """The scenes of a plan, or as many as the budget allows: `shortfall` then says why. Raises what `run_blocks`
    raises, and AssertionError for a scene that fails the check."""
    labels = len(plan.problem.spec.labels)
    rows, phi = np.empty((len(plan.problem.lowest), plan.wanted)), np.empty((labels, plan.wanted))
    count = 0
    with closing(plan):
        run = run_blocks(
            plan, labels, workers=jobs(plan), reserve=budget.reserve, spent=lambda: budget.spent, progress=progress
        )
        while True:
            try:
                block = next(run)
            except StopIteration as end:
                tally: Tally = end.value
                break
            _check(plan, block)
            part = slice(count, count + block.count)
            rows[:, part], phi[:, part] = block.rows, block.phi
            count += block.count
        info, warnings = summed_up(plan, tally)
        return SampledScenes(rows[:, :count], phi[:, :count], info, warnings, fell_short(plan, tally))


def to_file(
    path: Path,
    plan: Plan,
    header: Header,
    budget: Budget,
    *,
    versions: Mapping[str, str],
    resume: bool = False,
    joining: Callable[[Block], None] | None = None,
    stored: Callable[[Block], Block] | None = None,
    progress: Progress | None = None,
) -> tuple[Tally, tuple[Diagnostic, ...], Diagnostic | None]:
    """The scenes of a plan in a file, block by block: see `stream_scenes`. Returns the tally, the warnings, and why
    there are fewer scenes than wanted, if there are.

    A run is only resumed by the same `versions`, numpy's included. With fewer scenes than wanted there is no file,
    unless the request keeps partial results.
    """
    problem = plan.problem
    with closing(plan):
        tally = stream_scenes(
            path,
            plan,
            problem.spec.labels,
            lambda tally: header(summed_up(plan, tally)[0]),
            request=request_of(problem, versions),
            workers=jobs(plan),
            reserve=budget.reserve,
            resume=resume,
            keep_partial=problem.request.keep_partial,
            spent=lambda: budget.spent,
            inspect=lambda block: _check(plan, block),
            joining=joining,
            stored=stored,
            progress=progress,
        )
        return tally, summed_up(plan, tally)[1], fell_short(plan, tally)


def _check(plan: Plan, block: Block) -> None:
    if plan.verified:
        plan.check(block.rows, block.phi)


def request_of(problem: Problem, versions: Mapping[str, str]) -> dict[str, object]:
    """JSON that, together with a plan, determines the scenes."""
    request = problem.request
    return {
        "spec": problem.spec.sha256,
        "phi": {label: [phi.low, phi.high] for label, phi in request.phi.items()},
        "spread": request.spread,
        "fix": {name: list(pose) for name, pose in problem.fixed.items()},
        "numpy": np.__version__,
        **versions,
    }


def draw(
    problem: Problem, budget: Budget | None = None, progress: Progress | None = None, *, method: str | None = None
) -> SampledScenes:
    """Exact scenes for a problem, by the request's method or another one; in this process, unless the request gives a
    number of workers. Raises RequestError if it is known that there are none."""
    budget = Budget(problem.request.timeout) if budget is None else budget
    here = replace(problem.request, workers=problem.request.workers or 1)
    return in_memory(make_plan(replace(problem, request=here), budget, method=method), budget, progress)


# --------------------------------------------------------------------------------------------------------------------
# What a request may use: time, and processes of this machine that serve its plan and its run one after the other.
#
# It loads nothing that processes can load meanwhile.


SCENES = ("scenegen.sampling.engine.blocks", "scenegen.sampling.contest")
MOTIONS = ("scenegen.sampling.engine.blocks", "scenegen.sampling.motions.sampler")
MODELS = ("scenegen.sampling.engine.blocks", "scenegen.learn.guided", "scenegen.learn.models.checkpoint")


def start_processes(
    workers: int | None, engine: str = "local", *, settle: bool = False, load: tuple[str, ...] = SCENES
) -> IdleWorkers:
    """If a request asks for several processes, they start at once and load what most plans need, but as long as this
    one loads it has a core of its own; none if another engine draws its pieces, or a simulator settles them. Raises
    RequestError for an invalid number."""
    count = 1 if workers is None else check_workers(workers)
    if count == 1 or engine != "local" or settle:
        return IdleWorkers()
    now = max(1, min(count, cores() - 1))
    return IdleWorkers(now, load, later=min(count, cores()) - now)


@contextlib.contextmanager
def open_budget(
    request: SampleRequest, engine: str = "local", *, load: tuple[str, ...] = SCENES, reserve: IdleWorkers | None = None
) -> Iterator[Budget]:
    """The budget of a request, as a context manager. Its processes start now, unless there is a `reserve` already."""
    from scenegen.sampling.problem import Budget

    with contextlib.ExitStack() as stack:
        if reserve is None:
            reserve = start_processes(request.workers, engine, settle=request.settle, load=load)
            stack.enter_context(reserve)
        yield Budget(request.timeout, reserve=reserve)
