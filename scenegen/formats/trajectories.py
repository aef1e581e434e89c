"""Trajectories: poses over time, from simulators and trackers. Read from CSV, JSON Lines and Parquet.

A row is a moment: `t` in seconds, and `mug.x`, `mug.y`, `mug.theta` of every object, in metres and radians. A column
`motion` tells several motions of a file apart. Motion files of `scenegen sample` are read, too.
"""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from scenegen.errors import DataError
from scenegen.errors.temporal import (
    NOT_A_TRAJECTORY,
    TRAJECTORY_CELL,
    TRAJECTORY_COLUMN,
    TRAJECTORY_ENDS,
    TRAJECTORY_ORDER,
    TRAJECTORY_ROW,
    TRAJECTORY_TIMES,
    TRAJECTORY_TOO_LONG,
)
from scenegen.formats.files import read_bytes
from scenegen.formats.motions.table import is_motions, read_motions
from scenegen.needs import need
from scenegen.pose import NAMES, THETA, TWO_PI

Array = npt.NDArray[np.float64]

MOTION = "motion"
ENDINGS = (".csv", ".jsonl", ".parquet")
MAX_BYTES = 1 << 30
NEARLY = 1e-6  # of a step: how far a row's time may be from its moment's


class Table(NamedTuple):
    """Columns of numbers by name, all of one length. Of a file of several motions it is one, with the number that the
    file gives it; `before` rows stand above it."""

    file: str
    columns: dict[str, Array]
    number: int | None = None
    before: int = 0


def read_tables(path: Path) -> list[Table]:
    """The motions of a file, each with its columns. Raises DataError, and RequestError where a library is missing."""
    if is_motions(path):
        return _of_motions(path)
    table = read_table(path)
    if MOTION not in table.columns:
        return [table]
    numbers = table.columns[MOTION]
    starts = [0, *(np.flatnonzero(np.diff(numbers)) + 1).tolist()]
    if len(set(numbers[starts].tolist())) != len(starts):
        raise DataError(NOT_A_TRAJECTORY(file=path, reason="rows of one motion are not together"))
    if (numbers != np.round(numbers)).any():
        raise DataError(NOT_A_TRAJECTORY(file=path, reason="the column `motion` has values that are not whole"))
    ends = [*starts[1:], len(numbers)]
    return [
        Table(
            table.file,
            {name: column[start:end] for name, column in table.columns.items() if name != MOTION},
            int(numbers[start]),
            start,
        )
        for start, end in zip(starts, ends, strict=True)
    ]


def _of_motions(path: Path) -> list[Table]:
    """Motions that scenegen wrote: their poses."""
    found = read_motions(path)
    if not len(found):
        raise DataError(NOT_A_TRAJECTORY(file=path, reason="it has no motions"))
    times = np.arange(found.poses.shape[1], dtype=np.float64) * found.header.time.dt
    places = [f"{name}.{symbol}" for name in found.objects for symbol in NAMES]
    return [
        Table(str(path), {"t": times, **dict(zip(places, poses.reshape(len(times), -1).T, strict=True))}, number)
        for number, poses in enumerate(found.poses, 1)
    ]


def read_table(path: Path) -> Table:
    """The columns of a file of trajectories. Raises DataError."""
    if path.suffix not in ENDINGS:
        raise DataError(NOT_A_TRAJECTORY(file=path, reason=f"its ending is not one of {', '.join(ENDINGS)}"))
    data = read_bytes(path, "a trajectory", limit=MAX_BYTES)
    if path.suffix == ".parquet":
        return _parquet(path, data)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise DataError(NOT_A_TRAJECTORY(file=path, reason="it is not a text in UTF-8")) from None
    rows = _csv(path, text) if path.suffix == ".csv" else _json_lines(path, text)
    if not rows:
        raise DataError(NOT_A_TRAJECTORY(file=path, reason="it has no rows"))
    names = list(rows[0])
    columns = {name: np.array([row[name] for row in rows], dtype=np.float64) for name in names}
    return Table(str(path), columns)


def motion(
    table: Table,
    objects: Sequence[str],
    held: Mapping[int, Sequence[float]],
    times: Array,
    resample: bool = False,
) -> tuple[Array, list[str]]:
    """The poses at the times of the moments, (T + 1, N, 3), and the columns that are not needed.

    Columns of objects in `held` (their poses by index) can be missing. With `resample`, poses are interpolated in a
    straight line, headings the shorter way. Raises DataError for columns that are missing, and for other times.
    """
    columns = dict(table.columns)
    at = _column(table, columns, "t")
    backwards = np.flatnonzero(np.diff(at) <= 0.0)
    if len(backwards):
        row = int(backwards[0]) + 1
        where = table.before + row + 1
        raise DataError(TRAJECTORY_ORDER(file=table.file, row=where, time=at[row], before=at[row - 1]))
    if resample:
        if at[0] > times[0] + NEARLY or at[-1] < times[-1] - NEARLY * max(1.0, times[-1]):
            raise DataError(TRAJECTORY_ENDS(file=table.file, first=at[0], last=at[-1], end=times[-1]))
    else:
        _check_times(table, at, times)
    poses = np.empty((len(times), len(objects), len(NAMES)))
    for index, name in enumerate(objects):
        for axis, symbol in enumerate(NAMES):
            column = f"{name}.{symbol}"
            if index in held and column not in columns:
                poses[:, index, axis] = held[index][axis]
                continue
            values = _column(table, columns, column)
            if resample:
                values = np.interp(times, at, np.unwrap(values) if axis == THETA else values)
            poses[:, index, axis] = np.mod(values, TWO_PI) if axis == THETA else values
    return poses, sorted(columns)


def _column(table: Table, left: dict[str, Array], name: str) -> Array:
    if name not in left:
        raise DataError(TRAJECTORY_COLUMN(file=table.file, name=name, known=sorted(table.columns)))
    return left.pop(name)


def _check_times(table: Table, at: Array, times: Array) -> None:
    file = table.file
    step = times[1] - times[0]
    common = min(len(at), len(times))
    wrong = np.flatnonzero(np.abs(at[:common] - times[:common]) > NEARLY * step)
    if len(wrong):
        row = int(wrong[0])
        raise DataError(TRAJECTORY_TIMES(file=file, row=table.before + row + 1, found=at[row], wanted=times[row]))
    if len(at) < len(times):
        raise DataError(TRAJECTORY_ENDS(file=file, first=at[0], last=at[-1], end=times[-1]))
    if len(at) > len(times):
        raise DataError(TRAJECTORY_TOO_LONG(file=file, rows=len(at), moments=len(times)))


def _csv(path: Path, text: str) -> list[dict[str, float]]:
    try:
        lines = [line for line in csv.reader(io.StringIO(text), strict=True) if line]
    except csv.Error as error:
        raise DataError(NOT_A_TRAJECTORY(file=path, reason=str(error))) from None
    names = [name.strip() for name in lines[0]] if lines else []
    if len(set(names)) != len(names):
        raise DataError(NOT_A_TRAJECTORY(file=path, reason="two columns have one name"))
    rows = []
    for number, line in enumerate(lines[1:], 1):
        if len(line) != len(names):
            raise DataError(TRAJECTORY_ROW(file=path, row=number, given=len(line), wanted=len(names)))
        rows.append({name: _number(path, number, name, cell) for name, cell in zip(names, line, strict=True)})
    return rows


def _json_lines(path: Path, text: str) -> list[dict[str, float]]:
    rows: list[dict[str, float]] = []
    for number, line in enumerate((line for line in text.splitlines() if line.strip()), 1):
        try:
            said: Any = json.loads(line)
        except (ValueError, RecursionError):
            raise DataError(NOT_A_TRAJECTORY(file=path, reason=f"row {number} is not JSON")) from None
        if not isinstance(said, dict):
            raise DataError(NOT_A_TRAJECTORY(file=path, reason=f"row {number} is not an object with columns"))
        row = {name: _number(path, number, name, cell) for name, cell in said.items()}
        if rows and row.keys() != rows[0].keys():
            raise DataError(TRAJECTORY_ROW(file=path, row=number, given=len(row), wanted=len(rows[0])))
        rows.append(row)
    return rows


def _number(path: Path, row: int, name: str, cell: Any) -> float:
    try:
        value = math.nan if isinstance(cell, bool) or cell is None else float(cell)
    except (TypeError, ValueError, OverflowError):
        value = math.nan
    if not math.isfinite(value):
        shown = cell if isinstance(cell, str) else json.dumps(cell)
        raise DataError(TRAJECTORY_CELL(file=path, row=row, name=name, value=shown[:40]))
    return value


def _parquet(path: Path, data: bytes) -> Table:
    need("pyarrow", "for .parquet files")
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        table = pq.ParquetFile(io.BytesIO(data)).read(use_threads=False)
    except (pa.ArrowException, OSError, ValueError) as error:
        raise DataError(NOT_A_TRAJECTORY(file=path, reason=str(error).splitlines()[0][:100])) from None
    if not table.num_rows or len(set(table.column_names)) != table.num_columns:
        reason = "two columns have one name" if table.num_rows else "it has no rows"
        raise DataError(NOT_A_TRAJECTORY(file=path, reason=reason))
    columns = {}
    for name in table.column_names:
        cells = table.column(name).to_pylist()
        columns[name] = np.array([_number(path, row, name, cell) for row, cell in enumerate(cells, 1)])
    return Table(str(path), columns)
