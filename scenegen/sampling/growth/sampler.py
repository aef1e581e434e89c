"""Growth as a sampler: a plan, pieces that follow it, and what is said of a run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.bounds.proposal import BELOW_TURN
from scenegen.errors import Diagnostic, RequestError
from scenegen.lang.core import REQUIRE
from scenegen.sampling.cells import Cells
from scenegen.sampling.digest import digest
from scenegen.sampling.growth.grow import Stuck, grow
from scenegen.sampling.growth.kinship import Kinship
from scenegen.sampling.growth.machine import Machine
from scenegen.sampling.growth.moves import sweep
from scenegen.sampling.growth.particles import Particles
from scenegen.sampling.growth.plan import (
    GROWTH,
    ISLANDS,
    Recipe,
    Stalled,
    generator,
    make_recipe,
    spread_over,
    with_deadline,
)
from scenegen.sampling.growth.stuck import why_stuck
from scenegen.sampling.pieces import Account, Candidates, Tally
from scenegen.sampling.problem import Budget, Problem
from scenegen.sampling.report import too_early
from scenegen.sampling.splitting import probability

Array = npt.NDArray[np.float64]

BARREN = 8  # pieces in a row that bring nothing new before a run ends
LOW = 0.3  # effective share below which the user is warned
EXTRA = 8  # further sweeps for scenes that have not moved apart


@dataclass(frozen=True, slots=True, eq=False)
class Growth:
    """A plan for one request. The facts of a piece are: its islands, the sum of their estimates of the probability and
    of the squares of these, 1 if any lived, the share of walks taken, the share of scenes left out as copies, the
    design effect of common ancestors, and its evaluations."""

    problem: Problem
    machine: Machine
    recipe: Recipe

    name = "growth"
    fewest = 1
    patience = BARREN

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
            recipe.cells,
            (recipe.count, recipe.settle),
        )

    @property
    def wanted(self) -> int:
        return self.problem.request.n

    @property
    def seed(self) -> int:
        return self.problem.request.seed

    @property
    def cells(self) -> Cells:
        return self.problem.cells

    @property
    def reached(self) -> tuple[int, ...]:
        return self.recipe.cells

    @property
    def ruled_out(self) -> frozenset[int]:
        return frozenset()

    @property
    def shared_by(self) -> int:
        return -(-self.wanted // self.recipe.count)

    @property
    def evaluations(self) -> float:
        pieces = -(-self.wanted // self.recipe.count)
        return self.recipe.evaluations + pieces * self.recipe.piece

    def piece(self, k: int) -> Candidates:
        """Piece k. Raises StoppedError where the plan's deadline passes meanwhile."""
        with np.errstate(all="ignore"):  # phi may overflow or be undefined far from the range
            return self._piece(k)

    def _piece(self, k: int) -> Candidates:
        problem, recipe = self.problem, self.recipe
        machine = with_deadline(self.machine, self.machine.deadline)
        rng = generator(self.seed, k)
        grown = grow(machine, *spread_over(recipe.cells, recipe.count), recipe.steps, recipe.settings, rng)
        if isinstance(grown, Stuck):
            rows, phi = np.empty((len(problem.lowest), 0)), np.empty((len(problem.core.labels), 0))
            facts = [float(ISLANDS), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, machine.work]
            return Candidates(rows, phi, np.empty(0, dtype=np.intp), np.array(facts))
        particles = grown.particles
        accepted = float(np.mean([sweep(particles, recipe.settings) for _ in range(recipe.settle)]))
        for _ in range(EXTRA):
            if particles.apart.all():
                break
            sweep(particles, recipe.settings)
        apart = particles.apart
        rows = self._whole(particles, np.flatnonzero(apart), rng)
        rows = rows.take(_aside(self.seed, k).permutation(rows.shape[1]), axis=1)
        phi = problem.phi(rows)
        share = np.exp(grown.log_share + log_base(machine)).sum(axis=1)
        facts = [
            float(ISLANDS),
            float(share.sum()),
            float((share * share).sum()),
            1.0,
            accepted,
            1.0 - float(apart.mean()),
            Kinship(machine)(particles),
            machine.work,
        ]
        return Candidates(rows, phi, self.cells.find(phi), np.array(facts))

    def _whole(self, particles: Particles, index: npt.NDArray[np.intp], rng: np.random.Generator) -> Array:
        """Whole scenes, (3N, B): rows that no clause reads are drawn afresh."""
        lowest, highest = self.problem.lowest, self.problem.highest
        rows = particles.scenes[:, index]
        for row in range(len(lowest)):
            if row not in particles.machine.graph.rows and lowest[row] < highest[row]:
                rows[row] = lowest[row] + rng.random(len(index)) * (highest[row] - lowest[row])
        np.minimum(rows[2::3], BELOW_TURN, out=rows[2::3])
        return rows

    def account(self, tally: Tally) -> Account:
        """What the scene file says about the run, and what the user is warned of."""
        recipe = self.recipe
        islands, total, square, alive, accepted, copies, effect, made = tally.facts or (0.0,) * 8
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
            "acceptance": round(accepted / each, 4),
            "copies": round(copies / each, 4),
            "effective_share": round(share, 4),
        }
        info |= probability(int(islands), total, square)
        if REQUIRE in self.problem.core.labels:
            info["probability_of"] = "range and requirement"
        warnings: tuple[Diagnostic, ...] = ()
        if 0.0 < share < LOW:
            title = f"scenes of one ancestor are still alike: each is worth {share:.0%} of an independent one"
            note = "the table may be too full for its objects to pass each other; shares of arrangements are uncertain"
            warnings = (Diagnostic(title, help="compare runs with several seeds", note=note, severity="warning"),)
        return Account(info, f"{evaluations:,} evaluations of growth", warnings)

    def misses(self) -> tuple[Array, Array]:
        return np.empty((len(self.problem.lowest), 0)), np.empty((len(self.problem.core.labels), 0))


def plan_growth(problem: Problem, budget: Budget, *, patient: bool = True) -> Growth | Stalled:
    """The plan of a problem; Stalled where there is no room for some object, or time is up. Unless `patient`, little is
    spent on it, and its design effect may be infinite: such a plan is not to be used."""
    with np.errstate(all="ignore"):
        made = make_recipe(problem, budget, patient=patient)
    if isinstance(made, Stalled):
        return made
    machine, recipe = made
    return Growth(problem, machine, recipe)


def no_growth(problem: Problem, end: Stalled) -> RequestError:
    """What to say where growth came to nothing."""
    tried = f"{int(end.evaluations):,} evaluations of growth"
    if end.stuck is None or end.machine is None:
        return RequestError(too_early(problem, tried, problem.cells.count))
    return RequestError(why_stuck(end.machine, end.stuck, tried))


def log_base(machine: Machine) -> Array:
    """The natural logarithm of the share of the box of poses that contraction leaves to each cell, (C,)."""
    graph, problem = machine.graph, machine.problem
    rows = sorted(graph.rows)
    width = (problem.highest - problem.lowest)[rows][:, None]
    with np.errstate(divide="ignore"):
        out: Array = np.log((graph.high[rows] - graph.low[rows]) / width).sum(axis=0)
    return out


def _aside(seed: int, piece: int) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence([seed, GROWTH, piece + 1, 1]))
