"""Plans for motions: splitting for rare ranges, plain rejection for others. They run like plans for scenes.

A motion is a column of a block: the poses at all moments, then the mover of each step.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from scenegen.arrays import Array, Index
from scenegen.errors import RequestError
from scenegen.errors.requests import NO_TIME_TO_TELL
from scenegen.processes.pool import run_pieces
from scenegen.sampling.motions.problem import (
    MAX_MOTION_NUMBERS,
    MotionProblem,
    Variables,
    draw,
    poses_of,
    within_a_turn,
)
from scenegen.sampling.motions.schedule import MotionChains, Watch, generator, make_schedule
from scenegen.sampling.plan import PHI_TOLERANCE, Account, Piece, Plan, Record, Tally, digest
from scenegen.sampling.report import hits_info, probability_info, too_few_motions
from scenegen.sampling.splitting.levels import Schedule, follow
from scenegen.sampling.streams import MOTIONS_STREAM
from scenegen.search.effort import NEVER, Budget, Stop, StoppedError

PIECE_MOTIONS = 4096  # motions of a piece of rejection, and of a step of the pilot
MIN_PIECE_MOTIONS = 8  # the same, of very large motions
MAX_PILOT_STEPS = 64  # steps of the pilot at most, which decides between rejection and splitting
PILOT_HITS = 4  # hits of the rarest cell that tell how rare it is
MOTION_FACTS, OF_A_STATISTIC = 7, 3  # of a piece of splitting
MAX_REJECTED_MOTIONS = 4_000_000  # motions up to which rejection is cheaper than the levels of splitting


def columns(problem: MotionProblem, variables: Variables, poses: Array) -> Array:
    """Motions as columns: ((steps + 1) * 3 N + steps, P). The mover is an object's index, -1 where all move."""
    if problem.moves == "one" and len(problem.movable):
        mover = problem.movable[variables.mover]
    else:
        mover = np.full_like(variables.mover, -1)
    rows = poses.reshape(math.prod(poses.shape[:-1]), variables.count)
    return np.concatenate([rows, mover.astype(np.float64)])


@dataclass(frozen=True, slots=True, eq=False)
class _MotionPlan(Plan):
    problem: MotionProblem  # type: ignore[assignment]  # see MotionProblem for what runs need of a problem
    reachable: tuple[int, ...]

    @property
    def reached_cells(self) -> tuple[int, ...]:
        return self.reachable

    @np.errstate(all="ignore")
    def check(self, rows: Array, phi: Array) -> None:
        """Score motions once more. Raises AssertionError for one that is out of range, or was given another phi."""
        problem = self.problem
        some = max(1, MAX_MOTION_NUMBERS // problem.rows)
        for start in range(0, rows.shape[1], some):
            part = slice(start, start + some)
            again = problem.scores(problem.poses(rows[:, part]))
            assert (problem.cells.find(again) >= 0).all(), "a motion is out of range"
            given, found = phi[:, part], again[: len(phi)]
            assert ((np.abs(found - given) <= PHI_TOLERANCE) | (found == given)).all(), (
                "two scores of a motion disagree"
            )


@dataclass(frozen=True, slots=True, eq=False)
class MotionRejection(_MotionPlan):
    """Draws of the base distribution, of which those in range are kept: independent and exact. The fact of a
    piece is how many are in range."""

    share: float
    stop: Stop = NEVER

    method: ClassVar[str] = "rejection"
    patience: ClassVar[int | None] = None  # the pilot has hit every cell; time alone ends a run

    @property
    def plan_digest(self) -> str:
        return digest("motion rejection", self.reachable)

    @property
    def evaluations(self) -> float:
        return self.scenes_wanted / self.share

    @property
    def batch(self) -> int:
        """Motions drawn for a piece."""
        return self.problem.batch_size(PIECE_MOTIONS, MIN_PIECE_MOTIONS)

    @property
    def fact_count(self) -> int:
        return 1

    @property
    def scenes_per_piece(self) -> float:
        return self.batch * self.share

    @np.errstate(all="ignore")
    def draw(self, k: int) -> Piece:
        self.stop.check()
        made = draw(self.problem, self.batch, generator(self.seed, k))
        poses = within_a_turn(poses_of(self.problem, made))
        scores = self.problem.scores(poses, self.stop)
        cell = self.cells.find(scores)
        good = np.flatnonzero(cell >= 0)
        rows = columns(self.problem, made.take(good), poses[..., good])
        return Piece(rows, scores[:, good], cell[good], np.array([float(len(good))]))

    def account(self, tally: Tally) -> Account:
        hits, drawn = sum(tally.facts), tally.pieces * self.batch
        info = {"method": self.method, "seed": self.seed, "candidates": drawn, "pieces": tally.pieces}
        info |= hits_info(hits, drawn, self.problem.log_excess)
        return Account(info, f"{drawn:,} motions")


@dataclass(frozen=True, slots=True, eq=False)
class MotionSplitting(_MotionPlan):
    """Populations that follow a schedule: exact in the limit of long chains. The facts are the estimate of the
    probability, its square, 1 if the population survived, its logarithm and the square of that (0 if it did not),
    evaluations, the share of moves taken, then the means of the statistics, their squares and their variances."""

    schedule: Schedule
    stop: Stop = NEVER

    method: ClassVar[str] = "splitting"
    patience: ClassVar[int | None] = 8
    fewest: ClassVar[int] = 4

    @property
    def plan_digest(self) -> str:
        one = self.schedule
        values = one.stages, one.levels, one.left, one.cells, one.chains, one.evaluations
        return digest("motion splitting", Record("Schedule", (*values, {})))

    @property
    def evaluations(self) -> float:
        plan = self.schedule
        moves = sum(stage.moves for stage in plan.stages)
        return float(plan.evaluations + max(self.fewest, -(-self.scenes_wanted // plan.chains)) * plan.chains * moves)

    @property
    def fact_count(self) -> int:
        with np.errstate(all="ignore"):
            return MOTION_FACTS + OF_A_STATISTIC * len(self._start(0, 2).statistics())

    @property
    def scenes_per_piece(self) -> float:
        return self.schedule.chains

    def _start(self, k: int, count: int) -> MotionChains:
        return MotionChains.start(self.problem, count, generator(self.seed, k), self.stop)

    @np.errstate(all="ignore")
    def draw(self, k: int) -> Piece:
        plan, problem = self.schedule, self.problem
        chains = self._start(k, plan.chains)
        share, taken = follow(chains, plan.stages)
        if not share:
            facts = np.array([0.0] * 5 + [float(chains.evaluations)])
            return Piece(np.empty((problem.rows, 0)), np.empty((len(chains.scores), 0)), np.empty(0, np.intp), facts)
        watched = chains.statistics()
        mean, variance = watched.mean(axis=1), watched.var(axis=1)
        log = math.log(share)
        facts = np.array([share, share**2, 1.0, log, log**2, chains.evaluations, taken, *mean, *mean**2, *variance])
        made = chains.now.take(chains.rng.permutation(chains.count))
        poses = within_a_turn(poses_of(problem, made))
        scores = problem.scores(poses)
        cell = self.cells.find(scores)
        good = np.flatnonzero(cell >= 0)  # all but rounding: a step as long as its bound may be found longer
        rows = columns(problem, made.take(good), poses[..., good])
        return Piece(rows, scores[:, good], cell[good], facts)

    def account(self, tally: Tally) -> Account:
        plan = self.schedule
        empty = (0.0,) * MOTION_FACTS
        total, square, alive, *logs, made, taken = (*tally.facts, *empty)[:MOTION_FACTS]
        watched = tally.facts[MOTION_FACTS:]
        evaluations = plan.evaluations + int(made)
        info: dict[str, object] = {
            "method": self.method,
            "seed": self.seed,
            "candidates": evaluations,
            "levels": plan.levels,
            "pieces": tally.pieces,
            "chains": plan.chains,
            "settling": sum(stage.moves for stage in plan.stages if stage.region is None),
            "acceptance": round(taken / max(1.0, alive), 4),
            "correlation": round(plan.left, 4),
            "effective_share": effective_share(alive, plan.chains, np.array(watched).reshape(3, -1)),
        }
        of_logs = (logs[0], logs[1]) if alive == tally.pieces else None
        info |= probability_info(tally.pieces, total, square, of_logs, self.problem.log_excess)
        return Account(info, f"{evaluations:,} evaluations of splitting, {plan.levels} levels")


def effective_share(pieces: float, chains: int, watched: Array) -> float | None:
    """How many independent motions one motion is worth, from the scatter of the means of independent pieces: what it
    would be for independent motions over what it is, averaged over statistics; None for fewer than two pieces."""
    if pieces < 2.0 or not watched.shape[1]:
        return None
    mean, square, variance = watched / pieces
    between = np.maximum(square - mean**2, 0.0) * pieces / (pieces - 1.0)
    varies = variance > 1e-12
    if not varies.any():
        return 1.0
    return round(min(1.0, float(1.0 / (chains * between[varies] / variance[varies]).mean())), 4)


@dataclass(frozen=True, slots=True)
class _Pilot:
    """Step k of the pilot: how many of `batch` draws hit each cell. Raises what `stop` raises."""

    problem: MotionProblem
    batch: int
    stop: Stop

    def __call__(self, k: int) -> Index:
        problem, cells = self.problem, self.problem.cells
        self.stop.check()
        rng = np.random.default_rng(np.random.SeedSequence([problem.request.seed, MOTIONS_STREAM, 0, k]))
        with np.errstate(all="ignore"):
            cell = cells.find(problem.scores(poses_of(problem, draw(problem, self.batch, rng)), self.stop))
        return np.bincount(cell[cell >= 0], minlength=cells.count)


def pilot(problem: MotionProblem, budget: Budget) -> tuple[Index, int]:
    """How many draws of the base distribution hit each cell, and how many draws there were. Raises StoppedError."""
    drawn, batch = 0, problem.batch_size(PIECE_MOTIONS, MIN_PIECE_MOTIONS)
    counts = np.zeros(problem.cells.count, dtype=np.intp)
    steps = run_pieces(_Pilot(problem, batch, budget), range(MAX_PILOT_STEPS), problem.request.workers or 1)
    with closing(steps):
        for hits in steps:
            counts += hits
            drawn += batch
            if counts.min() >= PILOT_HITS:
                break
    return counts, drawn


def make_plan(
    problem: MotionProblem, budget: Budget, method: str = "auto", watch: Watch | None = None
) -> MotionRejection | MotionSplitting | None:
    """Rejection where a pilot hits every cell of the range often, or `method` says so; else splitting; None if that
    does not reach the range. Raises StoppedError when time is up."""
    if method in ("auto", "rejection"):
        counts, drawn = pilot(problem, budget)
        cost = problem.request.n / problem.cells.count * drawn / max(1, counts.min())
        if (counts.min() >= PILOT_HITS and cost <= MAX_REJECTED_MOTIONS) or (method == "rejection" and counts.any()):
            reached = tuple(map(int, np.flatnonzero(counts)))
            return MotionRejection(problem, reached, counts.sum() / drawn, budget)
        if method == "rejection":
            return None
    schedule = make_schedule(problem, budget, watch)
    return None if schedule is None else MotionSplitting(problem, tuple(schedule.cells), schedule, budget)


def plan_motions(problem: MotionProblem, budget: Budget, *, watch: Watch | None = None) -> Plan:
    """The plan of a request for motions, by its method: "auto", "rejection" or "splitting". `watch` is shown motions
    until there is one: at first any. Raises RequestError where the range is not reached, and if time is up before."""
    request, cells = problem.request, problem.cells
    with np.errstate(all="ignore"):
        if watch is not None:
            poses = within_a_turn(poses_of(problem, draw(problem, request.n, generator(request.seed, -1))))
            watch(np.ascontiguousarray(poses.transpose(3, 2, 0, 1)), 0)
        try:
            plan = make_plan(problem, budget, request.method, watch)
        except StoppedError:
            several = cells.count if cells.count > 1 else None
            facts = {"tried": "levels of motions", "undecided": cells.count, "cells": several}
            raise RequestError(NO_TIME_TO_TELL(**facts)) from None
    if plan is None:
        raise RequestError(too_few_motions(0, request.n, budget.is_spent))
    return plan


@dataclass(frozen=True, slots=True)
class SampledMotions:
    """Motions: `poses` (n, T + 1, N, 3) in metres and radians, `movers` (n, T), an object's index or -1 where all
    move, and `phi` (n, L). `info` says how they were drawn; `complete` is False if time, or the search, ended with
    fewer than the request's n."""

    poses: Array
    movers: Index
    phi: Array
    info: Mapping[str, object]
    complete: bool

    @property
    def count(self) -> int:
        return len(self.poses)


def sample(problem: MotionProblem, budget: Budget | None = None, *, method: str = "auto") -> SampledMotions:
    """The request's motions. `method` is "auto", "rejection" or "splitting". Motions do not depend on the request's
    `workers`. Raises RequestError where the range is not reached, and if time is up before the plan is made,
    AssertionError for a motion that fails the check."""
    from scenegen.sampling.engine.run import in_memory

    budget = Budget(problem.request.timeout) if budget is None else budget
    problem = replace(problem, request=replace(problem.request, method=method))
    found = in_memory(plan_motions(problem, budget), budget)
    poses = np.ascontiguousarray(problem.poses(found.rows).transpose(3, 2, 0, 1))
    movers = found.rows[problem.rows - problem.steps :].T.astype(np.intp)
    return SampledMotions(poses, movers, found.phi.T, found.info, found.shortfall is None)
