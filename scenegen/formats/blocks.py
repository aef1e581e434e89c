"""Scenes as blocks of arrays: what file formats take and give, however many scenes there are."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from scenegen.errors import DataError, Diagnostic

if TYPE_CHECKING:
    from scenegen.scene.data import SceneFile

Array = npt.NDArray[np.float64]

BLOCK = 65_536  # scenes of a block, and of a row group of a Parquet file
MOST = 1 << 26  # coordinates and values of phi that are read into memory at once: 537 MB


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
    """An open scene file. `header` has no scenes in it; `blocks` gives them, once, and closes the file at its end.
    `count` is how many there are where the file says so before they are read; `name` is what errors call it."""

    header: SceneFile
    labels: tuple[str, ...]
    blocks: Iterator[Block]
    count: int | None = None
    name: str = "this file"

    def whole(self, start: int = 0, stop: int | None = None) -> Block:
        """All scenes at once, or those from `start` up to, not including, `stop`. Raises DataError where they are too
        many for memory: before they are read, where the file says how many there are."""
        coordinates = 3 * len(self.header.objects)
        most = MOST // (coordinates + len(self.labels))
        known = self.count if stop is None else stop if self.count is None else min(stop, self.count)
        if known is not None and known - start > most:
            raise self._too_many(f"{known - start:,}", most)
        found: list[Block] = []
        done = held = 0
        for block in self.blocks:
            part = block.part(max(0, start - done), block.count if stop is None else max(0, stop - done))
            done += block.count
            held += part.count
            if held > most:
                raise self._too_many(f"more than {most:,}", most)
            found.append(part)
            if stop is not None and done >= stop:
                break
        return joined(found, coordinates, len(self.labels))

    def _too_many(self, count: str, most: int) -> DataError:
        title = f"{self.name} holds {count} scenes of {len(self.header.objects)} objects: too many for memory"
        help_ = (
            f"at most {most:,} of them are read at once; in Python, scenegen.read_scenes(path, stop={most}) reads a"
            " part. `scenegen export` makes other scene files of any number, block by block"
        )
        return DataError(Diagnostic(title, help=help_))


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
