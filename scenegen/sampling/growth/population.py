"""A population that finds out what it needs while it grows, and the scenes that are taken of it in the end.

All that it needs is counted in evaluations, never timed: its random numbers fix it, and it comes out the same in any
process.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from scenegen.arrays import Array, Index
from scenegen.sampling.growth.failure import GrowthFailed, too_full
from scenegen.sampling.growth.machine import Machine, MoveTally, Particles, make_machine
from scenegen.sampling.growth.moves import FINEST, JUMPS, KINDS, LIFTS, MoveSettings, sweep
from scenegen.sampling.growth.smc import (
    HITS,
    AncestorEffect,
    BurnIn,
    Grown,
    PlacementFailed,
    Step,
    apart,
    explore,
    part_of,
    settle,
)
from scenegen.sampling.problem import Budget, Problem
from scenegen.search.effort import StoppedError, TooMuchError

ISLANDS = 4  # independent populations of a piece: the error bar of the probability is their spread
SPARE = 1.15  # scenes grown for each one wanted: copies that have not moved apart are left out
KEPT = 0.5  # share of scenes that fill the cells evenly, at least, for scenes to be free to leave their cell
LUCK = 2.5  # standard deviations by which a cell may get fewer scenes than on average
USELESS = 0.002  # share of scenes that take a kind of move below which it is not made
MOST_TRIES = 32  # of a place for an object that is lifted
CALLS = 2.0  # what such a move costs before the first try, in tries
REDRAWN, RELOCATED = 0.25, 0.5  # times that an object, and all that hangs from it, is lifted for each of its turns
TRIED = 0.5  # the same, while it is found out how many find a place
TAKEN, SELDOM = 0.1, 0.25  # share of these that must find a place; so many times fewer are made of those that do not
EXCHANGEABLE = 0.99  # share of swaps taken from which on all kin are shuffled
FAMILIES = 12.0  # effective ancestors below which a larger population is grown
LARGER = 2048  # scenes of such a population, at least
MORE_HITS = 2.0 * HITS  # of larger ones


@dataclass(frozen=True, slots=True)
class Size:
    """Of a population: `count` scenes, which are doubled up to `most` as often as `again` says where few ancestors are
    left of them; where there are fewer than `fewest` in the end, it is left. `wanted` scenes are to be had of the whole
    request, by so many `populations` and the pieces that follow them."""

    count: int
    most: int
    again: int
    fewest: float
    wanted: int
    populations: int


@dataclass(frozen=True, slots=True, eq=False)
class PopulationSample:
    """What a population brings, a piece: `scenes` (3N, m), rows that no clause reads left open; `log_share` (islands,
    C) as in Grown, `accepted` the share of walks taken, `copies` that of scenes left out, `effect` the design effect,
    `work` the evaluations that it took; `even` scenes fill the cells evenly."""

    scenes: Array
    log_share: Array
    accepted: float
    copies: float
    effect: float
    work: float
    even: float

    @property
    def count(self) -> int:
        return int(self.scenes.shape[1])


@dataclass(frozen=True, slots=True, eq=False)
class Population:
    """`cost` is what it took to grow `count` scenes, in evaluations, `settled` how long such scenes are best moved;
    `taken` is None if it was left. Of its scenes, `share` fill the cells evenly: less than 1 if they may leave their
    cell."""

    count: int
    steps: tuple[Step, ...]
    cells: tuple[int, ...]
    cost: float
    settings: MoveSettings
    settled: BurnIn | None = None
    taken: PopulationSample | None = None
    share: float = 1.0


def spread_over(machine: Machine, cells: Sequence[int], count: int) -> tuple[Index, Index]:
    """The cell and the island of each of `count` scenes, (count,) each: all equally often, or as the machine says, as
    far as that goes."""
    number, which = np.arange(count), np.array(cells, dtype=np.intp)
    if machine.begin is None:
        return which[number // ISLANDS % len(cells)], number % ISLANDS
    places = np.cumsum(machine.begin[which])
    return which[
        np.searchsorted(places, (number // ISLANDS + 0.5) * ISLANDS / count * places[-1]).clip(0, len(which) - 1)
    ], number % ISLANDS


def make_population(machine: Machine, size: Size, rng: np.random.Generator) -> Population | PlacementFailed:
    """Grows it, as large as it has to be; PlacementFailed where there is no room for some object. Raises
    StoppedError."""
    possible = tuple(sorted(machine.problem.possible))
    count = size.count if machine.begin is None else max(size.count, _enough(machine.begin[list(possible)], size))
    for attempt in range(size.again + 1):
        tally = MoveTally()
        before = machine.work
        hits = HITS if attempt == 0 else MORE_HITS
        grown, steps = explore(machine, *spread_over(machine, possible, count), rng, tally, hits=hits)
        last = attempt == size.again or count >= size.most
        if isinstance(grown, PlacementFailed):
            if last or not grown.placed.attracted:
                return grown
        elif last or _ancestors(grown.particles) >= FAMILIES:
            break
        count = min(size.most, max(2 * count, LARGER))
    assert isinstance(grown, Grown)
    cost = machine.work - before
    found = _cells(grown.particles)
    reached = tuple(map(int, np.unique(found[found >= 0])))
    share = 1.0 if machine.begin is None else _even(found) / len(found)
    if _ancestors(grown.particles) < size.fewest or share < KEPT:
        return Population(count, tuple(steps), reached, cost, MoveSettings({}), share=share)
    scenes = wanted_scenes(reached, size.wanted) / size.populations / share
    settings, settled, now, accepted = _settle(grown.particles, tally, cost, scenes)
    taken = take(grown, max(now.thin, count / scenes), now.effect, accepted, rng)
    return Population(count, tuple(steps), reached, cost, settings, settled, taken, share)


def _enough(begin: Array, size: Size) -> int:
    """How many scenes of a loose machine leave enough in each cell, by all odds; 0 if that is beyond `most`."""
    each = size.wanted / size.populations / len(begin)
    count = math.ceil(float(begin.sum()) * (each + LUCK * math.sqrt(each)))
    return count if count <= size.most else 0


def wanted_scenes(reached: Sequence[int], wanted: int, spare: float = SPARE) -> float:
    """How many scenes are grown for so many, if every cell gets as many; `spare` for each of them."""
    return spare * len(reached) * math.ceil(wanted / len(reached))


def _ancestors(particles: Particles) -> float:
    """The effective number of first ancestors."""
    _, sizes = np.unique(particles.families[0], return_counts=True)
    return float(sizes.sum() ** 2 / (sizes * sizes).sum())


def _settle(
    particles: Particles, tally: MoveTally, cost: float, wanted: float
) -> tuple[MoveSettings, BurnIn, BurnIn, float]:
    """The settings tuned on whole scenes, how long these are moved, and the share of walks taken.
    Growing them took `cost`."""
    final = MoveTally(steps=tally.steps)  # which moves are taken is judged by whole scenes, step lengths by all
    lift = dict.fromkeys(particles.placed, (TRIED, MOST_TRIES // 4))
    trial = MoveSettings({}, redraws=lift, relocations=lift)
    for _ in range(2):
        sweep(particles, trial, final)
    settings = tuned(final)
    alike = AncestorEffect(particles.machine)
    taken: list[float] = []
    best, now = settle(particles, lambda: taken.append(sweep(particles, settings)), alike, cost, wanted)
    return settings, best, now, float(np.mean(taken))


def _cells(particles: Particles) -> Index:
    """The cell that each scene is in, (P,): its own, unless it may leave that; -1 out of the range."""
    problem, read = particles.machine.problem, particles.machine.graph.rows
    if particles.machine.begin is None:
        return particles.cell
    rows = [row if at in read else problem.lowest[at] for at, row in enumerate(particles.scenes)]
    return problem.cells.find(problem.phi(np.stack(np.broadcast_arrays(*rows))))


def _even(cells: Index) -> float:
    """How many scenes are left of those in these cells if all that are reached get equally many."""
    _, counts = np.unique(cells[cells >= 0], return_counts=True)
    return float(len(counts) * counts.min(initial=len(cells)))


def take(grown: Grown, thin: float, effect: float, accepted: float, rng: np.random.Generator) -> PopulationSample:
    """One in `thin` of whole scenes, without copies. `effect` is the design effect of common ancestors among all."""
    particles = grown.particles
    some = part_of(particles.cell, thin, rng)
    taken = apart(particles, some)
    effect = 1.0 + (effect - 1.0) / thin
    copies = 1.0 - len(taken) / len(some)
    cells, log_share = _cells(particles), grown.log_share
    if particles.machine.begin is not None:
        group = particles.island, particles.cell
        mine, all_ = np.zeros_like(log_share), np.zeros_like(log_share)
        np.add.at(mine, group, cells == particles.cell)
        np.add.at(all_, group, 1.0)
        with np.errstate(divide="ignore"):
            log_share = log_share + np.log(mine / np.maximum(all_, 1.0))
        taken = taken[cells[taken] >= 0]
    even = float(len(taken)) if particles.machine.begin is None else _even(cells[taken])
    return PopulationSample(
        particles.scenes[:, taken], log_share, accepted, copies, effect, particles.machine.work, even
    )


def tuned(tally: MoveTally) -> MoveSettings:
    """Step lengths by how far they bring an object, a third of them spread over all lengths; and the kinds of move that
    scenes take."""
    odds = {}
    sizes = 2.0 ** -np.arange(FINEST + 1)
    for thing, (tried, taken) in tally.steps.items():
        gain = (taken + 0.05) / (tried + 1.0) * sizes
        odds[thing] = 0.7 * gain / gain.sum() + 0.3 / (FINEST + 1)
    rates = {kind: tally.rate(kind) for kind in KINDS if kind not in LIFTS}  # how often these are made is found below
    kinds = [*LIFTS, *(kind for kind, rate in rates.items() if rate is None or rate >= USELESS)]
    if tally.rate("hop") or tally.rate("carry"):  # however seldom: nothing else brings an object to another surface
        kinds.append("hop")
    for kind in tally.tried:
        rate = tally.rate(kind)
        if kind.startswith(("swap", "trade")) and rate is not None and rate >= USELESS:
            kinds.append(kind.replace("swap", "shuffle") if rate >= EXCHANGEABLE else kind)
    redraws, relocations = {}, {}
    for thing in tally.steps:
        if (rate := tally.rate(f"redraw of {thing}")) is not None:
            redraws[thing] = lifted(rate, REDRAWN)
        if (rate := tally.rate(f"relocate of {thing}")) is not None:
            relocations[thing] = lifted(rate, RELOCATED)
    jumps = tally.rate("jump")
    return MoveSettings(
        odds, tuple(kinds), redraws, relocations, 1.0 if jumps is not None and jumps >= TAKEN else JUMPS
    )


def lifted(free: float, often: float) -> tuple[float, int]:
    """How often something is lifted off the table for each of its turns, and how many places are tried then: those that
    bring it elsewhere at the least cost, where a share of all places is `free`."""
    tries = 2 ** np.arange(int(np.log2(MOST_TRIES)) + 1)
    taken = 1.0 - (1.0 - free) ** tries
    best = int(np.argmax(taken / (CALLS + tries)))
    often *= 1.0 if taken[best] >= TAKEN else SELDOM if taken[best] >= SELDOM * TAKEN else 0.0
    return often, int(tries[best])


# --------------------------------------------------------------------------------------------------------------------
# The populations with which a plan of growth begins: the first is grown while the plan is made, the second is piece 1.


GROWTH = 6  # random stream of growth: plan and pieces
LEAST, MOST = 512, 4096  # scenes of a population
OF_A_CELL, FEWEST = 12, 5  # scenes of each cell of the range in an island, at least; and where few are wanted
A_SCENE = 3.0  # so many for each that is wanted of the cell are enough
NUMBERS = 1 << 22  # coordinates of a population at most
WORTH = 8e4  # moving ones from which on a population costs about twice as much as half of it


def first_population(
    problem: Problem, budget: Budget, size: Size, longest: float = math.inf
) -> tuple[Machine, Population] | GrowthFailed:
    """The machine and the first population of a problem, in at most `longest` seconds, as the machine counts them."""
    machine = None
    try:
        machine = make_machine(problem, deadline=budget.ends, loose=True)
        proof = too_full(machine.graph, problem.spec)
        if proof:
            return GrowthFailed(machine, None, 0.0, proof)
        machine.longest = longest
        machine, made = _population(machine, size, 0)
    except StoppedError:
        return GrowthFailed(machine, None, 0.0 if machine is None else machine.work)
    except TooMuchError:
        return GrowthFailed(machine, None, 0.0 if machine is None else machine.work, dear=True)
    machine.longest = math.inf
    return GrowthFailed(machine, made, machine.work) if isinstance(made, PlacementFailed) else (machine, made)


def second_population(problem: Problem, budget: Budget, size: Size) -> PopulationSample:
    """The second population of a problem; without scenes where there was no room for them. Raises StoppedError with the
    number of objects placed by then, if any could be."""
    machine = make_machine(problem, deadline=budget.ends, loose=True)
    try:
        machine, made = _population(machine, replace(size, fewest=0.0), 1)
    except StoppedError:
        raise StoppedError(placed_of(machine, size.count)) from None
    if isinstance(made, PlacementFailed) or made.taken is None:
        none = np.empty((len(problem.lowest), 0)), np.full((ISLANDS, problem.cells.count), -np.inf)
        return PopulationSample(*none, 0.0, 0.0, 0.0, machine.work, 0.0)
    return made.taken


def generator(seed: int, piece: int) -> np.random.Generator:
    """Random numbers of piece k."""
    return np.random.Generator(np.random.SFC64(np.random.SeedSequence([seed, GROWTH, piece + 1])))


def _population(machine: Machine, size: Size, which: int) -> tuple[Machine, Population | PlacementFailed]:
    """A population of the plan, and its machine: one that holds scenes in their cells where too many of a loose one's
    have left them."""
    problem = machine.problem
    made = make_population(machine, size, _of_plan(problem.request.seed, which))
    if isinstance(made, PlacementFailed) or machine.begin is None or made.share >= KEPT:
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
