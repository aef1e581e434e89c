"""Plain rejection: draw from the base distribution, keep what lies in the range.

Exact and independent, with no training, for any spec whose range is not too rare: within a cell the scenes follow the
base distribution because nothing but the cell decides what is kept.
"""

from __future__ import annotations

from scenegen.sampling.collect import Sampled
from scenegen.sampling.problem import Budget, Problem, Progress
from scenegen.sampling.report import finish

EXPLORE = 32  # pieces after which a cell that was never hit counts as out of reach


def rejection(problem: Problem, budget: Budget, progress: Progress | None = None) -> Sampled:
    """Scenes for a problem, or as many as the budget allows (`shortfall` then says why)."""
    collector = problem.collector()
    piece = 0
    while True:
        rows = problem.base(piece)
        phi = problem.score(rows)
        found = collector.offer(rows.numpy(), phi)
        piece += 1
        if progress is not None:
            progress(collector.found, problem.request.n, piece * problem.piece_size)
        done = collector.complete and (piece >= EXPLORE or not collector.undecided)
        if done or budget.spent:
            break
    info = {"method": "rejection", "seed": problem.request.seed, "draws": piece * problem.piece_size}
    missed = found < 0
    return finish(
        problem, collector, info, f"{piece * problem.piece_size:,} draws", rows.numpy()[:, missed], phi[:, missed], done
    )
