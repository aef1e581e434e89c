"""The plan of a growth run: the order of the objects, how many poses are tried for each, which moves are made and how
many.

A population is grown while planning; what it needed is written down and frozen, and pieces follow that. All of it is
counted in evaluations, never timed, so spec, request and seed fix the plan, and its pieces can run anywhere. Nothing
can be drawn by the plan before there is one. So that a second process has work by then, too, large requests have two
such populations that know nothing of each other: the second one is the second piece.
"""

from __future__ import annotations

import math
from contextlib import ExitStack
from dataclasses import dataclass

import numpy as np

from scenegen.bounds.effort import GROWN, STEPPED
from scenegen.sampling.growth.begin import LEAST, OF_A_CELL, WORTH, First, Stalled, Started, size_of, start_growth
from scenegen.sampling.growth.grow import Step
from scenegen.sampling.growth.machine import Machine
from scenegen.sampling.growth.moves import Settings
from scenegen.sampling.growth.population import ISLANDS, SPARE, Population, Size, Taken, wanted_scenes
from scenegen.sampling.problem import Budget, Problem

SPARE_OF_ONE = 1.07  # scenes grown for each one wanted by further pieces of a single cell: see settle.LOST
EVEN = 0.75  # of that, for an even number of pieces
AGAIN = 2  # times that a population is made larger


@dataclass(frozen=True, slots=True, eq=False)
class Recipe:
    """What pieces follow: `count` scenes for `cells`, `steps` for each object, then `settle` sweeps, and one scene in
    `thin` is taken; of these `share` fill the cells evenly. `effect` is the design effect of common ancestors that is
    left among these, `evaluations` the cost of the plan, `piece` of a piece; `seconds` are those of CPU that a
    population and a piece take, see bounds.effort. The first pieces are `populations` of their own, of the given
    `size`; those that are known are in `taken`."""

    steps: tuple[Step, ...]
    settings: Settings
    cells: tuple[int, ...]
    count: int
    settle: int
    thin: float
    effect: float
    evaluations: float
    piece: float
    size: Size
    taken: tuple[Taken, ...] = ()
    share: float = 1.0
    seconds: tuple[float, float] = math.inf, math.inf

    @property
    def brings(self) -> float:
        """About how many scenes a piece brings."""
        return self.share * self.count / self.thin

    @property
    def populations(self) -> int:
        return self.size.populations

    def pieces(self, scenes: int) -> int:
        """About how many pieces bring so many scenes."""
        each = self.taken[0].even if self.taken else self.brings
        further = math.ceil(max(0, scenes - self.populations * each) / self.brings)
        return min(self.populations, math.ceil(scenes / max(each, 1.0))) + further


def make_recipe(
    problem: Problem,
    budget: Budget,
    *,
    patient: bool,
    started: Started | None = None,
    longest: float = math.inf,
) -> tuple[Machine, Recipe, Started | None] | Stalled:
    """The plan for a problem; Stalled where there is no room for its objects, or time is up. Unless `patient`, small
    populations must do: the design effect is infinite where few ancestors are left of the first one. `started`
    is what other processes have begun; what is returned of it has the second population, too, if there are any."""
    size = size_of(problem, AGAIN if patient else 0)
    with ExitStack() as stack:
        if started is None or started.given_up or started.size != size:
            started = start_growth(problem, budget, size)
            if started is not None:
                stack.enter_context(started)
        if started is not None:
            started.begin_second()
        found = First(problem, budget, longest)(size) if started is None else started.first()
        if isinstance(found, Stalled):
            return found
        machine, made = found
        machine.deadline, machine.longest = budget.ends, math.inf  # by this process's clock
        stack.pop_all()  # `started` is the plan's
        return machine, _recipe(problem, machine, size, made), started


def _recipe(problem: Problem, machine: Machine, size: Size, made: Population) -> Recipe:
    """What a population found out, for the pieces that follow."""
    cells, count = made.cells, made.count
    if made.settled is None or made.taken is None:
        return Recipe(made.steps, made.settings, cells, count, 0, 1.0, np.inf, machine.work, np.inf, size)
    settled = made.settled
    there = size.populations * made.taken.even
    spare = SPARE if len(cells) > 1 else SPARE_OF_ONE
    left = max(0.0, wanted_scenes(cells, problem.request.n, spare) - there)
    wanted = max(ISLANDS * OF_A_CELL * len(cells), int(np.ceil(settled.thin * left / made.share)))
    pieces = -(-wanted // size.most)  # of one size: a last one for a few scenes would cost as much
    moving = len(machine.graph.rows)
    if pieces % 2 and size.populations > 1 and wanted / (pieces + 1) * moving >= EVEN * WORTH:
        pieces += 1  # as many for each of two processes
    each = max(count if count > size.count else LEAST // 2, -(-wanted // pieces))
    whole = made.cost + settled.cost * settled.sweeps  # smaller pieces take fewer evaluations, but as many steps
    piece = whole * each / count
    return Recipe(
        made.steps,
        made.settings,
        cells,
        each,
        settled.sweeps,
        settled.thin,
        settled.left,
        machine.work,
        piece,
        size,
        (made.taken,),
        made.share,
        (machine.seconds, GROWN * machine.each * piece + STEPPED * machine.steps_done * whole / machine.work),
    )
