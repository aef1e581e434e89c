"""Settled scenes as JSON, JSON Lines and Parquet; written block by block, whole or not at all. Of what is in them only
the poses are read back.

Parquet has a row per scene, the header in the file's metadata under `scenegen`. Columns: `scene`, `settled`, then of
each object `mug.x`, ..., `mug.qz`, `mug.shift_mm`, `mug.turn_deg`, then of each that was planned on one of several
surfaces `mug.on`, its number, then `phi.task`, ..., `moved` (a list of names) and `contacts` (a list of pairs with
`depth_mm`).
"""

from __future__ import annotations

import contextlib
import json
import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np
import numpy.typing as npt
from pydantic import ValidationError

from scenegen.arrays import Array
from scenegen.errors import DataError, OutputError
from scenegen.errors.files import COLUMN_TWICE, DAMAGED_PARQUET, DAMAGED_SCENES, WRONG_COLUMNS
from scenegen.scenes.blocks import PHI
from scenegen.scenes.data import SETTLED_FORMAT, SettledHeader
from scenegen.scenes.files import ending_of, open_input, read_bytes, whole_file
from scenegen.scenes.formats.header import first_problem, parse
from scenegen.scenes.formats.registry import FORMAT_NAME_BYTES, format_of
from scenegen.scenes.formats.scenes_json import MAX_JSON_BYTES

METADATA_KEY = b"scenegen"  # of the header in the metadata of a Parquet file


POSE = ("x", "y", "z", "qw", "qx", "qy", "qz")
MM = 1000.0  # millimetres of a metre

Touch = tuple[str | None, str | None, float]


@dataclass(frozen=True, slots=True, eq=False)
class SettledBlock:
    """m scenes of N objects. `poses` (m, N, 7) are place (metres) and quaternion, w first; `shift` (m, N) in metres and
    `turn` (m, N) in degrees are against the plan; `moved` (m, N) says which objects moved too far; `phi` (L, m) is that
    of the settled scene; `contacts` are by scene the pairs that touched before, None for the table, and how deep in
    metres; `on` (m, M) is the surface that each object stood on in the plan, where the header has several, counted from
    1. NaN, from a simulation that diverged, is written as null. Objects that are not there are NaN and have not
    moved."""

    poses: Array
    shift: Array
    turn: Array
    moved: npt.NDArray[np.bool_]
    phi: Array
    contacts: tuple[tuple[Touch, ...], ...]
    on: Array | None = None

    @property
    def count(self) -> int:
        return len(self.poses)

    @property
    def present(self) -> npt.NDArray[np.bool_]:
        """(m, N): which objects are there."""
        return np.asarray(self.moved | ~np.isnan(self.poses).any(axis=2))

    @property
    def deepest(self) -> Array:
        """(m,): the depth of each scene's deepest contact, in metres."""
        return np.array([max((depth for *_, depth in touches), default=0.0) for touches in self.contacts])


def settled_header(text: str | bytes, path: Path) -> SettledHeader:
    """Raises DataError."""
    try:
        return SettledHeader.model_validate_json(text)
    except ValidationError as error:
        raise DataError(first_problem(str(path), error)) from None


def write_settled(path: Path, header: SettledHeader, blocks: Iterable[SettledBlock]) -> None:
    """Write settled scenes in the format of the path's ending; the file appears whole or not at all. Raises
    RequestError, OutputError, and what `blocks` raises."""
    format_of(path)
    writers: dict[str, Callable[[IO[bytes], SettledHeader, Iterable[SettledBlock]], None]]
    writers = {".json": write_json, ".jsonl": write_lines, ".parquet": write_parquet}
    with whole_file(path) as sink:
        writers[ending_of(path)](sink, header, blocks)


def write_json(sink: IO[bytes], header: SettledHeader, blocks: Iterable[SettledBlock]) -> None:
    """The header indented, then one scene a line."""
    text = json.dumps(header.model_dump(mode="json"), indent=1, ensure_ascii=False, allow_nan=False)
    sink.write(f'{text.removesuffix("}").rstrip()},\n "scenes": ['.encode())
    between = "\n  "
    for line in _lines(header, blocks):
        sink.write(f"{between}{line}".encode())
        between = ",\n  "
    sink.write(b"\n ]\n}\n")


def write_lines(sink: IO[bytes], header: SettledHeader, blocks: Iterable[SettledBlock]) -> None:
    """The header in the first line, then one scene a line."""
    sink.write(json.dumps(header.model_dump(mode="json"), ensure_ascii=False, allow_nan=False).encode() + b"\n")
    for line in _lines(header, blocks):
        sink.write(f"{line}\n".encode())


def is_settled(path: Path) -> bool:
    """Whether a .json, .jsonl or .parquet file is one of settled scenes; False where it cannot be read."""
    wanted = f'"{SETTLED_FORMAT}"'.encode()
    with contextlib.suppress(OSError, ModuleNotFoundError):
        match ending_of(path):
            case ".json" | ".jsonl" if path.is_file():
                with path.open("rb") as file:
                    return wanted in file.read(FORMAT_NAME_BYTES)
            case ".parquet" if path.is_file():
                return names_settled(path, wanted)
    return False


def read_settled(path: Path) -> tuple[SettledHeader, Array, Array]:
    """The header of a file of settled scenes, the poses (n, N, 7) and the surfaces (n, M), NaN of what is not there.
    Raises DataError, also for a scene whose simulation diverged."""
    if ending_of(path) == ".parquet":
        header, poses, on = read_poses(path)
    else:
        data = read_bytes(path, "a file of settled scenes", limit=MAX_JSON_BYTES, remedy="write .parquet")
        first, *lines = data.split(b"\n") if ending_of(path) == ".jsonl" else [data]
        raw, _ = parse(first, str(path))
        scenes = [parse(line, f"line {k} of {path}")[0] for k, line in enumerate(lines, 2) if line.strip()] or (
            raw.pop("scenes", []) if isinstance(raw, dict) else []
        )
        header = settled_header(json.dumps(raw), path)
        poses = np.full((len(scenes), len(header.objects), len(POSE)), math.nan)
        on = np.full((len(scenes), len(header.surfaces)), math.nan)
        for number, scene in enumerate(scenes):
            try:
                for name, place in scene["objects"].items():
                    poses[number, header.objects.index(name)] = [place[axis] for axis in POSE]
                    if name in header.surfaces:
                        on[number, list(header.surfaces).index(name)] = header.surfaces[name].index(place["on"]) + 1
            except (KeyError, TypeError, ValueError, AttributeError):
                where = f"scenes.{number + 1}"
                raise DataError(DAMAGED_SCENES(file=path, place=where, reason="a pose is missing or null")) from None
    some, every = np.isnan(poses).any(axis=2), np.isnan(poses).all(axis=2)
    odd = np.asarray((some & ~every) | np.isinf(poses).any(axis=2)).any(axis=1)
    if odd.any():
        where = f"scenes.{int(odd.argmax()) + 1}"
        raise DataError(DAMAGED_SCENES(file=path, place=where, reason="a pose is missing or null"))
    known = np.array([len(names) for names in header.surfaces.values()])
    bad = ~np.isnan(on) & ~((on >= 1) & (on <= known) & (on == np.round(on)))
    if bad.any():
        where = f"scenes.{int(bad.any(axis=1).argmax()) + 1}"
        raise DataError(DAMAGED_SCENES(file=path, place=where, reason="there is no such surface"))
    return header, poses, on


def _lines(header: SettledHeader, blocks: Iterable[SettledBlock]) -> Iterator[str]:
    number = 0
    for block in blocks:
        for index in range(block.count):
            number += 1
            yield json.dumps(_scene(header, block, index, number), ensure_ascii=False, allow_nan=False)


def _scene(header: SettledHeader, block: SettledBlock, index: int, number: int) -> dict[str, Any]:
    """One scene as plain data; `number` counts from 1, as the scenes of the plan do."""
    there = block.present[index].tolist()
    moved = [name for name, far in zip(header.objects, block.moved[index].tolist(), strict=True) if far]
    rows = np.concatenate([block.poses[index], MM * block.shift[index, :, None], block.turn[index, :, None]], axis=1)
    objects: dict[str, dict[str, Any]] = {
        name: dict(zip((*POSE, "shift_mm", "turn_deg"), map(_number, row), strict=True))
        for name, row, here in zip(header.objects, rows.tolist(), there, strict=True)
        if here
    }
    chosen = {} if block.on is None else dict(zip(header.surfaces, block.on[index].tolist(), strict=True))
    for name, surface in chosen.items():
        if name in objects:
            objects[name]["on"] = header.surfaces[name][int(surface) - 1]
    return {
        "scene": number,
        "settled": not moved,
        "moved": moved,
        "phi": dict(zip(header.labels, map(_number, block.phi[:, index].tolist()), strict=True)),
        "objects": objects,
        "contacts": [{"a": a, "b": b, "depth_mm": MM * depth} for a, b, depth in block.contacts[index]],
    }


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None


GROUP_SCENES = 4096  # scenes of a row group: they come in small blocks


def write_parquet(sink: IO[bytes], header: SettledHeader, blocks: Iterable[SettledBlock]) -> None:
    """Scenes block by block; row groups have a fixed number of scenes. Raises OutputError if an object `phi` and a
    label would share a column."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    each = (*POSE, "shift_mm", "turn_deg")
    fields = [pa.field("scene", pa.int64()), pa.field("settled", pa.bool_())]
    fields += [pa.field(f"{name}.{column}", pa.float64()) for name in header.objects for column in each]
    fields += [pa.field(f"{name}.on", pa.float64()) for name in header.surfaces]
    fields += [pa.field(f"{PHI}{label}", pa.float64()) for label in header.labels]
    fields += [pa.field("moved", pa.list_(pa.string())), pa.field("contacts", pa.list_(_contact()))]
    schema = pa.schema(fields, metadata={METADATA_KEY: header.model_dump_json().encode()})
    if len(set(schema.names)) < len(schema.names):
        raise OutputError(COLUMN_TWICE(name=next(name for name in schema.names if schema.names.count(name) > 1)))
    waiting: list[Any] = []
    done = 0
    with pq.ParquetWriter(sink, schema, compression="zstd", write_page_checksum=True) as writer:
        for block in blocks:
            waiting.append(_batch(schema, header, block, done))
            done += block.count
            if sum(one.num_rows for one in waiting) >= GROUP_SCENES:
                writer.write_table(pa.Table.from_batches(waiting), row_group_size=GROUP_SCENES)
                waiting = []
        if waiting:
            writer.write_table(pa.Table.from_batches(waiting), row_group_size=GROUP_SCENES)


def names_settled(path: Path, wanted: bytes) -> bool:
    """Whether the metadata of a file says that it holds settled scenes; False where it cannot be read."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        metadata = pq.read_metadata(path).metadata or {}
    except (pa.ArrowException, OSError, ValueError):
        return False
    return wanted in metadata.get(METADATA_KEY, b"")


def read_poses(path: Path) -> tuple[SettledHeader, Array, Array]:
    """The header, the poses (n, N, 7) and the surfaces (n, M), NaN where null stands. Raises DataError."""
    from scenegen.scenes.formats.parquet import check_rows, is_number, open_parquet, report_pyarrow_errors

    with (
        open_input(path, "a file of settled scenes") as file,
        report_pyarrow_errors(lambda said: DAMAGED_PARQUET(path=path, reason=said)),
    ):
        parquet = open_parquet(path, file)
        header = settled_header((parquet.metadata.metadata or {}).get(METADATA_KEY, b""), path)
        names = [f"{name}.{column}" for name in header.objects for column in POSE]
        names += [f"{name}.on" for name in header.surfaces]
        for name in names:
            if name not in parquet.schema_arrow.names:
                raise DataError(WRONG_COLUMNS(path=path, name=name, wanted=tuple(names)))
            if not is_number(parquet.schema_arrow.field(name).type):
                raise DataError(WRONG_COLUMNS(name=name, path=path, found=parquet.schema_arrow.field(name).type))
        check_rows(path, parquet, len(names))
        table = parquet.read(columns=names, use_threads=False)
    values = np.array([table.column(name).to_numpy() for name in names], dtype=np.float64)
    poses, on = np.split(values.T, [len(header.objects) * len(POSE)], axis=1)
    return header, poses.reshape(table.num_rows, len(header.objects), len(POSE)), on


def _contact() -> Any:
    import pyarrow as pa

    return pa.struct([("a", pa.string()), ("b", pa.string()), ("depth_mm", pa.float64())])


def _batch(schema: Any, header: SettledHeader, block: SettledBlock, done: int) -> Any:
    import pyarrow as pa

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
        pa.array(contacts, type=pa.list_(_contact())),
    ]
    return pa.record_batch(columns, schema=schema)
