"""Growth as a sampler: a plan, pieces that follow it, and what is said of a run."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from scenegen.bounds.effort import StoppedError
from scenegen.errors import Diagnostic, RequestError
from scenegen.errors.requests import SCENES_ALIKE, TABLE_TOO_FULL
from scenegen.lang.core import REQUIRE
from scenegen.pose import BELOW_TURN, THETA, along
from scenegen.processes.beside import Beside
from scenegen.sampling.digest import digest
from scenegen.sampling.growth.begin import GROWTH, Second, Stalled, Started, generator, placed_of, with_deadline
from scenegen.sampling.growth.grow import Stuck, grow
from scenegen.sampling.growth.kinship import Kinship
from scenegen.sampling.growth.machine import Machine
from scenegen.sampling.growth.moves import sweep
from scenegen.sampling.growth.plan import Recipe, make_recipe
from scenegen.sampling.growth.population import ISLANDS, Taken, spread_over, take
from scenegen.sampling.growth.stuck import how_far, others, why_stuck
from scenegen.sampling.plan import Account, Piece, Plan, Tally
from scenegen.sampling.problem import Budget, Problem
from scenegen.sampling.report import too_early
from scenegen.sampling.splitting.sampler import probability

Array = npt.NDArray[np.float64]

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
    started: Started | None = field(default=None, kw_only=True)  # whose second population is piece 1; ends with `close`

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
                taken = Second(self.problem, self.budget)(recipe.size)
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
        if isinstance(grown, Stuck):
            return self._nothing(machine.work)
        particles = grown.particles
        accepted = float(np.mean([sweep(particles, recipe.settings) for _ in range(recipe.settle)]))
        return self._made(take(grown, recipe.thin, Kinship(machine)(particles), accepted, _aside(self.seed, k)), rng)

    def _made(self, taken: Taken, rng: np.random.Generator) -> Piece:
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

    def underway(self) -> Mapping[int, Beside[Any, Any]]:
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
    started: Started | None = None,
    longest: float = math.inf,
) -> Growth | Stalled:
    """The plan of a problem; Stalled where there is no room for some object, or time is up. Unless `patient`, little is
    spent on it, and its design effect may be infinite: such a plan is not to be used. Other processes may begin to
    draw meanwhile, and `close` ends them; `started` is what they have: see `start_growth`. The plan is the same
    without. It takes at most `longest` seconds, as a machine counts them, unless other processes have begun."""
    with np.errstate(all="ignore"):
        made = make_recipe(problem, budget, patient=patient, started=started, longest=longest)
    if isinstance(made, Stalled):
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
    if isinstance(plan, Stalled):
        raise no_growth(problem, plan)
    return plan


def no_growth(problem: Problem, end: Stalled) -> RequestError:
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
