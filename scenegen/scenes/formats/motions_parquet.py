"""Motions as Parquet, a row for each moment; the header is in the file's metadata. Needs pyarrow."""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from io import RawIOBase
from pathlib import Path
from typing import IO, Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from scenegen.arrays import Array
from scenegen.errors import DataError
from scenegen.errors.files import DAMAGED_MOTIONS, NOT_MOTIONS
from scenegen.pose import NAMES
from scenegen.scenes.blocks import COUNT_PREFIX, PHI, Block, element, join_blocks
from scenegen.scenes.files import open_input
from scenegen.scenes.formats.header import parse
from scenegen.scenes.formats.motions import MOTION_FACTS, VALUE_KINDS, MotionArrays, columns, motion_file, motions_of
from scenegen.scenes.formats.parquet import (
    METADATA_KEY,
    arrow_sink,
    check_rows,
    is_number,
    open_parquet,
    report_pyarrow_errors,
)
from scenegen.scenes.motions import MotionFile

GROUP_MOMENTS = 1 << 20  # moments of a row group


def write(
    sink: IO[bytes] | RawIOBase,
    header: MotionFile,
    labels: Sequence[str],
    blocks: Iterable[Block],
    facts: Sequence[str] = MOTION_FACTS,
) -> None:
    """Columns of doubles, and of integers for numbers of things; zstd. What is not there is null."""
    rows = header.coordinates + len(facts)
    if header.counts:  # all motions say which columns have nulls
        blocks = [join_blocks(list(blocks), rows, len(labels))]
    data = {**header.model_dump(mode="json", exclude={"motions"}), "columns": {"phi": [*labels], "facts": [*facts]}}
    metadata = {METADATA_KEY: json.dumps(data, ensure_ascii=False).encode()}

    def tables() -> Iterator[pa.Table]:
        done = 0
        for block in blocks:
            yield _table(header, metadata, columns(motions_of(header, labels, facts, block), done + 1))
            done += block.count

    each = tables()
    first = next(each, None)
    if first is None:
        nothing = Block(np.empty((rows, 0)), np.empty((len(labels), 0)))
        first = _table(header, metadata, columns(motions_of(header, labels, facts, nothing)))
    options = {"compression": "zstd", "compression_level": 1, "write_page_checksum": True}
    with arrow_sink(sink) as out, pq.ParquetWriter(out, first.schema, **options) as writer:
        for group in _groups(itertools.chain([first], each)):
            writer.write_table(group, row_group_size=GROUP_MOMENTS)


def _table(header: MotionFile, metadata: dict[bytes, bytes], found: list[tuple[str, Array]]) -> pa.Table:
    counts = {f"{COUNT_PREFIX}{one.name}" for one in header.counts}
    fields = [
        pa.field(name, pa.int64() if name in counts else pa.float64(), nullable=bool(np.isnan(values).any()))
        for name, values in found
    ]
    arrays = [
        pa.array(values, from_pandas=field.nullable).cast(field.type)
        for field, (_, values) in zip(fields, found, strict=True)
    ]
    return pa.table(arrays, schema=pa.schema(fields, metadata=metadata))


def _groups(tables: Iterable[pa.Table]) -> Iterator[pa.Table]:
    """The same rows in tables of `GROUP`, but for the last: the bytes depend on the motions alone."""
    waiting: pa.Table | None = None
    for table in tables:
        waiting = table if waiting is None else pa.concat_tables([waiting, table])
        while waiting.num_rows > GROUP_MOMENTS:
            yield waiting.slice(0, GROUP_MOMENTS).combine_chunks()
            waiting = waiting.slice(GROUP_MOMENTS)
    if waiting is not None:
        yield waiting.combine_chunks()


def header_bytes(path: Path) -> bytes:
    """The header in the metadata of a file; nothing where it cannot be read."""
    try:
        found: bytes = (pq.read_metadata(path).metadata or {}).get(METADATA_KEY, b"")
        return found
    except (pa.ArrowException, OSError, ValueError):
        return b""


def read(path: Path, source: Any = None) -> MotionArrays:
    """The motions of a file; `source` is the open file, if it is not on a disk. Raises DataError."""
    with (
        open_input(path, "a motions file") if source is None else source as file,
        report_pyarrow_errors(lambda said: NOT_MOTIONS(file=path, reason=said)),
    ):
        parquet = open_parquet(path, file)
        metadata = parquet.metadata.metadata or {}
        if METADATA_KEY not in metadata:
            raise DataError(NOT_MOTIONS(file=path, reason=f"no header under `{METADATA_KEY.decode()}` in its metadata"))
        header, names = _header(metadata[METADATA_KEY], path)
        kept = [name for name in _column_names(header, names) if name in parquet.schema_arrow.names]
        for name in kept:
            if not is_number(parquet.schema_arrow.field(name).type):
                raise DataError(DAMAGED_MOTIONS(file=path, place=name, reason="its values are no numbers"))
        check_rows(path, parquet, len(kept))
        # one thread: others may still run when the program ends
        table = parquet.read(columns=kept, use_threads=False)
    moments = header.time.steps + 1
    spare = {f"{element(one, k)}." for one in header.counts for k in range(1, one.most + 1)}

    def column(name: str) -> np.ndarray[Any, np.dtype[np.float64]]:
        if name not in table.column_names or table.num_rows % moments:
            reason = f"no column `{name}`" if name not in table.column_names else f"{table.num_rows} rows"
            raise DataError(DAMAGED_MOTIONS(file=path, place="", reason=reason))
        values = np.asarray(table.column(name).to_numpy(), dtype=np.float64)
        may_lack = name in names["facts"] or name[: name.rfind(".") + 1] in spare
        bad = np.isinf(values) if may_lack else ~np.isfinite(values)
        if bad.any():
            raise DataError(DAMAGED_MOTIONS(file=path, place=name, reason="a value is not a number"))
        return values

    places = [[column(f"{one.name}.{axis}") for axis in NAMES] for one in header.objects]
    poses = np.array(places).reshape(len(header.objects), len(NAMES), -1, moments).transpose(2, 3, 0, 1)
    found = MotionArrays(np.ascontiguousarray(poses), {}, {}, header)
    if header.counts:
        numbers = np.array([column(f"{COUNT_PREFIX}{one.name}").reshape(-1, moments) for one in header.counts])
        try:
            agree = bool((numbers == found.numbers[:, :, None]).all())
        except ValueError:
            agree = False
        if not agree:
            reason = "its poses are not those of as many things as it says"
            raise DataError(DAMAGED_MOTIONS(file=path, place="", reason=reason))
    phi = {name: column(f"{PHI}{name}")[::moments] for name in names["phi"]}
    facts = {name: column(name)[::moments] for name in names["facts"]}
    return replace(found, phi=phi, facts=facts)


def _header(data: bytes, path: Path) -> tuple[MotionFile, dict[str, list[str]]]:
    """The file without its motions, and the names of its columns of phi and of facts. Raises DataError."""
    raw, _ = parse(data, f"the header of {path}")
    names = raw.pop("columns", {}) if isinstance(raw, dict) else {}
    header = motion_file({**raw, "motions": []} if isinstance(raw, dict) else raw, str(path))
    found: dict[str, list[str]] = {}
    for kind in VALUE_KINDS:
        given = names.get(kind, []) if isinstance(names, dict) else None
        if not isinstance(given, list) or not all(isinstance(name, str) for name in given):
            raise DataError(DAMAGED_MOTIONS(file=path, place=f"columns.{kind}", reason="it is no list of names"))
        found[kind] = given
    return header, found


def _column_names(header: MotionFile, names: dict[str, list[str]]) -> list[str]:
    """The columns that are read, each once."""
    places = [f"{one.name}.{axis}" for one in header.objects for axis in NAMES]
    counts = [f"{COUNT_PREFIX}{one.name}" for one in header.counts]
    return list(dict.fromkeys([*places, *counts, *(f"{PHI}{name}" for name in names["phi"]), *names["facts"]]))
