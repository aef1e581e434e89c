"""A second look at every scene before it is handed out."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scenegen.sampling.problem import Problem

Array = npt.NDArray[np.float64]

AGREE = 1e-9  # how far apart two evaluators of phi may lie
CHUNK = 16_384  # scenes at a time, which stay in cache
LIVE = 1 << 22  # numbers that are alive at a time; specs of thousands of atoms get smaller chunks


def verify(problem: Problem, rows: Array, phi: Array) -> None:
    """Look at scenes, rows (3N, m) with phi (L, m), as if nothing were known about them: phi of every label anew, by
    numpy in float64; the ranges, what the spec requires, the workspace, the circle, and objects that are held.

    `phi` may lack the requirement's row. Raises AssertionError: what fails here is a bug of ours, and is never handed
    out.
    """
    size = max(64, min(CHUNK, LIVE // len(problem.core.nodes)))
    for start in range(0, rows.shape[1], size):
        part = slice(start, start + size)
        _look(problem, np.ascontiguousarray(rows[:, part]), phi[:, part])


def _look(problem: Problem, rows: Array, phi: Array) -> None:
    again = problem.phi(rows)
    if not (np.abs(again[: len(phi)] - phi) <= AGREE).all():
        raise AssertionError("two evaluators of the same spec disagree about phi")
    cells = problem.cells
    if not ((again >= cells.low[:, None]) & (again <= cells.high[:, None])).all():
        raise AssertionError("a sampler handed out a scene that was not asked for")
    if not problem.spec.workspace.contains(rows).all():
        raise AssertionError("a sampler placed an object outside the workspace")
    still = problem.lowest == problem.highest
    if (rows[still] != problem.lowest[still, None]).any():
        raise AssertionError("a sampler moved an object that is held in place")
