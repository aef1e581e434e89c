"""Growth as a sampler: a plan, pieces that follow it, and what is said of a run; and a few scenes soon, to look at."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from scenegen.arrays import Array
from scenegen.errors import Diagnostic
from scenegen.errors.requests import SCENES_ALIKE
from scenegen.lang.formula.core import REQUIRE
from scenegen.sampling.growth.failure import GrowthFailed
from scenegen.sampling.growth.model import GrowthModel, MoveTally, make_growth_model
from scenegen.sampling.growth.moves import MoveSettings, sweep
from scenegen.sampling.growth.packing import packing_proof
from scenegen.sampling.growth.population import (
    HITS,
    MIN_ANCESTORS,
    MIN_EVEN_SHARE,
    PIECE_ISLANDS,
    SPARE_PARTICLES,
    AncestorEffect,
    PlacementFailed,
    Population,
    PopulationSample,
    Size,
    Step,
    explore,
    grow,
    make_population,
    spread_scenes,
    take_sample,
    wanted_scenes,
)
from scenegen.sampling.plan import Account, Piece, Plan, Tally, digest
from scenegen.sampling.problem import Problem
from scenegen.sampling.report import probability_info
from scenegen.sampling.streams import GROWTH_STREAM
from scenegen.search.effort import (
    DRAW_SECONDS,
    GROWTH_SCORE_SECONDS,
    GROWTH_STEP_SECONDS,
    Budget,
    StoppedError,
    TooMuchError,
)

MIN_POPULATION, MAX_POPULATION = 512, 4096  # scenes of a population
CELL_SCENES, MIN_CELL_SCENES = 12, 5  # scenes of each cell in an island, at least; and where few are wanted
ENOUGH_PER_SCENE = 3.0  # so many for each that is wanted of the cell are enough
MAX_COORDINATES = 1 << 22  # coordinates of a population at most
LARGE_COORDINATES = 8e4  # moving ones from which on a population costs about twice as much as half of it


def generator(seed: int, piece: int) -> np.random.Generator:
    """Random numbers of piece k."""
    return np.random.Generator(np.random.SFC64(np.random.SeedSequence([seed, GROWTH_STREAM, piece + 1])))


def _population(
    model: GrowthModel, size: Size, which: int, *, larger: bool = False
) -> tuple[GrowthModel, Population | PlacementFailed]:
    """A population of the plan, and its model: one that holds scenes in their cells where too many of a loose one's
    have left them."""
    problem = model.problem
    made = make_population(model, size, _plan_generator(problem.request.seed, which), larger=larger)
    if isinstance(made, PlacementFailed) or model.begin is None or made.share >= MIN_EVEN_SHARE:
        return model, made
    strict = replace(
        make_growth_model(problem), work=model.work, steps_done=model.steps_done, drawn=model.drawn,
        dear=model.dear, deadline=model.deadline, longest=model.longest,
    )  # fmt: skip
    return strict, make_population(strict, size, _plan_generator(problem.request.seed, which), larger=larger)


def _plan_generator(seed: int, which: int) -> np.random.Generator:
    """Random numbers of the populations of a plan."""
    words = [seed, GROWTH_STREAM, 0, *([which] if which else [])]
    return np.random.Generator(np.random.SFC64(np.random.SeedSequence(words)))


def progress_of(model: GrowthModel, count: int) -> str:
    """How far a piece of so many scenes got that time cut short: so many objects were placed."""
    placed, objects = model.furthest, len(model.order)
    if placed < objects:
        return f"the next {count:,} scenes had {placed} of {objects} objects when time was up"
    return f"the next {count:,} scenes had all {objects} objects when time was up, but were not ready"


def size_of(problem: Problem, again: int = 0) -> Size:
    """How large the populations of a plan are, and how many."""
    n, rows, cells = problem.request.n, len(problem.lowest), len(problem.possible)
    most = max(64, min(MAX_POPULATION, MAX_COORDINATES // rows))
    of_a_cell = min(CELL_SCENES, max(MIN_CELL_SCENES, math.ceil(ENOUGH_PER_SCENE * n / cells)))
    least = max(MIN_POPULATION, PIECE_ISLANDS * of_a_cell * cells)
    wanted = int(SPARE_PARTICLES * n)
    each = min(MAX_POPULATION // 2, wanted)  # half as many would cost nearly as much
    half = wanted // 2
    moving = int((problem.lowest < problem.highest).sum())
    two = half >= MAX_POPULATION // 2 or (half >= least and half * moving >= LARGE_COORDINATES)
    count = min(most, max(least, min(each, half) if two else each))
    return Size(count, most, again, 0.0 if again else MIN_ANCESTORS / 2.0, n, 2 if two else 1)


def with_deadline(model: GrowthModel, deadline: float) -> GrowthModel:
    """The same with another deadline, and with its counts of work and of placed objects begun again."""
    return replace(model, work=0.0, steps_done=0, drawn=0.0, deadline=deadline, furthest=0)


SPARE_OF_ONE = 1.07  # scenes grown for each one wanted by further pieces of a single cell: see MAX_LOST_SHARE
EVEN_PIECES = 0.75  # of that, for an even number of pieces
MAX_ENLARGEMENTS = 2  # times that a population is made larger


@dataclass(frozen=True, slots=True, eq=False)
class Recipe:
    """What pieces follow: `count` scenes for `cells`, `steps` for each object, then `settle` sweeps, and one scene in
    `thin` is taken; of these `share` fill the cells evenly. `effect` is the design effect of common ancestors that is
    left among these, `evaluations` the cost of the plan, `piece` of a piece; `seconds` are those of CPU that a
    population and a piece take, see search.effort. The first pieces are `populations` of their own, of the given
    `size`; those that are known are in `taken`."""

    steps: tuple[Step, ...]
    settings: MoveSettings
    cells: tuple[int, ...]
    count: int
    settle: int
    thin: float
    effect: float
    evaluations: float
    piece: float
    size: Size
    taken: tuple[PopulationSample, ...] = ()
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


def _recipe(problem: Problem, model: GrowthModel, size: Size, made: Population) -> Recipe:
    """What a population found out, for the pieces that follow."""
    cells, count = made.cells, made.count
    if made.settled is None or made.taken is None:
        return Recipe(made.steps, made.settings, cells, count, 0, 1.0, np.inf, model.work, np.inf, size)
    settled = made.settled
    there = size.populations * made.taken.even
    spare = SPARE_PARTICLES if len(cells) > 1 else SPARE_OF_ONE
    left = max(0.0, wanted_scenes(cells, problem.request.n, spare) - there)
    wanted = max(PIECE_ISLANDS * CELL_SCENES * len(cells), int(np.ceil(settled.thin * left / made.share)))
    pieces = -(-wanted // size.most)  # of one size: a last one for a few scenes would cost as much
    moving = len(model.graph.rows)
    if pieces % 2 and size.populations > 1 and wanted / (pieces + 1) * moving >= EVEN_PIECES * LARGE_COORDINATES:
        pieces += 1  # as many for each of two processes
    each = max(count if count > size.count else MIN_POPULATION // 2, -(-wanted // pieces))
    whole = made.cost + settled.cost * settled.sweeps  # smaller pieces take fewer evaluations, but as many steps
    piece = whole * each / count
    share = whole / model.work if model.work else 1.0  # no work: no clause is left to evaluate
    around = GROWTH_STEP_SECONDS * model.steps_done * share
    around += (DRAW_SECONDS * model.drawn + model.dear) * share * each / count
    return Recipe(
        made.steps, made.settings, cells, each, settled.sweeps, settled.thin, settled.taken_effect, model.work, piece,
        size, (made.taken,), made.share, (model.seconds, GROWTH_SCORE_SECONDS * model.each * piece + around),
    )  # fmt: skip


GROWTH_FACTS = 11  # of a piece
LOW_SHARE = 0.3  # effective share below which the user is warned


@dataclass(frozen=True, slots=True, eq=False)
class Growth(Plan):
    """A plan for one request. The facts of a piece are: its islands, the sum of their estimates of the probability and
    of the squares of these, how many are not 0, the sums of their logarithms and of the squares of those, 1 if any
    lived, the share of walks taken, the share of scenes left out as copies, the design effect of common ancestors, and
    its evaluations."""

    model: GrowthModel
    recipe: Recipe
    budget: Budget

    method: ClassVar[str] = "growth"
    patience: ClassVar[int] = 8  # pieces in a row that bring nothing new

    @property
    def plan_digest(self) -> str:
        recipe = self.recipe
        odds = {thing: recipe.settings.odds(thing) for thing in self.model.order}
        return digest(
            "growth",
            self.model.order,
            recipe.steps,
            odds,
            recipe.settings.kinds,
            sorted(recipe.settings.redraws.items()),
            sorted(recipe.settings.relocations.items()),
            recipe.settings.jumps,
            recipe.cells,
            (recipe.count, recipe.settle, recipe.thin),
            recipe.size,
        )

    @property
    def reached_cells(self) -> tuple[int, ...]:
        return self.recipe.cells

    @property
    def fact_count(self) -> int:
        return GROWTH_FACTS

    @property
    def scenes_per_piece(self) -> float:
        return self.recipe.brings

    @property
    def shared_by(self) -> int:
        return self.recipe.pieces(self.scenes_wanted)

    @property
    def evaluations(self) -> float:
        recipe, pieces = self.recipe, self.recipe.pieces(self.scenes_wanted)
        grown = min(pieces, recipe.populations)
        return recipe.evaluations * grown + recipe.piece * (pieces - grown)

    @property
    def seconds(self) -> float:
        recipe, pieces = self.recipe, self.recipe.pieces(self.scenes_wanted)
        grown = min(pieces, recipe.populations)
        population, piece = recipe.seconds
        return population * (grown - 1) + piece * (pieces - grown)  # the first population is there

    @np.errstate(all="ignore")  # phi may overflow or be undefined far from the range
    def draw(self, k: int) -> Piece:
        """Piece k. Raises StoppedError where time is up meanwhile: with the number of objects placed by then."""
        recipe, rng = self.recipe, generator(self.seed, k)
        if k < recipe.populations:
            return self._population_piece(k, rng)
        model = with_deadline(self.model, self.budget.ends)
        try:
            return self._grow(model, k, rng)
        except StoppedError as error:
            raise StoppedError(progress_of(model, recipe.count)) from error

    def _population_piece(self, k: int, rng: np.random.Generator) -> Piece:
        """One of the first pieces. The first one was grown while the plan was made, the second one is grown here.
        Raises StoppedError with the number of objects placed by then."""
        recipe = self.recipe
        if k < len(recipe.taken):
            taken: PopulationSample | None = recipe.taken[k]
            work = recipe.evaluations
        else:
            model = with_deadline(self.model, self.budget.ends)
            try:
                model = make_growth_model(self.problem, deadline=self.budget.ends, loose=True)
                used, made = _population(model, replace(recipe.size, fewest=0.0), 1)
            except StoppedError as error:
                raise StoppedError(progress_of(model, recipe.size.count)) from error
            taken, work = None if isinstance(made, PlacementFailed) else made.taken, used.work
        if taken is None or not taken.count:
            return self._empty_piece(work)
        return self._make_piece(taken if k else replace(taken, work=0.0), rng)  # that of the first one is the plan's

    def _empty_piece(self, work: float) -> Piece:
        """What a piece brings whose scenes have died out."""
        rows, phi = np.empty((len(self.problem.lowest), 0)), np.empty((len(self.problem.core.labels), 0))
        facts = np.array([float(PIECE_ISLANDS), *np.zeros(GROWTH_FACTS - 2), work])
        return Piece(rows, phi, np.empty(0, dtype=np.intp), facts)

    def _grow(self, model: GrowthModel, k: int, rng: np.random.Generator) -> Piece:
        recipe = self.recipe
        grown = grow(model, *spread_scenes(model, recipe.cells, recipe.count), recipe.steps, recipe.settings, rng)
        if isinstance(grown, PlacementFailed):
            return self._empty_piece(model.work)
        particles = grown.particles
        accepted = float(np.mean([sweep(particles, recipe.settings) for _ in range(recipe.settle)]))
        return self._make_piece(
            take_sample(grown, recipe.thin, AncestorEffect(model)(particles), accepted, _side_generator(self.seed, k)),
            rng,
        )

    def _make_piece(self, taken: PopulationSample, rng: np.random.Generator) -> Piece:
        """A piece of these scenes, in which rows that no clause reads are drawn afresh."""
        rows = self.model.complete(taken.scenes.copy(), rng)
        phi = self.problem.phi(rows)
        share = np.exp(taken.log_share + log_base(self.model)).sum(axis=1)
        log = np.log(share[share > 0.0])
        shares = float(PIECE_ISLANDS), float(share.sum()), float((share * share).sum()), float(len(log))
        logs = float(log.sum()), float((log * log).sum()), 1.0
        facts = taken.accepted, taken.copies, taken.effect, taken.work
        return Piece(rows, phi, self.cells.find(phi), np.array([*shares, *logs, *facts]))

    def account(self, tally: Tally) -> Account:
        """What the scene file says about the run, and what the user is warned of."""
        recipe = self.recipe
        islands, total, square, lived, log, log_square, alive, accepted, copies, effect, made = (
            tally.facts or (0.0,) * GROWTH_FACTS
        )
        each = max(alive, 1.0)
        evaluations = int(recipe.evaluations + made)
        share = min(1.0, each / effect) if effect else 0.0
        info: dict[str, object] = {
            "method": "growth",
            "seed": self.seed,
            "candidates": evaluations,
            "objects": len(self.model.order),
            "pieces": tally.pieces,
            "population": recipe.count,
            "sweeps": recipe.settle,
            "thinning": round(float(recipe.thin), 2),
            "acceptance": round(accepted / each, 4),
            "copies": round(copies / each, 4),
            "effective_share": round(share, 4),
        }
        logs = (log, log_square) if lived == islands else None
        info |= probability_info(int(islands), total, square, logs)
        if REQUIRE in self.problem.core.labels:
            info["probability_of"] = "range and requirement"
        warnings: tuple[Diagnostic, ...] = ()
        if 0.0 < share < LOW_SHARE:
            warnings = (SCENES_ALIKE(share=share),)
        return Account(info, f"{evaluations:,} evaluations of growth", warnings)


@np.errstate(all="ignore")
def plan_growth(
    problem: Problem, budget: Budget, *, patient: bool = True, longest: float = math.inf, larger: bool = False
) -> Growth | GrowthFailed:
    """The plan of a problem; GrowthFailed where there is no room for some object, or time is up. Unless `patient`,
    small populations must do: the design effect is infinite where few ancestors are left of the first one, and such a
    plan is not to be used. It takes at most `longest` seconds, as a model counts them. `larger`: it is known that a
    small population leaves too few ancestors, so a larger one is grown at once.

    A population is grown while planning; what it needed is written down and frozen, and pieces follow that. All of it
    is counted in evaluations, never timed, so spec, request and seed fix the plan, and its pieces can run anywhere.
    Large requests have two such populations that know nothing of each other: the second one is the second piece.
    """
    size = size_of(problem, MAX_ENLARGEMENTS if patient else 0)
    model = None
    try:
        model = make_growth_model(problem, deadline=budget.ends, loose=True)
        proof = packing_proof(model.graph, problem.spec)
        if proof:
            return GrowthFailed(model, None, 0.0, proof)
        model.longest = longest
        model, made = _population(model, size, 0, larger=larger)
    except (StoppedError, TooMuchError) as error:
        return GrowthFailed(model, None, 0.0 if model is None else model.work, dear=isinstance(error, TooMuchError))
    model.longest = math.inf
    if isinstance(made, PlacementFailed):
        return GrowthFailed(model, made, model.work)
    return Growth(problem, model, _recipe(problem, model, size, made), budget)


def make_plan(problem: Problem, budget: Budget) -> Growth:
    """The plan of a problem. Raises RequestError where growth comes to nothing."""
    plan = plan_growth(problem, budget)
    if isinstance(plan, GrowthFailed):
        raise plan.error(problem)
    return plan


def log_base(model: GrowthModel) -> Array:
    """The natural logarithm of the probability of what contraction leaves to each cell, (C,), under the base
    distribution."""
    graph, problem = model.graph, model.problem
    rows = sorted(graph.rows)
    width = (problem.highest - problem.lowest)[rows][:, None]
    with np.errstate(divide="ignore"):
        out: Array = np.log((graph.high[rows] - graph.low[rows]) / width).sum(axis=0) + problem.log_excess
    return out


def _side_generator(seed: int, piece: int) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence([seed, GROWTH_STREAM, piece + 1, 1]))


GLIMPSE_SIZES = (12, 96)  # scenes of a population: the larger one where none of the smaller ones lives
GLIMPSE_HITS = 4.0  # poses that meet all clauses that a scene of the smaller one should have among its tries
GLIMPSE_ROUNDS = 1  # of contraction
GLIMPSE_STREAM = (GROWTH_STREAM, 0, 1)  # the stream of its random numbers: no plan reads it


@np.errstate(all="ignore")  # phi may overflow or be undefined far from the range
def glimpse(problem: Problem, budget: Budget, count: int, sizes: Sequence[int] = GLIMPSE_SIZES) -> Array:
    """At most `count` scenes in the range of the request, (3N, m), of its first cells, its last, and some between:
    something to look at while a plan is made; none where nothing is found soon.

    One small population is grown for each of them, in a box that is contracted once, without the moves that make its
    scenes differ and without any account of how they are distributed. They are in range, and no more than that. Where
    none of the populations lives, larger ones are tried, with all that growth has.
    """
    try:
        model = make_growth_model(problem, rounds=GLIMPSE_ROUNDS, deadline=budget.ends)
        possible = sorted(problem.possible)
        cells = np.array([possible[round(k * (len(possible) - 1) / max(1, count - 1))] for k in range(count)])
        rng = np.random.default_rng(np.random.SeedSequence([problem.request.seed, *GLIMPSE_STREAM]))
        rows = np.empty((len(problem.lowest), 0))
        for size in sizes:
            island = np.repeat(np.arange(count), size)
            quick = size < sizes[-1]
            hits = GLIMPSE_HITS if quick else HITS
            grown, _ = explore(model, cells[island], island, rng, MoveTally(), hits=hits, moves=not quick)
            if not isinstance(grown, PlacementFailed):
                _, first = np.unique(grown.particles.island, return_index=True)
                rows = grown.particles.scenes[:, first].copy()
                break
        phi = problem.phi(model.complete(rows, rng))
        return rows[:, ((phi >= problem.cells.low[:, None]) & (phi <= problem.cells.high[:, None])).all(axis=0)]
    except (StoppedError, TooMuchError):
        return np.empty((len(problem.lowest), 0))
