"""Multilevel splitting: scenes for rare ranges.

A population of uniform scenes moves level by level into the requested range. There its chains continue with Metropolis
moves under the base distribution, and are thinned until successive scenes are nearly independent. Exact in the limit of
long chains; the report says how far from it a run is. If scenes are spread over cells, the chains visit all cells, with
weights that make the cells equally frequent, so one descent serves every cell.

The plan is made once; piece k is an independent population that follows it (`run_piece`), wherever it runs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from scenegen.errors import Diagnostic
from scenegen.errors.requests import CHAINS_CORRELATED
from scenegen.lang.formula.core import REQUIRE
from scenegen.sampling.plan import Account, Piece, Plan, Record, Tally, digest
from scenegen.sampling.problem import Budget, Problem
from scenegen.sampling.report import student
from scenegen.sampling.splitting.chain_state import ChainTape, frame_of
from scenegen.sampling.splitting.chains import NEGLIGIBLE, Chains, Statistics, design_effect
from scenegen.sampling.splitting.levels import Schedule, SplittingStalled, aside, begin, make_schedule
from scenegen.search.effort import MOVED, NEVER, Stop, per_scene

Array = npt.NDArray[np.float64]

FACTS = 9  # of a piece, and two for each statistic
_SETTLING = 2  # factor on the thinning: so many moves decorrelate survivors of one ancestor
FEWEST = 4  # minimum number of pieces: the error bar of the probability is their spread
BARREN = 8  # a run ends after so many pieces in a row without a new scene


@dataclass(frozen=True, slots=True)
class PopulationScenes:
    """Scenes of one population: rows (3N, B), phi (L, B), all in range, in the order in which they were taken.

    `probability` is its estimate of the probability of the range under the base distribution, unbiased because its
    levels are fixed; `accepted` is the mean acceptance rate while scenes were taken, `stuck` the share of chains that
    had not moved between two takes, `effect` (S,) the design effect of its ancestors on each statistic.
    """

    rows: Array
    phi: Array
    probability: float
    accepted: float
    stuck: float
    effect: Array
    evaluations: int


@dataclass(frozen=True, slots=True, eq=False)
class Splitting(Plan):
    """A plan for one request; `stop` can interrupt its pieces and does not change their results. The facts of a piece
    are: 1 if it survived, its estimate of the probability, the square and the logarithm of that and the square of this
    (0 if it did not survive), the acceptance rate and the share
    stuck, its scenes, its evaluations, then the design effects and their squares."""

    schedule: Schedule
    stop: Stop = NEVER

    method: ClassVar[str] = "splitting"
    fewest: ClassVar[int] = FEWEST
    patience: ClassVar[int] = BARREN

    @property
    def plan_digest(self) -> str:
        one = self.schedule
        values = one.stages, one.levels, one.cells, one.chains, one.takes, one.thinning, one.left, one.evaluations
        return digest("splitting", Record("Schedule", (*values, {})))

    @property
    def reached(self) -> tuple[int, ...]:
        return tuple(sorted(self.schedule.cells))

    @property
    def fact_count(self) -> int:
        frame = frame_of(self.problem)
        chains = Chains.start(frame, ChainTape(frame), self.cells, 2, np.random.default_rng(0))
        with np.errstate(all="ignore"):
            return FACTS + 2 * len(Statistics(frame)(chains))

    @property
    def scenes_per_piece(self) -> float:
        return self.schedule.chains * self.schedule.takes

    @property
    def evaluations(self) -> float:
        plan = self.schedule
        moves = sum(stage.moves for stage in plan.stages) + (_SETTLING + plan.takes - 1) * plan.thinning
        pieces = max(FEWEST, -(-self.wanted // (plan.chains * plan.takes)))
        return float(plan.evaluations + pieces * plan.chains * (1 + moves))

    @property
    def seconds(self) -> float:
        each, _ = per_scene(self.problem.core.nodes)
        return MOVED * each * (self.evaluations - self.schedule.evaluations)

    def draw(self, k: int) -> Piece:
        """Piece k. Raises StoppedError if time is up meanwhile."""
        made = run_piece(self.problem, self.schedule, k, self.stop)
        order = aside(self.seed, k).permutation(made.rows.shape[1])  # survivors of one ancestor are next to each other
        rows, phi = made.rows.take(order, axis=1), made.phi.take(order, axis=1)
        log = math.log(made.probability) if made.probability else 0.0
        facts = [
            float(len(made.effect) > 0),
            made.probability,
            made.probability**2,
            log,
            log**2,
            made.accepted,
            made.stuck,
            float(len(order)),
            float(made.evaluations),
            *made.effect,
            *made.effect**2,
        ]
        return Piece(rows, phi, self.cells.find(phi), np.array(facts))

    def account(self, tally: Tally) -> Account:
        """What the scene file says about the run, and the warnings for the user."""
        plan = self.schedule
        alive, total, square, log, log_square, accepted, stuck, scenes, made, *effects = tally.facts or (0.0,) * FACTS
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
        logs = (log, log_square) if alive == tally.pieces else None
        info |= probability(tally.pieces, total, square, logs, self.problem.log_excess)
        if REQUIRE in self.problem.core.labels:
            info["probability_of"] = "range and requirement"
        warnings: tuple[Diagnostic, ...] = ()
        if plan.left > 2 * NEGLIGIBLE:
            warnings = (CHAINS_CORRELATED(moves=plan.thinning, correlation=float(plan.left)),)
        return Account(info, f"{evaluations:,} evaluations of splitting", warnings)


def plan_splitting(problem: Problem, budget: Budget, *, longest: float = math.inf) -> Splitting | SplittingStalled:
    """The plan of a problem; SplittingStalled if its range is not reached. There must be something to move: see
    `moves`. The descent may take `longest` seconds, by the constants of bounds.effort."""
    with np.errstate(all="ignore"):  # phi may overflow or be undefined far from the range: such scenes are rejected
        most = longest / (MOVED * per_scene(problem.core.nodes)[0])
        plan = make_schedule(problem, budget, most)
    return plan if isinstance(plan, SplittingStalled) else Splitting(problem, plan, budget)


def make_plan(problem: Problem, budget: Budget) -> Splitting:
    """The plan of a problem. Raises RequestError if its range is not reached."""
    plan = plan_splitting(problem, budget)
    if isinstance(plan, SplittingStalled):
        raise plan.error(problem)
    return plan


def run_piece(problem: Problem, plan: Schedule, number: int, stop: Stop = NEVER) -> PopulationScenes:
    """Piece `number` of a plan: always the same scenes, in any process. Raises what `stop` raises."""
    with np.errstate(all="ignore"):
        return _run_piece(problem, plan, number, stop)


def _run_piece(problem: Problem, plan: Schedule, number: int, stop: Stop) -> PopulationScenes:
    begun = begin(problem, plan.chains, number, stop)
    for stage in plan.stages:
        begun.follow(stage)
    chains = begun.chains
    if not begun.probability:
        return _nothing(problem, chains.evaluations)
    chain_state, rng = chains.chain_state, chains.rng
    statistics = Statistics(chain_state, stop)
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
        parts.append(chain_state.complete([row[index] for row in chains.rows], problem.lowest, problem.highest, rng))
    rows = np.concatenate(parts, axis=1) if len(parts) > 1 else parts[0]
    phi = problem.phi(rows)
    good = np.isin(problem.cells.find(phi), np.fromiter(plan.cells, dtype=np.intp))
    if not good.all():
        rows, phi = rows[:, good], phi[:, good]
    share = stuck / (chains.count * plan.takes)
    return PopulationScenes(rows, phi, begun.probability, accepted, share, effect, chains.evaluations)


def _nothing(problem: Problem, evaluations: int) -> PopulationScenes:
    """A piece whose population died out on a level: its estimate of the probability is 0, which keeps the mean
    unbiased."""
    rows, phi = np.empty((len(problem.lowest), 0)), np.empty((len(problem.core.labels), 0))
    return PopulationScenes(rows, phi, 0.0, 0.0, 0.0, np.empty(0), evaluations)


def _worst(count: float, effects: Array) -> float:
    """The largest design effect of any statistic. Among a few hundred estimates some are large by chance, so two
    standard errors over the pieces are subtracted from each. `effects` (2, S) are sums and sums of squares over `count`
    pieces."""
    if not count:
        return 1.0
    mean, square = effects / count
    error = np.sqrt(np.maximum(square - mean * mean, 0.0) / (count - 1.0)) if count > 1.0 else 0.0
    return float((mean - 2.0 * error).max(initial=1.0))


def probability(
    count: int, total: float, square: float, logs: tuple[float, float] | None = None, excess: float = 0.0
) -> dict[str, object]:
    """log10 of the mean of independent unbiased estimates, given their number, sum and sum of squares, and the
    half-width of its 95 % interval (Student's t, converted to the logarithm); None if unknown.

    `logs` are the sum of the natural logarithms and that of their squares, where no estimate is 0: the interval is then
    that of nearly lognormal estimates, see `interval.ratio`. `excess` is added to the logarithm of the mean.
    """
    if not total > 0.0:
        return {"log10_probability": None, "log10_error": None}
    mean = total / count
    log10 = math.log10(mean) + excess / math.log(10.0)
    out: dict[str, object] = {"log10_probability": round(log10, 5) + 0.0, "log10_error": None}
    if count > 1:
        variance = max(0.0, square - count * mean * mean) / (count - 1) / mean**2
        if logs is not None:
            scatter = max(0.0, logs[1] - logs[0] ** 2 / count) / (count - 1)
            widest = scatter + 0.5 * scatter**2 * count / (count - 1)  # of a wild scatter: Cox's interval
            variance = max(variance, math.expm1(scatter) if scatter < 1.0 else widest)
        out["log10_error"] = round(student(count - 1) * math.sqrt(variance / count) / math.log(10.0), 5)
    return out
