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
from dataclasses import dataclass, replace

import numpy as np

from scenegen.bounds.effort import StoppedError
from scenegen.processes.beside import Beside
from scenegen.processes.process import cores
from scenegen.sampling.growth.full import too_full
from scenegen.sampling.growth.grow import Step, Stuck
from scenegen.sampling.growth.machine import Machine, make_machine
from scenegen.sampling.growth.moves import Settings
from scenegen.sampling.growth.population import (
    FAMILIES,
    ISLANDS,
    SPARE,
    Population,
    Size,
    Taken,
    make_population,
    wanted_scenes,
)
from scenegen.sampling.problem import Budget, Problem

GROWTH = 6  # random stream of growth: plan and pieces
LEAST, MOST = 512, 4096  # scenes of a population
OF_A_CELL, FEWEST = 12, 5  # scenes of each cell of the range in an island, at least; and where few are wanted
A_SCENE = 3.0  # so many for each that is wanted of the cell are enough
NUMBERS = 1 << 22  # coordinates of a population at most
WORTH = 8e4  # moving ones from which on a population costs about twice as much as half of it
SPARE_OF_ONE = 1.07  # scenes grown for each one wanted by further pieces of a single cell: see settle.LOST
EVEN = 0.75  # of that, for an even number of pieces
AGAIN = 2  # times that a population is made larger


@dataclass(frozen=True, slots=True, eq=False)
class Recipe:
    """What pieces follow: `count` scenes for `cells`, `steps` for each object, then `settle` sweeps, and one scene in
    `thin` is taken. `effect` is the design effect of common ancestors that is left among these, `evaluations` the cost
    of the plan, `piece` of a piece. The first pieces are `populations` of their own, of the given `size`; those that
    are known are in `taken`."""

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

    @property
    def brings(self) -> float:
        """About how many scenes a piece brings."""
        return self.count / self.thin

    @property
    def populations(self) -> int:
        return self.size.populations

    def pieces(self, scenes: int) -> int:
        """About how many pieces bring so many scenes."""
        each = self.taken[0].count if self.taken else self.brings
        further = math.ceil(max(0, scenes - self.populations * each) / self.brings)
        return min(self.populations, math.ceil(scenes / max(each, 1.0))) + further


@dataclass(frozen=True, slots=True, eq=False)
class Stalled:
    """No plan: time was up (`stuck` is None), there was no room for an object, or a `proof` says that there is none for
    all of them."""

    machine: Machine | None
    stuck: Stuck | None
    evaluations: float
    proof: str = ""

    @property
    def crowded(self) -> bool:
        """Whether poses met all clauses but those that keep objects apart: the table is too full."""
        return self.stuck is not None and self.stuck.placed.attracted > 0


@dataclass(frozen=True, slots=True)
class Second:
    """The second population of a problem, in any process; without scenes where there was no room for them. Raises
    StoppedError with the number of objects placed by then."""

    problem: Problem
    budget: Budget

    def __call__(self, size: Size) -> Taken:
        machine, made = _made(self.problem, self.budget, replace(size, fewest=0.0), 1)
        if made is None:
            raise StoppedError(placed_of(machine, size.count))
        if isinstance(made, Stuck) or made.taken is None:
            none = np.empty((len(self.problem.lowest), 0)), np.full((ISLANDS, self.problem.cells.count), -np.inf)
            return Taken(*none, 0.0, 0.0, 0.0, machine.work)
        return made.taken


@dataclass(frozen=True, slots=True)
class First:
    """The machine and the first population of a problem, in any process; None if time was up before."""

    problem: Problem
    budget: Budget

    def __call__(self, size: Size) -> tuple[Machine, Population | Stuck | None]:
        return _made(self.problem, self.budget, size, 0)


def _made(problem: Problem, budget: Budget, size: Size, which: int) -> tuple[Machine, Population | Stuck | None]:
    with np.errstate(all="ignore"):
        machine = with_deadline(make_machine(problem), budget.ends)
        try:
            return machine, make_population(machine, size, _of_plan(problem.request.seed, which))
        except StoppedError:
            return machine, None


@dataclass(slots=True)
class Started:
    """Both populations of a problem, each in a process of its own. A context manager, at the end of which they are
    given up."""

    first: Beside[Size, tuple[Machine, Population | Stuck | None]]
    second: Beside[Size, Taken]
    given_up: bool = False

    def __enter__(self) -> Started:
        return self

    def __exit__(self, *_: object) -> None:
        self.give_up()

    def give_up(self) -> None:
        """End what is not done: nobody will ask for it."""
        if not self.given_up:
            self.given_up = True
            self.first.__exit__()
            self.second.__exit__()


def start_growth(problem: Problem, budget: Budget) -> Started | None:
    """The populations of a large request, in other processes, while it is found out whether growth is the method for
    it: a plan that is not `patient` takes them. None for small requests, or where there are no further processes."""
    size = _size(problem, 0)
    if not _shared(problem, size):
        return None
    first = Beside(First(problem, budget), size, budget.reserve)
    return Started(first, Beside(Second(problem, budget), size, budget.reserve))


def _shared(problem: Problem, size: Size) -> bool:
    """Whether there are two populations, and a process for each."""
    workers = problem.request.workers
    return size.populations > 1 and (cores() if workers is None else workers) > 1


def generator(seed: int, piece: int) -> np.random.Generator:
    """Random numbers of piece k."""
    return np.random.Generator(np.random.SFC64(np.random.SeedSequence([seed, GROWTH, piece + 1])))


def _of_plan(seed: int, which: int) -> np.random.Generator:
    """Random numbers of the populations of a plan."""
    words = [seed, GROWTH, 0, *([which] if which else [])]
    return np.random.Generator(np.random.SFC64(np.random.SeedSequence(words)))


def make_recipe(
    problem: Problem,
    budget: Budget,
    *,
    patient: bool,
    ahead: bool,
    started: Started | None = None,
) -> tuple[Machine, Recipe] | Stalled:
    """The plan for a problem; Stalled where there is no room for its objects, or time is up. Unless `patient`, small
    populations must do: the design effect is infinite where few ancestors are left of the first one. `ahead`: the
    second population may be made meanwhile. `started`: see `start_growth`."""
    size = _size(problem, AGAIN if patient else 0)
    started = None if started is None or started.given_up else started
    with ExitStack() as stack:
        second = None if started is None or not ahead else started.second
        if started is None and ahead and _shared(problem, size):
            second = stack.enter_context(Beside(Second(problem, budget), size, budget.reserve))
        machine = None
        try:
            machine = make_machine(problem)
            proof = too_full(machine.graph, problem.core.objects)
            if proof:
                return Stalled(machine, None, 0.0, proof)
            machine.deadline = budget.ends
            if started is None:
                made = make_population(machine, size, _of_plan(problem.request.seed, 0))
            else:
                machine, found = started.first.result()
                if found is None:
                    raise StoppedError
                made = found
                machine.deadline = budget.ends
            if isinstance(made, Stuck):
                return Stalled(machine, made, machine.work)
        except StoppedError:
            return Stalled(machine, None, 0.0 if machine is None else machine.work)
        recipe = _recipe(problem, machine, size, made)
        if second is not None and made.taken is not None:
            recipe = _with_second(recipe, second)
    return machine, recipe


def _with_second(recipe: Recipe, second: Beside[Size, Taken]) -> Recipe:
    """The recipe with its second piece, unless time is up before that is made."""
    try:
        return replace(recipe, taken=(*recipe.taken, second.result()))
    except StoppedError:
        return recipe


def placed_of(machine: Machine, count: int) -> str:
    """How far a piece of so many scenes got that time cut short: so many objects were placed."""
    placed, objects = machine.furthest, len(machine.order)
    if placed < objects:
        return f"the next {count:,} scenes had {placed} of {objects} objects when time was up"
    return f"the next {count:,} scenes had all {objects} objects when time was up, but were not ready"


def _size(problem: Problem, again: int) -> Size:
    """How large the populations of a plan are, and how many."""
    n, rows, cells = problem.request.n, len(problem.lowest), len(problem.possible)
    most = max(64, min(MOST, NUMBERS // rows))
    of_a_cell = min(OF_A_CELL, max(FEWEST, math.ceil(A_SCENE * n / cells)))
    least = max(LEAST, ISLANDS * of_a_cell * cells)
    wanted = int(SPARE * n)
    each = min(MOST // 2, wanted)  # half as many would cost nearly as much
    half = wanted // 2
    moving = int((problem.lowest < problem.highest).sum())
    two = half >= MOST // 2 or (half >= least and half * moving >= WORTH)
    count = min(most, max(least, min(each, half) if two else each))
    return Size(count, most, again, 0.0 if again else FAMILIES / 2.0, n, 2 if two else 1)


def _recipe(problem: Problem, machine: Machine, size: Size, made: Population) -> Recipe:
    """What a population found out, for the pieces that follow."""
    cells, count = made.cells, made.count
    if made.settled is None or made.taken is None:
        return Recipe(made.steps, made.settings, cells, count, 0, 1.0, np.inf, machine.work, np.inf, size)
    settled = made.settled
    there = size.populations * made.taken.count
    spare = SPARE if len(cells) > 1 else SPARE_OF_ONE
    left = max(0.0, wanted_scenes(cells, problem.request.n, spare) - there)
    wanted = max(ISLANDS * OF_A_CELL * len(cells), int(np.ceil(settled.thin * left)))
    pieces = -(-wanted // size.most)  # of one size: a last one for a few scenes would cost as much
    moving = len(machine.graph.rows)
    if pieces % 2 and size.populations > 1 and wanted / (pieces + 1) * moving >= EVEN * WORTH:
        pieces += 1  # as many for each of two processes
    each = max(count if count > size.count else LEAST // 2, -(-wanted // pieces))
    piece = (made.cost + settled.cost * settled.sweeps) * each / count
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
    )


def with_deadline(machine: Machine, deadline: float) -> Machine:
    """The same with another deadline, and with its counts of work and of placed objects begun again."""
    return replace(machine, work=0.0, deadline=deadline, furthest=0)
