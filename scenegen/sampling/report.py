"""What is said when cells were not reached or too few scenes were found."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scenegen.errors import Diagnostic
from scenegen.lang.core import REQUIRE, Atom
from scenegen.robustness.explain import deciding_atoms
from scenegen.sampling.collect import Collector, Sampled
from scenegen.sampling.problem import Problem
from scenegen.sampling.request import Range

Array = npt.NDArray[np.float64]

SHOWN = 4096  # candidates looked at to find out which atom fails most


def finish(
    problem: Problem,
    collector: Collector,
    info: dict[str, object],
    tried: str,
    rows: Array,
    phi: Array,
    done: bool,
    *,
    early: bool = False,
) -> Sampled:
    """What a sampler hands out. `rows` (3N, B) and `phi` (L, B) are its last misses; `done` says that nothing lacks,
    `early` that time was up before it was known which cells can be reached."""
    cells = {"asked": collector.cells.count, "reached": collector.cells.count - len(collector.unreached)}
    warnings = (*problem.request.warnings, *_unreached(collector, tried))
    why = None if done else _shortfall(problem, collector, tried, rows, phi, early)
    if problem.request.fixed:
        info = {**info, "fix": {name: list(pose) for name, pose in problem.request.fixed.items()}}
    if collector.found:
        kept, values = collector.scenes()
    else:
        kept, values = rows[:, :0], phi[:, :0]
    return Sampled(kept, values, {**info, "cells": cells}, warnings, why)


def _unreached(collector: Collector, tried: str) -> tuple[Diagnostic, ...]:
    """A warning that names the cells in which nothing was found; `tried` says how hard it was tried."""
    missing = collector.unreached
    if not missing or not collector.found:
        return ()
    cells = collector.cells
    shown = "; ".join(cells.describe(cell) for cell in missing[:3])
    more = f" and {len(missing) - 3} more" if len(missing) > 3 else ""
    ruled_out = sum(cell not in collector.possible for cell in missing)
    note = f"interval bounds rule out {ruled_out} of them" if ruled_out else ""
    title = f"{len(missing)} of {cells.count} cells of the range were not reached in {tried}"
    help_ = "the scenes are spread over the others"
    return (Diagnostic(title, help=help_, note=f"{shown}{more}" + (f"; {note}" if note else ""), severity="warning"),)


def _percent(share: float) -> str:
    """A share for people: one that is not whole is never rounded to 100 %."""
    return "over 99.9%" if 0.999 < share < 1.0 else f"{share:.1%}"


def _shortfall(problem: Problem, collector: Collector, tried: str, rows: Array, phi: Array, early: bool) -> Diagnostic:
    """Why fewer scenes than wanted were found, judged by the last candidates: rows (3N, B), phi (L, B)."""
    found, n = collector.found, problem.request.n
    title = f"found {found or 'none'} of {n:,} scenes in {tried}"
    if early or found >= n:
        title = f"time was up after {tried}, too early to tell which parts of the range can be reached"
        note = f"nothing was found yet in {len(collector.undecided)} of {problem.cells.count} cells"
        help_ = "give it more time with --timeout, ask for `--spread base`, or save what there is with --keep-partial"
        return Diagnostic(title, help=help_, note=note)
    usable = ~np.isnan(phi).any(axis=0)
    if phi.shape[1] and not usable.any():
        note = f"in each of the last {phi.shape[1]:,} candidates a coordinate was not a number"
        return Diagnostic(title, help="the model is of no use; train it again", note=note)
    rows, phi = rows[:, usable], phi[:, usable]
    low, high = problem.cells.low[:, None], problem.cells.high[:, None]
    out = (phi < low) | (phi > high)
    remedy = "widen the range, give it more time with --timeout"
    remedy += ", or save what there is with --keep-partial" if found else ""
    if not out.any():
        lacking = collector.deficits(hopeful=True) or collector.deficits()
        worst = max(lacking, key=lambda cell: lacking[cell], default=None)
        note = "" if worst is None else f"{problem.cells.describe(worst)} is the rarest part of the range"
        return Diagnostic(title, help=f"ask for `--spread base`, or a narrower range; or {remedy}", note=note)
    label = int(out.mean(axis=1).argmax())
    name, share = tuple(problem.core.labels)[label], out[label].mean()
    wanted = Range(0.0) if name == REQUIRE else problem.request.ranges[name]
    failing = rows[:, out[label]][:, :SHOWN]
    atom_index, count = next(iter(deciding_atoms(problem.core, failing, name).items()))
    atom = problem.core.nodes[atom_index]
    assert isinstance(atom, Atom)
    note = f"phi of `{name}` was outside `{wanted}` in {_percent(share)} of the last {phi.shape[1]:,} candidates"
    label_text = f"decides phi in {count / failing.shape[1]:.0%} of those that fail"
    return Diagnostic(title, atom.spans[0] if atom.spans else None, f"`{atom.text}` {label_text}", remedy, note=note)
