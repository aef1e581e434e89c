"""Motions as Parquet, a row for each moment; the header is in the file's metadata. Needs pyarrow."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import IO, Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from scenegen.errors import DataError
from scenegen.errors.time import DAMAGED_MOTIONS, NOT_MOTIONS
from scenegen.pose import NAMES
from scenegen.scenes.blocks import COUNT, PHI
from scenegen.scenes.files import opened
from scenegen.scenes.formats.header import parse
from scenegen.scenes.formats.motions.table import KINDS, PEEK, MotionArrays, columns
from scenegen.scenes.formats.motions.text import motion_file
from scenegen.scenes.formats.parquet import KEY, check_rows, is_number, open_parquet, refused
from scenegen.scenes.motions import MOTIONS_FORMAT, MotionFile
from scenegen.scenes.numbers import element


def write(sink: IO[bytes], motions: MotionArrays, ending: str) -> None:
    """Columns of doubles, and of integers for numbers of things; zstd. What is not there is null."""
    found = columns(motions)
    header = motions.header.model_dump(mode="json", exclude={"motions"})
    names = {"phi": list(motions.phi), "facts": list(motions.facts)}
    counts = {f"{COUNT}{one.name}" for one in motions.header.counts}
    fields = [
        pa.field(name, pa.int64() if name in counts else pa.float64(), nullable=bool(np.isnan(values).any()))
        for name, values in found
    ]
    metadata = {KEY: json.dumps({**header, "columns": names}, ensure_ascii=False).encode()}
    arrays = [
        pa.array(values, from_pandas=field.nullable).cast(field.type)
        for field, (_, values) in zip(fields, found, strict=True)
    ]
    table = pa.table(arrays, schema=pa.schema(fields, metadata=metadata))
    pq.write_table(table, sink, compression="zstd", compression_level=1, write_page_checksum=True)


def names_motions(path: Path) -> bool:
    """Whether the metadata of a file says that it holds motions; False where it cannot be read."""
    try:
        metadata = pq.read_metadata(path).metadata or {}
    except (pa.ArrowException, OSError, ValueError):
        return False
    return f'"{MOTIONS_FORMAT}"'.encode() in metadata.get(KEY, b"")[:PEEK]


def read(path: Path) -> MotionArrays:
    """Raises DataError."""
    with (
        opened(path, "a motions file") as file,
        refused(lambda said: NOT_MOTIONS(file=path, reason=said)),
    ):
        parquet = open_parquet(path, file)
        metadata = parquet.metadata.metadata or {}
        if KEY not in metadata:
            raise DataError(NOT_MOTIONS(file=path, reason=f"no header under `{KEY.decode()}` in its metadata"))
        header, names = _header(metadata[KEY], path)
        kept = [name for name in _wanted(header, names) if name in parquet.schema_arrow.names]
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
        bad = np.isinf(values) if name[: name.rfind(".") + 1] in spare else ~np.isfinite(values)
        if bad.any():
            raise DataError(DAMAGED_MOTIONS(file=path, place=name, reason="a value is not a number"))
        return values

    places = [[column(f"{one.name}.{axis}") for axis in NAMES] for one in header.objects]
    poses = np.array(places).reshape(len(header.objects), len(NAMES), -1, moments).transpose(2, 3, 0, 1)
    found = MotionArrays(header, np.ascontiguousarray(poses), {}, {})
    if header.counts:
        numbers = np.array([column(f"{COUNT}{one.name}").reshape(-1, moments) for one in header.counts])
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
    for kind in KINDS:
        given = names.get(kind, []) if isinstance(names, dict) else None
        if not isinstance(given, list) or not all(isinstance(name, str) for name in given):
            raise DataError(DAMAGED_MOTIONS(file=path, place=f"columns.{kind}", reason="it is no list of names"))
        found[kind] = given
    return header, found


def _wanted(header: MotionFile, names: dict[str, list[str]]) -> list[str]:
    """The columns that are read, each once."""
    places = [f"{one.name}.{axis}" for one in header.objects for axis in NAMES]
    counts = [f"{COUNT}{one.name}" for one in header.counts]
    return list(dict.fromkeys([*places, *counts, *(f"{PHI}{name}" for name in names["phi"]), *names["facts"]]))
