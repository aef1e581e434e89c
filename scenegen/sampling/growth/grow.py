"""Growing a population of scenes: objects one after another, resampling, moves (sequential Monte Carlo; Del Moral et
al. 2006, Doucet and Johansen 2009)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from scenegen.pose import PLACE, is_angle, row_of
from scenegen.sampling.growth.insert import InsertionTally, place
from scenegen.sampling.growth.machine import Machine
from scenegen.sampling.growth.moves import MoveSettings, sweep
from scenegen.sampling.growth.particles import MoveTally, Particles, resample
from scenegen.sampling.growth.touch import make_values

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.intp]

FIRST_TRIES = 16  # poses tried in every scene to see how many are needed
MOST_POSES = 1 << 21  # poses tried for one object in all scenes, at most
HITS = 6.0  # poses that meet all clauses that a scene should have among its tries
EVEN = 0.9  # effective share of the scenes after weighting from which on no moves are made
SWEEPS, MOST_SWEEPS = 3.0, 24  # sweeps after a step for each scene that a carried weight stands for, but for one
AFFORDED, PAID = 2e4, 0.3  # evaluations that they may take, and how many for each evaluation of growth before them
SOME = 24  # objects moved after one is placed: all of them would cost more than the scenes' number of objects squared


@dataclass(frozen=True, slots=True)
class Step:
    """One object: `tries` poses in every scene, then `sweeps` over at most SOME of the placed objects."""

    tries: int
    sweeps: int


@dataclass(frozen=True, slots=True)
class Grown:
    """`particles` have all objects; `log_share` (islands, C) is each island's estimate of the share of the contracted
    box that is of each cell, as a natural logarithm, -inf where none was found."""

    particles: Particles
    log_share: Array


@dataclass(frozen=True, slots=True)
class PlacementFailed:
    """No scene has room for the object of stage `stage`; `placed` tells what its tries came to, `particles` are the
    scenes before it."""

    particles: Particles
    stage: int
    placed: InsertionTally


def grow(
    machine: Machine,
    cell: Index,
    island: Index,
    steps: Sequence[Step],
    settings: MoveSettings,
    rng: np.random.Generator,
) -> Grown | PlacementFailed:
    """Scenes for the given cells and islands, (P,) each, by a plan. There may be fewer in the end: they can die out."""
    particles = Particles.start(machine, cell, island, rng)
    return _grow(particles, settings, lambda particles: _by_plan(particles, steps))


def explore(
    machine: Machine,
    cell: Index,
    island: Index,
    rng: np.random.Generator,
    tally: MoveTally,
    *,
    hits: float = HITS,
    moves: bool = True,
) -> tuple[Grown | PlacementFailed, list[Step]]:
    """Scenes as `grow` makes them, while the steps of a plan are found out. `hits` poses that meet all clauses are
    wanted of each scene and object; without `moves`, scenes are as alike as resampling makes them."""
    steps: list[Step] = []
    settings = MoveSettings({})

    def advance(particles: Particles) -> tuple[InsertionTally, int]:
        placed = _with_enough_tries(particles, hits)
        steps.append(Step(placed.tries // particles.count, 0))
        return placed, -1 if moves else 0

    particles = Particles.start(machine, cell, island, rng)
    return _grow(particles, settings, advance, tally, steps), steps


def _by_plan(particles: Particles, steps: Sequence[Step]) -> tuple[InsertionTally, int]:
    step = steps[particles.stage + 1]
    return place(particles, step.tries), step.sweeps


def _with_enough_tries(particles: Particles, hits: float) -> InsertionTally:
    stage, tries, most = particles.stage, FIRST_TRIES, max(FIRST_TRIES, MOST_POSES // particles.count)
    held, chances = list(particles.held), particles.chances.copy()
    while True:
        placed = place(particles, tries, planning=True)
        rate = placed.hits / placed.tries
        enough = int(np.ceil(hits / rate)) if rate > 0.0 else 16 * tries
        if enough <= 2 * tries or tries >= most:
            return placed
        tries = min(most, max(2, enough))
        particles.stage, particles.held, particles.chances = stage, list(held), chances.copy()


def _grow(
    particles: Particles,
    settings: MoveSettings,
    advance: Callable[[Particles], tuple[InsertionTally, int]],
    tally: MoveTally | None = None,
    steps: list[Step] | None = None,
) -> Grown | PlacementFailed:
    machine, rng = particles.machine, particles.rng
    log_share = np.full((int(particles.island.max()) + 1, machine.cells), -np.inf)
    log_share[particles.island, particles.cell] = 0.0
    last, start = len(machine.order) - 1, machine.work
    for stage in range(len(machine.order)):
        placed, sweeps = advance(particles)
        keep, mean = resample(placed.weights, particles.group, rng)
        with np.errstate(divide="ignore"):
            factor = np.zeros_like(log_share)
            factor[particles.island, particles.cell] = np.log(mean)
        log_share += factor
        if not len(keep):
            return PlacementFailed(particles, stage, placed)
        if sweeps < 0:
            even = float(placed.weights.sum() ** 2 / (particles.count * (placed.weights**2).sum()))
            sweeps = 0 if even > EVEN or stage == last else _sweeps(even)
            assert steps is not None
            steps[-1] = Step(steps[-1].tries, sweeps)
        machine.furthest = max(machine.furthest, stage + 1)
        if stage in (last // 2, 3 * last // 4, last):
            particles.note_ancestors()
        particles.take(keep)
        begun = machine.work
        for done in range(sweeps):
            sweep(particles, settings, tally, SOME)
            if steps is not None and machine.work - begun > max(AFFORDED, PAID * (begun - start)):
                steps[-1] = Step(steps[-1].tries, done + 1)
                break
    return Grown(particles, log_share)


def _sweeps(even: float) -> int:
    """Sweeps after a step: more where few scenes carry the weight, for their copies must part. While few objects are
    placed that costs little, and later, when objects stand in each other's way, it would cost much."""
    return min(MOST_SWEEPS, int(np.ceil(SWEEPS * (1.0 / even - 1.0))))


# --------------------------------------------------------------------------------------------------------------------
# How much scenes with a common ancestor are alike.


T = TypeVar("T")

PAIRS = 24  # pairs of objects whose differences are watched
CLAUSES = 48  # clauses, and ways of choices, whose margins are watched


class AncestorEffect:
    """The design effect of common ancestors: by how much the mean of a statistic varies more than that of independent
    scenes.

    Watched are all coordinates, signed and unsigned differences of pairs of objects, margins of clauses other than
    pairs, and means, variances and covariance of the places of all objects of one kind together, which stay when these
    trade places; all relative to the mean of the scene's cell.
    """

    def __init__(self, machine: Machine) -> None:
        graph = machine.graph
        self._machine = machine
        self._rows = sorted(graph.rows)
        clauses = [clause.node for clause in graph.clauses]
        ways = [way.whole.node for choice in graph.choices for way in choice.ways]
        self._margins = make_values(graph.core, [*_some(clauses, CLAUSES), *_some(ways, CLAUSES)])
        order = machine.order
        pairs = [(order[a], order[b]) for a in range(len(order)) for b in range(a)]
        self._pairs = _some(pairs, PAIRS)

    def __call__(self, particles: Particles) -> float:
        """1 where scenes of one ancestor are as different as any; the worst statistic counts, and the remembered
        generation of ancestors in which it is worst. What chance makes of some hundred statistics is taken off."""
        values = self._statistics(particles)
        worst = 1.0
        for family in particles.families:
            sizes = np.bincount(family)
            pairs = float((sizes * (sizes - 1.0)).sum())
            if pairs <= 0.0:
                continue
            sums = np.stack([np.bincount(family, weights=row, minlength=len(sizes)) for row in values])
            alike = ((sums * sums).sum(axis=1) - (values * values).sum(axis=1)) / pairs
            correlation = float(alike.max(initial=0.0)) - 3.0 * np.sqrt(2.0 / pairs)
            worst = max(worst, 1.0 + max(0.0, correlation) * pairs / particles.count)
        return worst

    def _statistics(self, particles: Particles) -> Array:
        """(S, P), standardised; those that are the same in all scenes are 0."""
        scenes, found = particles.scenes, list[Array]()
        for row in self._rows:
            found += [np.cos(scenes[row]), np.sin(scenes[row])] if is_angle(row) else [scenes[row]]
        for first, second in self._pairs:
            for axis in PLACE:
                apart = scenes[row_of(first, axis)] - scenes[row_of(second, axis)]
                found += [apart, np.abs(apart)]
        found += [np.broadcast_to(value, particles.count) for value in self._margins(list(scenes))]
        for kin in self._machine.kin:
            x, y = (scenes[[row_of(block[0], axis) for block in kin]] for axis in PLACE)
            found += [x.mean(axis=0), y.mean(axis=0), x.var(axis=0), y.var(axis=0)]
            found += [((x - x.mean(axis=0)) * (y - y.mean(axis=0))).mean(axis=0)]
        table = np.nan_to_num(np.array(found).reshape(len(found), particles.count))
        middle = table.mean(axis=1, keepdims=True)
        table -= middle
        if self._machine.cells > 1:
            # Scenes of one ancestor are of one cell. That cells differ is not kinship: each gets its share.
            counts = np.bincount(particles.cell, minlength=self._machine.cells)
            for row in table:
                row -= (np.bincount(particles.cell, weights=row, minlength=len(counts)) / np.maximum(counts, 1))[
                    particles.cell
                ]
        spread = np.sqrt((table * table).mean(axis=1, keepdims=True))
        out: Array = table * np.where(spread > 1e-9 * (1.0 + np.abs(middle)), 1.0 / np.maximum(spread, 1e-300), 0.0)
        return out


def _some(items: list[T], most: int) -> list[T]:
    """At most so many of the items, evenly over all."""
    return items[:: max(1, -(-len(items) // most))]
