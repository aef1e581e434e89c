"""The populations with which a plan of growth begins, each in any process, and where there are two, in others before
growth is chosen."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from scenegen.bounds.effort import StoppedError, TooMuchError
from scenegen.processes.beside import Beside
from scenegen.processes.process import cores
from scenegen.sampling.growth.full import too_full
from scenegen.sampling.growth.grow import Stuck
from scenegen.sampling.growth.machine import Machine, make_machine
from scenegen.sampling.growth.population import FAMILIES, ISLANDS, KEPT, SPARE, Population, Size, Taken, make_population
from scenegen.sampling.problem import Budget, Problem

GROWTH = 6  # random stream of growth: plan and pieces
LEAST, MOST = 512, 4096  # scenes of a population
OF_A_CELL, FEWEST = 12, 5  # scenes of each cell of the range in an island, at least; and where few are wanted
A_SCENE = 3.0  # so many for each that is wanted of the cell are enough
NUMBERS = 1 << 22  # coordinates of a population at most
WORTH = 8e4  # moving ones from which on a population costs about twice as much as half of it


@dataclass(frozen=True, slots=True, eq=False)
class Stalled:
    """No plan: time was up (`stuck` is None), there was no room for an object, a `proof` (facts of
    TABLE_TOO_FULL) says that there is none for all of them, or it is `dear`: it takes longer than was allowed."""

    machine: Machine | None
    stuck: Stuck | None
    evaluations: float
    proof: Mapping[str, str] = field(default_factory=dict)
    dear: bool = False

    @property
    def crowded(self) -> bool:
        """Whether poses met all clauses but those that keep objects apart: the table is too full."""
        return self.stuck is not None and self.stuck.placed.attracted > 0


@dataclass(frozen=True, slots=True)
class First:
    """The machine and the first population of a problem, in any process; in at most `longest` seconds, as the machine
    counts them."""

    problem: Problem
    budget: Budget
    longest: float = math.inf

    def __call__(self, size: Size) -> tuple[Machine, Population] | Stalled:
        machine = None
        with np.errstate(all="ignore"):
            try:
                machine = make_machine(self.problem, deadline=self.budget.ends, loose=True)
                proof = too_full(machine.graph, self.problem.spec)
                if proof:
                    return Stalled(machine, None, 0.0, proof)
                machine.longest = self.longest
                machine, made = _population(machine, size, 0)
            except StoppedError:
                return Stalled(machine, None, 0.0 if machine is None else machine.work)
            except TooMuchError:
                return Stalled(machine, None, 0.0 if machine is None else machine.work, dear=True)
        return Stalled(machine, made, machine.work) if isinstance(made, Stuck) else (machine, made)


@dataclass(frozen=True, slots=True)
class Second:
    """The second population of a problem, in any process; without scenes where there was no room for them. Raises
    StoppedError with the number of objects placed by then, if any could be."""

    problem: Problem
    budget: Budget

    def __call__(self, size: Size) -> Taken:
        with np.errstate(all="ignore"):
            machine = make_machine(self.problem, deadline=self.budget.ends, loose=True)
            try:
                machine, made = _population(machine, replace(size, fewest=0.0), 1)
            except StoppedError:
                raise StoppedError(placed_of(machine, size.count)) from None
        if isinstance(made, Stuck) or made.taken is None:
            none = np.empty((len(self.problem.lowest), 0)), np.full((ISLANDS, self.problem.cells.count), -np.inf)
            return Taken(*none, 0.0, 0.0, 0.0, machine.work, 0.0)
        return made.taken


@dataclass(slots=True)
class Started:
    """The two populations of a problem, as far as other processes have begun with them. A context manager, at the end
    of which they are given up, unless they are `kept` by the plan that was chosen."""

    problem: Problem
    budget: Budget
    size: Size
    given_up: bool = False
    kept: bool = False
    _first: Beside[Size, tuple[Machine, Population] | Stalled] | None = None
    _second: Beside[Size, Taken] | None = None

    def __enter__(self) -> Started:
        return self

    def __exit__(self, *_: object) -> None:
        if not self.kept:
            self.give_up()

    def begin_first(self) -> None:
        self._first = Beside(First(self.problem, self.budget), self.size, self.budget.reserve)

    def begin_second(self) -> None:
        """Now, if it has not begun yet."""
        if self._second is None:
            self._second = Beside(Second(self.problem, self.budget), self.size, self.budget.reserve)

    def first(self) -> tuple[Machine, Population] | Stalled:
        """Waits for it; if no other process has begun with it, this one makes it."""
        if self._first is None:
            return First(self.problem, self.budget)(self.size)
        with self._first:  # then its process is free
            return self._first.result()

    def second(self) -> Taken | None:
        """Waits for it; None if it has not begun, or time is up."""
        try:
            return None if self._second is None else self._second.result()
        except StoppedError:
            return None

    def going(self) -> Beside[Size, Taken] | None:
        """The work on the second one, if it has begun and is not given up."""
        return None if self.given_up else self._second

    def give_up(self) -> None:
        """End what is not done: nobody will ask for it."""
        if not self.given_up:
            self.given_up = True
            for one in (self._first, self._second):
                if one is not None:
                    one.__exit__()


def start_growth(problem: Problem, budget: Budget, size: Size | None = None) -> Started | None:
    """The populations of a large request, to be begun in other processes; those of a plan that is not `patient` while
    it is found out whether growth is the method. None for small requests, or where there are no further processes."""
    size = size_of(problem) if size is None else size
    workers = problem.request.workers
    several = (cores() if workers is None else workers) > 1
    return Started(problem, budget, size) if several and size.populations > 1 else None


def generator(seed: int, piece: int) -> np.random.Generator:
    """Random numbers of piece k."""
    return np.random.Generator(np.random.SFC64(np.random.SeedSequence([seed, GROWTH, piece + 1])))


def _population(machine: Machine, size: Size, which: int) -> tuple[Machine, Population | Stuck]:
    """A population of the plan, and its machine: one that holds scenes in their cells where too many of a loose one's
    have left them."""
    problem = machine.problem
    made = make_population(machine, size, _of_plan(problem.request.seed, which))
    if isinstance(made, Stuck) or machine.begin is None or made.share >= KEPT:
        return machine, made
    strict = replace(
        make_machine(problem), work=machine.work, steps_done=machine.steps_done, deadline=machine.deadline,
        longest=machine.longest,
    )  # fmt: skip
    return strict, make_population(strict, size, _of_plan(problem.request.seed, which))


def _of_plan(seed: int, which: int) -> np.random.Generator:
    """Random numbers of the populations of a plan."""
    words = [seed, GROWTH, 0, *([which] if which else [])]
    return np.random.Generator(np.random.SFC64(np.random.SeedSequence(words)))


def placed_of(machine: Machine, count: int) -> str:
    """How far a piece of so many scenes got that time cut short: so many objects were placed."""
    placed, objects = machine.furthest, len(machine.order)
    if placed < objects:
        return f"the next {count:,} scenes had {placed} of {objects} objects when time was up"
    return f"the next {count:,} scenes had all {objects} objects when time was up, but were not ready"


def size_of(problem: Problem, again: int = 0) -> Size:
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


def with_deadline(machine: Machine, deadline: float) -> Machine:
    """The same with another deadline, and with its counts of work and of placed objects begun again."""
    return replace(machine, work=0.0, steps_done=0, deadline=deadline, furthest=0)
