"""What is said when cells were not reached or too few scenes were found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set

import numpy as np
import numpy.typing as npt

from scenegen.bounds.effort import per_scene
from scenegen.errors import Diagnostic
from scenegen.lang.core import REQUIRE, Atom
from scenegen.lang.deciding import deciding_atoms
from scenegen.sampling.collect import Collector, Sampled
from scenegen.sampling.pieces import Plan, Tally
from scenegen.sampling.problem import Problem
from scenegen.sampling.request import Range

Array = npt.NDArray[np.float64]

SHOWN = 4096  # candidates looked at to find out which atom fails most
LOOK = 1 << 22  # work (see bounds.effort) that this may take: a tenth of a second, for time is up


def summed_up(plan: Plan, tally: Tally) -> tuple[dict[str, object], tuple[Diagnostic, ...]]:
    """What a scene file says of an exact sampler's run, and what the user is warned of."""
    problem, account = plan.problem, plan.account(tally)
    missing = sorted(set(range(problem.cells.count)).difference(plan.reached))
    warnings = _unreached(problem, missing, problem.possible - plan.ruled_out, account.tried, len(tally.strays))
    return _info(problem, account.info, len(missing)), (*problem.request.warnings, *warnings, *account.warnings)


def fell_short(plan: Plan, tally: Tally) -> Diagnostic | None:
    """Why a run of an exact sampler has fewer scenes than wanted; None where it has them all."""
    if tally.scenes >= plan.wanted:
        return None
    tried = plan.account(tally).tried
    return shortfall(plan.problem, tally.found, tried, *plan.misses(), rarest=tally.scarcest)


def finish(
    problem: Problem,
    collector: Collector,
    info: Mapping[str, object],
    tried: str,
    rows: Array,
    phi: Array,
    done: bool,
) -> Sampled:
    """What a proposer's run hands out. `rows` (3N, B) and `phi` (L, B) are its last misses; `done` says that nothing
    lacks."""
    found, missing = collector.found, collector.unreached
    warnings = _unreached(problem, missing, collector.possible, tried) if found else ()
    why = None
    if not done and found >= problem.request.n:
        why = too_early(problem, tried, len(collector.undecided), keep=True)
    elif not done:
        lacking = collector.deficits(hopeful=True) or collector.deficits()
        rarest = max(lacking, key=lambda cell: lacking[cell], default=None)
        why = shortfall(problem, found, tried, rows, phi, rarest=rarest)
    kept, values = collector.scenes() if found else (rows[:, :0], phi[:, :0])
    return Sampled(kept, values, _info(problem, info, len(missing)), (*problem.request.warnings, *warnings), why)


def _info(problem: Problem, info: Mapping[str, object], missing: int) -> dict[str, object]:
    held = problem.request.fixed
    fix: dict[str, object] = {"fix": {name: list(pose) for name, pose in held.items()}} if held else {}
    count = problem.cells.count
    return {**info, **fix, "cells": {"asked": count, "reached": count - missing}}


def _unreached(
    problem: Problem, missing: Sequence[int], possible: Set[int], tried: str, strays: int = 0
) -> tuple[Diagnostic, ...]:
    """A warning that names the cells that get no scenes; `tried` says how hard it was tried, `strays` in how many of
    them scenes were met all the same, too late to share in."""
    if not missing:
        return ()
    cells = problem.cells
    shown = "; ".join(cells.describe(cell) for cell in missing[:3])
    more = f" and {len(missing) - 3} more" if len(missing) > 3 else ""
    ruled_out = sum(cell not in possible for cell in missing)
    note = f"; interval bounds rule out {ruled_out} of them" if ruled_out else ""
    note += f"; a scene was met in {strays} of them, too late to share in" if strays else ""
    title = f"{len(missing)} of {cells.count} cells of the range were not reached in {tried}"
    help_ = "the scenes are spread over the others"
    return (Diagnostic(title, help=help_, note=f"{shown}{more}{note}", severity="warning"),)


def _percent(share: float) -> str:
    """A share for people: one that is not whole is never rounded to 100 %."""
    return "over 99.9%" if 0.999 < share < 1.0 else f"{share:.1%}"


def too_early(problem: Problem, tried: str, undecided: int, *, keep: bool = False) -> Diagnostic:
    """Time was up before it was known which cells get scenes; `undecided` of them are open. `keep`: there are scenes,
    which can be had all the same."""
    title = f"time was up after {tried}, too early to tell which parts of the range can be reached"
    note = f"nothing was found yet in {undecided} of {problem.cells.count} cells"
    keeping = ", or save what there is with --keep-partial" if keep else ""
    help_ = f"give it more time with --timeout, {'' if keep else 'or '}ask for `--spread base`{keeping}"
    return Diagnostic(title, help=help_, note=note)


def _shown(problem: Problem) -> int:
    return max(16, min(SHOWN, int(LOOK / max(1.0, per_scene(problem.core.nodes)[0]))))


def shortfall(
    problem: Problem, found: int, tried: str, rows: Array, phi: Array, *, rarest: int | None = None
) -> Diagnostic:
    """Why fewer scenes than wanted were found, judged by the last candidates: rows (3N, B), phi (L, B). `rarest` is the
    cell that lacks most."""
    title = f"found {f'{found:,}' if found else 'none'} of {problem.request.n:,} scenes in {tried}"
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
        note = "" if rarest is None else f"{problem.cells.describe(rarest)} is the rarest part of the range"
        return Diagnostic(title, help=f"ask for `--spread base`, or a narrower range; or {remedy}", note=note)
    label = int(out.mean(axis=1).argmax())
    name, share = tuple(problem.core.labels)[label], out[label].mean()
    wanted = Range(0.0) if name == REQUIRE else problem.request.ranges[name]
    failing = rows[:, out[label]][:, : _shown(problem)]
    atom_index, count = next(iter(deciding_atoms(problem.core, failing, name).items()))
    atom = problem.core.nodes[atom_index]
    assert isinstance(atom, Atom)
    note = f"phi of `{name}` was outside `{wanted}` in {_percent(share)} of the last {phi.shape[1]:,} candidates"
    if name == REQUIRE:  # no range helps where it is the spec that leaves no space
        remedy = "require less, or make the workspace larger; or give it more time with --timeout"
        remedy += ", or save what there is with --keep-partial" if found else ""
    label_text = f"decides phi in {count / failing.shape[1]:.0%} of those that fail"
    return Diagnostic(title, atom.spans[0] if atom.spans else None, f"`{atom.text}` {label_text}", remedy, note=note)
