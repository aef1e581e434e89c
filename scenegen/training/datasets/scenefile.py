"""Scenes of a file as training data: `--data scenes.parquet`, .jsonl or .json.

The phi that a file stores is not looked at: every scene is labelled by the spec that is trained on, so a file of
another spec about the same objects serves as well. What fits is held in memory; a longer Parquet file is read again in
every epoch (scenegen.training.datasets.streamed).
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import torch
from torch import Tensor

from scenegen.errors import DataError, RequestError
from scenegen.errors.models import TOO_FEW_IN_FILE, TOO_MANY_TO_TRAIN
from scenegen.errors.requests import NO_SCENES
from scenegen.formats.blocks import Block
from scenegen.formats.registry import read_scenes
from scenegen.lang.spec import CheckedSpec
from scenegen.pose import row_count
from scenegen.scene.data import SceneFile
from scenegen.training.datasets.arrange import as_core, check_scenes, order_of
from scenegen.training.datasets.dataset import Dataset, labelled
from scenegen.training.datasets.numbered import of_member

WHOLE = 1 << 26  # coordinates and labels of scenes that are held in memory at once: 268 MB as float32


def fits(spec: CheckedSpec, scenes: int) -> bool:
    """Whether that many scenes are held in memory. It depends on the spec alone, not on the machine."""
    return scenes * (row_count(len(spec.core.objects)) + len(spec.labels)) <= WHOLE


def whole_file(spec: CheckedSpec, path: Path, scenes: int | None) -> Dataset:
    """The first `scenes` scenes of a file (None: all), labelled by `spec`; of a file whose scenes differ in how many
    things there are, those with the spec's.

    Raises DataError where they are not of the spec's objects or break it, and where there are fewer; RequestError for a
    file that is no scene file by its name, or too long for memory.
    """
    reading, counted = of_member(read_scenes(path), spec)
    header = reading.header
    order = order_of(spec, [one.name for one in header.objects])
    found: list[Tensor] = []
    count = 0
    for block in limited(reading.blocks, scenes):
        found.append(storage(spec, header, block, order, count))
        count += block.count
        if not fits(spec, count):
            raise RequestError(TOO_MANY_TO_TRAIN(path=path))
    if not count:
        raise DataError(NO_SCENES(file=path, counted=counted))
    check_count(path, count, scenes, counted)
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


def storage(spec: CheckedSpec, header: SceneFile, block: Block, order: list[int], before: int) -> Tensor:
    """A block's scenes as (3N, m) float32 in the spec's order of objects, then the switches of choices, checked. Raises
    DataError."""
    rows = as_core(spec, header, block.rows, order)
    check_scenes(spec, rows, before)
    return torch.from_numpy(rows).to(torch.float32)


def check_count(path: Path, found: int, scenes: int | None, counted: str | None = None) -> None:
    """Raises DataError where a file holds fewer scenes than were asked for; `counted` says of which numbers of
    things."""
    if scenes is not None and found < scenes:
        raise DataError(TOO_FEW_IN_FILE(path=path, found=found, wanted=scenes, counted=counted))
