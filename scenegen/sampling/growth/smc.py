"""Sequential Monte Carlo (Del Moral et al. 2006, Doucet and Johansen 2009): a population of scenes grows by one object
after another, with resampling and moves; how much its scenes are alike then, and how long they are moved on."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from scenegen.arrays import Array, Index
from scenegen.pose import PLACE, X, Y, is_angle, row_of
from scenegen.sampling.growth.insertion import InsertionTally, place
from scenegen.sampling.growth.machine import Machine, MoveTally, Particles, resample
from scenegen.sampling.growth.moves import MoveSettings, sweep
from scenegen.sampling.growth.touch import make_values

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


# --------------------------------------------------------------------------------------------------------------------
# How long a population is moved once it has grown, and which share of it is worth taking.
#
# Scenes of a common ancestor are alike. Sweeps of moves make them differ; where these take long, it is cheaper to
# grow a larger population and to take a random part of it: of N scenes with design effect e, a random part of N / k
# has only 1 + (e - 1) / k. Which part is taken must not depend on what the scenes are like, nor on their ancestors:
# copies carry the weight that their scene had. So a plan follows the design effect from sweep to sweep, and settles
# for as many as bring the wanted scenes at the least cost.


ALIKE = 1.5  # design effect of common ancestors from which on scenes count as apart
LOST = 0.04  # share of the scenes that may be left out because they share an object's place with another
LONGEST = 400  # sweeps at most
FEWEST_SWEEPS = 4  # sweeps at least
SURE = 12  # sweeps from which on scenes that seem to differ are trusted to do so: a larger population tells more
SPENT = 0.4  # share of what all scenes will cost that may be spent to see how many sweeps are best
SET_UP = 0.5  # what a further population costs however small it is, of what one as large as the first one does
NOISE = 1.1  # the design effect is known to about so much
TRIED_EARLY, HELPED_EARLY = 0.15, 0.8  # the same, as long as scenes are nearly as much alike as in the beginning
FAR, DEARER, STILL = 4.0, 1.2, 2.0  # times the best number and cost at which the search ends if scenes are still alike


@dataclass(frozen=True, slots=True)
class BurnIn:
    """`sweeps` are made, then one scene in `thin` is taken at random. `effect` is the design effect of common ancestors
    that is left among all scenes by then, `cost` what a sweep takes, in evaluations."""

    sweeps: int
    thin: float
    effect: float
    cost: float

    @property
    def left(self) -> float:
        """The design effect among the scenes that are taken."""
        return 1.0 + (self.effect - 1.0) / self.thin


def settle(
    particles: Particles,
    sweep: Callable[[], object],
    alike: Callable[[Particles], float],
    grown: float,
    wanted: float,
) -> tuple[BurnIn, BurnIn]:
    """What is best for the pieces of a plan, and how the given particles stand in the end: they are its first piece.

    `sweep` moves the particles once, `alike` gives their design effect; growing them took `grown` evaluations, and
    `wanted` scenes are to be had. Sweeps end where the particles themselves are enough, have taken a good part of what
    all wanted scenes will cost, or are far more than the best number and dearer, and the scenes still much alike; of
    their numbers, the one is taken that makes all scenes cheapest, of at least SURE if these are apart in the end.
    """
    machine = particles.machine
    begun, done = machine.work, 0
    best: BurnIn | None = None
    sure: BurnIn | None = None
    cheapest, surest, slowest = np.inf, np.inf, 0.0
    while True:
        block = max(1, done // 3)
        for _ in range(block):
            sweep()
        done += block
        if done < FEWEST_SWEEPS:
            continue
        effect = alike(particles)
        thin = max(1.0, (effect - 1.0) / (ALIKE - 1.0), partners(particles) / (2.0 * LOST))
        each = (machine.work - begun) / done
        now = BurnIn(done, thin, effect, each)
        pieces = wanted * thin / particles.count - 1.0
        rest = 0.0 if pieces <= 0.0 else SET_UP + pieces
        cost = each * done + rest * (grown + each * done)
        if cost < cheapest:
            cheapest, best = cost, now
        if cost < surest and done >= SURE:
            surest, sure = cost, now
        slowest = max(slowest, thin)
        assert best is not None
        spent = (machine.work - begun) / cheapest
        enough = pieces <= 0.0 or (thin <= 1.0 and done >= SURE)
        helps = cost <= NOISE * cheapest  # the last sweeps have made the whole cheaper
        over = done >= LONGEST or (done >= FAR * best.sweeps and cost > DEARER * cheapest and thin >= STILL)
        if enough or over or (not helps and spent > (SPENT if thin < HELPED_EARLY * slowest else TRIED_EARLY)):
            return ((sure or now) if thin <= 1.0 else best), now


def part_of(cell: Index, thin: float, rng: np.random.Generator) -> Index:
    """One in `thin` of the scenes at random, as many of each cell as that goes: their indices, in random order."""
    order = rng.permutation(len(cell))
    number = np.empty(len(cell), dtype=np.intp)  # of each scene among those of its cell
    by_cell = np.argsort(cell[order], kind="stable")
    sizes = np.bincount(cell[order][by_cell])
    number[by_cell] = np.arange(len(cell)) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    return order[np.argsort(number, kind="stable")][: int(np.ceil(len(cell) / thin))]


def partners(particles: Particles) -> float:
    """The mean number of other scenes with which a scene shares some object's place."""
    values, scene = _places(particles, np.arange(particles.count))
    shared = np.zeros((particles.count, particles.count), dtype=bool)
    for distance in range(1, len(values)):
        same = np.flatnonzero(values[distance:] == values[:-distance])
        if not len(same):
            break
        shared[scene[same], scene[same + distance]] = True
    np.fill_diagonal(shared, val=False)
    return float((shared | shared.T).sum()) / particles.count


def apart(particles: Particles, order: Index) -> Index:
    """The scenes of `order` that share no object's place with one before them."""
    values, number = _places(particles, order)
    if not len(values):
        return order
    again = np.concatenate([[False], values[1:] == values[:-1]])
    keep = np.ones(len(order), dtype=bool)
    first = number[np.maximum.accumulate(np.where(again, 0, np.arange(len(values))))]
    keep[number[again & (number != first)]] = False
    return order[keep]


def _places(particles: Particles, order: Index) -> tuple[Array, Index]:
    """What tells the place of each placed object in the scenes of `order`, and the number of its scene there, both
    sorted by place, then by number. Moves go by random steps, so equal places are copies."""
    free = particles.machine.graph.rows
    rows = [
        row_of(thing, X if row_of(thing, X) in free else Y)
        for thing in particles.placed
        if any(row_of(thing, axis) in free for axis in PLACE)
    ]
    values = particles.scenes[rows][:, order].ravel()
    number = np.tile(np.arange(len(order)), len(rows))
    sorting = np.lexsort((number, values))
    return values[sorting], number[sorting]
