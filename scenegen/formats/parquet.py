"""Scenes as Parquet: columns `mug.x`, `mug.y`, `mug.theta`, ..., `phi.task`, the header in the file's metadata.

Needs pyarrow (`pip install "scenegen[parquet]"`). Row groups have a fixed number of scenes, so the bytes depend on the
scenes, the header and pyarrow's version, not on the blocks in which they came. Coordinates are as good as random: byte
stream splitting with zstd at level 1 saves an eighth of the space at 0.2 microseconds a scene, dictionaries save
nothing. Every page carries a checksum, which is checked when it is read.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import IO

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from scenegen.errors import DataError, Diagnostic, quoted
from scenegen.formats.blocks import BLOCK, MOST, Block, Reading, check_numbers, regrouped
from scenegen.formats.columns import PHI, columns
from scenegen.formats.files import opened
from scenegen.formats.header import HELP, dump_header, load_header, not_scenes
from scenegen.scene.data import SceneFile

KEY = b"scenegen"  # of the header in the file's metadata
LARGEST = 1 << 30  # bytes of a row group, unpacked

_SMALLER = "`scenegen export {path} --out other.parquet` makes smaller ones"


def write(sink: IO[bytes], header: SceneFile, labels: Sequence[str], blocks: Iterable[Block]) -> None:
    """Scenes block by block. Raises OutputError where an object `phi` and a label `x` would share a column."""
    names = columns([one.name for one in header.objects], labels)
    fields = [pa.field(name, pa.float64(), nullable=False) for name in names]
    schema = pa.schema(fields, metadata={KEY: dump_header(header.without_scenes()).encode()})
    options = {"compression": "zstd", "compression_level": 1, "use_dictionary": False}
    with pq.ParquetWriter(sink, schema, use_byte_stream_split=True, write_page_checksum=True, **options) as writer:
        for block in regrouped(blocks):
            check_numbers(block)
            arrays = [pa.array(row) for row in (*block.rows, *block.phi)]
            writer.write_batch(pa.record_batch(arrays, schema=schema), row_group_size=BLOCK)


def read(path: Path) -> Reading:
    """Open a file of scenes. Raises DataError, and so does the iterator of blocks where a later part is damaged."""
    with contextlib.ExitStack() as opening:
        parquet, header, labels = _open(path, opening)
        with _damage(path):
            count = parquet.metadata.num_rows
        blocks = _blocks(path, parquet, 3 * len(header.objects), opening.pop_all())
        return Reading(header, labels, blocks, count, str(path))


def group_sizes(path: Path) -> tuple[int, ...]:
    """How many scenes each row group of a file holds, from its metadata alone. Raises DataError, also where a group is
    too large to be in memory at once."""
    with contextlib.ExitStack() as opening:
        parquet, header, labels = _open(path, opening)
        with _damage(path):
            sizes = tuple(parquet.metadata.row_group(index).num_rows for index in range(parquet.num_row_groups))
        most = MOST // (3 * len(header.objects) + len(labels))
        if max(sizes, default=0) > most:
            title = f"a row group of {path} holds {max(sizes):,} scenes; at most {most:,} are in memory at once"
            raise DataError(Diagnostic(title, help=_SMALLER.format(path=path)))
        return sizes


def read_groups(path: Path, groups: Sequence[int]) -> Iterator[Block]:
    """The scenes of some row groups, in the order asked for; one group is in memory at a time. Raises DataError."""
    with contextlib.ExitStack() as opening:
        parquet, header, _ = _open(path, opening)
        with _damage(path):
            sizes = [parquet.metadata.row_group(index).num_rows for index in range(parquet.num_row_groups)]
        for index in groups:
            with _damage(path):
                table = parquet.read_row_group(index, use_threads=False)
            yield _block(path, table, 3 * len(header.objects), sum(sizes[:index]))


def _open(path: Path, opening: contextlib.ExitStack) -> tuple[pq.ParquetFile, SceneFile, tuple[str, ...]]:
    """The file, open for as long as `opening` is, its header and its labels. Raises DataError."""
    file = opening.enter_context(opened(path, "a scenes file"))
    with _damage(path):
        parquet = pq.ParquetFile(file, page_checksum_verification=True)
        schema, metadata = parquet.schema_arrow, parquet.metadata.metadata or {}
        groups = [parquet.metadata.row_group(index).total_byte_size for index in range(parquet.num_row_groups)]
    if KEY not in metadata:
        raise DataError(not_scenes(str(path), f"no header under `{KEY.decode()}` in its metadata"))
    if max(groups, default=0) > LARGEST:  # a page, which is unpacked as a whole, can be as large as its group
        title = f"a row group of {path} is {max(groups):,} bytes long; the limit is {LARGEST:,}"
        help_ = f"write the file with row groups of {BLOCK:,} scenes, as scenegen does"
        raise DataError(Diagnostic(title, help=help_))
    header = load_header(metadata[KEY], f"the header of {path}").without_scenes()
    return parquet, header, _labels(path, schema, header)


def _labels(path: Path, schema: pa.Schema, header: SceneFile) -> tuple[str, ...]:
    """The labels that the columns are of, once these are what they should be."""
    wanted = columns([one.name for one in header.objects], ())
    names = list(schema.names)
    phi = names[len(wanted) :]
    odd = [name for name in phi if not name.startswith(PHI)]
    if names[: len(wanted)] != wanted or odd:
        lack = next((name for name in wanted if name not in names), None)
        title = f"{path} has columns in another order than its objects"
        if lack is not None or odd:
            title = f"{path} has no column `{lack}`" if lack is not None else f"{path} has a column `{odd[0]}`"
        help_ = f"its columns should be {quoted(wanted)}, then phi of each label"
        raise DataError(Diagnostic(title, help=help_))
    for field in schema:
        if field.type != pa.float64():
            title = f"column `{field.name}` of {path} holds {field.type}, not float64"
            raise DataError(Diagnostic(title, help=HELP))
    return tuple(name.removeprefix(PHI) for name in phi)


def _blocks(path: Path, parquet: pq.ParquetFile, coordinates: int, closing: contextlib.ExitStack) -> Iterator[Block]:
    with closing:
        batches = parquet.iter_batches(BLOCK, use_threads=False)
        done = 0
        while True:
            with _damage(path):
                batch = next(batches, None)
            if batch is None:
                return
            yield _block(path, batch, coordinates, done)
            done += batch.num_rows


def _block(path: Path, batch: pa.RecordBatch | pa.Table, coordinates: int, done: int) -> Block:
    """A part of the file as a block; `done` scenes came before it. Raises DataError for what is no number."""
    if isinstance(batch, pa.Table):  # NumPy arrays of chunked columns come as copies anyway
        arrays = [column.to_numpy() for column in batch.columns]
    else:
        arrays = [column.to_numpy(zero_copy_only=False) for column in batch.columns]
    table = np.array(arrays, dtype=np.float64).reshape(batch.num_columns, batch.num_rows)
    bad = np.flatnonzero(~np.isfinite(table).all(axis=0))
    if len(bad):
        column = batch.schema.names[int(np.flatnonzero(~np.isfinite(table[:, bad[0]]))[0])]
        title = f"{path} is damaged: no number stands in column `{column}` of scene {done + int(bad[0]) + 1}"
        raise DataError(Diagnostic(title, help=HELP))
    return Block(table[:coordinates], table[coordinates:])


@contextlib.contextmanager
def _damage(path: Path) -> Iterator[None]:
    """What pyarrow finds wrong with a file, as a diagnostic. Its words are for programmers: the first line will do."""
    try:
        yield
    except (pa.ArrowException, OSError, ValueError) as error:
        said = (str(error).splitlines() or [""])[0].rstrip(".")
        raise DataError(Diagnostic(f"{path} is damaged, or no Parquet file", help=HELP, note=said)) from error
