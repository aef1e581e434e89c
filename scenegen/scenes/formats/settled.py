"""Settled scenes as JSON, JSON Lines and Parquet; written block by block, whole or not at all. Of what is in them only
the poses are read back.
"""

from __future__ import annotations

import contextlib
import json
import math
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import IO, Any

import numpy as np

from scenegen.errors import DataError
from scenegen.errors.files import DAMAGED_SCENES
from scenegen.scenes.data import SETTLED_FORMAT, SettledHeader
from scenegen.scenes.files import read_bytes, whole_file
from scenegen.scenes.formats.header import parse
from scenegen.scenes.formats.registry import format_of
from scenegen.scenes.formats.scenes_json import MOST_BYTES
from scenegen.scenes.formats.settled_blocks import MM, POSE, Array, SettledBlock, settled_header

PEEK = 256  # bytes at the start of a file within which it names its format


def write_settled(path: Path, header: SettledHeader, blocks: Iterable[SettledBlock]) -> None:
    """Write settled scenes in the format of the path's ending; the file appears whole or not at all. Raises
    RequestError, OutputError, and what `blocks` raises."""
    format_of(path)
    writers: dict[str, Callable[[IO[bytes], SettledHeader, Iterable[SettledBlock]], None]]
    writers = {".json": write_json, ".jsonl": write_lines, ".parquet": write_parquet}
    with whole_file(path) as sink:
        writers[path.suffix.lower()](sink, header, blocks)


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


def write_parquet(sink: IO[bytes], header: SettledHeader, blocks: Iterable[SettledBlock]) -> None:
    """A row per scene; see `settled_parquet`."""
    from scenegen.scenes.formats import settled_parquet

    settled_parquet.write(sink, header, blocks)


def is_settled(path: Path) -> bool:
    """Whether a .json, .jsonl or .parquet file is one of settled scenes; False where it cannot be read."""
    wanted = f'"{SETTLED_FORMAT}"'.encode()
    with contextlib.suppress(OSError, ModuleNotFoundError):
        match path.suffix.lower():
            case ".json" | ".jsonl" if path.is_file():
                with path.open("rb") as file:
                    return wanted in file.read(PEEK)
            case ".parquet" if path.is_file():
                from scenegen.scenes.formats.settled_parquet import names_settled

                return names_settled(path, wanted)
    return False


def read_settled(path: Path) -> tuple[SettledHeader, Array, Array]:
    """The header of a file of settled scenes, the poses (n, N, 7) and the surfaces (n, M), NaN of what is not there.
    Raises DataError, also for a scene whose simulation diverged."""
    if path.suffix.lower() == ".parquet":
        from scenegen.scenes.formats.settled_parquet import read_poses

        header, poses, on = read_poses(path)
    else:
        data = read_bytes(path, "a file of settled scenes", limit=MOST_BYTES, remedy="write .parquet")
        first, *lines = data.split(b"\n") if path.suffix.lower() == ".jsonl" else [data]
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
