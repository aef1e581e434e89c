"""Covers of one cell each, and how often their candidates hit it. They need nothing of each other, so several processes
make them where that takes long: it is most of the work before the first scene is drawn."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from dataclasses import dataclass

import numpy as np

from scenegen.bounds.effort import TooMuchError, per_scene
from scenegen.bounds.prune import SPENT, Cover
from scenegen.bounds.worlds import chooses
from scenegen.processes.pool import Pool, check_workers
from scenegen.processes.process import cores
from scenegen.sampling.problem import PLAN, Budget, Problem
from scenegen.sampling.rejection.draw import CHUNK, explore
from scenegen.sampling.rejection.stages import Stages
from scenegen.sampling.rejection.trial import effort_of, make_cover

SEARCH = 5  # chunks drawn from a cell's own cover before the cell counts as unreachable
WORTH = 2.5e7  # work of each process, about, at which it saves more time than it takes to start: half a second


@dataclass(frozen=True, slots=True)
class Own:
    """A cell's cover: `hits` of the cell among `tried` candidates, and the `work` of it all, see `Effort`. Without
    parts, the cell is proved empty. None: it took more work than was allowed. `stages` are the cover's, if they were
    made."""

    cover: Cover | None
    hits: int
    tried: int
    work: float
    stages: Stages | None = None


@dataclass(frozen=True, slots=True)
class _Covering:
    """The job: an item is a cell and the work allowed for it. Raises StoppedError where time is long up."""

    problem: Problem
    budget: Budget

    def __call__(self, item: tuple[int, float]) -> Own:
        cell, most = item
        problem, effort = self.problem, effort_of(self.budget, most)
        stream = (problem.request.seed, PLAN, cell + 1)
        try:
            cover = make_cover(problem, problem.wanted(cell), stream, effort, *_enough(problem))
            if not cover.parts:
                return Own(cover, 0, 0, effort.used)
            rng = np.random.default_rng(np.random.SeedSequence(list(stream)))
            hits, tried, stages = explore(problem, cover, SEARCH, rng, effort, cell)
        except TooMuchError:
            return Own(None, 0, 0, effort.used)
        return Own(cover, int(hits[cell]), tried, effort.used, stages)


def _enough(problem: Problem) -> tuple[float, float | None]:
    """From which work on any cover of a cell is good enough, as `prune` takes it: see `trial._enough`. Where objects
    choose among surfaces, a cover is worth as much work as drawing the cell's scenes takes if they are so rare that the
    search just hits them; where the search misses them, a better cover would seldom have helped."""
    if not chooses(problem.core):
        return math.inf, None
    each, _ = per_scene(problem.core.nodes)
    share = problem.request.n / len(problem.possible)
    return 0.0, max(SPENT, share * each * SEARCH * CHUNK)


def own_covers(
    problem: Problem, cells: Sequence[int], budget: Budget, most: Callable[[], float]
) -> Generator[Own, None, None]:
    """The covers of cells, in their order; made by several processes if the first of them show that it is worth it.

    `most` is the work that is allowed when a cover is begun. Several are begun at a time, so less may be left in their
    turn: the caller compares their work with that, and the result is the same for any number of processes.
    Raises StoppedError in the turn of a cover that time was up for, and what `Pool.map` raises.
    """
    job = _Covering(problem, budget)
    work = 0.0
    for done, cell in enumerate(cells):
        workers = _sharers(problem, len(cells) - done, work / max(1, done))
        if workers > 1:
            items = ((one, most()) for one in cells[done:])
            with Pool(job, workers, unit="cover", reserve=budget.reserve) as pool, closing(pool.map(items)) as made:
                yield from made
            return
        own = job((cell, most()))
        work += own.work
        yield own


def _sharers(problem: Problem, covers: int, each: float) -> int:
    """How many processes make so many covers that take so much work each."""
    worth = int(each * covers / WORTH)
    if worth < 2:
        return 1
    workers = problem.request.workers
    most = cores() if workers is None else min(check_workers(workers), cores())
    return min(most, covers, worth)
