"""Scenes of a file as training data: `--data scenes.parquet`, .jsonl or .json.

The phi that a file stores is not looked at: every scene is labelled by the spec that is trained on, so a file of
another spec about the same objects serves as well. What fits is held in memory; a longer Parquet file is read anew in
every epoch (scenegen.data.streamed).
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import torch
from torch import Tensor

from scenegen.data.arrange import arranged, check_scenes, order_of
from scenegen.data.dataset import Dataset, labelled
from scenegen.errors import DataError, Diagnostic, RequestError
from scenegen.formats.blocks import Block
from scenegen.formats.table import read_scenes
from scenegen.lang.spec import CheckedSpec

WHOLE = 1 << 26  # coordinates and labels of scenes that are held in memory at once: 268 MB as float32


def fits(spec: CheckedSpec, scenes: int) -> bool:
    """Whether that many scenes are held in memory. It depends on the spec alone, not on the machine."""
    return scenes * (3 * len(spec.objects) + len(spec.labels)) <= WHOLE


def whole_file(spec: CheckedSpec, path: Path, scenes: int | None) -> Dataset:
    """The first `scenes` scenes of a file (None: all), labelled by `spec`.

    Raises DataError where they are not of the spec's objects or break it, and where there are fewer; RequestError for a
    file that is no scene file by its name, or too long for memory.
    """
    reading = read_scenes(path)
    order = order_of(spec, [one.name for one in reading.header.objects])
    found: list[Tensor] = []
    count = 0
    for block in limited(reading.blocks, scenes):
        found.append(storage(spec, block, order, count))
        count += block.count
        if not fits(spec, count):
            title = f"{path} holds more scenes than fit into memory"
            raise RequestError(Diagnostic(title, help="write it as .parquet, which is read part by part"))
    if not count:
        raise DataError(Diagnostic(f"there are no scenes in {path}", help="sample some first"))
    check_count(path, count, scenes)
    return labelled(spec, torch.cat(found, dim=1))


def limited(blocks: Iterator[Block], scenes: int | None) -> Iterator[Block]:
    """The first `scenes` scenes of some blocks."""
    left = scenes
    for block in blocks:
        if left is not None and block.count >= left:
            yield block.part(0, left)
            return
        yield block
        left = None if left is None else left - block.count


def storage(spec: CheckedSpec, block: Block, order: list[int], before: int) -> Tensor:
    """A block's scenes as (3N, m) float32 in the spec's order of objects, checked. Raises DataError."""
    rows = arranged(block.rows, order)
    check_scenes(spec, rows, before)
    return torch.from_numpy(rows).to(torch.float32)


def check_count(path: Path, found: int, scenes: int | None) -> None:
    """Raises DataError where a file holds fewer scenes than were asked for."""
    if scenes is not None and found < scenes:
        title = f"{path} holds {found:,} scenes, not the {scenes:,} of --scenes"
        raise DataError(Diagnostic(title, help="leave --scenes out to train on all of them"))
