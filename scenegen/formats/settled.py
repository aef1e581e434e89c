"""Settled scenes as JSON, JSON Lines and Parquet; written block by block, whole or not at all.

They are results, and are not read back: `json`, pandas and polars do that.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import IO, Any

import numpy as np

from scenegen.formats.files import whole_file
from scenegen.formats.registry import format_of
from scenegen.formats.settled_blocks import MM, POSE, SettledBlock
from scenegen.scene.settled import SettledHeader


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
    from scenegen.formats import settled_parquet

    settled_parquet.write(sink, header, blocks)


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
    objects = {
        name: dict(zip((*POSE, "shift_mm", "turn_deg"), map(_number, row), strict=True))
        for name, row, here in zip(header.objects, rows.tolist(), there, strict=True)
        if here
    }
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
