"""A population of scenes: sequential Monte Carlo (Del Moral et al. 2006, Doucet and Johansen 2009).

It grows by one object after another, with resampling and moves; then its scenes are moved on until those of a common
ancestor differ, and a part of them is taken. All that it needs is counted in evaluations, never timed: its random
numbers fix it, and it comes out the same in any process."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from scenegen.arrays import Array, Index
from scenegen.pose import PLACE, X, Y, is_angle, row_of
from scenegen.sampling.growth.constraints import make_values
from scenegen.sampling.growth.insertion import InsertionTally, place
from scenegen.sampling.growth.model import GrowthModel, MoveTally, Particles
from scenegen.sampling.growth.moves import JUMPS, LIFT_KINDS, MOVE_KINDS, MoveSettings, sweep
from scenegen.sampling.growth.support_moves import FINEST_STEP
from scenegen.sampling.resampling import resample_groups

FIRST_TRIES = 16  # poses tried in every scene to see how many are needed
MAX_TRIED_POSES = 1 << 21  # poses tried for one object in all scenes, at most
HITS = 6.0  # poses that meet all clauses that a scene should have among its tries
EVEN_WEIGHTS = 0.9  # effective share of the scenes after weighting from which on no moves are made
SWEEPS, MAX_SWEEPS = 3.0, 24  # sweeps after a step for each scene that a carried weight stands for, but for one
AFFORDED, PAID = 2e4, 0.3  # evaluations that they may take, and how many for each evaluation of growth before them
MAX_MOVED_OBJECTS = 24  # objects moved after one is placed: to move all would cost more than their number squared


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
    model: GrowthModel,
    cell: Index,
    island: Index,
    steps: Sequence[Step],
    settings: MoveSettings,
    rng: np.random.Generator,
) -> Grown | PlacementFailed:
    """Scenes for the given cells and islands, (P,) each, by a plan. There may be fewer in the end: they can die out."""

    def advance(particles: Particles) -> tuple[InsertionTally, int]:
        step = steps[particles.stage + 1]
        return place(particles, step.tries), step.sweeps

    return _grow(Particles.start(model, cell, island, rng), settings, advance)


def explore(
    model: GrowthModel,
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

    particles = Particles.start(model, cell, island, rng)
    return _grow(particles, settings, advance, tally, steps), steps


def _with_enough_tries(particles: Particles, hits: float) -> InsertionTally:
    stage, tries, most = particles.stage, FIRST_TRIES, max(FIRST_TRIES, MAX_TRIED_POSES // particles.count)
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
    model, rng = particles.model, particles.rng
    log_share = np.full((int(particles.island.max()) + 1, model.cells), -np.inf)
    log_share[particles.island, particles.cell] = 0.0
    last, start = len(model.order) - 1, model.work
    for stage in range(len(model.order)):
        placed, sweeps = advance(particles)
        keep, mean = resample_groups(placed.weights, particles.group, rng)
        with np.errstate(divide="ignore"):
            factor = np.zeros_like(log_share)
            factor[particles.island, particles.cell] = np.log(mean)
        log_share += factor
        if not len(keep):
            return PlacementFailed(particles, stage, placed)
        if sweeps < 0:
            even = float(placed.weights.sum() ** 2 / (particles.count * (placed.weights**2).sum()))
            sweeps = 0 if even > EVEN_WEIGHTS or stage == last else _sweeps(even)
            assert steps is not None
            steps[-1] = Step(steps[-1].tries, sweeps)
        model.furthest = max(model.furthest, stage + 1)
        if stage in (last // 2, 3 * last // 4, last):
            particles.families.append(np.arange(particles.count))
        particles.take(keep)
        begun = model.work
        for done in range(sweeps):
            sweep(particles, settings, tally, MAX_MOVED_OBJECTS)
            if steps is not None and model.work - begun > max(AFFORDED, PAID * (begun - start)):
                steps[-1] = Step(steps[-1].tries, done + 1)
                break
    return Grown(particles, log_share)


def _sweeps(even: float) -> int:
    """Sweeps after a step: more where few scenes carry the weight, for their copies must part. While few objects are
    placed that costs little, and later, when objects stand in each other's way, it would cost much."""
    return min(MAX_SWEEPS, int(np.ceil(SWEEPS * (1.0 / even - 1.0))))


Item = TypeVar("Item")

MAX_WATCHED_PAIRS = 24  # pairs of objects whose differences are watched
MAX_WATCHED_CLAUSES = 48  # clauses, and ways of choices, whose margins are watched


class AncestorEffect:
    """The design effect of common ancestors: by how much the mean of a statistic varies more than that of independent
    scenes.

    Watched are all coordinates, signed and unsigned differences of pairs of objects, margins of clauses other than
    pairs, and means, variances and covariance of the places of all objects of one kind together, which stay when these
    trade places; all relative to the mean of the scene's cell.
    """

    def __init__(self, model: GrowthModel) -> None:
        graph = model.graph
        self._model = model
        self._rows = sorted(graph.rows)
        clauses = [clause.node for clause in graph.clauses]
        ways = [way.whole.node for choice in graph.choices for way in choice.ways]
        self._margins = make_values(
            graph.core, [*_evenly_chosen(clauses, MAX_WATCHED_CLAUSES), *_evenly_chosen(ways, MAX_WATCHED_CLAUSES)]
        )
        order = model.order
        pairs = [(order[a], order[b]) for a in range(len(order)) for b in range(a)]
        self._pairs = _evenly_chosen(pairs, MAX_WATCHED_PAIRS)

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
        for kin in self._model.kin:
            x, y = (scenes[[row_of(block[0], axis) for block in kin]] for axis in PLACE)
            found += [x.mean(axis=0), y.mean(axis=0), x.var(axis=0), y.var(axis=0)]
            found += [((x - x.mean(axis=0)) * (y - y.mean(axis=0))).mean(axis=0)]
        table = np.nan_to_num(np.array(found).reshape(len(found), particles.count))
        middle = table.mean(axis=1, keepdims=True)
        table -= middle
        if self._model.cells > 1:
            # Scenes of one ancestor are of one cell. That cells differ is not kinship: each gets its share.
            counts = np.bincount(particles.cell, minlength=self._model.cells)
            for row in table:
                row -= (np.bincount(particles.cell, weights=row, minlength=len(counts)) / np.maximum(counts, 1))[
                    particles.cell
                ]
        spread = np.sqrt((table * table).mean(axis=1, keepdims=True))
        out: Array = table * np.where(spread > 1e-9 * (1.0 + np.abs(middle)), 1.0 / np.maximum(spread, 1e-300), 0.0)
        return out


def _evenly_chosen(items: list[Item], most: int) -> list[Item]:
    """At most so many of the items, evenly over all."""
    return items[:: max(1, -(-len(items) // most))]


ALIKE_EFFECT = 1.5  # design effect of common ancestors from which on scenes count as apart
MAX_LOST_SHARE = 0.04  # share of the scenes that may be left out because they share an object's place with another
MAX_SETTLE_SWEEPS = 400  # sweeps at most
MIN_SETTLE_SWEEPS = 4  # sweeps at least
TRUSTED_SWEEPS = 12  # sweeps from which on scenes that seem to differ do so: a larger population tells more
MAX_SETTLE_SHARE = 0.4  # share of what all scenes will cost that may be spent to see how many sweeps are best
SET_UP = 0.5  # what a further population costs however small it is, of what one as large as the first one does
EFFECT_NOISE = 1.1  # the design effect is known to about so much
MAX_EARLY_SHARE, HELPED_EARLY = 0.15, 0.8  # the same, as long as scenes are nearly as much alike as in the beginning
FAR_SWEEPS, DEARER, STILL = 4.0, 1.2, 2.0  # times the best number and cost at which alike scenes end the search


@dataclass(frozen=True, slots=True)
class BurnIn:
    """`sweeps` are made, then one scene in `thin` is taken at random. `effect` is the design effect of common ancestors
    that is left among all scenes by then, `cost` what a sweep takes, in evaluations."""

    sweeps: int
    thin: float
    effect: float
    cost: float

    @property
    def taken_effect(self) -> float:
        """The design effect among the scenes that are taken."""
        return 1.0 + (self.effect - 1.0) / self.thin


def settle(
    particles: Particles, sweep: Callable[[], object], alike: Callable[[Particles], float], grown: float, wanted: float
) -> tuple[BurnIn, BurnIn]:
    """What is best for the pieces of a plan, and how the given particles stand in the end: they are its first piece.

    Scenes of a common ancestor are alike. Sweeps of moves make them differ; where these take long, it is cheaper to
    grow a larger population and to take a random part of it: of N scenes with design effect e, a random part of N / k
    has only 1 + (e - 1) / k. Which part is taken must not depend on what the scenes are like, nor on their ancestors:
    copies carry the weight that their scene had.

    `sweep` moves the particles once, `alike` gives their design effect; growing them took `grown` evaluations, and
    `wanted` scenes are to be had. Sweeps end where the particles themselves are enough, have taken a good part of what
    all wanted scenes will cost, or are far more than the best number and dearer, and the scenes still much alike; of
    their numbers, the one is taken that makes all scenes cheapest, of at least SURE if these are apart in the end.
    """
    model = particles.model
    begun, done = model.work, 0
    best: BurnIn | None = None
    sure: BurnIn | None = None
    cheapest, surest, slowest = np.inf, np.inf, 0.0
    while True:
        block = max(1, done // 3)
        for _ in range(block):
            sweep()
        done += block
        if done < MIN_SETTLE_SWEEPS:
            continue
        effect = alike(particles)
        thin = max(1.0, (effect - 1.0) / (ALIKE_EFFECT - 1.0), shared_places(particles) / (2.0 * MAX_LOST_SHARE))
        each = (model.work - begun) / done
        now = BurnIn(done, thin, effect, each)
        pieces = wanted * thin / particles.count - 1.0
        rest = 0.0 if pieces <= 0.0 else SET_UP + pieces
        cost = each * done + rest * (grown + each * done)
        if cost < cheapest:
            cheapest, best = cost, now
        if cost < surest and done >= TRUSTED_SWEEPS:
            surest, sure = cost, now
        slowest = max(slowest, thin)
        assert best is not None
        spent = model.work - begun
        enough = pieces <= 0.0 or (thin <= 1.0 and done >= TRUSTED_SWEEPS)
        helps = cost <= EFFECT_NOISE * cheapest  # the last sweeps have made the whole cheaper
        over = done >= MAX_SETTLE_SWEEPS or (
            done >= FAR_SWEEPS * best.sweeps and cost > DEARER * cheapest and thin >= STILL
        )
        most = (MAX_SETTLE_SHARE if thin < HELPED_EARLY * slowest else MAX_EARLY_SHARE) * cheapest
        if enough or over or (not helps and spent > most):
            return ((sure or now) if thin <= 1.0 else best), now


def pick_part(cell: Index, thin: float, rng: np.random.Generator) -> Index:
    """One in `thin` of the scenes at random, as many of each cell as that goes: their indices, in random order."""
    order = rng.permutation(len(cell))
    number = np.empty(len(cell), dtype=np.intp)  # of each scene among those of its cell
    by_cell = np.argsort(cell[order], kind="stable")
    sizes = np.bincount(cell[order][by_cell])
    number[by_cell] = np.arange(len(cell)) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    return order[np.argsort(number, kind="stable")][: int(np.ceil(len(cell) / thin))]


def shared_places(particles: Particles) -> float:
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


def distinct_particles(particles: Particles, order: Index) -> Index:
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
    free = particles.model.graph.rows
    rows = [
        row_of(thing, X if row_of(thing, X) in free else Y)
        for thing in particles.placed_objects
        if any(row_of(thing, axis) in free for axis in PLACE)
    ]
    values = particles.scenes[rows][:, order].ravel()
    number = np.tile(np.arange(len(order)), len(rows))
    sorting = np.lexsort((number, values))
    return values[sorting], number[sorting]


PIECE_ISLANDS = 4  # independent populations of a piece: the error bar of the probability is their spread
SPARE_PARTICLES = 1.15  # scenes grown for each one wanted: copies that have not moved apart are left out
MIN_EVEN_SHARE = 0.5  # share of scenes that fill the cells evenly, at least, for scenes to be free to leave their cell
CELL_DEVIATIONS = 2.5  # standard deviations by which a cell may get fewer scenes than on average
USELESS_RATE = 0.002  # share of scenes that take a kind of move below which it is not made
MAX_LIFT_TRIES = 32  # of a place for an object that is lifted
LIFT_OVERHEAD = 2.0  # what such a move costs before the first try, in tries
REDRAWN, RELOCATED = 0.25, 0.5  # times that an object, and all that hangs from it, is lifted for each of its turns
TRIAL_LIFTS = 0.5  # the same, while it is found out how many find a place
TAKEN, SELDOM = 0.1, 0.25  # share of these that must find a place; so many times fewer are made of those that do not
EXCHANGEABLE = 0.99  # share of swaps taken from which on all kin are shuffled
MIN_ANCESTORS = 12.0  # effective ancestors below which a larger population is grown
MIN_LARGER_POPULATION = 2048  # scenes of such a population, at least
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


def spread_scenes(model: GrowthModel, cells: Sequence[int], count: int) -> tuple[Index, Index]:
    """The cell and the island of each of `count` scenes, (count,) each: all equally often, or as the model says, as
    far as that goes."""
    number, which = np.arange(count), np.array(cells, dtype=np.intp)
    if model.begin is None:
        return which[number // PIECE_ISLANDS % len(cells)], number % PIECE_ISLANDS
    places = np.cumsum(model.begin[which])
    return which[
        np.searchsorted(places, (number // PIECE_ISLANDS + 0.5) * PIECE_ISLANDS / count * places[-1]).clip(
            0, len(which) - 1
        )
    ], number % PIECE_ISLANDS


def make_population(
    model: GrowthModel, size: Size, rng: np.random.Generator, *, larger: bool = False
) -> Population | PlacementFailed:
    """Grows it, as large as it has to be; PlacementFailed where there is no room for some object. `larger`: the first
    size is known to leave too few ancestors. Raises StoppedError."""
    possible = tuple(sorted(model.problem.possible))
    count = size.count if model.begin is None else max(size.count, _scenes_for_cells(model.begin[list(possible)], size))
    for attempt in range(size.again + 1):
        if attempt:
            count = min(size.most, max(2 * count, MIN_LARGER_POPULATION))
        elif larger:
            continue
        tally = MoveTally()
        before = model.work
        hits = HITS if attempt == 0 else MORE_HITS
        grown, steps = explore(model, *spread_scenes(model, possible, count), rng, tally, hits=hits)
        last = attempt == size.again or count >= size.most
        if isinstance(grown, PlacementFailed):
            if last or not grown.placed.attracted:
                return grown
        elif last or _ancestors(grown.particles) >= MIN_ANCESTORS:
            break
    assert isinstance(grown, Grown)
    cost = model.work - before
    found = _cells(grown.particles)
    reached = tuple(map(int, np.unique(found[found >= 0])))
    share = 1.0 if model.begin is None else _even_count(found) / len(found)
    if _ancestors(grown.particles) < size.fewest or share < MIN_EVEN_SHARE:
        return Population(count, tuple(steps), reached, cost, MoveSettings({}), share=share)
    scenes = wanted_scenes(reached, size.wanted) / size.populations / share
    settings, settled, now, accepted = _settle(grown.particles, tally, cost, scenes)
    taken = take_sample(grown, max(now.thin, count / scenes), now.effect, accepted, rng)
    return Population(count, tuple(steps), reached, cost, settings, settled, taken, share)


def _scenes_for_cells(begin: Array, size: Size) -> int:
    """How many scenes of a loose model leave enough in each cell, by all odds; 0 if that is beyond `most`."""
    each = size.wanted / size.populations / len(begin)
    count = math.ceil(float(begin.sum()) * (each + CELL_DEVIATIONS * math.sqrt(each)))
    return count if count <= size.most else 0


def wanted_scenes(reached: Sequence[int], wanted: int, spare: float = SPARE_PARTICLES) -> float:
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
    lift = dict.fromkeys(particles.placed_objects, (TRIAL_LIFTS, MAX_LIFT_TRIES // 4))
    trial = MoveSettings({}, redraws=lift, relocations=lift)
    for _ in range(2):
        sweep(particles, trial, final)
    settings = tuned_settings(final)
    alike = AncestorEffect(particles.model)
    taken: list[float] = []
    best, now = settle(particles, lambda: taken.append(sweep(particles, settings)), alike, cost, wanted)
    return settings, best, now, float(np.mean(taken))


def _cells(particles: Particles) -> Index:
    """The cell that each scene is in, (P,): its own, unless it may leave that; -1 out of the range."""
    problem, read = particles.model.problem, particles.model.graph.rows
    if particles.model.begin is None:
        return particles.cell
    rows = [row if at in read else problem.lowest[at] for at, row in enumerate(particles.scenes)]
    return problem.cells.find(problem.phi(np.stack(np.broadcast_arrays(*rows))))


def _even_count(cells: Index) -> float:
    """How many scenes are left of those in these cells if all that are reached get equally many."""
    _, counts = np.unique(cells[cells >= 0], return_counts=True)
    return float(len(counts) * counts.min(initial=len(cells)))


def take_sample(
    grown: Grown, thin: float, effect: float, accepted: float, rng: np.random.Generator
) -> PopulationSample:
    """One in `thin` of whole scenes, without copies. `effect` is the design effect of common ancestors among all."""
    particles = grown.particles
    some = pick_part(particles.cell, thin, rng)
    taken = distinct_particles(particles, some)
    effect = 1.0 + (effect - 1.0) / thin
    copies = 1.0 - len(taken) / len(some)
    cells, log_share = _cells(particles), grown.log_share
    if particles.model.begin is not None:
        group = particles.island, particles.cell
        mine, all_ = np.zeros_like(log_share), np.zeros_like(log_share)
        np.add.at(mine, group, cells == particles.cell)
        np.add.at(all_, group, 1.0)
        with np.errstate(divide="ignore"):
            log_share = log_share + np.log(mine / np.maximum(all_, 1.0))
        taken = taken[cells[taken] >= 0]
    even = float(len(taken)) if particles.model.begin is None else _even_count(cells[taken])
    return PopulationSample(particles.scenes[:, taken], log_share, accepted, copies, effect, particles.model.work, even)


def tuned_settings(tally: MoveTally) -> MoveSettings:
    """Step lengths by how far they bring an object, a third of them spread over all lengths; and the kinds of move that
    scenes take."""
    odds = {}
    sizes = 2.0 ** -np.arange(FINEST_STEP + 1)
    for thing, (tried, taken) in tally.steps.items():
        gain = (taken + 0.05) / (tried + 1.0) * sizes
        odds[thing] = 0.7 * gain / gain.sum() + 0.3 / (FINEST_STEP + 1)
    rates = {
        kind: tally.rate(kind) for kind in MOVE_KINDS if kind not in LIFT_KINDS
    }  # how often these are made is found below
    kinds = [*LIFT_KINDS, *(kind for kind, rate in rates.items() if rate is None or rate >= USELESS_RATE)]
    if tally.rate("hop") or tally.rate("carry"):  # however seldom: nothing else brings an object to another surface
        kinds.append("hop")
    for kind in tally.tried:
        rate = tally.rate(kind)
        if kind.startswith(("swap", "trade")) and rate is not None and rate >= USELESS_RATE:
            kinds.append(kind.replace("swap", "shuffle") if rate >= EXCHANGEABLE else kind)
    redraws, relocations = {}, {}
    for thing in tally.steps:
        if (rate := tally.rate(f"redraw of {thing}")) is not None:
            redraws[thing] = tempered_shares(rate, REDRAWN)
        if (rate := tally.rate(f"relocate of {thing}")) is not None:
            relocations[thing] = tempered_shares(rate, RELOCATED)
    jumps = tally.rate("jump")
    return MoveSettings(
        odds, tuple(kinds), redraws, relocations, 1.0 if jumps is not None and jumps >= TAKEN else JUMPS
    )


def tempered_shares(free: float, often: float) -> tuple[float, int]:
    """How often something is lifted off the table for each of its turns, and how many places are tried then: those that
    bring it elsewhere at the least cost, where a share of all places is `free`."""
    tries = 2 ** np.arange(int(np.log2(MAX_LIFT_TRIES)) + 1)
    taken = 1.0 - (1.0 - free) ** tries
    best = int(np.argmax(taken / (LIFT_OVERHEAD + tries)))
    often *= 1.0 if taken[best] >= TAKEN else SELDOM if taken[best] >= SELDOM * TAKEN else 0.0
    return often, int(tries[best])
