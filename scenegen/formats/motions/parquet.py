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
from scenegen.errors.motions import DAMAGED_MOTIONS, NOT_MOTIONS
from scenegen.formats.columns import COUNT
from scenegen.formats.files import opened
from scenegen.formats.motions.table import PEEK, MotionArrays, columns
from scenegen.formats.motions.text import motion_file
from scenegen.pose import NAMES
from scenegen.scene.motions import FORMAT
from scenegen.scene.numbers import element

KEY = b"scenegen"


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
    return f'"{FORMAT}"'.encode() in metadata.get(KEY, b"")[:PEEK]


def read(path: Path) -> MotionArrays:
    """Raises DataError."""
    with opened(path, "a motions file") as file:
        try:
            # one thread: others may still run when the program ends
            table = pq.ParquetFile(file, page_checksum_verification=True).read(use_threads=False)
        except (pa.ArrowException, OSError, ValueError) as error:
            said = (str(error).splitlines() or [""])[0].rstrip(".")
            raise DataError(NOT_MOTIONS(file=path, reason=said)) from error
    metadata = table.schema.metadata or {}
    if KEY not in metadata:
        raise DataError(NOT_MOTIONS(file=path, reason=f"no header under `{KEY.decode()}` in its metadata"))
    raw: dict[str, Any] = json.loads(metadata[KEY])
    names = raw.pop("columns", {})
    header = motion_file({**raw, "motions": []}, str(path))
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
    phi = {name: column(f"phi.{name}")[::moments] for name in names.get("phi", ())}
    facts = {name: column(name)[::moments] for name in names.get("facts", ())}
    return replace(found, phi=phi, facts=facts)
