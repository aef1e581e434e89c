"""Trajectories: poses over time, from simulators and trackers. Read from CSV, JSON Lines and Parquet.

A row is a moment: `t` in seconds, and `mug.x`, `mug.y`, `mug.theta` of every object, in metres and radians. A column
`motion` tells several motions of a file apart. Motion files of `scenegen sample` are read, too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from scenegen.errors import DataError, Diagnostic
from scenegen.errors.time import NOT_A_TRAJECTORY, TRAJECTORY_TIMES
from scenegen.geometry.workspace import Workspace
from scenegen.pose import NAMES, THETA, TWO_PI
from scenegen.scenes.formats.plain import ENDINGS, Table, doubts, read_table
from scenegen.scenes.formats.registry import is_motions, read_motions

Array = npt.NDArray[np.float64]

MOTION, TIME = "motion", "t"
NEARLY = 1e-6  # of a step: how far a row's time may be from its moment's


def read_tables(path: Path) -> list[Table]:
    """The motions of a file, each with its columns. Raises DataError, and RequestError where a library is missing."""
    if is_motions(path):
        return _of_motions(path)
    if path.suffix.lower() not in ENDINGS:
        raise DataError(NOT_A_TRAJECTORY(file=path, reason=f"its ending is not one of {', '.join(ENDINGS)}"))
    table = read_table(path, "a trajectory", NOT_A_TRAJECTORY)
    if MOTION not in table.names:
        return [table]
    numbers = table.column(MOTION)
    starts = [0, *(np.flatnonzero(np.diff(numbers)) + 1).tolist()]
    if len(set(numbers[starts].tolist())) != len(starts):
        raise DataError(NOT_A_TRAJECTORY(file=path, reason="rows of one motion are not together"))
    if (numbers != np.round(numbers)).any():
        raise DataError(NOT_A_TRAJECTORY(file=path, reason="the column `motion` has values that are not whole"))
    ends = [*starts[1:], len(numbers)]
    return [table.part(start, end, int(numbers[start])) for start, end in zip(starts, ends, strict=True)]


def _of_motions(path: Path) -> list[Table]:
    """Motions that scenegen wrote: their poses."""
    found = read_motions(path)
    if not len(found):
        raise DataError(NOT_A_TRAJECTORY(file=path, reason="it has no motions"))
    times = np.arange(found.poses.shape[1], dtype=np.float64) * found.header.time.dt
    places = [f"{name}.{symbol}" for name in found.objects for symbol in NAMES]
    columns = (
        {TIME: times, **dict(zip(places, poses.reshape(len(times), -1).T, strict=True))} for poses in found.poses
    )
    return [
        Table(str(path), NOT_A_TRAJECTORY, tuple(each), each.__getitem__, 0, len(times), number)
        for number, each in enumerate(columns, 1)
    ]


def motion(
    table: Table,
    objects: Sequence[str],
    held: Mapping[int, Sequence[float]],
    times: Array,
    workspace: Workspace,
    resample: bool = False,
) -> tuple[Array, list[str], float, list[Diagnostic]]:
    """The poses at the times of the moments, (T + 1, N, 3), the columns that are not needed, the time that counts as 0:
    that of the first row, if it is later than 0 (trackers write seconds since 1970), and warnings.

    Columns of objects in `held` (their poses by index) can be missing. With `resample`, poses are interpolated in a
    straight line, headings the shorter way. Raises DataError for columns that are missing, and for other times.
    """
    at, used = table.column(TIME), {TIME, MOTION}
    backwards = np.flatnonzero(np.diff(at) <= 0.0)
    if len(backwards):
        row = int(backwards[0]) + 1
        where = table.start + row + 1
        raise DataError(TRAJECTORY_TIMES(file=table.file, row=where, time=at[row], before=at[row - 1]))
    rounding = 2.0 * float(np.spacing(np.abs(at).max()))
    start = float(at[0]) if at[0] > NEARLY * times[min(1, len(times) - 1)] else 0.0
    at = at - start
    if resample:
        if at[-1] < times[-1] - NEARLY * max(1.0, times[-1]) - rounding:
            raise DataError(TRAJECTORY_TIMES(file=table.file, first=at[0], last=at[-1], end=times[-1]))
    else:
        _check_times(table, at, times, rounding)
    poses = np.empty((len(times), len(objects), len(NAMES)))
    given: list[tuple[str, Array]] = []
    for index, name in enumerate(objects):
        for axis, symbol in enumerate(NAMES):
            column = f"{name}.{symbol}"
            if index in held and column not in table.names:
                poses[:, index, axis] = held[index][axis]
                continue
            values = table.column(column)
            used.add(column)
            given.append((column, values))
            if resample:
                values = np.interp(times, at, np.unwrap(values) if axis == THETA else values)
            poses[:, index, axis] = np.mod(values, TWO_PI) if axis == THETA else values
    unused = sorted(name for name in table.names if name and name not in used)
    return poses, unused, start, doubts(table.file, given, workspace, table.start + 1)


def _check_times(table: Table, at: Array, times: Array, rounding: float) -> None:
    file = table.file
    step = times[1] - times[0]
    common = min(len(at), len(times))
    wrong = np.flatnonzero(np.abs(at[:common] - times[:common]) > NEARLY * step + rounding)
    if len(wrong):
        row = int(wrong[0])
        raise DataError(TRAJECTORY_TIMES(file=file, row=table.start + row + 1, found=at[row], wanted=times[row]))
    if len(at) < len(times):
        raise DataError(TRAJECTORY_TIMES(file=file, first=at[0], last=at[-1], end=times[-1]))
    if len(at) > len(times):
        raise DataError(TRAJECTORY_TIMES(file=file, rows=len(at), moments=len(times)))
