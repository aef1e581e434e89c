"""A cover of the whole range, and the results of the first candidates from it."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass

import numpy as np

from scenegen.arrays import Index
from scenegen.errors import Diagnostic, RequestError
from scenegen.processes.pool import Pool, check_workers
from scenegen.processes.process import cores
from scenegen.sampling.problem import SCENES_IN_CACHE, Problem, refuse_impossible
from scenegen.sampling.rejection.draw import EXPLORE_CHUNKS, Stages, explore, misses
from scenegen.sampling.report import shortfall, too_early
from scenegen.sampling.streams import REJECTION_PLAN_STREAM
from scenegen.search.effort import (
    BOUND_SECONDS,
    SCORE_SECONDS,
    Budget,
    Effort,
    StoppedError,
    TooMuchError,
    work_per_scene,
)
from scenegen.search.prune import MIN_COVER_WORK, Cover, GoodEnough, prune

# work of a trial above which another method is worth a try: more than any shipped spec takes, 2 to 3 s
TRIAL_WORK = 1.4e8
# with priors, work after which any cover will do: at least this, or this share of the work of drawing the scenes
PRIOR_COVER_WORK, PRIOR_COVER_SHARE = 5e6, 0.1
CANDIDATE_MARGIN = 32.0  # times as many candidates as scenes, for cells that are rarer than others
LONG_SEARCH_CANDIDATES = 32 * 65_536  # candidates after which the search ends if exploration found no cell at all


@dataclass(frozen=True, slots=True)
class Rate:
    """Scored candidates, and how many of them were accepted."""

    candidates: int = 0
    hits: int = 0


@dataclass(frozen=True, slots=True)
class Trial:
    """A cover of the whole range and the results of the first candidates from it: `hits` (C,) of each cell, among
    `tried`. `work` is its cost, see scenegen.search.effort; `stages` are the cover's, if they were made."""

    cover: Cover
    hits: Index
    tried: int
    work: float = 0.0
    stages: Stages | None = None

    @property
    def rate(self) -> Rate:
        return Rate(self.tried, int(self.hits.sum()))


def make_trial(
    problem: Problem, budget: Budget, most: float = math.inf, further: Callable[[], float] | None = None
) -> Trial:
    """The cover of the whole range and its first candidates. `further` is called where that takes more work than
    `most`: the work may come to what that returns, if it is more.

    Raises RequestError if the cover proves that there is no scene, or if time is up before there is a cover, and
    TooMuchError if the work exceeds what is allowed, which does not depend on the machine.
    """
    seed = problem.request.seed
    effort = effort_of(budget, most, further)
    try:
        cover = make_cover(problem, problem.demand(), (seed, REJECTION_PLAN_STREAM), effort, _enough(problem))
        if not cover.parts:
            refuse_impossible(problem, effort_of(budget))
        rng = np.random.default_rng(np.random.SeedSequence([seed, REJECTION_PLAN_STREAM, 0]))
        hits, tried, stages = explore(problem, cover, EXPLORE_CHUNKS, rng, effort)
    except StoppedError:
        raise RequestError(too_early(problem, "no draws at all", problem.cells.count)) from None
    return Trial(cover, hits, tried, effort.used, stages)


def _enough(problem: Problem) -> GoodEnough | None:
    """Which cover of the whole range, or of a cell, is good enough, if cells are about as common as each other.

    Where objects choose among surfaces, covers of many choices get better little by little, and most often few scenes
    are asked for. Where things usually are somewhere, many candidates are good from the start, and bounds of quantiles
    take long. Else the best is worth it."""
    each, _ = work_per_scene(problem.core.nodes)
    drawing = problem.request.n * each
    if problem.chooses:
        return GoodEnough(CANDIDATE_MARGIN * drawing, MIN_COVER_WORK)
    if problem.spec.priors:
        drawing *= SCORE_SECONDS / BOUND_SECONDS
        return GoodEnough(drawing, 0.0, max(PRIOR_COVER_WORK, PRIOR_COVER_SHARE * drawing))
    return None


def search_longer(problem: Problem, trial: Trial, budget: Budget, most: float = math.inf) -> Trial:
    """A longer search, if the first candidates were all out of range: at least LONG_SEARCH candidates, then more until
    one is in range, there are `most`, or time is up.

    Raises RequestError if time is up although some were in range: how many would depend on the machine, and so would
    every plan that is made of it.
    """
    rng = np.random.default_rng(np.random.SeedSequence([problem.request.seed, REJECTION_PLAN_STREAM, 0, 1]))
    hits, tried, stages = trial.hits.copy(), trial.tried, trial.stages
    effort = Effort(lambda: budget.is_spent)
    while tried < LONG_SEARCH_CANDIDATES or (tried < most and not hits.any()):
        try:
            effort.check()
            more, count, stages = explore(problem, trial.cover, EXPLORE_CHUNKS, rng, effort, stages=stages)
        except StoppedError:
            if hits.any():
                undecided = problem.cells.count - int(np.count_nonzero(hits))
                raise RequestError(too_early(problem, f"{tried:,} draws", undecided)) from None
            break
        hits += more
        tried += count
    return Trial(trial.cover, hits, tried, trial.work, stages)


def nothing_found(problem: Problem, trial: Trial) -> Diagnostic:
    """The error for a search in which no candidate was in range."""
    return shortfall(problem, 0, f"{trial.tried:,} draws", *misses(problem, trial.cover))


def effort_of(budget: Budget, most: float = math.inf, further: Callable[[], float] | None = None) -> Effort:
    """Work that is stopped if time has long been up."""
    return Effort(lambda: budget.overdrawn, most, further=further)


def make_cover(
    problem: Problem,
    wanted: Mapping[int, tuple[float, float]],
    seed: tuple[int, ...],
    effort: Effort,
    enough: GoodEnough | None = None,
) -> Cover:
    """A cover of the scenes that meet a demand; see `prune`."""
    return prune(
        problem.core, problem.lowest, problem.highest, wanted, seed, problem.tape, effort, enough, problem.stands
    )


# Covers of one cell each, and how often their candidates hit it. They need nothing of each other, so several
# processes make them where that takes long: it is most of the work before the first scene is drawn.


CELL_CHUNKS = 5  # chunks drawn from a cell's own cover before the cell counts as unreachable
PROCESS_WORK = 2.5e7  # work of each process, about, at which it saves more time than it takes to start: half a second


@dataclass(frozen=True, slots=True)
class CellCover:
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

    def __call__(self, item: tuple[int, float]) -> CellCover:
        cell, most = item
        problem, effort = self.problem, effort_of(self.budget, most)
        stream = (problem.request.seed, REJECTION_PLAN_STREAM, cell + 1)
        try:
            cover = make_cover(problem, problem.demand(cell), stream, effort, _enough_for_cell(problem))
            if not cover.parts:
                return CellCover(cover, 0, 0, effort.used)
            rng = np.random.default_rng(np.random.SeedSequence(list(stream)))
            hits, tried, stages = explore(problem, cover, CELL_CHUNKS, rng, effort, cell)
        except TooMuchError:
            return CellCover(None, 0, 0, effort.used)
        return CellCover(cover, int(hits[cell]), tried, effort.used, stages)


def _enough_for_cell(problem: Problem) -> GoodEnough | None:
    """Which cover of a cell is good enough, where the trial hits it seldom or never: see `_enough`. Where objects
    choose among surfaces, a cover is worth as much work as drawing the cell's scenes takes if they are so rare that the
    search just hits them; where the search misses them, a better cover would seldom have helped."""
    if not problem.chooses:
        return _enough(problem)
    each, _ = work_per_scene(problem.core.nodes)
    share = problem.request.n / len(problem.possible)
    return GoodEnough(0.0, max(MIN_COVER_WORK, share * each * CELL_CHUNKS * SCENES_IN_CACHE))


def own_covers(
    problem: Problem, cells: Sequence[int], budget: Budget, most: Callable[[], float]
) -> Generator[CellCover, None, None]:
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
            with Pool(job, workers, unit="cover") as pool, closing(pool.map(items)) as made:
                yield from made
            return
        own = job((cell, most()))
        work += own.work
        yield own


def _sharers(problem: Problem, covers: int, each: float) -> int:
    """How many processes make so many covers that take so much work each."""
    worth = int(each * covers / PROCESS_WORK)
    if worth < 2:
        return 1
    workers = problem.request.workers
    most = cores() if workers is None else min(check_workers(workers), cores())
    return min(most, covers, worth)
