"""Scenes as blocks of arrays: what file formats take and give, however many scenes there are."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from scenegen.scene.data import SceneFile

Array = npt.NDArray[np.float64]

BLOCK = 65_536  # scenes of a block, and of a row group of a Parquet file


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """m scenes: `rows` (3N, m) in the order of the file's objects, metres and radians; `phi` (L, m) in label order."""

    rows: Array
    phi: Array

    @property
    def count(self) -> int:
        return int(self.rows.shape[1])

    def part(self, start: int, stop: int) -> Block:
        """The scenes from `start` up to, not including, `stop`."""
        return Block(self.rows[:, start:stop], self.phi[:, start:stop])


@dataclass(frozen=True, slots=True, eq=False)
class Reading:
    """An open scene file. `header` has no scenes in it; `blocks` gives them, once, and closes the file at its end."""

    header: SceneFile
    labels: tuple[str, ...]
    blocks: Iterator[Block]

    def whole(self) -> Block:
        """All scenes at once."""
        objects = len(self.header.objects)
        return joined(list(self.blocks), 3 * objects, len(self.labels))


def joined(blocks: Sequence[Block], coordinates: int, labels: int) -> Block:
    """Several blocks as one; (coordinates, 0) and (labels, 0) where there are none."""
    rows = np.concatenate([np.empty((coordinates, 0)), *(block.rows for block in blocks)], axis=1)
    phi = np.concatenate([np.empty((labels, 0)), *(block.phi for block in blocks)], axis=1)
    return Block(rows, phi)


def regrouped(blocks: Iterable[Block], size: int = BLOCK) -> Iterator[Block]:
    """The same scenes in blocks of exactly `size`, the last one excepted; never more than `size` wait for others."""
    waiting: list[Block] = []
    count = 0
    for block in blocks:
        start = 0
        while count + block.count - start >= size:
            stop = start + size - count
            waiting.append(block.part(start, stop))
            yield _one(waiting)
            waiting, count, start = [], 0, stop
        if start < block.count:
            waiting.append(block.part(start, block.count))
            count += block.count - start
    if waiting:
        yield _one(waiting)


def _one(blocks: list[Block]) -> Block:
    return blocks[0] if len(blocks) == 1 else joined(blocks, len(blocks[0].rows), len(blocks[0].phi))


def check_numbers(block: Block) -> None:
    """No file holds infinities or NaN, and no sampler hands them out. Raises ValueError: a bug, not a user's fault."""
    if not (np.isfinite(block.rows).all() and np.isfinite(block.phi).all()):
        raise ValueError("a scene with a number that is not finite was to be written")
