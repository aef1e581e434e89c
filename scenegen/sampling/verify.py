"""Verification of every scene before it is returned."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scenegen.sampling.problem import Problem

Array = npt.NDArray[np.float64]

AGREE = 1e-9  # maximum difference of two evaluators of phi
CHUNK = 16_384  # scenes at a time, which stay in cache
LIVE = 1 << 22  # numbers in memory at a time; specs of thousands of atoms get smaller chunks


def verify(problem: Problem, rows: Array, phi: Array) -> None:
    """Verify scenes, rows (3N, m) with phi (L, m), from scratch: phi of every label by numpy in float64; the ranges,
    the requirement, the workspace, the range of headings, and fixed objects.

    `phi` may lack the requirement's row. Raises AssertionError: a failure is a bug of scenegen, and such scenes are
    never returned.
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
        raise AssertionError("a sampler returned a scene outside the requested range")
    if not problem.spec.workspace.contains(rows).all():
        raise AssertionError("a sampler placed an object outside the workspace")
    still = problem.lowest == problem.highest
    if (rows[still] != problem.lowest[still, None]).any():
        raise AssertionError("a sampler moved an object that is held in place")
