"""The plan of a growth run: the order of the objects, how many poses are tried for each, which moves are made and how
many.

One population is grown while planning; what it needed is written down and frozen. All of it is counted in evaluations,
never timed, so spec, request and seed fix the plan, and its pieces can run anywhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from scenegen.bounds.effort import StoppedError
from scenegen.sampling.growth.grow import Grown, Step, Stuck, explore
from scenegen.sampling.growth.kinship import Kinship
from scenegen.sampling.growth.machine import Machine, make_machine
from scenegen.sampling.growth.moves import FINEST, KINDS, Settings, sweep
from scenegen.sampling.growth.particles import Particles
from scenegen.sampling.growth.tally import Tally
from scenegen.sampling.problem import Budget, Problem

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.intp]

GROWTH = 6  # random stream of growth: plan and pieces
ISLANDS = 4  # independent populations of a piece: the error bar of the probability is their spread
LEAST, MOST = 512, 4096  # scenes of a population
OF_A_CELL = 12  # scenes of each cell of the range in an island, at least
NUMBERS = 1 << 22  # coordinates of a population at most
SPARE = 1.15  # scenes grown for each one wanted: copies that have not moved apart are left out
ALIKE = 1.5  # design effect of common ancestors from which on scenes count as apart
APART = 0.995  # share of the scenes in which every object must have moved since a copy was made
LONGEST = 400  # sweeps at most
PATIENT = 12.0  # times the cost of growing that sweeps may take, but for a few
FEW = 16
ANYWAY = 3e5  # evaluations that sweeps may take however little growing costs
USELESS = 0.002  # share of scenes that take a kind of move below which it is not made
EXCHANGEABLE = 0.99  # share of swaps taken from which on all kin are shuffled
FAMILIES = 12.0  # effective ancestors below which a larger population is grown
AGAIN = 2  # times that a population is made four times larger


@dataclass(frozen=True, slots=True, eq=False)
class Recipe:
    """What pieces follow: `count` scenes for `cells`, `steps` for each object, then `settle` sweeps. `effect` is the
    design effect of common ancestors that is left then, `evaluations` the cost of the plan, `piece` of a piece."""

    steps: tuple[Step, ...]
    settings: Settings
    cells: tuple[int, ...]
    count: int
    settle: int
    effect: float
    evaluations: float
    piece: float


@dataclass(frozen=True, slots=True, eq=False)
class Stalled:
    """No plan: time was up (`stuck` is None), or there was no room for an object."""

    machine: Machine | None
    stuck: Stuck | None
    evaluations: float

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
        machine.deadline = budget.started + budget.seconds
        return _make(machine, AGAIN if patient else 0)
    except StoppedError:
        return Stalled(machine, None, 0.0 if machine is None else machine.work)


def _make(machine: Machine, again: int) -> tuple[Machine, Recipe] | Stalled:
    problem = machine.problem
    possible = tuple(sorted(problem.possible))
    most = max(64, min(MOST, NUMBERS // len(problem.lowest)))
    count = min(most, max(LEAST, ISLANDS * OF_A_CELL * len(possible)))
    rng = generator(problem.request.seed, -1)
    for attempt in range(again + 1):
        tally = Tally()
        before = machine.work
        grown, steps = explore(machine, *spread_over(possible, count), rng, tally)
        last = attempt == again or count >= most
        if isinstance(grown, Stuck):
            if last or not grown.placed.attracted:
                return Stalled(machine, grown, machine.work)
        elif last or _ancestors(grown.particles) >= FAMILIES:
            break
        count = min(most, 4 * count)
    assert isinstance(grown, Grown)
    cost = machine.work - before
    reached = tuple(map(int, np.unique(grown.particles.cell)))
    wanted = max(ISLANDS * OF_A_CELL * len(reached), int(np.ceil(SPARE * problem.request.n)))
    size = min(most, max(count if count > LEAST else LEAST // 2, wanted))
    if not again and _ancestors(grown.particles) < FAMILIES / 2.0:
        return machine, Recipe(tuple(steps), Settings({}), reached, size, 0, np.inf, machine.work, np.inf)
    settle, effect, settings, swept = _settle(grown.particles, tally, cost)
    piece = (cost + swept * settle) * size / count
    return machine, Recipe(tuple(steps), settings, reached, size, settle, effect, machine.work, piece)


def _ancestors(particles: Particles) -> float:
    """The effective number of first ancestors."""
    _, sizes = np.unique(particles.families[0], return_counts=True)
    return float(sizes.sum() ** 2 / (sizes * sizes).sum())


def _settle(particles: Particles, tally: Tally, cost: float) -> tuple[int, float, Settings, float]:
    """How many sweeps make scenes of one ancestor as different as any, the design effect left after these, the settings
    tuned on the way, and the cost of a sweep."""
    machine = particles.machine
    kinship = Kinship(machine)
    begun, done = machine.work, 0
    final = Tally(steps=tally.steps)  # which moves are taken is judged by whole scenes, step lengths by all
    while done < 2:
        sweep(particles, Settings({}), final)
        done += 1
    settings = tuned(final)
    while True:
        block = max(1, done // 3)
        for _ in range(block):
            sweep(particles, settings)
        done += block
        effect = kinship(particles)
        spent = machine.work - begun > max(ANYWAY, PATIENT * cost) and done >= FEW
        if (effect <= ALIKE and particles.apart.mean() >= APART) or done >= LONGEST or spent:
            return done, effect, settings, (machine.work - begun) / done


def tuned(tally: Tally) -> Settings:
    """Step lengths by how far they bring an object, a third of them spread over all lengths; and the kinds of move that
    scenes take."""
    odds = {}
    sizes = 2.0 ** -np.arange(FINEST + 1)
    for thing, (tried, taken) in tally.steps.items():
        gain = (taken + 0.05) / (tried + 1.0) * sizes
        odds[thing] = 0.7 * gain / gain.sum() + 0.3 / (FINEST + 1)
    kinds = [kind for kind in KINDS if (rate := tally.rate(kind)) is None or rate >= USELESS]
    for kind in tally.tried:
        rate = tally.rate(kind)
        if kind.startswith(("swap", "trade")) and rate is not None and rate >= USELESS:
            kinds.append(kind.replace("swap", "shuffle") if rate >= EXCHANGEABLE else kind)
    return Settings(odds, tuple(kinds))


def with_deadline(machine: Machine, deadline: float) -> Machine:
    """The same with another deadline, and with its count of work begun again."""
    return replace(machine, work=0.0, deadline=deadline)
