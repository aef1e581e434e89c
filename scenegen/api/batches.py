"""Batches of a stored set, in order or shuffled, for one of several readers."""

from __future__ import annotations

import bisect
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
import numpy.typing as npt

from scenegen.arrays import Array
from scenegen.sampling.streams import BATCHES_STREAM
from scenegen.scenes.blocks import Block, join_blocks

MIXED_GROUPS = 4  # row groups whose scenes are mixed: 262,144 scenes


@dataclass(frozen=True, slots=True)
class RowGroup:
    """A row group: the number of its shard, its place in it, the number of its first scene in the set, its size."""

    shard: int
    index: int
    first: int
    count: int


class RowGroupStore(Protocol):
    """A stored set, as far as batches need it."""

    def __len__(self) -> int: ...
    def groups(self) -> list[RowGroup]: ...
    def read_group(self, group: RowGroup) -> Block: ...
    def poses(self, block: Block) -> Array: ...


@dataclass(frozen=True, slots=True, eq=False)
class SceneBatches:
    """Iterates over (poses (m, N, 3), phi (m, L)) in float64, m = `batch` but for the last. `reader` of `readers` gets
    its part of the scenes, `epoch` chooses the order."""

    stored: RowGroupStore
    batch: int
    shuffle: bool
    seed: int
    even: bool
    reader: int = 0
    readers: int = 1
    epoch: int = 0

    def __len__(self) -> int:
        """How many batches this reader gets."""
        start, stop = self._range()
        return -(-(stop - start) // self.batch)

    def for_reader(self, reader: int, readers: int, epoch: int) -> SceneBatches:
        """The batches of one reader of several in an epoch."""
        return replace(self, reader=reader, readers=readers, epoch=epoch)

    def __iter__(self) -> Iterator[tuple[Array, Array]]:
        rest: Block | None = None
        for mixed in self._mixed_blocks():
            block = mixed if rest is None else join_blocks([rest, mixed], len(mixed.rows), len(mixed.phi))
            whole = block.count // self.batch * self.batch
            yield from self._cut(block.part(0, whole))
            rest = block.part(whole, block.count) if whole < block.count else None
        if rest is not None:
            yield from self._cut(rest)

    def _cut(self, block: Block) -> Iterator[tuple[Array, Array]]:
        poses = self.stored.poses(block)
        phi = np.ascontiguousarray(block.phi.T)
        for start in range(0, block.count, self.batch):
            yield poses[start : start + self.batch], phi[start : start + self.batch]

    def _range(self) -> tuple[int, int]:
        total = len(self.stored)
        if self.even:
            total -= total % self.readers
        return total * self.reader // self.readers, total * (self.reader + 1) // self.readers

    def _mixed_blocks(self) -> Iterator[Block]:
        groups = self.stored.groups()
        generator = np.random.default_rng(np.random.SeedSequence([self.seed, BATCHES_STREAM, self.epoch]))
        order = generator.permutation(len(groups)) if self.shuffle else np.arange(len(groups))
        chosen = list(parts(groups, order, *self._range()))
        own = np.random.default_rng(
            np.random.SeedSequence([self.seed, BATCHES_STREAM, self.epoch, self.reader, self.readers])
        )
        step = MIXED_GROUPS if self.shuffle else 1
        for start in range(0, len(chosen), step):
            blocks = [self.stored.read_group(group).part(s.start, s.stop) for group, s in chosen[start : start + step]]
            block = join_blocks(blocks, len(blocks[0].rows), len(blocks[0].phi))
            if self.shuffle:
                which = own.permutation(block.count)
                block = Block(block.rows.take(which, axis=1), block.phi.take(which, axis=1))
            yield block


def parts(
    groups: list[RowGroup], order: npt.NDArray[np.intp], start: int, stop: int
) -> Iterator[tuple[RowGroup, slice]]:
    """Of the scenes of all groups in this order, those from `start` up to `stop`: a slice of each group."""
    ends = np.cumsum([groups[index].count for index in order])
    first = bisect.bisect_right(ends, start)
    for place in range(first, len(order)):
        group = groups[order[place]]
        begin = int(ends[place]) - group.count
        if begin >= stop:
            return
        yield group, slice(max(0, start - begin), min(group.count, stop - begin))
