"""Settled scenes as Parquet: a row per scene, the header in the file's metadata under `scenegen`.

Columns: `scene`, `settled`, then of each object `mug.x`, ..., `mug.qz`, `mug.shift_mm`, `mug.turn_deg`, then of each
that was planned on one of several surfaces `mug.on`, its number, then `phi.task`, ..., `moved` (a list of names) and
`contacts` (a list of pairs with `depth_mm`).
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import IO

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from scenegen.errors import DataError, OutputError
from scenegen.errors.files import COLUMN_TWICE, COLUMN_TYPE, DAMAGED_PARQUET, WRONG_COLUMNS
from scenegen.scenes.blocks import PHI
from scenegen.scenes.data import SettledHeader
from scenegen.scenes.files import opened
from scenegen.scenes.formats.parquet import KEY, check_rows, is_number, open_parquet, refused
from scenegen.scenes.formats.settled_blocks import MM, POSE, Array, SettledBlock

GROUP = 4096  # scenes of a row group: they come in small blocks

CONTACT = pa.struct([("a", pa.string()), ("b", pa.string()), ("depth_mm", pa.float64())])


def write(sink: IO[bytes], header: SettledHeader, blocks: Iterable[SettledBlock]) -> None:
    """Scenes block by block; row groups have a fixed number of scenes. Raises OutputError if an object `phi` and a
    label would share a column."""
    each = (*POSE, "shift_mm", "turn_deg")
    fields = [pa.field("scene", pa.int64()), pa.field("settled", pa.bool_())]
    fields += [pa.field(f"{name}.{column}", pa.float64()) for name in header.objects for column in each]
    fields += [pa.field(f"{name}.on", pa.float64()) for name in header.surfaces]
    fields += [pa.field(f"{PHI}{label}", pa.float64()) for label in header.labels]
    fields += [pa.field("moved", pa.list_(pa.string())), pa.field("contacts", pa.list_(CONTACT))]
    schema = pa.schema(fields, metadata={KEY: header.model_dump_json().encode()})
    if len(set(schema.names)) < len(schema.names):
        raise OutputError(COLUMN_TWICE(name=next(name for name in schema.names if schema.names.count(name) > 1)))
    waiting: list[pa.RecordBatch] = []
    done = 0
    with pq.ParquetWriter(sink, schema, compression="zstd", write_page_checksum=True) as writer:
        for block in blocks:
            waiting.append(_batch(schema, header, block, done))
            done += block.count
            if sum(one.num_rows for one in waiting) >= GROUP:
                writer.write_table(pa.Table.from_batches(waiting), row_group_size=GROUP)
                waiting = []
        if waiting:
            writer.write_table(pa.Table.from_batches(waiting), row_group_size=GROUP)


def names_settled(path: Path, wanted: bytes) -> bool:
    """Whether the metadata of a file says that it holds settled scenes; False where it cannot be read."""
    try:
        metadata = pq.read_metadata(path).metadata or {}
    except (pa.ArrowException, OSError, ValueError):
        return False
    return wanted in metadata.get(KEY, b"")


def read_poses(path: Path) -> tuple[SettledHeader, Array, Array]:
    """The header, the poses (n, N, 7) and the surfaces (n, M), NaN where null stands. Raises DataError."""
    from scenegen.scenes.formats.settled_blocks import settled_header

    with (
        opened(path, "a file of settled scenes") as file,
        refused(lambda said: DAMAGED_PARQUET(path=path, reason=said)),
    ):
        parquet = open_parquet(path, file)
        header = settled_header((parquet.metadata.metadata or {}).get(KEY, b""), path)
        names = [f"{name}.{column}" for name in header.objects for column in POSE]
        names += [f"{name}.on" for name in header.surfaces]
        for name in names:
            if name not in parquet.schema_arrow.names:
                raise DataError(WRONG_COLUMNS(path=path, name=name, wanted=tuple(names)))
            if not is_number(parquet.schema_arrow.field(name).type):
                raise DataError(COLUMN_TYPE(column=name, path=path, found=parquet.schema_arrow.field(name).type))
        check_rows(path, parquet, len(names))
        table = parquet.read(columns=names, use_threads=False)
    values = np.array([table.column(name).to_numpy() for name in names], dtype=np.float64)
    poses, on = np.split(values.T, [len(header.objects) * len(POSE)], axis=1)
    return header, poses.reshape(table.num_rows, len(header.objects), len(POSE)), on


def _batch(schema: pa.Schema, header: SettledHeader, block: SettledBlock, done: int) -> pa.RecordBatch:
    names = np.array(header.objects, dtype=object)
    values = np.concatenate([block.poses, MM * block.shift[..., None], block.turn[..., None]], axis=2)
    on = () if block.on is None else block.on.T
    numbers = [*values.reshape(block.count, -1).T, *on, *block.phi]
    contacts = [[{"a": a, "b": b, "depth_mm": MM * depth} for a, b, depth in touches] for touches in block.contacts]
    columns = [
        pa.array(np.arange(done + 1, done + block.count + 1)),
        pa.array(~block.moved.any(axis=1)),
        *(pa.array(column, from_pandas=True) for column in numbers),  # NaN becomes null
        pa.array([names[moved].tolist() for moved in block.moved], type=pa.list_(pa.string())),
        pa.array(contacts, type=pa.list_(CONTACT)),
    ]
    return pa.record_batch(columns, schema=schema)
