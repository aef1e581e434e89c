"""A short deterministic search for a scene that meets a demand: what bounds cannot prove, a witness can."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from scenegen.bounds.contract import contract, start
from scenegen.bounds.effort import Effort, scoring
from scenegen.bounds.requirements import Ends, push_down
from scenegen.bounds.tape import make_tape, weight
from scenegen.lang.core import Core
from scenegen.lang.interpret import evaluate
from scenegen.primitives import NUMPY

Array = npt.NDArray[np.float64]

SCENES = 1024  # of one round of the search
KEPT = 32
ROUNDS = 40
FIRST = 128  # scenes that are looked at before anything else
WORK = 30_000  # tape nodes that contraction may visit; the search may visit as many, SEARCHES times
SEARCHES = 15
SHRINK = 0.85  # of the step from round to round
LIVE = 1 << 20  # numbers of one round at most
LARGEST = 20_000  # nodes from which on there is no search


@dataclass(frozen=True, slots=True)
class Reach:
    """Whether a demand can be met: "yes" with a `witness` (3N,), "no" as bounds prove, or "unknown". `best` is the
    least margin of the best scene that was looked at, and `nearest` (3N,) is that scene. `short`: the effort allowed
    ended the search before its last round."""

    verdict: Literal["yes", "no", "unknown"]
    witness: Array | None = None
    best: float = -np.inf
    nearest: Array | None = None
    short: bool = False


def find(
    core: Core,
    lowest: Array,
    highest: Array,
    wanted: Mapping[int, Ends],
    *,
    work: int = WORK,
    effort: Effort | None = None,
) -> Reach:
    """Whether all wanted formula nodes can lie within their ends at once, in the box lowest..highest (3N,).

    A few uniform scenes first; then contraction; then uniform scenes of the contracted box, the best of which are moved
    by ever smaller steps. The random numbers are always the same. `work` bounds the effort, in visits of nodes.
    Raises what `effort` raises.
    """
    effort = Effort() if effort is None else effort
    rng = np.random.default_rng(0)
    easy, margins = _best(
        core, wanted, effort, lowest[:, None] + (highest - lowest)[:, None] * rng.random((len(lowest), FIRST))
    )
    if margins[0] >= 0.0:
        return Reach("yes", easy[:, 0], float(margins[0]), easy[:, 0])
    if weight(core.nodes) > 2 * work or len(core.nodes) > LARGEST:
        return Reach("unknown", None, float(margins[0]), easy[:, 0], True)
    tape = make_tape(core, lowest, highest, effort)
    lo, hi = start(tape, [push_down(core, wanted)], lowest[:, None], highest[:, None])
    rounds = max(1, min(4, work // weight(tape.nodes)))
    if not contract(tape.nodes, lo, hi, rounds, batches=tape.batches, effort=effort)[0]:
        return Reach("no", None, float(margins[0]), easy[:, 0])
    low, high = lowest.copy(), highest.copy()
    for row, at in tape.rows.items():
        low[row], high[row] = max(low[row], lo[at, 0]), min(high[row], hi[at, 0])
    free = np.flatnonzero(high > low)
    count = max(KEPT, min(SCENES, LIVE // len(core.nodes)))
    rows = low[:, None] + (high - low)[:, None] * rng.random((len(low), count))
    best, margins = _best(core, wanted, effort, rows)
    step = 0.3
    rounds = SEARCHES * work // weight(core.nodes)
    for _ in range(min(ROUNDS, rounds)):
        if margins[0] >= 0.0 or not len(free):
            break
        step *= SHRINK
        rows = np.repeat(best, max(1, count // best.shape[1]), axis=1)
        moved = rng.random((len(free), rows.shape[1])) < np.maximum(2.0 / len(free), 0.3)
        rows[free] += np.where(moved, step * (high - low)[free, None] * rng.standard_normal(moved.shape), 0.0)
        np.clip(rows, low[:, None], high[:, None], out=rows)
        best, margins = _best(core, wanted, effort, np.concatenate([best, rows], axis=1))
    found = best[:, 0]
    if margins[0] >= 0.0:
        return Reach("yes", found, float(margins[0]), found)
    return Reach("unknown", None, float(margins[0]), found, rounds < ROUNDS)


def _best(core: Core, wanted: Mapping[int, Ends], effort: Effort, rows: Array) -> tuple[Array, Array]:
    """The scenes with the largest least margin, best first, and their margins."""
    effort.spend(scoring(core.nodes, rows.shape[1]))
    values = evaluate(core, list(rows), NUMPY, effort.check)
    margin = np.full(rows.shape[1], np.inf)
    for node, (low, high) in wanted.items():
        np.minimum(margin, np.minimum(values[node] - low, high - values[node]), out=margin)
    margin = np.where(np.isnan(margin), -np.inf, margin)
    order = np.argsort(-margin, kind="stable")[:KEPT]
    return rows[:, order], margin[order]
