"""Multilevel splitting: scenes for rare ranges.

A population of uniform scenes moves level by level into the requested range. There its chains continue with Metropolis
moves under the base distribution, and are thinned until successive scenes are nearly independent. Exact in the limit of
long chains; the report says how far from it a run is. If scenes are spread over cells, the chains visit all cells, with
weights that make the cells equally frequent, so one descent serves every cell.

The plan is made once; piece k is an independent population that follows it (`Splitting.draw`), wherever it runs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import numpy as np

from scenegen.arrays import Array
from scenegen.errors import Diagnostic, RequestError
from scenegen.errors.requests import SCENES_ALIKE
from scenegen.lang.formula.core import REQUIRE
from scenegen.sampling.plan import Account, NoPlan, Piece, Plan, Record, Tally, digest
from scenegen.sampling.problem import Problem
from scenegen.sampling.report import BLAME_SCENES, probability_info, shortfall, too_early
from scenegen.sampling.splitting.chain_state import ChainTape, chain_state_of
from scenegen.sampling.splitting.chains import NEGLIGIBLE, Chains, Statistics, design_effect, forgetting
from scenegen.sampling.splitting.levels import Descent, Schedule, Stage, follow
from scenegen.sampling.splitting.moves import Tuning
from scenegen.sampling.splitting.tuning import MAX_THINNING, Tuner, even_out
from scenegen.sampling.streams import SPLITTING_STREAM
from scenegen.search.effort import NEVER, Budget, Stop, StoppedError, moving_seconds

SPLITTING_FACTS = 9  # of a piece, and two for each statistic
SETTLE_FACTOR = 2  # factor on the thinning: so many moves decorrelate survivors of one ancestor
MIN_PIECES = 4  # minimum number of pieces: the error bar of the probability is their spread


TARGET_PIECES = 8  # pieces of a request that is large enough
MAX_CHAINS = 8192  # chains of a piece: a row of this length stays in the cache, and numpy's overhead per call is small
PLAN_CHAINS = MAX_CHAINS // 2  # chains of the plan: one process makes it, so more would only keep others waiting
MIN_CHAINS = 1024  # of a piece: with fewer ancestors the shares of modes would be noisy
MAX_TAKES = 16  # maximum number of scenes from one chain
MAX_CHAIN_COORDINATES = 1 << 21  # maximum number of coordinates of a piece's chains


def generator(seed: int, piece: int) -> np.random.Generator:
    """Random numbers of piece k; the plan's are those of piece -1."""
    return np.random.Generator(np.random.SFC64(np.random.SeedSequence([seed, SPLITTING_STREAM, piece + 1])))


def _side_generator(seed: int, piece: int) -> np.random.Generator:
    """Random numbers for the processing of the finished scenes of piece k, or of the plan (-1)."""
    return np.random.default_rng(np.random.SeedSequence([seed, SPLITTING_STREAM, piece + 1, 1]))


@dataclass(frozen=True, slots=True)
class SplittingStalled(NoPlan):
    """No plan: `why` the descent ended, the scenes it ended with, D rows and L phi, (P,) each, and its cost. There are
    no scenes if time was up before the first."""

    why: Literal["time", "range"]
    rows: tuple[Array, ...]
    phi: tuple[Array, ...]
    evaluations: int
    levels: int

    @property
    def time_is_up(self) -> bool:
        return self.why == "time"

    def error(self, problem: Problem) -> RequestError:
        """The nearest scenes show which atoms fail."""
        tried = f"{self.evaluations:,} evaluations of splitting, {self.levels} levels"
        if not self.phi:
            return RequestError(too_early(problem, tried, len(problem.possible)))
        shown = min(len(self.phi[0]), BLAME_SCENES)
        rng = _side_generator(problem.request.seed, -1)
        rows = chain_state_of(problem).complete(
            [row[:shown] for row in self.rows], problem.lowest, problem.highest, rng
        )
        return RequestError(shortfall(problem, 0, tried, rows, np.array([phi[:shown] for phi in self.phi])))


def make_schedule(problem: Problem, budget: Budget, most: float = np.inf) -> Schedule | SplittingStalled:
    """The plan for a problem; SplittingStalled if the range cannot be reached, or time is up. The descent may take
    `most` evaluations."""
    descent = None
    try:
        descent = _SceneDescent(problem, budget, most)
        return descent.plan()
    except StoppedError:
        return SplittingStalled("time", (), (), 0, 0) if descent is None else descent.stall("time")


class _SceneDescent(Descent[Chains]):
    """The descent of a request for scenes."""

    kept = 0.5

    def __init__(self, problem: Problem, budget: Budget, most: float = np.inf) -> None:
        self._problem, self._budget, self._most = problem, budget, most
        chain_state, cells = chain_state_of(problem), problem.cells
        most = max(256, MAX_CHAIN_COORDINATES // chain_state.dimension)
        least, n = max(MIN_CHAINS, 8 * cells.count), problem.request.n * 51 // 50  # rounding takes a few out of range
        self._size = min(most, MAX_CHAINS, max(least, -(-n // TARGET_PIECES)))
        self._takes = min(MAX_TAKES, -(-n // (TARGET_PIECES * self._size)))
        if self._takes > 1:  # as many pieces as planned, none for a few last scenes
            self._size = min(self._size, max(least, -(-n // (TARGET_PIECES * self._takes))))
        ensemble = min(most, max(PLAN_CHAINS, least))
        tape = ChainTape(chain_state, stop=budget)
        super().__init__(Chains.start(chain_state, tape, cells, ensemble, generator(problem.request.seed, -1)))
        self._tuner = Tuner(self.chains)

    def plan(self) -> Schedule | SplittingStalled:
        """The schedule. Raises StoppedError if time is up."""
        cells, labels, chains = self._problem.cells, tuple(self._problem.core.labels), self.chains
        if not self.reach(cells, [len(labels) - 1] if labels[-1] == REQUIRE else []):
            return self.stall("time" if self._budget.is_spent else "range")
        levels, reached = len(self.stages), frozenset({0})
        if cells.count > 1:
            for region, moves in even_out(chains, self._tuner):
                self.stages.append(Stage(region, self._tuner.tuning(), moves))
                if self._budget.is_spent:
                    return self.stall("time")
            assert chains.region.weights is not None
            reached = frozenset(map(int, np.flatnonzero(chains.region.weights)))
        statistics = Statistics(chains.chain_state, self._budget)
        tuning = self._tuner.tune(statistics)
        memory = forgetting(chains, statistics, tuning, MAX_THINNING)
        self.stages[-1] = replace(self.stages[-1], tuning=tuning)
        evaluations = chains.evaluations + self._tuner.evaluations
        stages = tuple(self.stages)
        return Schedule(stages, levels, reached, self._size, memory.left, evaluations, self._takes, memory.moves)

    def move(self) -> tuple[Tuning, int]:
        moves = self._tuner.adapt()
        return self._tuner.tuning(), moves

    def is_over(self) -> bool:
        return self._budget.is_spent or self.chains.evaluations > self._most

    def stall(self, why: Literal["time", "range"]) -> SplittingStalled:
        evaluations = self.chains.evaluations + self._tuner.evaluations
        return SplittingStalled(why, tuple(self.chains.rows), tuple(self.chains.scores), evaluations, len(self.stages))


@dataclass(frozen=True, slots=True, eq=False)
class Splitting(Plan):
    """A plan for one request; `stop` can interrupt its pieces and does not change their results. The facts of a piece
    are: 1 if it survived, its estimate of the probability, the square and the logarithm of that and the square of this
    (0 if it did not survive), the mean acceptance rate while scenes were taken, the share of chains that had not moved
    between two takes, its scenes, its evaluations, then the design effects of its ancestors on each statistic and their
    squares."""

    schedule: Schedule
    stop: Stop = NEVER

    method: ClassVar[str] = "splitting"
    fewest: ClassVar[int] = MIN_PIECES
    patience: ClassVar[int] = 8  # pieces in a row without a new scene

    @property
    def plan_digest(self) -> str:
        one = self.schedule
        values = one.stages, one.levels, one.cells, one.chains, one.takes, one.thinning, one.left, one.evaluations
        return digest("splitting", Record("Schedule", (*values, {})))

    @property
    def reached_cells(self) -> tuple[int, ...]:
        return tuple(sorted(self.schedule.cells))

    @property
    def fact_count(self) -> int:
        frame = chain_state_of(self.problem)
        chains = Chains.start(frame, ChainTape(frame), self.cells, 2, np.random.default_rng(0))
        with np.errstate(all="ignore"):
            return SPLITTING_FACTS + 2 * len(Statistics(frame)(chains))

    @property
    def scenes_per_piece(self) -> float:
        return self.schedule.chains * self.schedule.takes

    @property
    def evaluations(self) -> float:
        return float(self.schedule.evaluations + self.schedule.chains * self._moves)

    @property
    def _moves(self) -> int:
        """How often all chains of a piece move, in all pieces; to begin counts as a move."""
        plan = self.schedule
        moves = sum(stage.moves for stage in plan.stages) + (SETTLE_FACTOR + plan.takes - 1) * plan.thinning
        return max(MIN_PIECES, -(-self.scenes_wanted // (plan.chains * plan.takes))) * (1 + moves)

    @property
    def seconds(self) -> float:
        return moving_seconds(self.problem.core.nodes, self.schedule.chains * self._moves, self._moves)

    @np.errstate(all="ignore")
    def draw(self, k: int) -> Piece:
        """Piece k: a population of its own that follows the schedule, always the same, in any process. Raises
        StoppedError if time is up meanwhile."""
        problem, plan = self.problem, self.schedule
        chain_state, rng = chain_state_of(problem), generator(self.seed, k)
        chains = Chains.start(chain_state, ChainTape(chain_state, stop=self.stop), problem.cells, plan.chains, rng)
        estimate, _ = follow(chains, plan.stages)
        if not estimate:  # it died out on a level: its estimate of 0 keeps the mean unbiased
            rows, phi = np.empty((len(problem.lowest), 0)), np.empty((len(problem.core.labels), 0))
            none = np.array([*np.zeros(SPLITTING_FACTS - 1), float(chains.evaluations)])
            return Piece(rows, phi, np.empty(0, dtype=np.intp), none)
        statistics = Statistics(chain_state, self.stop)
        tuning = plan.stages[-1].tuning
        chains.pool = list(chains.rows)
        for _ in range(SETTLE_FACTOR):
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
            taken = [row[index] for row in chains.rows]
            parts.append(chain_state.complete(taken, problem.lowest, problem.highest, rng))
        rows = np.concatenate(parts, axis=1)
        phi = problem.phi(rows)
        good = np.isin(problem.cells.find(phi), np.fromiter(plan.cells, dtype=np.intp))
        # survivors of one ancestor are next to each other: they are mixed
        order = np.flatnonzero(good)[_side_generator(self.seed, k).permutation(np.count_nonzero(good))]
        rows, phi = rows.take(order, axis=1), phi.take(order, axis=1)
        log, share = math.log(estimate), stuck / (chains.count * plan.takes)
        facts = [1.0, estimate, estimate**2, log, log**2, accepted, share, len(order), chains.evaluations]
        return Piece(rows, phi, self.cells.find(phi), np.array([*facts, *effect, *effect**2]))

    def account(self, tally: Tally) -> Account:
        """What the scene file says about the run, and the warnings for the user."""
        plan = self.schedule
        alive, total, square, log, log_square, accepted, stuck, scenes, made, *effects = (
            tally.facts or (0.0,) * SPLITTING_FACTS
        )
        effect = _worst_effect(alive, np.array(effects).reshape(2, -1))
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
        info |= probability_info(tally.pieces, total, square, logs, self.problem.log_excess)
        if REQUIRE in self.problem.core.labels:
            info["probability_of"] = "range and requirement"
        warnings: tuple[Diagnostic, ...] = ()
        if plan.left > 2 * NEGLIGIBLE:
            warnings = (SCENES_ALIKE(moves=plan.thinning, correlation=float(plan.left)),)
        return Account(info, f"{evaluations:,} evaluations of splitting", warnings)


@np.errstate(all="ignore")
def plan_splitting(problem: Problem, budget: Budget, *, longest: float = math.inf) -> Splitting | SplittingStalled:
    """The plan of a problem; SplittingStalled if its range is not reached. There must be something to move: see
    `moves`. The descent may take `longest` seconds, by the constants of search.effort. phi may overflow or be undefined
    far from the range: such scenes are rejected."""
    most = longest / moving_seconds(problem.core.nodes, PLAN_CHAINS, 1.0) * PLAN_CHAINS
    plan = make_schedule(problem, budget, most)
    return plan if isinstance(plan, SplittingStalled) else Splitting(problem, plan, budget)


def make_plan(problem: Problem, budget: Budget) -> Splitting:
    """The plan of a problem. Raises RequestError if its range is not reached."""
    plan = plan_splitting(problem, budget)
    if isinstance(plan, SplittingStalled):
        raise plan.error(problem)
    return plan


def _worst_effect(count: float, effects: Array) -> float:
    """The largest design effect of any statistic. Among a few hundred estimates some are large by chance, so two
    standard errors over the pieces are subtracted from each. `effects` (2, S) are sums and sums of squares over `count`
    pieces."""
    if not count:
        return 1.0
    mean, square = effects / count
    error = np.sqrt(np.maximum(square - mean * mean, 0.0) / (count - 1.0)) if count > 1.0 else 0.0
    return float((mean - 2.0 * error).max(initial=1.0))
