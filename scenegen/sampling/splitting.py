"""Multilevel splitting: scenes for ranges that hardly any uniform scene lies in.

A population of uniform scenes descends level by level to the wanted range; from then on its chains wander within it by
Metropolis moves under the base distribution, and scenes are taken far enough apart to have forgotten one another. Exact
in the limit of long chains; the report says how far from it a run is. With a spread over cells the chains wander
through all of them under weights that make them equally frequent, so that one descent serves every cell.

The plan is made once; piece k is an independent population that follows it (`run_piece`), wherever it runs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch

from scenegen.errors import Diagnostic
from scenegen.sampling.chains import Chains
from scenegen.sampling.collect import Collector, Sampled
from scenegen.sampling.frame import Tape, frame_of
from scenegen.sampling.levels import Plan, Stalled, generator, make_plan
from scenegen.sampling.mixing import NEGLIGIBLE, Statistics, design_effect
from scenegen.sampling.problem import Budget, Problem, Progress
from scenegen.sampling.rejection import rejection
from scenegen.sampling.report import finish

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


def splitting(problem: Problem, budget: Budget, progress: Progress | None = None) -> Sampled:
    """Scenes for a problem, or as many as the budget allows (`shortfall` then says why)."""
    if not frame_of(problem).dimension:  # nothing that phi depends on can move: all scenes are alike to it
        return rejection(problem, budget, progress)
    with np.errstate(all="ignore"):  # phi may overflow or be undefined far from the range: such scenes are not taken
        return _splitting(problem, budget, progress)


def _splitting(problem: Problem, budget: Budget, progress: Progress | None) -> Sampled:
    plan = make_plan(problem, budget)
    collector = problem.collector()
    if isinstance(plan, Stalled):
        return _stalled(problem, plan, collector)
    for cell in collector.undecided:
        if cell not in plan.cells:
            collector.give_up(cell)
    pieces: list[Piece] = []
    evaluations, barren = plan.evaluations, 0
    last = np.empty((len(problem.lowest), 0)), np.empty((len(problem.core.labels), 0))
    while True:
        piece = run_piece(problem, plan, len(pieces))
        found = collector.found
        collector.offer(piece.rows, piece.phi)
        pieces.append(piece)
        last = piece.rows, piece.phi
        evaluations += piece.evaluations
        barren = barren + 1 if collector.found == found else 0
        if progress is not None:
            progress(collector.found, problem.request.n, evaluations)
        done = collector.complete and not collector.deficits(hopeful=True)
        if (done and len(pieces) >= FEWEST) or budget.spent or barren >= BARREN:
            break
    info, warnings = _account(problem, plan, pieces, evaluations)
    sampled = finish(problem, collector, info, f"{evaluations:,} evaluations of splitting", *last, done)
    return Sampled(sampled.rows, sampled.phi, sampled.info, (*sampled.warnings, *warnings), sampled.shortfall)


def run_piece(problem: Problem, plan: Plan, number: int) -> Piece:
    """Piece `number` of a plan: the same scenes whenever and wherever it is run."""
    with np.errstate(all="ignore"):
        return _run_piece(problem, plan, number)


def _run_piece(problem: Problem, plan: Plan, number: int) -> Piece:
    frame = frame_of(problem)
    rng = generator(problem.request.seed, number)
    chains = Chains.start(frame, Tape(frame), problem.cells, plan.chains, rng)
    statistics = Statistics(frame)
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
    phi = problem.score(torch.from_numpy(rows))
    good = np.isin(problem.cells.find(phi), np.fromiter(plan.cells, dtype=np.intp))
    if not good.all():
        rows, phi = rows[:, good], phi[:, good]
    share = stuck / (chains.count * plan.takes)
    return Piece(rows, phi, probability, accepted, share, effect, chains.evaluations)


def _nothing(problem: Problem, evaluations: int) -> Piece:
    """A piece whose population died out on a level: its estimate of the probability is 0, as it must be."""
    rows, phi = np.empty((len(problem.lowest), 0)), np.empty((len(problem.core.labels), 0))
    return Piece(rows, phi, 0.0, 0.0, 0.0, np.empty(0), evaluations)


def _account(
    problem: Problem, plan: Plan, pieces: Sequence[Piece], evaluations: int
) -> tuple[dict[str, object], tuple[Diagnostic, ...]]:
    """What the scene file says about the run, and what the user is warned of."""
    alive = [piece for piece in pieces if len(piece.effect)]
    scenes = sum(piece.rows.shape[1] for piece in alive)
    effect = float(np.mean([piece.effect for piece in alive], axis=0).max(initial=1.0)) if alive else 1.0
    within = (1.0 + plan.left) / max(1.0 - plan.left, 1e-6) if plan.takes > 1 else 1.0
    effective = scenes / (effect * within)
    info: dict[str, object] = {
        "method": "splitting",
        "seed": problem.request.seed,
        "candidates": evaluations,
        "levels": plan.levels,
        "pieces": len(pieces),
        "chains": plan.chains,
        "thinning": plan.thinning,
        "acceptance": _mean([piece.accepted for piece in alive]),
        "stuck": _mean([piece.stuck for piece in alive]),
        "correlation": round(float(plan.left), 4),
        "effective_share": round(float(min(1.0, effective / scenes)), 4) if scenes else 0.0,
    }
    info |= probability([piece.probability for piece in pieces])
    warnings: tuple[Diagnostic, ...] = ()
    if plan.left > 2 * NEGLIGIBLE:
        title = f"after {plan.thinning:,} moves the chains still resemble what they were ({plan.left:.0%} correlation)"
        note = "the range may have parts between which no move leads; the shares of such parts are uncertain"
        warnings = (Diagnostic(title, help="compare runs with several seeds", note=note, severity="warning"),)
    return info, warnings


def _mean(values: Sequence[float]) -> float:
    return round(float(np.mean(values)), 4) if values else 0.0


def probability(estimates: Sequence[float]) -> dict[str, object]:
    """log10 of the probability that independent unbiased estimates agree on, and the half-width of its 95 % interval
    (Student's t over the estimates, carried to the logarithm); None where it is unknown."""
    mean = float(np.mean(estimates))
    if not mean > 0.0:
        return {"log10_probability": None, "log10_error": None}
    out: dict[str, object] = {"log10_probability": round(math.log10(mean), 5), "log10_error": None}
    count = len(estimates)
    if count > 1:
        error = float(np.std(estimates, ddof=1)) / math.sqrt(count)
        student = _STUDENT[count - 2] if count - 2 < len(_STUDENT) else 1.96 + 2.5 / (count - 1)
        out["log10_error"] = round(student * error / (mean * math.log(10.0)), 5)
    return out


def _stalled(problem: Problem, end: Stalled, collector: Collector) -> Sampled:
    """Nothing was found: the scenes that came nearest tell what stands in the way."""
    shown = min(len(end.phi[0]), 4096)
    rng = generator(problem.request.seed, -1)
    rows = frame_of(problem).complete([row[:shown] for row in end.rows], problem.lowest, problem.highest, rng)
    info: dict[str, object] = {
        "method": "splitting",
        "seed": problem.request.seed,
        "candidates": end.evaluations,
        "levels": end.levels,
    }
    tried = f"{end.evaluations:,} evaluations of splitting, {end.levels} levels"
    return finish(problem, collector, info, tried, rows, np.array([phi[:shown] for phi in end.phi]), False)
