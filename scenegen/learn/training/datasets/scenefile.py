"""Scenes of a file as training data: `--data scenes.parquet`, .jsonl or .json.

The phi that a file stores is not looked at: every scene is labelled by the spec that is trained on, so a file of
another spec about the same objects serves as well. What fits is held in memory; a longer Parquet file is read again in
every epoch (scenegen.learn.training.datasets.streamed).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from scenegen.errors import DataError, RequestError
from scenegen.errors.learning import TOO_FEW_IN_FILE, TOO_MANY_TO_TRAIN
from scenegen.errors.requests import NO_SCENES
from scenegen.lang.spec import CheckedSpec
from scenegen.learn.training.datasets.dataset import Dataset, labelled
from scenegen.pose import row_count, rows_of
from scenegen.scenes.arrange import as_core, check_scenes, order_of, refuse_numbers
from scenegen.scenes.blocks import Block, SceneFileReading, counts_in, element, member_of, numbers_in
from scenegen.scenes.data import SceneFile
from scenegen.scenes.formats.registry import read_scenes

# --------------------------------------------------------------------------------------------------------------------
# Scenes of a file that differ in how many things there are, as training data of one number: a model has one.


def of_member(reading: SceneFileReading, spec: CheckedSpec) -> tuple[SceneFileReading, str | None]:
    """The scenes with the things that `spec` has, as a file of these alone, and how many things that are, in words; a
    file whose scenes all have the same things as it is. Raises DataError where no scene of the file can have the spec's
    objects."""
    header = reading.header
    if not header.counts:
        return reading, None
    names = [one.name for one in header.objects]
    there = np.array([[name in spec.objects for name in names]])
    try:
        wanted = numbers_in(names, header.counts, there)[:, 0]
    except ValueError:
        order_of(spec, names)  # says what differs
        refuse_numbers(header, "training")
        raise
    member = member_of(header, dict(zip((one.name for one in header.counts), wanted.tolist(), strict=True)))
    here = {one.name for one in member.objects}
    rows = [row for which, name in enumerate(names) if name in here for row in rows_of(which)]
    rows += [row_count(len(names)) + which for which, one in enumerate(header.choosers) if one.name in here]

    def blocks() -> Iterator[Block]:
        for block in reading.blocks:
            mine = np.flatnonzero((counts_in(header, block.rows) == wanted[:, None]).all(axis=0))
            yield Block(block.rows[np.array(rows)[:, None], mine], block.phi[:, mine])

    counted = " and ".join(element(one, number) for one, number in zip(header.counts, wanted.tolist(), strict=True))
    return replace(reading, header=member, blocks=blocks(), count=None), counted


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
