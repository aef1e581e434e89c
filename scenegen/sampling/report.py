"""Reports for cells that were not reached and for requests with too few scenes."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence, Set
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from scenegen.arrays import Array
from scenegen.errors import Diagnostic
from scenegen.errors.requests import (
    NO_TIME_TO_TELL,
    PROPOSALS_NOT_NUMBERS,
    TOO_FEW_IN_CELL,
    TOO_FEW_IN_RANGE,
    TOO_FEW_MEET_REQUIREMENT,
    TOO_FEW_MOTIONS,
    UNREACHED_CELLS,
)
from scenegen.lang.formula.core import REQUIRE, Atom
from scenegen.lang.formula.interpret import deciding_atoms
from scenegen.sampling.plan import Plan, Tally
from scenegen.sampling.problem import Problem
from scenegen.sampling.request import Range
from scenegen.search.effort import work_per_scene

BLAME_SCENES = 4096  # candidates scored to find out which atom fails most
BLAME_WORK = 1 << 22  # maximum work (see search.effort) for this: a tenth of a second, because time is up


def run_info(plan: Plan, tally: Tally) -> tuple[dict[str, object], tuple[Diagnostic, ...]]:
    """What a scene file says about a run, and the warnings for the user."""
    problem, account = plan.problem, plan.account(tally)
    info, warnings = dict(account.info), problem.warnings
    if plan.is_verified:
        count = problem.cells.count
        missing = sorted(set(range(count)).difference(plan.reached_cells))
        if not problem.over_time:
            possible = (problem.possible | problem.improbable) - plan.ruled_out
            warnings += _unreached_warnings(problem, missing, possible, account.tried, len(tally.strays))
            if problem.fixed_poses:
                info["fix"] = {name: list(pose) for name, pose in problem.fixed_poses.items()}
        info["cells"] = {"asked": count, "reached": count - len(missing)}
    if plan.why is not None:
        info |= {"auto": True, "reason": plan.why}
    return info, (*warnings, *account.warnings)


def too_few_motions(found: int, wanted: int, time_is_up: bool) -> Diagnostic:
    """Why fewer motions than requested were found."""
    reason = "time is up" if time_is_up else "the search did not reach the range"
    return TOO_FEW_MOTIONS(found=found, wanted=wanted, reason=reason)


def shortfall_of_run(plan: Plan, tally: Tally, time_is_up: bool) -> Diagnostic | None:
    """Why a run has fewer scenes than requested; None if it has all."""
    if tally.scenes >= plan.scenes_wanted:
        return None
    if plan.problem.over_time:
        return too_few_motions(tally.found, plan.scenes_wanted, time_is_up)
    account = plan.account(tally)
    blamed, rarest = plan.shortfall_of(tally)
    problem = blamed.problem
    if blamed is not plan:  # of a part; what is missing is missing from the whole
        problem = replace(problem, request=replace(problem.request, n=plan.scenes_wanted))
    why = shortfall(problem, tally.found, account.tried, *blamed.misses(), rarest=rarest)
    return why.but(refused=account.note or tally.cut)


def _unreached_warnings(
    problem: Problem, missing: Sequence[int], possible: Set[int], tried: str, strays: int = 0
) -> tuple[Diagnostic, ...]:
    """A warning that names the cells that get no scenes; `tried` says how long the search was, `strays` in how many of
    them scenes were found later, too late for them to get a share."""
    if not missing:
        return ()
    cells = problem.cells
    shown = "; ".join(cells.describe(cell) for cell in missing[:3])
    return (
        UNREACHED_CELLS(
            missing=len(missing),
            count=cells.count,
            tried=tried,
            shown=shown,
            more=len(missing) - 3 if len(missing) > 3 else None,
            ruled_out=sum(cell not in possible for cell in missing) or None,
            strays=strays or None,
        ),
    )


def _percent(share: float) -> str:
    """A share as text; anything below the whole is never rounded to 100 %."""
    return "over 99.9%" if 0.999 < share < 1.0 else f"{share:.1%}"


def too_early(problem: Problem, tried: str, undecided: int) -> Diagnostic:
    """The error if time is up before it is known which cells get scenes; `undecided` of them are open."""
    return NO_TIME_TO_TELL(tried=tried, undecided=undecided, cells=_cell_count(problem))


def _cell_count(problem: Problem) -> int | None:
    """How many cells the scenes are spread over; None if there is nothing to spread them over."""
    return problem.cells.count if problem.cells.count > 1 else None


def _blame_scenes(problem: Problem) -> int:
    return max(16, min(BLAME_SCENES, int(BLAME_WORK / max(1.0, work_per_scene(problem.core.nodes)[0]))))


def shortfall(
    problem: Problem, found: int, tried: str, rows: Array, phi: Array, *, rarest: int | None = None
) -> Diagnostic:
    """Why fewer scenes than requested were found, according to the last candidates: rows (3N, B), phi (L, B). `rarest`
    is the cell that lacks most scenes."""
    facts: dict[str, Any] = {"found": found or None, "n": problem.request.n, "tried": tried}
    usable = ~np.isnan(phi).any(axis=0)
    if phi.shape[1] and not usable.any():
        return PROPOSALS_NOT_NUMBERS(**facts, candidates=phi.shape[1])
    rows, phi = rows[:, usable], phi[:, usable]
    low, high = problem.cells.low[:, None], problem.cells.high[:, None]
    out = (phi < low) | (phi > high)
    if not out.any():
        several = _cell_count(problem)
        named = None if rarest is None or several is None else problem.cells.describe(rarest)
        return TOO_FEW_IN_CELL(**facts, cells=several, rarest=named)
    label = int(out.mean(axis=1).argmax())
    name, share = tuple(problem.core.labels)[label], out[label].mean()
    wanted = Range(0.0) if name == REQUIRE else problem.request.phi[name]
    failing = rows[:, out[label]][:, : _blame_scenes(problem)]
    atom_index, count = next(iter(deciding_atoms(problem.core, failing, name).items()))
    atom = problem.core.nodes[atom_index]
    assert isinstance(atom, Atom)
    # no other range helps if the requirement leaves no space
    kind = TOO_FEW_MEET_REQUIREMENT if name == REQUIRE else TOO_FEW_IN_RANGE
    facts |= {"label": name, "range": wanted, "share": _percent(share), "candidates": phi.shape[1]}
    facts |= {"atom": atom.text, "deciding": count / failing.shape[1]}
    return kind(atom.spans[0] if atom.spans else None, **facts)


# Student's t for 95 % by degrees of freedom, two-sided; beyond the table the normal's value is near enough.
_STUDENT = (12.71, 4.30, 3.18, 2.78, 2.57, 2.45, 2.36, 2.31, 2.26, 2.23, 2.20, 2.18, 2.16, 2.14, 2.13)


@dataclass(frozen=True, slots=True)
class Estimate:
    """log10 of a probability, and half of its 95 % interval, in the same units."""

    log10: float
    error: float


def student_quantile(degrees: int) -> float:
    """The quantile of Student's t that leaves 2.5 % on either side, for so many degrees of freedom (at least 1)."""
    return _STUDENT[degrees - 1] if degrees <= len(_STUDENT) else 1.96 + 2.5 / degrees


def hits_info(hits: float, drawn: float, log_share: float = 0.0) -> dict[str, object]:
    """log10 of the probability that `hits` of `drawn` independent draws tell, and half of its 95 % interval, as a file
    says them; None if unknown. `log_share`, a natural logarithm, is added to that of the share."""
    if not hits:
        return {"log10_probability": None, "log10_error": None}
    kept, log10 = hits / drawn, math.log10(math.e)
    return {
        "log10_probability": round(log_share * log10 + math.log10(kept), 6) + 0.0,
        "log10_error": round(1.96 * log10 * math.sqrt((1.0 - kept) / hits), 6),
    }


def ratio(mine: Array, base: Array) -> Estimate | None:
    """The ratio of the means of two sets of estimates, (B,) each, entry b of both from independent run b; None if it is
    0.

    An estimate that is a product over many levels is nearly lognormal (Berard, Del Moral and Doucet 2014), and skewed:
    most runs are below the mean, and if all are, their standard deviation is too small as well. So the variance of the
    mean is computed from the scatter of the logarithms, which does not depend on how large the mean came out. Where a
    run found nothing there is no logarithm, and the ratio is linearised instead (Cochran 1977, 6.4).
    """
    value = float(mine.sum() / base.sum()) if base.sum() > 0.0 else 0.0
    if not value > 0.0:
        return None
    count = len(mine)
    if (mine > 0.0).all():
        log = np.log(np.stack([mine, base]))
        covariance = np.cov(log)
        # of X / E X and Y / E Y for lognormal X and Y; 0 where both are the same
        variance = float(np.exp(covariance[0, 0]) + np.exp(covariance[1, 1]) - 2.0 * np.exp(covariance[0, 1]))
    else:
        variance = float(((mine - value * base) / mine.mean()).var(ddof=1))
    error = student_quantile(count - 1) * math.sqrt(max(0.0, variance) / count)
    return Estimate(math.log10(value), error / math.log(10.0))


def probability_info(
    count: int, total: float, square: float, logs: tuple[float, float] | None = None, excess: float = 0.0
) -> dict[str, object]:
    """log10 of the mean of independent unbiased estimates, given their number, sum and sum of squares, and the
    half-width of its 95 % interval (Student's t, converted to the logarithm); None if unknown.

    `logs` are the sum of the natural logarithms and that of their squares, where no estimate is 0: the interval is then
    that of nearly lognormal estimates, see `ratio`. `excess` is added to the logarithm of the mean. Of estimates whose
    squares are too small for a float, only the logarithms tell how much they scatter.
    """
    if not total > 0.0:
        return {"log10_probability": None, "log10_error": None}
    mean = total / count
    log10 = math.log10(mean) + excess / math.log(10.0)
    out: dict[str, object] = {"log10_probability": round(log10, 5) + 0.0, "log10_error": None}
    digits = mean**2 > sys.float_info.min  # the square of a smaller mean has none
    if count > 1 and (digits or logs is not None):
        variance = max(0.0, square - count * mean * mean) / (count - 1) / mean**2 if digits else 0.0
        if logs is not None:
            scatter = max(0.0, logs[1] - logs[0] ** 2 / count) / (count - 1)
            widest = scatter + 0.5 * scatter**2 * count / (count - 1)  # of a wild scatter: Cox's interval
            variance = max(variance, math.expm1(scatter) if scatter < 1.0 else widest)
        out["log10_error"] = round(student_quantile(count - 1) * math.sqrt(variance / count) / math.log(10.0), 5)
    return out
