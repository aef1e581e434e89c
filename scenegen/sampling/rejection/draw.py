"""Candidates from a cover, scored and sorted into cells, some at a time."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.bounds.effort import Effort, per_scene, scoring
from scenegen.bounds.prune import Cover
from scenegen.lang.interpret import evaluate
from scenegen.lang.least_gap import find_groups
from scenegen.pose import BELOW_TURN, THETA, along
from scenegen.primitives import NUMPY
from scenegen.sampling.problem import PLAN, Problem

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.intp]
Bool = npt.NDArray[np.bool_]

LIVE = 1 << 22  # numbers in memory at a time while candidates are scored
CHUNK = 16_384  # maximum number of candidates drawn and scored at a time: intermediates then stay in cache
WORK = 1 << 26  # candidates times nodes of one exploration
PIECE, PART = 1 << 24, 1 << 22  # work (see bounds.effort) of a piece and of a chunk: a third and a tenth of a second
EXPLORE = 4  # chunks drawn from the common cover to see which cells they hit
CHEAP = 0.3  # share of the work of scoring; less than that is done before the rest
GUESS = 2048  # candidates that show how many are scored no further than that
ENOUGH = 16  # hits after which a cell's rate is known well enough


def within(problem: Problem, work: float) -> int:
    """How many candidates can be scored with so much work, at least 64."""
    return max(64, int(work / max(1.0, per_scene(problem.core.nodes)[0])))


def affordable(problem: Problem, count: int) -> int:
    """That many candidates, or fewer if scoring one takes thousands of operations."""
    return max(64, min(count, WORK // EXPLORE // len(problem.core.nodes), within(problem, PIECE)))


def chunks(problem: Problem, count: int) -> list[int]:
    live = LIVE // max(len(problem.core.nodes), len(problem.lowest))
    size = max(64, min(CHUNK, live, within(problem, PART)))
    whole, rest = divmod(count, size)
    return [size] * whole + ([rest] if rest else [])


def explore(
    problem: Problem, cover: Cover, most: int, rng: np.random.Generator, effort: Effort, cell: int | None = None
) -> tuple[Index, int]:
    """Hits of each cell, (C,), in a few chunks of candidates, and how many there were; with `cell`, as soon as that one
    is known well enough. Raises what `effort` raises."""
    hits = np.zeros(problem.cells.count, dtype=np.intp)
    tried = 0
    for chunk in range(most):
        for count in chunks(problem, affordable(problem, 2048 if cell is not None and not chunk else CHUNK)):
            effort.spend(scoring(problem.core.nodes, count))
            _, _, cells = draw_kept(problem, cover, count, rng, check=effort.check)
            hits += np.bincount(cells, minlength=problem.cells.count)
            tried += count
        if cell is not None and hits[cell] >= ENOUGH:
            break
    return hits, tried


def draw_kept(
    problem: Problem,
    cover: Cover,
    count: int,
    rng: np.random.Generator,
    room: Array | None = None,
    check: Callable[[], None] | None = None,
) -> tuple[Array, Array, Index]:
    """The accepted ones of `count` candidates, in random order: rows (3N, m), phi (L, m), cells (m,). `room` is a
    buffer for the draws, (3N, CHUNK); `check` may interrupt, see `evaluate`."""
    rows, spans, usable = _drawn(problem, cover, count, rng, room)
    first = _cheap_label(problem)
    if first is not None:
        passed = np.flatnonzero(usable & _in_range(problem, first.label, first.values(problem, rows, check)))
        spans = [slice(*np.searchsorted(passed, (span.start, span.stop))) for span in spans]
        rows, usable = rows.take(passed, axis=1), np.ones(len(passed), dtype=bool)
    phi = _scored(problem, cover, rows, spans, usable, check)
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
) -> Array:
    """phi (L, B); and `usable` loses those that are not scenes of their part."""
    labels = problem.core.labels.values()
    needed = {*labels, *(node for part in cover.parts for node, _, _ in part.apart)}
    values = evaluate(problem.core, list(rows), NUMPY, check, needed)
    for part, span in zip(cover.parts, spans, strict=True):
        if part.apart:
            mine = part.owns(values, span)
            if mine is not None:
                usable[span] &= mine
    phi = np.empty((len(labels), rows.shape[1]))
    for label, node in enumerate(labels):
        phi[label] = values[node]
    return phi


def _in_range(problem: Problem, label: int, value: Array) -> Bool:
    low, high = problem.cells.low[label], problem.cells.high[label]
    held: Bool = np.asarray((value >= low) & (value <= high) if low > -math.inf else value <= high)
    return held if low > -math.inf or high < math.inf else np.ones(np.shape(value), dtype=bool)


@dataclass(frozen=True, slots=True)
class _Cheap:
    """A label that is looked at before all others; `work` is that of scoring it."""

    work: float
    label: int
    node: int

    def values(self, problem: Problem, rows: Array, check: Callable[[], None] | None = None) -> Array:
        found: Array = evaluate(problem.core, list(rows), NUMPY, check, (self.node,))[self.node]
        return found


def _cheap_label(problem: Problem) -> _Cheap | None:
    """The label that costs much less than all of them and has a range: most candidates need not be scored any further
    than that."""
    nodes, found = problem.core.nodes, []
    for label, node in enumerate(problem.core.labels.values()):
        if problem.cells.low[label] > -math.inf or problem.cells.high[label] < math.inf:
            skipped = find_groups(problem.core, (node,)).skipped
            work = per_scene(one for index, one in enumerate(nodes) if index not in skipped)[0]
            found.append(_Cheap(work, label, node))
    best = min(found, key=lambda one: one.work, default=None)
    return best if best is not None and best.work <= CHEAP * per_scene(nodes)[0] else None


def work_each(problem: Problem, cover: Cover, rng: np.random.Generator) -> float:
    """The work of a candidate on average; see scenegen.bounds.effort."""
    whole, first = per_scene(problem.core.nodes)[0], _cheap_label(problem)
    if first is None:
        return whole
    rows, _, usable = _drawn(problem, cover, affordable(problem, GUESS), rng)
    passed = float(np.mean(usable & _in_range(problem, first.label, first.values(problem, rows))))
    return first.work + passed * (whole - first.work)


def misses(problem: Problem, cover: Cover) -> tuple[Array, Array]:
    """Candidates out of the range, for the report: rows (3N, m) and phi (L, m)."""
    rng = np.random.default_rng(np.random.SeedSequence([problem.request.seed, PLAN, 0]))
    count = chunks(problem, CHUNK)[0]
    rows, phi, usable = candidates(problem, cover, count, rng)
    out = np.flatnonzero(usable & (problem.cells.find(phi) < 0))
    return rows[:, out], phi[:, out]
