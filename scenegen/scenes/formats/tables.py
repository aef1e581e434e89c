"""Tables of numbers that other programs wrote, scenes or motions: CSV, JSON Lines and Parquet without a header of ours.

Only columns that are asked for are looked at: what else a file holds may be text, or nothing at all. In a file of
motions a row is a moment: `t` in seconds, and `mug.x`, `mug.y`, `mug.theta` of every object, in metres and radians. A
column `motion` tells several motions apart. Motion files of `scenegen sample` are read, too.
"""

from __future__ import annotations

import functools
import io
import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from scenegen.arrays import Array
from scenegen.errors import DataError, Diagnostic
from scenegen.errors.diagnostic import Kind
from scenegen.errors.files import NOT_A_TRAJECTORY, TABLE_CELL, TRAJECTORY_TIMES
from scenegen.geometry.workspace import Workspace
from scenegen.lang.tables import MAX_TABLE_BYTES, Table, csv_cells
from scenegen.needs import need
from scenegen.pose import NAMES, THETA, TWO_PI
from scenegen.scenes.arrange import doubts
from scenegen.scenes.files import ending_of, read_bytes
from scenegen.scenes.formats.registry import is_motions, read_motions

TABLE_ENDINGS = (".csv", ".jsonl", ".parquet")
MARK_BYTES = 1 << 16  # bytes within which a file of scenegen says that it is one
OWN_FORMAT = re.compile(rb'"format"\s*:\s*"scenegen/')


def read_table(path: Path, what: str, wrong: Kind) -> Table:
    """The table in a file with one of `ENDINGS`; `what` is the file's role. Raises DataError, and RequestError where a
    library is missing."""
    ending = ending_of(path)
    data = read_bytes(path, what, limit=MAX_TABLE_BYTES)
    if ending == ".parquet":
        return _parquet(path, data, wrong)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise DataError(wrong(file=path, reason="it is not a text in UTF-8")) from None
    names, cells, count = csv_cells(path, text, wrong) if ending == ".csv" else _json_lines(path, text, wrong)
    if not count:
        raise DataError(wrong(file=path, reason="it has no rows"))
    return Table(str(path), wrong, names, functools.cache(cells), 0, count)


def _json_lines(path: Path, text: str, wrong: Kind) -> tuple[tuple[str, ...], Callable[[str], Any], int]:
    rows: list[dict[str, Any]] = []
    for number, line in enumerate((line for line in io.StringIO(text, newline=None) if line.strip()), 1):
        try:
            said: Any = json.loads(line)
        except (ValueError, RecursionError):
            raise DataError(wrong(file=path, reason=f"row {number} is not JSON")) from None
        if not isinstance(said, dict):
            raise DataError(wrong(file=path, reason=f"row {number} is not an object with columns"))
        rows.append(said)
    names = dict.fromkeys(name for row in rows for name in row)
    return tuple(names), lambda name: [row.get(name) for row in rows], len(rows)


def is_plain(path: Path) -> bool:
    """Whether a file can hold no more than poses: without a header that says of what; False where it cannot be read."""
    ending = ending_of(path)
    try:
        if ending == ".parquet":
            import pyarrow as pa
            import pyarrow.parquet as pq

            try:
                return b"scenegen" not in (pq.read_metadata(path).metadata or {})
            except (pa.ArrowException, OSError, ValueError):
                return False
        if ending in (".json", ".jsonl"):
            with path.open("rb") as file:
                return OWN_FORMAT.search(file.read(MARK_BYTES)) is None
    except (OSError, ModuleNotFoundError):
        return False
    return ending == ".csv"


def _parquet(path: Path, data: bytes, wrong: Kind) -> Table:
    need("pyarrow", "for .parquet files")
    import pyarrow as pa
    import pyarrow.parquet as pq

    from scenegen.scenes.formats.parquet import check_rows, is_number, open_parquet, report_pyarrow_errors

    def damage(said: str) -> Diagnostic:
        return wrong(file=path, reason=said)

    with report_pyarrow_errors(damage):
        parquet = open_parquet(path, io.BytesIO(data))
        check_rows(path, parquet, 1)
        schema = parquet.schema_arrow
    if not parquet.metadata.num_rows:
        raise DataError(wrong(file=path, reason="it has no rows"))

    read: list[str] = []  # columns, which are kept

    def cells(name: str) -> Any:
        kind = schema.field(name).type
        kind = kind.value_type if pa.types.is_dictionary(kind) else kind
        text = pa.types.is_string(kind) or pa.types.is_large_string(kind) or pa.types.is_string_view(kind)
        other = pa.types.is_decimal(kind) or pa.types.is_null(kind)
        if not (text or other or is_number(kind)):
            raise DataError(TABLE_CELL(file=path, row=1, name=name, value=str(kind)))
        read.append(name)
        check_rows(path, parquet, len(read))
        with report_pyarrow_errors(damage):
            if not text:
                column = parquet.read(columns=[name], use_threads=False).column(0)
                return column.to_pylist() if other else column.to_numpy()
            # a long text that stands in every row is in memory once
            texts = pq.ParquetFile(io.BytesIO(data), read_dictionary=[name], page_checksum_verification=True)
            column = texts.read(columns=[name], use_threads=False).column(0)
            return [cell for chunk in column.chunks for cell in _texts(chunk)]

    return Table(str(path), wrong, tuple(schema.names), functools.cache(cells), 0, parquet.metadata.num_rows)


def _texts(chunk: Any) -> Iterator[str | None]:
    """The texts of a column that is stored as numbers of a list of texts."""
    known = chunk.dictionary.to_pylist()
    return (None if number is None else known[number] for number in chunk.indices.to_pylist())


MOTION, TIME = "motion", "t"
TIME_TOLERANCE = 1e-6  # of a step: how far a row's time may be from its moment's


def read_tables(path: Path) -> list[Table]:
    """The motions of a file, each with its columns. Raises DataError, and RequestError where a library is missing."""
    if is_motions(path):
        return _of_motions(path)
    if ending_of(path) not in TABLE_ENDINGS:
        raise DataError(NOT_A_TRAJECTORY(file=path, reason=f"its ending is not one of {', '.join(TABLE_ENDINGS)}"))
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
    start = float(at[0]) if at[0] > TIME_TOLERANCE * times[min(1, len(times) - 1)] else 0.0
    at = at - start
    if resample:
        if at[-1] < times[-1] - TIME_TOLERANCE * max(1.0, times[-1]) - rounding:
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
    wrong = np.flatnonzero(np.abs(at[:common] - times[:common]) > TIME_TOLERANCE * step + rounding)
    if len(wrong):
        row = int(wrong[0])
        raise DataError(TRAJECTORY_TIMES(file=file, row=table.start + row + 1, found=at[row], wanted=times[row]))
    if len(at) < len(times):
        raise DataError(TRAJECTORY_TIMES(file=file, first=at[0], last=at[-1], end=times[-1]))
    if len(at) > len(times):
        raise DataError(TRAJECTORY_TIMES(file=file, rows=len(at), moments=len(times)))
