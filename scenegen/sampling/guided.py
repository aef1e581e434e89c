"""Scenes from any proposer, refined onto their targets and verified.

A proposer is told which phi is wanted and answers with scenes, good or bad: a trained model, in practice. What it
proposes is moved onto the target, re-scored exactly, and handed out only if it lies in the range and the workspace. The
distribution within a cell is the proposer's, moved a little: approximate, and said so.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from scenegen.sampling.base import piece_generator
from scenegen.sampling.cells import Cells
from scenegen.sampling.collect import Sampled
from scenegen.sampling.problem import GUIDED, PILOT, Budget, Problem, Progress
from scenegen.sampling.refine import refine
from scenegen.sampling.report import finish

Array = npt.NDArray[np.float64]

Proposer = Callable[[Tensor, torch.Generator], Tensor]
"""Wanted phi (L, B) and the random numbers to use -> scenes (3N, B) in metres and radians."""

SMALLEST, LARGEST = 256, 16_384  # candidates of one round, at most a piece
PATIENCE = 2048  # candidates after which a cell that never worked counts as out of reach


class Targets:
    """Where to aim: values of phi that scenes have together.

    Drawn from a pilot sample of the base distribution, so that labels which are free, or tied to each other, get values
    that go together; where the pilot has nothing in a cell, uniform in the cell.
    """

    def __init__(self, problem: Problem) -> None:
        self._cells: Cells = problem.cells
        self._phi = problem.score(problem.base(0, stream=PILOT))
        found = self._cells.find(self._phi)
        order = np.argsort(found, kind="stable")
        borders = np.searchsorted(found[order], np.arange(self._cells.count + 1))
        self._members = [order[borders[cell] : borders[cell + 1]] for cell in range(self._cells.count)]

    def draw(self, cells: npt.NDArray[np.intp], generator: np.random.Generator) -> Array:
        """A wanted phi for each of B cells, (B,) -> (L, B)."""
        out = np.empty((self._phi.shape[0], len(cells)))
        for cell in map(int, np.unique(cells)):
            mine = np.flatnonzero(cells == cell)
            members = self._members[cell]
            if len(members):
                out[:, mine] = self._phi[:, generator.choice(members, len(mine))]
            else:
                out[:, mine] = self._guess(cell, len(mine), generator)
        return out

    def _guess(self, cell: int, count: int, generator: np.random.Generator) -> Array:
        """Uniform between the ends a cell has; labels with an open end take a value the pilot met, clipped to it."""
        low, high = self._cells.limits(cell)
        guess: Array = self._phi[:, generator.integers(self._phi.shape[1], size=count)]
        closed = np.isfinite(low) & np.isfinite(high)
        guess = np.clip(guess, low[:, None], high[:, None])
        width = np.where(closed, high - low, 0.0)[:, None]
        return np.where(closed[:, None], low[:, None] + width * generator.random(guess.shape), guess)


def guided(problem: Problem, propose: Proposer, name: str, budget: Budget, progress: Progress | None = None) -> Sampled:
    """Refined and verified scenes; as many as the budget allows (`shortfall` says why). `name` is the proposer's."""
    collector = problem.collector()
    targets = Targets(problem)
    tries: dict[int, int] = {}
    candidates = moved = piece = 0
    rows, phi = np.empty((3 * len(problem.spec.objects), 0)), np.empty((len(problem.core.labels), 0))
    while True:
        lacking = collector.deficits(hopeful=True)
        if not lacking or budget.spent:
            break
        generator = piece_generator(problem.request.seed, piece, GUIDED)
        chooser = np.random.default_rng(np.random.SeedSequence([problem.request.seed, GUIDED, piece]))
        wanted = _round(lacking, min(LARGEST, problem.piece_size), chooser)
        rows, phi, shifted = _candidates(problem, targets, propose, wanted, generator, chooser)
        found = collector.offer(rows, phi)
        candidates, moved, piece = candidates + len(wanted), moved + shifted, piece + 1
        for cell, count in zip(*np.unique(wanted, return_counts=True), strict=True):
            tries[int(cell)] = tries.get(int(cell), 0) + int(count)
            if tries[int(cell)] >= PATIENCE:
                collector.give_up(int(cell))
        rows, phi = rows[:, found < 0], phi[:, found < 0]
        if progress is not None:
            progress(collector.found, problem.request.n, candidates)
    done = collector.complete and not collector.deficits(hopeful=True)
    info = {"method": "model", "model": name, "seed": problem.request.seed, "raw": False, "candidates": candidates}
    info["refined"] = moved
    return finish(problem, collector, info, f"{candidates:,} candidates of the {name}", rows, phi, done)


def _round(lacking: dict[int, int], largest: int, chooser: np.random.Generator) -> npt.NDArray[np.intp]:
    """The cell of each candidate of a round: twice what is lacking, within limits, cells in order."""
    cells = np.fromiter(lacking, dtype=np.intp)
    need = np.fromiter(lacking.values(), dtype=np.float64)
    size = int(min(max(2 * need.sum(), SMALLEST), largest))
    return np.sort(chooser.choice(cells, size=size, p=need / need.sum()))


def _candidates(
    problem: Problem,
    targets: Targets,
    propose: Proposer,
    wanted: npt.NDArray[np.intp],
    generator: torch.Generator,
    chooser: np.random.Generator,
) -> tuple[Array, Array, int]:
    """Proposed and refined scenes with their exact phi, and how many of them refinement moved."""
    target = torch.from_numpy(targets.draw(wanted, chooser))
    limits = [problem.cells.limits(int(cell)) for cell in wanted]
    low, high = (torch.from_numpy(np.stack(ends, axis=1)) for ends in zip(*limits, strict=True))
    proposed = propose(target, generator).to(torch.float64)
    rows = refine(problem.robustness, problem.spec.workspace, proposed, target, low, high, problem.held)
    inside = problem.spec.workspace.contains(rows.numpy())
    moved = int((rows != proposed).any(dim=0).sum())
    phi = problem.score(rows)
    # A scene outside the workspace is never handed out, whatever its phi.
    return rows.numpy(), np.where(inside, phi, np.nan), moved


def unrefined(problem: Problem, propose: Proposer, name: str) -> Sampled:
    """The proposer's own scenes, unrefined and unfiltered, with targets spread like the request (`--raw`)."""
    seed, n = problem.request.seed, problem.request.n
    chooser = np.random.default_rng(np.random.SeedSequence([seed, GUIDED, 0]))
    possible = np.array(sorted(problem.possible), dtype=np.intp)
    wanted = np.resize(chooser.permutation(possible), n)
    target = Targets(problem).draw(wanted, chooser)
    rows = propose(torch.from_numpy(target), piece_generator(seed, 0, GUIDED)).to(torch.float64)
    phi = problem.phi(rows.numpy())
    info = {"method": "model", "model": name, "seed": seed, "raw": True, "candidates": n}
    return Sampled(rows.numpy(), phi, info, problem.request.warnings)
