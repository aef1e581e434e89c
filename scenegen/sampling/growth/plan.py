"""The plan of a growth run: the order of the objects, how many poses are tried for each, which moves are made and how
many.

One population is grown while planning; what it needed is written down and frozen. All of it is counted in evaluations,
never timed, so spec, request and seed fix the plan, and its pieces can run anywhere.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from scenegen.bounds.effort import StoppedError
from scenegen.sampling.growth.full import too_full
from scenegen.sampling.growth.grow import HITS, Grown, Step, Stuck, explore
from scenegen.sampling.growth.kinship import Kinship
from scenegen.sampling.growth.machine import Machine, make_machine
from scenegen.sampling.growth.moves import FINEST, JUMPS, KINDS, LIFTS, Settings, sweep
from scenegen.sampling.growth.particles import Particles
from scenegen.sampling.growth.settle import Settled, apart, part_of, settle
from scenegen.sampling.growth.tally import Tally
from scenegen.sampling.problem import Budget, Problem

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.intp]

GROWTH = 6  # random stream of growth: plan and pieces
ISLANDS = 4  # independent populations of a piece: the error bar of the probability is their spread
LEAST, MOST = 512, 4096  # scenes of a population
OF_A_CELL, FEWEST = 12, 5  # scenes of each cell of the range in an island, at least; and where few are wanted
A_SCENE = 3.0  # so many for each that is wanted of the cell are enough
NUMBERS = 1 << 22  # coordinates of a population at most
SPARE = 1.15  # scenes grown for each one wanted: copies that have not moved apart are left out
USELESS = 0.002  # share of scenes that take a kind of move below which it is not made
MOST_TRIES = 32  # of a place for an object that is lifted
CALLS = 2.0  # what such a move costs before the first try, in tries
REDRAWN, RELOCATED = 0.25, 0.5  # times that an object, and all that hangs from it, is lifted for each of its turns
TRIED = 0.5  # the same, while it is found out how many find a place
TAKEN, SELDOM = 0.1, 0.25  # share of these that must find a place; so many times fewer are made of those that do not
EXCHANGEABLE = 0.99  # share of swaps taken from which on all kin are shuffled
FAMILIES = 12.0  # effective ancestors below which a larger population is grown
AGAIN = 2  # times that a population is made larger
MORE_HITS = 2.0 * HITS  # of larger ones


@dataclass(frozen=True, slots=True, eq=False)
class First:
    """What the population of a plan brings, its first piece: `scenes` (3N, m), rows that no clause reads left open;
    `log_share` (islands, C) as in Grown, `accepted` the share of walks taken, `copies` that of scenes left out,
    `effect` the design effect."""

    scenes: Array
    log_share: Array
    accepted: float
    copies: float
    effect: float


@dataclass(frozen=True, slots=True, eq=False)
class Recipe:
    """What pieces follow: `count` scenes for `cells`, `steps` for each object, then `settle` sweeps, and one scene in
    `thin` is taken. `effect` is the design effect of common ancestors that is left among these, `evaluations` the cost
    of the plan, `piece` of a piece. `first` is the first piece: the population by which all this was found out."""

    steps: tuple[Step, ...]
    settings: Settings
    cells: tuple[int, ...]
    count: int
    settle: int
    thin: float
    effect: float
    evaluations: float
    piece: float
    first: First | None = None

    @property
    def brings(self) -> float:
        """About how many scenes a piece brings."""
        return self.count / self.thin

    def pieces(self, scenes: int) -> int:
        """About how many pieces bring so many scenes."""
        there = 0 if self.first is None else self.first.scenes.shape[1]
        return (self.first is not None) + math.ceil(max(0, scenes - there) / self.brings)


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


def generator(seed: int, piece: int) -> np.random.Generator:
    """Random numbers of piece k; the plan's are those of piece -1."""
    return np.random.Generator(np.random.SFC64(np.random.SeedSequence([seed, GROWTH, piece + 1])))


def spread_over(cells: Sequence[int], count: int) -> tuple[Index, Index]:
    """The cell and the island of each of `count` scenes, (count,) each: all equally often, as far as that goes."""
    number = np.arange(count)
    return np.array(cells, dtype=np.intp)[number // ISLANDS % len(cells)], number % ISLANDS


def make_recipe(problem: Problem, budget: Budget, *, patient: bool) -> tuple[Machine, Recipe] | Stalled:
    """The plan for a problem; Stalled where there is no room for its objects, or time is up. Unless `patient`, one
    small population must do: the design effect is infinite where few ancestors are left of it."""
    machine = None
    try:
        machine = make_machine(problem)
        proof = too_full(machine.graph, problem.core.objects)
        if proof:
            return Stalled(machine, None, 0.0, proof)
        machine.deadline = budget.ends
        return _make(machine, AGAIN if patient else 0)
    except StoppedError:
        return Stalled(machine, None, 0.0 if machine is None else machine.work)


def _make(machine: Machine, again: int) -> tuple[Machine, Recipe] | Stalled:
    problem = machine.problem
    possible = tuple(sorted(problem.possible))
    most = max(64, min(MOST, NUMBERS // len(problem.lowest)))
    wanted = min(MOST // 2, int(SPARE * problem.request.n))  # half as many would cost nearly as much
    of_a_cell = min(OF_A_CELL, max(FEWEST, math.ceil(A_SCENE * problem.request.n / len(possible))))
    count = min(most, max(LEAST, wanted, ISLANDS * of_a_cell * len(possible)))
    rng = generator(problem.request.seed, -1)
    for attempt in range(again + 1):
        tally = Tally()
        before = machine.work
        hits = HITS if attempt == 0 else MORE_HITS
        grown, steps = explore(machine, *spread_over(possible, count), rng, tally, hits=hits)
        last = attempt == again or count >= most
        if isinstance(grown, Stuck):
            if last or not grown.placed.attracted:
                return Stalled(machine, grown, machine.work)
        elif last or _ancestors(grown.particles) >= FAMILIES:
            break
        count = min(most, max(2 * count, 4 * LEAST))
    assert isinstance(grown, Grown)
    cost = machine.work - before
    reached = tuple(map(int, np.unique(grown.particles.cell)))
    if not again and _ancestors(grown.particles) < FAMILIES / 2.0:
        return machine, Recipe(tuple(steps), Settings({}), reached, count, 0, 1.0, np.inf, machine.work, np.inf)
    scenes = SPARE * len(reached) * -(-problem.request.n // len(reached))  # every cell gets as many
    settings, settled, now, accepted = _settle(grown.particles, tally, cost, scenes)
    first = _first(grown, max(now.thin, grown.particles.count / scenes), now.effect, accepted, rng)
    left = max(0.0, scenes - first.scenes.shape[1])
    wanted = max(ISLANDS * OF_A_CELL * len(reached), int(np.ceil(settled.thin * left)))
    pieces = -(-wanted // most)  # of one size: a last one for a few scenes would cost as much
    size = max(count if count > LEAST else LEAST // 2, -(-wanted // pieces))
    piece = (cost + settled.cost * settled.sweeps) * size / count
    recipe = Recipe(
        tuple(steps), settings, reached, size, settled.sweeps, settled.thin, settled.left, machine.work, piece, first
    )
    return machine, recipe


def _ancestors(particles: Particles) -> float:
    """The effective number of first ancestors."""
    _, sizes = np.unique(particles.families[0], return_counts=True)
    return float(sizes.sum() ** 2 / (sizes * sizes).sum())


def _settle(particles: Particles, tally: Tally, cost: float, wanted: float) -> tuple[Settings, Settled, Settled, float]:
    """The settings tuned on whole scenes, how long these are moved, see settle.py, and the share of walks taken.
    Growing them took `cost`."""
    final = Tally(steps=tally.steps)  # which moves are taken is judged by whole scenes, step lengths by all
    lift = dict.fromkeys(particles.placed, (TRIED, MOST_TRIES // 4))
    trial = Settings({}, redraws=lift, relocations=lift)
    for _ in range(2):
        sweep(particles, trial, final)
    settings = tuned(final)
    alike = Kinship(particles.machine)
    taken: list[float] = []
    best, now = settle(particles, lambda: taken.append(sweep(particles, settings)), alike, cost, wanted)
    return settings, best, now, float(np.mean(taken))


def _first(grown: Grown, thin: float, effect: float, accepted: float, rng: np.random.Generator) -> First:
    particles = grown.particles
    some = part_of(particles.cell, thin, rng)
    taken = apart(particles, some)
    effect = 1.0 + (effect - 1.0) / thin
    return First(particles.scenes[:, taken], grown.log_share, accepted, 1.0 - len(taken) / len(some), effect)


def tuned(tally: Tally) -> Settings:
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
    return Settings(odds, tuple(kinds), redraws, relocations, 1.0 if jumps is not None and jumps >= TAKEN else JUMPS)


def lifted(free: float, often: float) -> tuple[float, int]:
    """How often something is lifted off the table for each of its turns, and how many places are tried then: those that
    bring it elsewhere at the least cost, where a share of all places is `free`."""
    tries = 2 ** np.arange(int(np.log2(MOST_TRIES)) + 1)
    taken = 1.0 - (1.0 - free) ** tries
    best = int(np.argmax(taken / (CALLS + tries)))
    often *= 1.0 if taken[best] >= TAKEN else SELDOM if taken[best] >= SELDOM * TAKEN else 0.0
    return often, int(tries[best])


def with_deadline(machine: Machine, deadline: float) -> Machine:
    """The same with another deadline, and with its counts of work and of placed objects begun again."""
    return replace(machine, work=0.0, deadline=deadline, furthest=0)
