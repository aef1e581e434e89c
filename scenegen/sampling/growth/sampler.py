"""Growth as a sampler: a plan, pieces that follow it, and what is said of a run."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from scenegen.errors import Diagnostic, RequestError, Span, quoted
from scenegen.errors.requests import NO_ROOM, NO_TIME_TO_GROW, SCENES_ALIKE, TABLE_TOO_FULL
from scenegen.geometry import NUMPY, PRIMITIVES
from scenegen.geometry.footprint import POINT
from scenegen.lang.formula.core import REQUIRE, Atom, Core, Junction
from scenegen.lang.spec import options_of
from scenegen.pose import BELOW_TURN, FLAT, THETA, along, row_of
from scenegen.processes.ahead import BackgroundTask
from scenegen.sampling.growth.grow import AncestorEffect, Grown, PlacementFailed, Step, explore, grow
from scenegen.sampling.growth.machine import Machine, make_machine
from scenegen.sampling.growth.moves import MoveSettings, sweep
from scenegen.sampling.growth.particles import MoveTally
from scenegen.sampling.growth.population import (
    GROWTH,
    ISLANDS,
    LEAST,
    OF_A_CELL,
    SPARE,
    WORTH,
    FirstPopulationJob,
    GrowthFailed,
    Population,
    PopulationSample,
    SecondPopulationJob,
    Size,
    StartedGrowth,
    generator,
    placed_of,
    size_of,
    spread_over,
    start_growth,
    take,
    wanted_scenes,
    with_deadline,
)
from scenegen.sampling.growth.room import area
from scenegen.sampling.growth.touch import make_values, within
from scenegen.sampling.plan import Account, Piece, Plan, Tally, digest
from scenegen.sampling.problem import Budget, Problem
from scenegen.sampling.report import too_early
from scenegen.sampling.splitting.sampler import probability
from scenegen.search.effort import GROWN, STEPPED, Effort, StoppedError, TooMuchError

# --------------------------------------------------------------------------------------------------------------------
# The plan of a growth run: the order of the objects, how many poses are tried for each, which moves are made and how
# many.
#
# A population is grown while planning; what it needed is written down and frozen, and pieces follow that. All of it
# is counted in evaluations, never timed, so spec, request and seed fix the plan, and its pieces can run anywhere.
# Nothing can be drawn by the plan before there is one. So that a second process has work by then, too, large requests
# have two such populations that know nothing of each other: the second one is the second piece.


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


def make_recipe(
    problem: Problem,
    budget: Budget,
    *,
    patient: bool,
    started: StartedGrowth | None = None,
    longest: float = math.inf,
) -> tuple[Machine, Recipe, StartedGrowth | None] | GrowthFailed:
    """The plan for a problem; GrowthFailed where there is no room for its objects, or time is up. Unless `patient`,
    small populations must do: the design effect is infinite where few ancestors are left of the first one. `started`
    is what other processes have begun; what is returned of it has the second population, too, if there are any."""
    size = size_of(problem, AGAIN if patient else 0)
    with ExitStack() as stack:
        if started is None or started.given_up or started.size != size:
            started = start_growth(problem, budget, size)
            if started is not None:
                stack.enter_context(started)
        if started is not None:
            started.begin_second()
        found = FirstPopulationJob(problem, budget, longest)(size) if started is None else started.first()
        if isinstance(found, GrowthFailed):
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


# --------------------------------------------------------------------------------------------------------------------
# What is said where no scene has room for all objects: how far it got, and what refused the rest.


Array = npt.NDArray[np.float64]

TRIED = 64  # poses in each of so many scenes, by which it is judged which clauses refuse an object
SHOWN = 3
TIGHT = 0.5  # of an area: more than objects that are put down at random take
MORE = 3  # further objects of which it is seen whether they are refused, too
SCENES, EFFORT = 256, 1e5  # scenes for that, and evaluations that each may take at least


def others(problem: Problem, machine: Machine, end: PlacementFailed) -> tuple[int, tuple[int, ...]]:
    """How many objects can be placed at once, and which are refused then: those that have been are left to the last, as
    far as a little work goes."""
    refused = [machine.order[end.stage]]
    most = end.stage
    for attempt in range(MORE):
        number = np.arange(SCENES)
        cell = end.particles.cell[number % end.particles.count]
        try:
            again = make_machine(problem, refused, deadline=machine.deadline)
        except StoppedError:
            break
        again.most = max(EFFORT, machine.work)
        try:
            found, _ = explore(again, cell, number % 2, np.random.default_rng(attempt), MoveTally())
        except (StoppedError, TooMuchError):
            most = max(most, again.furthest)
            break
        if isinstance(found, Grown):  # in another order there was room for all: few scenes were lucky
            break
        most = max(most, found.stage)
        thing = again.order[found.stage]
        if thing in refused:
            break
        refused.append(thing)
    return most, tuple(refused)


def why_stuck(machine: Machine, end: PlacementFailed, placed: tuple[int, tuple[int, ...]], tried: str) -> Diagnostic:
    """The objects that could be `placed`, see `others`; the clauses that refuse the first one that could not be; and
    how full the table is."""
    problem, order = machine.problem, machine.order
    names = problem.core.objects
    most, refused_things = placed
    thing = order[end.stage]
    facts: dict[str, Any] = {
        "names": tuple(names[one] for one in refused_things),
        "placed": str(most),
        "count": len(order),
        **_filled(machine, thing),
    }
    refused = _refused(machine, end)
    if end.placed.attracted > 0:
        by_footprints, by_distances = _in_the_way(machine, end)
        if not by_distances or by_distances[0][2] < by_footprints:
            crowd = {"crowded": end.placed.attracted, "tries": end.placed.tries, "first": names[thing]}
            return NO_ROOM(tried=tried, **crowd, **facts)
        refused = by_distances
    span: Span | None = None
    if refused:
        text, span, share = refused[0]
        also = "; ".join(f"`{text}` {share:.0%}" for text, _, share in refused[1:SHOWN])
        facts |= {"clause": text, "share": share, "others": also}
    return NO_ROOM(span, tried=tried, **facts)


def how_far(machine: Machine, tried: str) -> Diagnostic:
    """What to say where time is up while scenes grow."""
    count = len(machine.order)
    placed = None if machine.furthest == count else str(machine.furthest)
    fullest = max((_filled(machine, thing) for thing in machine.order), key=lambda facts: facts["filled"])
    return NO_TIME_TO_GROW(tried=tried, placed=placed, count=count, tight=fullest["filled"] >= TIGHT or None, **fullest)


def _filled(machine: Machine, thing: int) -> dict[str, Any]:
    """How full the surfaces are on which an object can stand: the share of their area that the footprints take of those
    that stand nowhere else; of the workspace where it stands on nothing."""
    spec = machine.problem.spec
    options = {one: options_of(one, spec.supports, spec.choices) for one in machine.order if one < len(spec.shapes)}
    mine = options.get(thing, ())
    things = [one for one, own in options.items() if set(own) <= set(mine) and bool(own) == bool(mine)]
    space = sum(area(one.outline) for one in mine) if mine else _table(machine)
    where = quoted([one.name for one in mine]) if mine else "the workspace"
    filled = sum(area(spec.shapes[one].footprint) for one in things) / space
    return {"standing": len(things), "filled": filled, "where": where}


def _in_the_way(machine: Machine, end: PlacementFailed) -> tuple[float, list[tuple[str, Span | None, float]]]:
    """The share of the poses in the object's room that footprints refuse; and of those that distances do which the
    spec asks for by name, with the text of each clause."""
    thing, particles = machine.order[end.stage], end.particles
    some = np.arange(min(TRIED, particles.count))
    scenes, cell = particles.scenes[:, some], particles.cell[some]
    poses = machine.room(thing, end.stage).boxes(scenes, cell, Effort()).draw(TRIED, np.random.default_rng(0))
    rows: list[Array] = list(scenes)
    for row, values in zip(machine.touch[thing].rows, poses, strict=True):
        rows[row] = values
    placed = set(machine.order[: end.stage + 1])
    pairs = [pair for pair in machine.graph.pairs if thing in pair.objects and pair.objects <= placed]
    by_footprints, found = np.zeros((TRIED, len(some)), dtype=bool), []
    for pair in pairs:
        ends = [
            [rows[row_of(end, axis)] for axis in FLAT] if isinstance(end, int) else end
            for end in (pair.first, pair.second)
        ]
        gap = PRIMITIVES["gap"].evaluate(NUMPY, *pair.shapes, *ends[0], *ends[1])
        refused = gap < (pair.low[cell] if len(pair.low) > 1 else pair.low[0])
        if pair.shapes == (POINT, POINT):
            found.append((*_said(machine.problem.core, pair.node), float(np.mean(refused))))
        else:
            by_footprints |= refused
    return float(np.mean(by_footprints)), sorted(found, key=lambda one: -one[2])


def _refused(machine: Machine, end: PlacementFailed) -> list[tuple[str, Span | None, float]]:
    """The clauses other than pairs that touch the object, with the share of poses of its box that each refuses."""
    thing = machine.order[end.stage]
    touch = machine.touch[thing]
    clauses = touch.in_force(end.stage)
    if not clauses:
        return []
    particles, rng = end.particles, np.random.default_rng(0)
    some = np.arange(min(TRIED, particles.count))
    cell = particles.cell[some]
    rows: list[Array] = list(particles.scenes[:, some])
    for row in touch.rows:
        low, high = machine.graph.low[row][cell], machine.graph.high[row][cell]
        rows[row] = low + rng.random((TRIED, len(some))) * (high - low)
    values = make_values(machine.problem.core, [clause.node for clause in clauses])(rows)
    found = []
    for clause, value in zip(clauses, values, strict=True):
        inside = within(value, clause, cell)
        if inside is not None:
            text, span = _said(machine.problem.core, clause.node)
            found.append((text, span, 1.0 - float(np.mean(inside))))
    return sorted(found, key=lambda one: -one[2])


def _said(core: Core, node: int) -> tuple[str, Span | None]:
    at = core.nodes[node]
    if isinstance(at, Atom):
        return at.text, at.spans[0] if at.spans else None
    assert isinstance(at, Junction)
    text, span = _said(core, at.args[0])
    return at.text or f"{text} {'and' if at.kind == 'min' else 'or'} ...", span


def _table(machine: Machine) -> float:
    space = machine.problem.spec.workspace
    return (space.x[1] - space.x[0]) * (space.y[1] - space.y[0])


FACTS = 11  # of a piece
BARREN = 8  # pieces in a row that bring nothing new before a run ends
LOW = 0.3  # effective share below which the user is warned


@dataclass(frozen=True, slots=True, eq=False)
class Growth(Plan):
    """A plan for one request. The facts of a piece are: its islands, the sum of their estimates of the probability and
    of the squares of these, how many are not 0, the sums of their logarithms and of the squares of those, 1 if any
    lived, the share of walks taken, the share of scenes left out as copies, the design effect of common ancestors, and
    its evaluations."""

    machine: Machine
    recipe: Recipe
    budget: Budget
    started: StartedGrowth | None = field(
        default=None, kw_only=True
    )  # whose second population is piece 1; ends with `close`

    method: ClassVar[str] = "growth"
    patience: ClassVar[int] = BARREN

    def __reduce__(self) -> tuple[Any, ...]:
        one = self.joined()
        return _restored, (one.problem, one.machine, one.recipe, one.budget, one.why)

    @property
    def plan_digest(self) -> str:
        recipe = self.recipe
        odds = {thing: recipe.settings.odds(thing) for thing in self.machine.order}
        return digest(
            "growth",
            self.machine.order,
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
    def reached(self) -> tuple[int, ...]:
        return self.recipe.cells

    @property
    def fact_count(self) -> int:
        return FACTS

    @property
    def scenes_per_piece(self) -> float:
        return self.recipe.brings

    @property
    def shared_by(self) -> int:
        return self.recipe.pieces(self.wanted)

    @property
    def evaluations(self) -> float:
        recipe, pieces = self.recipe, self.recipe.pieces(self.wanted)
        grown = min(pieces, recipe.populations)
        return recipe.evaluations * grown + recipe.piece * (pieces - grown)

    @property
    def seconds(self) -> float:
        recipe, pieces = self.recipe, self.recipe.pieces(self.wanted)
        grown = min(pieces, recipe.populations)
        population, piece = recipe.seconds
        return population * (grown - 1) + piece * (pieces - grown)  # the first population is there

    def draw(self, k: int) -> Piece:
        """Piece k. Raises StoppedError where time is up meanwhile: with the number of objects placed by then."""
        with np.errstate(all="ignore"):  # phi may overflow or be undefined far from the range
            return self._draw(k)

    def _draw(self, k: int) -> Piece:
        recipe = self.recipe
        rng = generator(self.seed, k)
        if k < recipe.populations:
            return self._of_population(k, rng)
        machine = with_deadline(self.machine, self.budget.ends)
        try:
            return self._grow(machine, k, rng)
        except StoppedError as error:
            raise StoppedError(placed_of(machine, recipe.count)) from error

    def _of_population(self, k: int, rng: np.random.Generator) -> Piece:
        """One of the first pieces. The second one may have been made while the plan was."""
        recipe = self.recipe
        taken = recipe.taken[k] if k < len(recipe.taken) else None
        if taken is None and self.started is not None:
            taken = self.started.second()
        if taken is None:
            try:
                taken = SecondPopulationJob(self.problem, self.budget)(recipe.size)
            except StoppedError as error:
                none = placed_of(with_deadline(self.machine, self.budget.ends), recipe.size.count)
                raise StoppedError(error.how_far or none) from error
        if not taken.count:
            return self._nothing(taken.work)
        return self._made(taken if k else replace(taken, work=0.0), rng)  # that of the first one is the plan's

    def _nothing(self, work: float) -> Piece:
        """What a piece brings whose scenes have died out."""
        rows, phi = np.empty((len(self.problem.lowest), 0)), np.empty((len(self.problem.core.labels), 0))
        facts = np.array([float(ISLANDS), *np.zeros(FACTS - 2), work])
        return Piece(rows, phi, np.empty(0, dtype=np.intp), facts)

    def _grow(self, machine: Machine, k: int, rng: np.random.Generator) -> Piece:
        recipe = self.recipe
        grown = grow(machine, *spread_over(machine, recipe.cells, recipe.count), recipe.steps, recipe.settings, rng)
        if isinstance(grown, PlacementFailed):
            return self._nothing(machine.work)
        particles = grown.particles
        accepted = float(np.mean([sweep(particles, recipe.settings) for _ in range(recipe.settle)]))
        return self._made(
            take(grown, recipe.thin, AncestorEffect(machine)(particles), accepted, _aside(self.seed, k)), rng
        )

    def _made(self, taken: PopulationSample, rng: np.random.Generator) -> Piece:
        """A piece of these scenes, in which rows that no clause reads are drawn afresh."""
        lowest, highest = self.problem.lowest, self.problem.highest
        rows = taken.scenes.copy()
        for row in range(len(lowest)):
            if row not in self.machine.graph.rows and lowest[row] < highest[row]:
                rows[row] = lowest[row] + rng.random(rows.shape[1]) * (highest[row] - lowest[row])
        np.minimum(rows[along(THETA)], BELOW_TURN, out=rows[along(THETA)])
        phi = self.problem.phi(rows)
        share = np.exp(taken.log_share + log_base(self.machine)).sum(axis=1)
        log = np.log(share[share > 0.0])
        shares = float(ISLANDS), float(share.sum()), float((share * share).sum()), float(len(log))
        logs = float(log.sum()), float((log * log).sum()), 1.0
        facts = taken.accepted, taken.copies, taken.effect, taken.work
        return Piece(rows, phi, self.cells.find(phi), np.array([*shares, *logs, *facts]))

    def underway(self) -> Mapping[int, BackgroundTask[Any, Any]]:
        going = None if self.started is None else self.started.going()
        return {} if going is None else {1: going}

    def alone(self) -> Growth:
        return replace(self, started=None)

    def joined(self) -> Growth:
        if self.started is None:
            return self
        second = self.started.second()
        self.started.give_up()
        taken = self.recipe.taken if second is None else (*self.recipe.taken, second)
        return replace(self, recipe=replace(self.recipe, taken=taken), started=None)

    def close(self) -> None:
        if self.started is not None:
            self.started.give_up()

    def account(self, tally: Tally) -> Account:
        """What the scene file says about the run, and what the user is warned of."""
        recipe = self.recipe
        islands, total, square, lived, log, log_square, alive, accepted, copies, effect, made = (
            tally.facts or (0.0,) * FACTS
        )
        each = max(alive, 1.0)
        evaluations = int(recipe.evaluations + made)
        share = min(1.0, each / effect) if effect else 0.0
        info: dict[str, object] = {
            "method": "growth",
            "seed": self.seed,
            "candidates": evaluations,
            "objects": len(self.machine.order),
            "pieces": tally.pieces,
            "population": recipe.count,
            "sweeps": recipe.settle,
            "thinning": round(float(recipe.thin), 2),
            "acceptance": round(accepted / each, 4),
            "copies": round(copies / each, 4),
            "effective_share": round(share, 4),
        }
        logs = (log, log_square) if lived == islands else None
        info |= probability(int(islands), total, square, logs)
        if REQUIRE in self.problem.core.labels:
            info["probability_of"] = "range and requirement"
        warnings: tuple[Diagnostic, ...] = ()
        if 0.0 < share < LOW:
            warnings = (SCENES_ALIKE(share=share),)
        return Account(info, f"{evaluations:,} evaluations of growth", warnings)


def plan_growth(
    problem: Problem,
    budget: Budget,
    *,
    patient: bool = True,
    started: StartedGrowth | None = None,
    longest: float = math.inf,
) -> Growth | GrowthFailed:
    """The plan of a problem; GrowthFailed where there is no room for some object, or time is up. Unless `patient`,
    little is spent on it, and its design effect may be infinite: such a plan is not to be used. Other processes may
    begin to draw meanwhile, and `close` ends them; `started` is what they have: see `start_growth`. The plan is the
    same without. It takes at most `longest` seconds, as a machine counts them, unless other processes have begun."""
    with np.errstate(all="ignore"):
        made = make_recipe(problem, budget, patient=patient, started=started, longest=longest)
    if isinstance(made, GrowthFailed):
        return made
    machine, recipe, started = made
    plan = Growth(problem, machine, recipe, budget, started=started)
    if not recipe.taken:  # the first population was left, and with it the second
        plan.close()
        return plan.alone()
    return plan if budget.reserve is not None else plan.joined()  # who has no processes for the run may not close it


def _restored(problem: Problem, machine: Machine, recipe: Recipe, budget: Budget, why: str | None) -> Growth:
    return Growth(problem, machine, recipe, budget, why=why)


def make_plan(problem: Problem, budget: Budget) -> Growth:
    """The plan of a problem. Raises RequestError where growth comes to nothing."""
    plan = plan_growth(problem, budget)
    if isinstance(plan, GrowthFailed):
        raise no_growth(problem, plan)
    return plan


def no_growth(problem: Problem, end: GrowthFailed) -> RequestError:
    """What to say where growth came to nothing."""
    tried = f"{int(end.evaluations):,} evaluations of growth"
    if end.proof:
        return RequestError(TABLE_TOO_FULL(**end.proof))
    if end.machine is None:
        return RequestError(too_early(problem, tried, problem.cells.count))
    if end.stuck is None:
        return RequestError(how_far(end.machine, tried))
    with np.errstate(all="ignore"):
        return RequestError(why_stuck(end.machine, end.stuck, others(problem, end.machine, end.stuck), tried))


def log_base(machine: Machine) -> Array:
    """The natural logarithm of the probability of what contraction leaves to each cell, (C,), under the base
    distribution."""
    graph, problem = machine.graph, machine.problem
    rows = sorted(graph.rows)
    width = (problem.highest - problem.lowest)[rows][:, None]
    with np.errstate(divide="ignore"):
        out: Array = np.log((graph.high[rows] - graph.low[rows]) / width).sum(axis=0) + problem.log_excess
    return out


def _aside(seed: int, piece: int) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence([seed, GROWTH, piece + 1, 1]))
