"""Scenes as Parquet: columns `mug.x`, `mug.y`, `mug.theta`, ..., `phi.task`, the header in the file's metadata.

Needs pyarrow (the extra `parquet`). Row groups have a fixed number of scenes, so the bytes depend on the
scenes, the header and pyarrow's version, not on the sizes of the blocks. Coordinates are nearly random: byte stream
splitting with zstd at level 1 saves an eighth of the space at 0.2 microseconds per scene, dictionaries save nothing.
Every page has a checksum, which is checked when it is read.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from io import RawIOBase
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from scenegen.arrays import Array
from scenegen.errors import DataError, Diagnostic, ScenegenError
from scenegen.errors.declarations import NUMBERS_DISAGREE
from scenegen.errors.files import COLUMN_NOT_A_NUMBER, DAMAGED_PARQUET, NOT_SCENES, TOO_LARGE_TO_READ, WRONG_COLUMNS
from scenegen.processes.process import cannot_start
from scenegen.scenes.blocks import (
    BLOCK,
    COUNT_PREFIX,
    MAX_NUMBERS,
    PHI,
    RARITY,
    Block,
    SceneFileReading,
    check_finite,
    columns,
    counts_in,
    regroup,
)
from scenegen.scenes.data import SceneFile
from scenegen.scenes.files import open_input
from scenegen.scenes.formats.header import dump_header, load_header

Check = Callable[["Footer"], None]

HEADER_LAST = True  # see `registry`
METADATA_KEY = b"scenegen"  # of the header in the file's metadata
BUFFER = 1 << 22  # bytes written at a time: Arrow writes a page in small parts, and would wait for Python with each
MAX_GROUP_BYTES = 1 << 30  # bytes of a row group, unpacked


class Footer(NamedTuple):
    """What a file says of itself at its end: its header, its labels in the order of their columns, its size in bytes,
    how many scenes each row group has, and the range of phi by label; None where the file does not say it."""

    header: SceneFile
    labels: tuple[str, ...]
    bytes: int
    groups: tuple[int, ...]
    phi: dict[str, tuple[float, float] | None]

    @property
    def scenes(self) -> int:
        return sum(self.groups)


_SMALLER = "`scenegen export` to another .parquet file makes smaller ones"


def write(
    sink: IO[bytes] | RawIOBase,
    header: SceneFile,
    labels: Sequence[str],
    blocks: Iterable[Block],
    rarity: Callable[[Array], Array] | None = None,
    *,
    final: Callable[[], SceneFile] | None = None,
) -> None:
    """Scenes block by block. `rarity` makes of phi (L, m) the columns `log10p.task`, ..., (L, m), after those of phi;
    readers here leave these out. `final`, called after the last block, gives the header as it is stored: what stands
    there of the whole run may become known while scenes are written. Raises OutputError if an object `phi` and a label
    `x` would share a column."""
    names = columns(header, labels)
    if rarity is not None:
        names += [f"{RARITY}{label}" for label in labels]
    spare, counts = _spare(header), {f"{COUNT_PREFIX}{one.name}" for one in header.counts}
    fields = [
        pa.field(name, pa.int64() if name in counts else pa.float64(), nullable=name.rpartition(".")[0] in spare)
        for name in names
    ]
    schema = pa.schema(fields)
    options = {"compression": "zstd", "compression_level": 1, "use_dictionary": False, "store_schema": False}
    with (
        arrow_sink(sink) as buffered,
        pq.ParquetWriter(buffered, schema, use_byte_stream_split=True, write_page_checksum=True, **options) as writer,
    ):
        for block in regroup(blocks):
            check_finite(header, block)
            more = () if rarity is None else rarity(block.phi)
            numbers = counts_in(header, block.rows) if counts else ()
            rows = (*block.rows, *numbers, *block.phi, *more)
            arrays = [_column(row, field) for row, field in zip(rows, fields, strict=True)]
            writer.write_batch(pa.record_batch(arrays, schema=schema), row_group_size=BLOCK)
        last = header if final is None else final()
        writer.add_key_value_metadata({METADATA_KEY: dump_header(last.without_scenes()).encode()})


def arrow_sink(sink: IO[bytes] | RawIOBase) -> pa.BufferedOutputStream:
    """What Arrow writes a file to."""
    return pa.BufferedOutputStream(pa.PythonFile(_Sink(sink), mode="w"), BUFFER)


class _Sink(RawIOBase):
    """Passes on what Arrow writes, and stays open at the end. Once the sink has raised an error nothing more goes
    there: Arrow would try again when it lets go, and print the error."""

    def __init__(self, sink: IO[bytes] | RawIOBase) -> None:
        self._sink, self._failed = sink, False

    def writable(self) -> bool:
        return True

    def tell(self) -> int:
        return self._sink.tell()

    def write(self, data: Any) -> int:
        if not self._failed:
            self._failed = True
            self._sink.write(data)
            self._failed = False
        return len(data)


def _column(row: np.ndarray[Any, Any], field: pa.Field) -> pa.Array:
    """A row as a column; NaN becomes null where that may be."""
    if field.nullable:
        return pa.array(row, from_pandas=True)
    # `pa.array` would load pandas where that is installed, which takes longer than to write a small file
    return pa.Array.from_buffers(field.type, len(row), [None, pa.py_buffer(np.ascontiguousarray(row))])


def read(path: Path, source: Any = None, check: Check | None = None) -> SceneFileReading:
    """Open a file of scenes; `source` is the open file, if it is not on a disk, and `check` raises DataError for what
    is not the file that it should be. Raises DataError, and so does the iterator of blocks if a later part is
    damaged."""
    with contextlib.ExitStack() as opening:
        parquet, header, labels = _open(path, opening, source, check)
        with _damage(path):
            count = parquet.metadata.num_rows
        blocks = _blocks(path, parquet, header, columns(header, labels), opening.pop_all())
        return SceneFileReading(header, labels, blocks, count, str(path))


def group_sizes(path: Path) -> tuple[int, ...]:
    """How many scenes each row group of a file has, from its metadata alone. Raises DataError, also if a group is too
    large for memory."""
    with contextlib.ExitStack() as opening:
        parquet, header, labels = _open(path, opening)
        with _damage(path):
            sizes = tuple(parquet.metadata.row_group(index).num_rows for index in range(parquet.num_row_groups))
        most = MAX_NUMBERS // (header.coordinates + len(labels))
        if max(sizes, default=0) > most:
            facts = {"size": max(sizes), "unit": "scenes", "limit": most, "remedy": _SMALLER}
            raise DataError(TOO_LARGE_TO_READ(path=path, **facts))
        return sizes


def read_groups(path: Path, groups: Sequence[int], source: Any = None, check: Check | None = None) -> Iterator[Block]:
    """The scenes of some row groups, in the given order; one group is in memory at a time. Raises DataError, as `read`
    does."""
    with contextlib.ExitStack() as opening:
        parquet, header, labels = _open(path, opening, source, check)
        wanted = columns(header, labels)
        with _damage(path):
            sizes = [parquet.metadata.row_group(index).num_rows for index in range(parquet.num_row_groups)]
        for index in groups:
            with _damage(path):
                table = parquet.read_row_group(index, columns=wanted, use_threads=False).select(wanted)
            yield _block(path, table, header, sum(sizes[:index]))


def _open(
    path: Path, opening: contextlib.ExitStack, source: Any = None, check: Check | None = None
) -> tuple[pq.ParquetFile, SceneFile, tuple[str, ...]]:
    """The file, open for as long as `opening` is, its header and its labels. Raises DataError."""
    file = opening.enter_context(open_input(path, "a scenes file") if source is None else source)
    with _damage(path):
        parquet = open_parquet(path, file)
        schema, metadata = parquet.schema_arrow, parquet.metadata.metadata or {}
    if METADATA_KEY not in metadata:
        reason = f"no header under `{METADATA_KEY.decode()}` in its metadata"
        raise DataError(NOT_SCENES(file=path, reason=reason, poses=True))
    header = load_header(metadata[METADATA_KEY], f"the header of {path}").without_scenes()
    labels = _labels(path, schema, header)
    if check is not None:
        check(_footer(path, file, parquet, header, labels))
    return parquet, header, labels


def open_parquet(path: Path, file: Any) -> pq.ParquetFile:
    """A Parquet file of any kind. Raises what pyarrow raises, and DataError where a row group is too large for
    memory."""
    parquet = pq.ParquetFile(file, page_checksum_verification=True)
    groups = [parquet.metadata.row_group(index).total_byte_size for index in range(parquet.num_row_groups)]
    if max(groups, default=0) > MAX_GROUP_BYTES:  # a page, which is unpacked as a whole, can be as large as its group
        remedy = f"write the file with row groups of {BLOCK:,} scenes, as scenegen does"
        facts = {"size": max(groups), "unit": "bytes", "limit": MAX_GROUP_BYTES, "remedy": remedy}
        raise DataError(TOO_LARGE_TO_READ(path=path, **facts))
    return parquet


def check_rows(path: Path, parquet: pq.ParquetFile, columns: int) -> None:
    """Before so many columns of numbers are read as a whole: a few bytes can stand for any number of equal values.
    Raises DataError where they are too many for memory."""
    numbers = parquet.metadata.num_rows * columns
    if numbers > MAX_NUMBERS:
        raise DataError(
            TOO_LARGE_TO_READ(path=path, size=8 * numbers, limit=8 * MAX_NUMBERS, remedy="write several files")
        )


def _footer(path: Path, file: Any, parquet: pq.ParquetFile, header: SceneFile, labels: tuple[str, ...]) -> Footer:
    with _damage(path):
        groups = [parquet.metadata.row_group(index) for index in range(parquet.num_row_groups)]
        at = {name: column for column, name in enumerate(parquet.schema_arrow.names)}
        phi: dict[str, tuple[float, float] | None] = {}
        for label in labels:
            each = [group.column(at[f"{PHI}{label}"]).statistics for group in groups]
            known = bool(each) and all(one is not None and one.has_min_max for one in each)
            phi[label] = (min(one.min for one in each), max(one.max for one in each)) if known else None
        size = file.seek(0, os.SEEK_END)
        return Footer(header, labels, size, tuple(group.num_rows for group in groups), phi)


def is_number(kind: pa.DataType) -> bool:
    return bool(pa.types.is_floating(kind) or pa.types.is_integer(kind))


def _labels(path: Path, schema: pa.Schema, header: SceneFile) -> tuple[str, ...]:
    """The labels of the columns, after these were checked. Columns count by their names, in any order; others may
    stand beside them. Raises DataError."""
    wanted, names = columns(header, ()), list(schema.names)
    labels = [name for name in names if name.startswith(PHI) and name not in wanted]
    for name in (*wanted, *labels):
        if names.count(name) != 1:
            raise DataError(WRONG_COLUMNS(path=path, name=name, twice=(name in names) or None, wanted=tuple(wanted)))
    counts = {f"{COUNT_PREFIX}{one.name}" for one in header.counts}
    for name in (*wanted, *labels):
        found = schema.field(name).type
        if found != (pa.int64() if name in counts else pa.float64()):
            raise DataError(WRONG_COLUMNS(name=name, path=path, found=found))
    return tuple(name.removeprefix(PHI) for name in labels)


def _blocks(
    path: Path, parquet: pq.ParquetFile, header: SceneFile, wanted: list[str], closing: contextlib.ExitStack
) -> Iterator[Block]:
    with closing:
        batches = parquet.iter_batches(BLOCK, columns=wanted, use_threads=False)
        done = 0
        while True:
            with _damage(path):
                batch = next(batches, None)
            if batch is None:
                return
            yield _block(path, batch.select(wanted), header, done)
            done += batch.num_rows


def _block(path: Path, batch: pa.RecordBatch | pa.Table, header: SceneFile, done: int) -> Block:
    """A part of the file as a block; `done` scenes came before it. Raises DataError for values that are not numbers."""
    if isinstance(batch, pa.Table):  # NumPy arrays of chunked columns come as copies anyway
        arrays = [column.to_numpy() for column in batch.columns]
    else:
        arrays = [column.to_numpy(zero_copy_only=False) for column in batch.columns]
    table = np.array(arrays, dtype=np.float64).reshape(batch.num_columns, batch.num_rows)
    if header.counts:
        return _numbered_block(path, table, header, done)
    bad = np.flatnonzero(~np.isfinite(table).all(axis=0))
    if len(bad):
        column = batch.schema.names[int(np.flatnonzero(~np.isfinite(table[:, bad[0]]))[0])]
        raise DataError(COLUMN_NOT_A_NUMBER(path=path, column=column, scene=done + int(bad[0]) + 1))
    return Block(table[: header.coordinates], table[header.coordinates :])


def _spare(header: SceneFile) -> set[str]:
    """The objects that are not there in every scene."""
    return {f"{one.name}[{k}]" for one in header.counts for k in range(one.least + 1, one.most + 1)}


def _numbered_block(path: Path, table: Array, header: SceneFile, done: int) -> Block:
    """A part of a file whose scenes differ in how many things there are. Raises DataError where numbers of things and
    poses do not agree."""
    rows, numbers, phi = np.split(table, [header.coordinates, header.coordinates + len(header.counts)])
    try:
        if not np.isfinite(phi).all():
            raise ValueError(f"scene {int(np.flatnonzero(~np.isfinite(phi).all(axis=0))[0]) + 1}")
        wrong = (counts_in(header, rows) != numbers).any(axis=0)
        if wrong.any():
            raise ValueError(f"scene {int(np.flatnonzero(wrong)[0]) + 1}")
    except ValueError as error:
        scene = done + int(str(error).removeprefix("scene "))
        raise DataError(NUMBERS_DISAGREE(file=path, scene=f"scene {scene}")) from None
    return Block(rows, phi)


def _damage(path: Path) -> contextlib.AbstractContextManager[None]:
    return report_pyarrow_errors(lambda said: DAMAGED_PARQUET(path=path, reason=said))


@contextlib.contextmanager
def report_pyarrow_errors(wrong: Callable[[str], Diagnostic]) -> Iterator[None]:
    """pyarrow's error for a file, as a diagnostic. Its text is for programmers, so only the first line is shown."""
    try:
        yield
    except ScenegenError:
        raise
    except (pa.ArrowException, OSError, ValueError) as error:
        said = (str(error).splitlines() or [""])[0].rstrip(".")
        if "launch worker thread" in said:
            raise cannot_start("a thread", error) from error
        raise DataError(wrong(said[:200])) from error
