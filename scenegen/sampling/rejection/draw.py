"""Candidates from a cover, scored and sorted into cells, some at a time."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from scenegen.bounds.effort import Effort, per_scene
from scenegen.bounds.prune import Cover
from scenegen.lang.interpret import evaluate
from scenegen.lang.least_gap import Groups
from scenegen.pose import BELOW_TURN, THETA, along
from scenegen.primitives import NUMPY
from scenegen.sampling.problem import PLAN, Problem
from scenegen.sampling.rejection.stages import Stages
from scenegen.sampling.rejection.stages import make_stages as stages_for

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.intp]
Bool = npt.NDArray[np.bool_]

LIVE = 1 << 22  # numbers in memory at a time while candidates are scored
CHUNK = 16_384  # maximum number of candidates drawn and scored at a time: intermediates then stay in cache
WORK = 1 << 26  # candidates times nodes of one exploration
PIECE, PART = 1 << 24, 1 << 22  # work (see bounds.effort) of a piece and of a chunk: a third and a tenth of a second
EXPLORE = 4  # chunks drawn from the common cover to see which cells they hit
PILOT = 512  # candidates that show which conditions are best checked first
ENOUGH = 16  # hits after which a cell's rate is known well enough


def within(problem: Problem, work: float) -> int:
    """How many candidates can be scored with so much work, at least 64."""
    return max(64, int(work / max(1.0, per_scene(problem.core.nodes)[0])))


def affordable(problem: Problem, count: int) -> int:
    """That many candidates, or fewer if scoring one takes thousands of operations."""
    return max(64, min(count, WORK // EXPLORE // len(problem.core.nodes), within(problem, PIECE)))


def chunk_size(problem: Problem) -> int:
    """How many candidates are drawn and scored at a time."""
    live = LIVE // max(len(problem.core.nodes), len(problem.lowest))
    return max(64, min(CHUNK, live, within(problem, PART)))


def chunks(count: int, size: int) -> list[int]:
    """`count` candidates in chunks of a size."""
    whole, rest = divmod(count, size)
    return [size] * whole + ([rest] if rest else [])


def explore(
    problem: Problem,
    cover: Cover,
    most: int,
    rng: np.random.Generator,
    effort: Effort,
    cell: int | None = None,
    stages: Stages | None = None,
) -> tuple[Index, int, Stages | None]:
    """Hits of each cell, (C,), in a few chunks of candidates, how many there were, and the cover's stages, if they were
    given or worth making; with `cell`, as soon as that one is known well enough. Raises what `effort` raises."""
    hits = np.zeros(problem.cells.count, dtype=np.intp)
    tried, size = 0, chunk_size(problem)
    for chunk in range(most):
        for count in chunks(affordable(problem, 2048 if cell is not None and not chunk else CHUNK), size):
            if stages is None and tried:
                stages = make_stages(problem, cover)
            each, calls = per_scene(problem.core.nodes)
            effort.spend(calls + count * (each if stages is None else min(each, stages.work)))
            _, _, cells = draw_kept(problem, cover, count, rng, check=effort.check, stages=stages)
            hits += np.bincount(cells, minlength=problem.cells.count)
            tried += count
        if cell is not None and hits[cell] >= ENOUGH:
            break
    return hits, tried, stages


def draw_kept(
    problem: Problem,
    cover: Cover,
    count: int,
    rng: np.random.Generator,
    room: Array | None = None,
    check: Callable[[], None] | None = None,
    stages: Stages | None = None,
) -> tuple[Array, Array, Index]:
    """The accepted ones of `count` candidates, in random order: rows (3N, m), phi (L, m), cells (m,). `room` is a
    buffer for the draws, (3N, CHUNK); `check` may interrupt, see `evaluate`; `stages` save work."""
    rows, spans, usable = _drawn(problem, cover, count, rng, room)
    if stages is not None:
        rows, at = stages.survivors(problem.core, rows, usable, check)
        if at is not None:
            spans = [slice(*np.searchsorted(at, (span.start, span.stop))) for span in spans]
            usable = np.ones(len(at), dtype=bool)
    phi = _scored(problem, cover, rows, spans, usable, check, None if stages is None else stages.full)
    for label, value in enumerate(phi):
        usable &= _in_range(problem, label, value)
    # Candidates come part by part: without shuffling, a piece that is cut off would lack the last parts.
    kept = rng.permutation(np.flatnonzero(usable))
    chosen = phi.take(kept, axis=1)
    return rows.take(kept, axis=1), chosen, problem.cells.find(chosen)


def candidates(problem: Problem, cover: Cover, count: int, rng: np.random.Generator) -> tuple[Array, Array, Bool]:
    """Candidates (3N, B), their exact phi (L, B), and which are scenes of the part that they were drawn for, (B,)."""
    rows, spans, usable = _drawn(problem, cover, count, rng)
    return rows, _scored(problem, cover, rows, spans, usable), usable


def _drawn(
    problem: Problem, cover: Cover, count: int, rng: np.random.Generator, room: Array | None = None
) -> tuple[Array, Sequence[slice], Bool]:
    """Candidates (3N, B), which of them belong to each part, and which are scenes of its box, (B,)."""
    rows = np.empty((len(problem.lowest), count)) if room is None else room[:, :count]
    usable, spans = cover.draw(rows, rng)
    np.minimum(rows[along(THETA)], BELOW_TURN, out=rows[along(THETA)])
    return rows, spans, usable


def _scored(
    problem: Problem,
    cover: Cover,
    rows: Array,
    spans: Sequence[slice],
    usable: Bool,
    check: Callable[[], None] | None = None,
    full: Groups | None = None,
) -> Array:
    """phi (L, B); and `usable` loses those that are not scenes of their part."""
    labels = problem.core.labels.values()
    values = evaluate(problem.core, list(rows), NUMPY, check, _needed(problem, cover) if full is None else full)
    for part, span in zip(cover.parts, spans, strict=True):
        if part.apart:
            mine = part.owns(values, span)
            if mine is not None:
                usable[span] &= mine
    phi = np.empty((len(labels), rows.shape[1]))
    for label, node in enumerate(labels):
        phi[label] = values[node]
    return phi


def _needed(problem: Problem, cover: Cover) -> set[int]:
    """The nodes whose values scoring reads."""
    return {*problem.core.labels.values(), *(node for part in cover.parts for node, _, _ in part.apart)}


def _in_range(problem: Problem, label: int, value: Array) -> Bool:
    low, high = problem.cells.low[label], problem.cells.high[label]
    held: Bool = np.asarray((value >= low) & (value <= high) if low > -math.inf else value <= high)
    return held if low > -math.inf or high < math.inf else np.ones(np.shape(value), dtype=bool)


def make_stages(problem: Problem, cover: Cover) -> Stages:
    """What is scored first of candidates from a cover."""
    rng = np.random.default_rng(np.random.SeedSequence([problem.request.seed, PLAN, 0, 3]))
    rows, _, usable = _drawn(problem, cover, affordable(problem, PILOT), rng)
    return stages_for(problem, rows, usable, _needed(problem, cover))


def misses(problem: Problem, cover: Cover) -> tuple[Array, Array]:
    """Candidates out of the range, for the report: rows (3N, m) and phi (L, m)."""
    rng = np.random.default_rng(np.random.SeedSequence([problem.request.seed, PLAN, 0]))
    rows, phi, usable = candidates(problem, cover, chunk_size(problem), rng)
    out = np.flatnonzero(usable & (problem.cells.find(phi) < 0))
    return rows[:, out], phi[:, out]
