"""Cells that no candidate hit, looked at together: where phi jumps, most of the cells of a range have no scenes.

Bounds seldom prove this, and a cover of each such cell takes as long as one of the whole range. Where all those covers
would take long, one is made of each run of such cells first. Cells that its candidates hit are served from it; if they
miss all cells, these get no covers of their own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scenegen.bounds.effort import StoppedError
from scenegen.bounds.prune import Cover
from scenegen.bounds.requirements import Ends
from scenegen.bounds.worlds import chooses
from scenegen.sampling.problem import PLAN, Budget, Problem
from scenegen.sampling.rejection.draw import explore
from scenegen.sampling.rejection.stages import Stages
from scenegen.sampling.rejection.trial import Trial, effort_of, make_cover

WORTH = 3e7  # work of covers of a cell each, about, above which a look at all of them together is worth it: 0.5 s
LEAST = 2  # cells of a run
CHUNKS = 10  # drawn from the cover of a run
ROUGH = 5e6  # work of a cover of a run, about: many candidates are drawn in the time that a good one takes


@dataclass(frozen=True, slots=True, eq=False)
class Served:
    """Cells that are taken from one cover; a candidate hits the rarest of them with the probability `rate`. `stages`
    are the cover's, if they were made."""

    cells: tuple[int, ...]
    cover: Cover
    rate: float
    stages: Stages | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Sieve:
    """What is known of cells that need no covers of their own: those that are served together, those proved empty, and
    those that no candidate hit."""

    served: tuple[Served, ...] = ()
    empty: frozenset[int] = frozenset()
    barren: frozenset[int] = frozenset()
    tried: int = 0
    work: float = 0.0

    @property
    def settled(self) -> frozenset[int]:
        return self.empty.union(self.barren, *(one.cells for one in self.served))


def sift(problem: Problem, trial: Trial, cells: Sequence[int], budget: Budget, most: float, worth: float) -> Sieve:
    """Look at those of `cells` (rising) together that no candidate of the trial hit. A cell is served with others where
    it takes at most `worth` candidates for each scene that it is to get. Without choices of surfaces phi seldom jumps:
    nothing is looked at.

    Raises StoppedError if time is up, and TooMuchError if the work exceeds `most`.
    """
    missed = [cell for cell in cells if not trial.hits[cell]]
    if len(missed) * trial.work < WORTH or not chooses(problem.core):
        return Sieve()
    served, empty, barren = list[Served](), set[int](), set[int]()
    effort, tried = effort_of(budget, most), 0
    possible = sorted(problem.possible)
    waiting = _runs(missed, possible)
    while waiting:
        run = waiting.pop()
        if len(run) < LEAST:
            continue
        if budget.spent:
            raise StoppedError
        stream = (problem.request.seed, PLAN, run[0] + 1, run[-1] + 1)
        cover = make_cover(problem, _wanted(problem, run), stream, effort, 0.0, ROUGH)
        if not cover.parts:
            empty.update(run)
            continue
        rng = np.random.default_rng(np.random.SeedSequence(list(stream)))
        hits, count, stages = explore(problem, cover, CHUNKS, rng, effort)
        tried += count
        if not hits[run].any():
            barren.update(run)
            continue
        common = [cell for cell in run if hits[cell] * worth >= count]
        if common:
            served.append(Served(tuple(common), cover, float(hits[common].min()) / count, stages))
            waiting += _runs([cell for cell in run if cell not in common], possible)
    return Sieve(tuple(served), frozenset(empty), frozenset(barren), tried, effort.used)


def _runs(missed: Sequence[int], possible: Sequence[int]) -> list[list[int]]:
    """Cells that follow one another among the possible ones, all rising."""
    place = {cell: number for number, cell in enumerate(possible)}
    runs: list[list[int]] = []
    for cell in missed:
        if runs and place[cell] == place[runs[-1][-1]] + 1:
            runs[-1].append(cell)
        else:
            runs.append([cell])
    return runs


def _wanted(problem: Problem, run: Sequence[int]) -> dict[int, Ends]:
    """A demand that the scenes of all these cells meet."""
    limits = [problem.cells.limits(cell) for cell in run]
    low, high = np.min([ends[0] for ends in limits], axis=0), np.max([ends[1] for ends in limits], axis=0)
    return problem.demand(low, high)
