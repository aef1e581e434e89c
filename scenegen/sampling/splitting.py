"""Multilevel splitting: scenes for ranges that hardly any uniform scene lies in.

A population of uniform scenes descends level by level to the wanted range; from then on its chains wander within it by
Metropolis moves under the base distribution, and scenes are taken far enough apart to have forgotten one another. Exact
in the limit of long chains; the report says how far from it a run is. With a spread over cells the chains wander
through all of them under weights that make them equally frequent, so that one descent serves every cell.

The plan is made once; piece k is an independent population that follows it (`run_piece`), wherever it runs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.bounds.effort import NEVER, Stop
from scenegen.errors import Diagnostic
from scenegen.lang.core import REQUIRE
from scenegen.sampling.cells import Cells
from scenegen.sampling.chains import Chains
from scenegen.sampling.digest import digest
from scenegen.sampling.frame import Tape, frame_of
from scenegen.sampling.levels import SPLIT, Plan, Stalled, generator, make_plan
from scenegen.sampling.mixing import NEGLIGIBLE, Statistics, design_effect
from scenegen.sampling.pieces import MANY_PIECES, Account, Candidates, Tally
from scenegen.sampling.problem import Budget, Problem
from scenegen.sampling.report import SHOWN, shortfall, too_early

Array = npt.NDArray[np.float64]

_SETTLING = 2  # times the distance between two scenes that survivors of one ancestor get to forget it
FEWEST = 4  # pieces at least: the error bar of the probability is their spread
BARREN = 8  # pieces in a row that bring nothing new before a run ends
# Student's t for 95 % by degrees of freedom, two-sided; beyond the table the normal's value is near enough.
_STUDENT = (12.71, 4.30, 3.18, 2.78, 2.57, 2.45, 2.36, 2.31, 2.26, 2.23, 2.20, 2.18, 2.16, 2.14, 2.13)


@dataclass(frozen=True, slots=True)
class Piece:
    """Scenes of one population: rows (3N, B), phi (L, B), all in the wanted range, in the order of their taking.

    `probability` is its estimate of the probability of the range under the base distribution, unbiased as its levels
    are given; `accepted` is the mean share of chains that took a move while scenes were taken, `stuck` the share that
    had not moved between two takes, `effect` (S,) the design effect of its ancestors on each statistic.
    """

    rows: Array
    phi: Array
    probability: float
    accepted: float
    stuck: float
    effect: Array
    evaluations: int


@dataclass(frozen=True, slots=True)
class Splitting:
    """A plan for one request; `stop` can break its pieces off, and is no part of what they depend on. The facts of a
    piece are: 1 if it lived, its estimate of the probability and the square of that, the share of moves taken and the
    share stuck, its scenes, its evaluations, then the design effects and their squares."""

    problem: Problem
    plan: Plan
    stop: Stop = NEVER

    name = "splitting"
    fewest = FEWEST
    patience = BARREN

    @property
    def plan_digest(self) -> str:
        return digest("splitting", self.plan)

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
        return tuple(sorted(self.plan.cells))

    @property
    def ruled_out(self) -> frozenset[int]:
        return frozenset()

    @property
    def shared_by(self) -> int:
        return MANY_PIECES

    @property
    def evaluations(self) -> float:
        plan = self.plan
        moves = sum(stage.moves for stage in plan.stages) + (_SETTLING + plan.takes - 1) * plan.thinning
        pieces = max(FEWEST, -(-self.wanted // (plan.chains * plan.takes)))
        return float(plan.evaluations + pieces * plan.chains * (1 + moves))

    def piece(self, k: int) -> Candidates:
        """Piece k. Raises StoppedError where time is up meanwhile."""
        made = run_piece(self.problem, self.plan, k, self.stop)
        order = _aside(self.seed, k).permutation(made.rows.shape[1])  # survivors of one ancestor stand together
        rows, phi = made.rows.take(order, axis=1), made.phi.take(order, axis=1)
        facts = [
            float(len(made.effect) > 0),
            made.probability,
            made.probability**2,
            made.accepted,
            made.stuck,
            float(len(order)),
            float(made.evaluations),
            *made.effect,
            *made.effect**2,
        ]
        return Candidates(rows, phi, self.cells.find(phi), np.array(facts))

    def account(self, tally: Tally) -> Account:
        """What the scene file says about the run, and what the user is warned of."""
        plan = self.plan
        alive, total, square, accepted, stuck, scenes, made, *effects = tally.facts or (0.0,) * 7
        effect = _worst(alive, np.array(effects).reshape(2, -1))
        within = (1.0 + plan.left) / max(1.0 - plan.left, 1e-6) if plan.takes > 1 else 1.0
        evaluations = plan.evaluations + int(made)
        info: dict[str, object] = {
            "method": "splitting",
            "seed": self.seed,
            "candidates": evaluations,
            "levels": plan.levels,
            "pieces": tally.pieces,
            "chains": plan.chains,
            "thinning": plan.thinning,
            "acceptance": round(accepted / max(alive, 1.0), 4),
            "stuck": round(stuck / max(alive, 1.0), 4),
            "correlation": round(float(plan.left), 4),
            "effective_share": round(min(1.0, 1.0 / (effect * within)), 4) if scenes else 0.0,
        }
        info |= probability(tally.pieces, total, square)
        if REQUIRE in self.problem.core.labels:
            info["probability_of"] = "range given the requirement"
        warnings: tuple[Diagnostic, ...] = ()
        if plan.left > 2 * NEGLIGIBLE:
            title = (
                f"after {plan.thinning:,} moves the chains still resemble what they were ({plan.left:.0%} correlation)"
            )
            note = "the range may have parts between which no move leads; the shares of such parts are uncertain"
            warnings = (Diagnostic(title, help="compare runs with several seeds", note=note, severity="warning"),)
        return Account(info, f"{evaluations:,} evaluations of splitting", warnings)

    def misses(self) -> tuple[Array, Array]:
        return np.empty((len(self.problem.lowest), 0)), np.empty((len(self.problem.core.labels), 0))


def plan_splitting(problem: Problem, budget: Budget) -> Splitting | Stalled:
    """The plan of a problem; Stalled where its range is not reached. There must be something to move: see `moves`."""
    with np.errstate(all="ignore"):  # phi may overflow or be undefined far from the range: such scenes are not taken
        plan = make_plan(problem, budget)
    return plan if isinstance(plan, Stalled) else Splitting(problem, plan, budget)


def moves(problem: Problem) -> bool:
    """Whether anything that phi depends on can move: otherwise all scenes are alike to it, and rejection serves."""
    return frame_of(problem).dimension > 0


def run_piece(problem: Problem, plan: Plan, number: int, stop: Stop = NEVER) -> Piece:
    """Piece `number` of a plan: the same scenes whenever and wherever it is run. Raises what `stop` raises."""
    with np.errstate(all="ignore"):
        return _run_piece(problem, plan, number, stop)


def _run_piece(problem: Problem, plan: Plan, number: int, stop: Stop) -> Piece:
    frame = frame_of(problem)
    rng = generator(problem.request.seed, number)
    chains = Chains.start(frame, Tape(frame, stop=stop), problem.cells, plan.chains, rng)
    statistics = Statistics(frame, stop)
    probability = 1.0
    for stage in plan.stages:
        share = chains.narrow(stage.region)
        if stage.counts:
            probability *= share
        if not share:
            return _nothing(problem, chains.evaluations)
        chains.run(stage.moves, stage.tuning)
    tuning = plan.stages[-1].tuning
    chains.pool = list(chains.rows)
    for _ in range(_SETTLING):
        chains.reflect(tuning)
        accepted = chains.run(plan.thinning, tuning)
    effect = design_effect(chains, statistics(chains))
    parts: list[Array] = []
    stuck = 0
    for take in range(plan.takes):
        if take:
            chains.reflect(tuning)
            accepted = chains.run(plan.thinning, tuning)
        index = chains.take()
        stuck += chains.count - len(index)
        parts.append(frame.complete([row[index] for row in chains.rows], problem.lowest, problem.highest, rng))
    rows = np.concatenate(parts, axis=1) if len(parts) > 1 else parts[0]
    phi = problem.phi(rows)
    good = np.isin(problem.cells.find(phi), np.fromiter(plan.cells, dtype=np.intp))
    if not good.all():
        rows, phi = rows[:, good], phi[:, good]
    share = stuck / (chains.count * plan.takes)
    return Piece(rows, phi, probability, accepted, share, effect, chains.evaluations)


def _nothing(problem: Problem, evaluations: int) -> Piece:
    """A piece whose population died out on a level: its estimate of the probability is 0, as it must be."""
    rows, phi = np.empty((len(problem.lowest), 0)), np.empty((len(problem.core.labels), 0))
    return Piece(rows, phi, 0.0, 0.0, 0.0, np.empty(0), evaluations)


def _aside(seed: int, piece: int) -> np.random.Generator:
    """Random numbers for what is done with the scenes of piece k, or of the plan (-1), once they are there."""
    return np.random.default_rng(np.random.SeedSequence([seed, SPLIT, piece + 1, 1]))


def _worst(count: float, effects: Array) -> float:
    """The largest design effect of any statistic beyond what chance makes of some hundred estimates: two standard
    errors over the pieces are taken off each. `effects` (2, S) are sums and sums of squares over `count` pieces."""
    if not count:
        return 1.0
    mean, square = effects / count
    error = np.sqrt(np.maximum(square - mean * mean, 0.0) / (count - 1.0)) if count > 1.0 else 0.0
    return float((mean - 2.0 * error).max(initial=1.0))


def probability(count: int, total: float, square: float) -> dict[str, object]:
    """log10 of the probability that independent unbiased estimates agree on, given their number, sum and sum of
    squares, and the half-width of its 95 % interval (Student's t, carried to the logarithm); None where unknown."""
    if not total > 0.0:
        return {"log10_probability": None, "log10_error": None}
    mean = total / count
    out: dict[str, object] = {"log10_probability": round(math.log10(mean), 5), "log10_error": None}
    if count > 1:
        variance = max(0.0, square - count * mean * mean) / (count - 1)
        student = _STUDENT[count - 2] if count - 2 < len(_STUDENT) else 1.96 + 2.5 / (count - 1)
        out["log10_error"] = round(student * math.sqrt(variance / count) / (mean * math.log(10.0)), 5)
    return out


def why_stalled(problem: Problem, end: Stalled) -> Diagnostic:
    """What to say where the descent ended early: the scenes that came nearest tell what stands in the way."""
    tried = f"{end.evaluations:,} evaluations of splitting, {end.levels} levels"
    if not end.phi:
        return too_early(problem, tried, len(problem.possible))
    shown = min(len(end.phi[0]), SHOWN)
    rng = _aside(problem.request.seed, -1)
    rows = frame_of(problem).complete([row[:shown] for row in end.rows], problem.lowest, problem.highest, rng)
    return shortfall(problem, 0, tried, rows, np.array([phi[:shown] for phi in end.phi]))
