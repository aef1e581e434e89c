"""Monitoring: phi of trajectories that were recorded elsewhere."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from scenegen.api.spec import Spec, check_spec
from scenegen.errors import DataError, Diagnostic, RequestError
from scenegen.errors.files import HELD_ELSEWHERE, TABLE_UNUSED
from scenegen.errors.temporal import NOT_OVER_TIME, TRAJECTORY_START
from scenegen.formats.trajectories import motion, read_tables
from scenegen.lang.moments import Scored, score
from scenegen.lang.timed import Timed
from scenegen.pose import as_rows
from scenegen.training.datasets.arrange import held, held_elsewhere
from scenegen.validation import as_path


def read_trajectories(
    spec: Spec, path: str | Path, *, resample: bool = False
) -> tuple[dict[int | None, npt.NDArray[np.float64]], list[Diagnostic]]:
    """The poses of a file's trajectories at the moments of a spec over time, by the number that the file gives them
    (None in a file of one that does not say), (T + 1, N, 3) each; and notes about what was left out.

    CSV, JSON Lines or Parquet: `t` in seconds, `mug.x`, `mug.y`, `mug.theta`, ... in metres and radians, one row a
    moment; `motion` numbers several motions of a file. Times may count from any moment, that of the first row. Or a
    file of motions that scenegen wrote. With `resample`, rows
    at other times are interpolated. Raises RequestError for a spec without `time`, and DataError for what is no such
    file, and where an object that the spec holds stands elsewhere.
    """
    check_spec(spec)
    path = as_path("path", path)
    timed = _timed(spec)
    horizon = timed.horizon
    times = np.arange(horizon.moments, dtype=np.float64) * np.float64(horizon.dt)
    found: dict[int | None, npt.NDArray[np.float64]] = {}
    left_out: list[str] = []
    starts: list[float] = []
    warnings: list[Diagnostic] = []
    for table in read_tables(path):
        found[table.number], left_out, start, doubts = motion(
            table, timed.objects, spec.declared.fixed, times, spec.declared.workspace, resample
        )
        starts.append(start)
        warnings = warnings or doubts
        moved = held_elsewhere(spec.declared, as_rows(found[table.number]))
        if moved is not None:
            place = f"at moment {moved[1]}" + (f" of motion {table.number}" if table.number is not None else "")
            raise DataError(HELD_ELSEWHERE(**held(spec.declared, moved[0]), place=f"{place} in {path}"))
    notes = warnings + ([TABLE_UNUSED(file=path, columns=left_out)] if left_out else [])
    return found, notes + ([TRAJECTORY_START(file=path, start=max(starts))] if any(starts) else [])


def score_trajectory(spec: Spec, poses: npt.NDArray[np.float64]) -> Scored:
    """phi of one motion, (T + 1, N, 3), at every moment, and what decides it; in numpy, float64."""
    return score(_timed(spec), poses)


def _timed(spec: Spec) -> Timed:
    if spec.over_time is None:
        raise RequestError(NOT_OVER_TIME(file=spec.declared.name))
    return spec.over_time
