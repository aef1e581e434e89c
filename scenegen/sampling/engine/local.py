"""The engine of this machine: pieces are drawn by worker processes, shards are packed in this process, by threads.

To pack and write a shard takes longer than to draw its scenes where these are easy to find. Nearly all of it is in
libraries that let other threads run, so threads of this process do as well as processes, and nothing is sent to them.
A shard is packed block by block while it fills, so little of the last one is left when the last scene is drawn. Packing
is the longest part, so its thread does nothing else: this one checks the scenes, and a third one computes the hash.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import replace
from functools import partial
from itertools import count
from typing import Any

from scenegen.processes.pool import check_workers, run_pieces
from scenegen.processes.process import cores
from scenegen.sampling.engine.blocks import Drawing
from scenegen.sampling.engine.engines import DrawnPiece, Engine, SceneHandle, ShardWriter, chosen
from scenegen.sampling.engine.run import jobs
from scenegen.sampling.engine.stream import BlockPacker, ByteBudget
from scenegen.sampling.plan import Plan
from scenegen.scenes.blocks import Array, Block
from scenegen.scenes.sets import Shard
from scenegen.scenes.stores import Tell

WRITERS = 3  # shards that are packed and written at a time

Written = tuple[Shard, list[str]]
"""A shard, and what its store said on the way, for the main thread to tell."""


class Local(Engine):
    """Holds scenes as blocks in memory. A single worker is this process, which then writes shards before it goes on."""

    def __init__(self, workers: int) -> None:
        self._workers = workers
        self._threads = ThreadPoolExecutor(WRITERS) if workers > 1 else None
        self._room = ByteBudget()
        self._tell: Tell | None = None
        self._packing: BlockPacker[Written] | None = None  # the shard that is being filled
        self._packed: deque[tuple[BlockPacker[Written], int]] = deque()  # those that are full, and their pieces
        self._shards: deque[Shard] = deque()  # written by this process, in order

    def pieces(self, drawing: Drawing, first: int) -> Generator[DrawnPiece, None, None]:
        with closing(run_pieces(drawing, count(first), self._workers)) as results:
            for scenes, cell, facts in results:
                yield DrawnPiece(cell, facts, scenes)

    def choose(self, which: Array, parts: Mapping[int, SceneHandle]) -> SceneHandle:
        return chosen(which, parts)

    def fetch(self, scenes: SceneHandle) -> Block:
        assert isinstance(scenes, Block)
        return scenes

    def hold(self, scenes: Block) -> SceneHandle:
        return scenes

    def pack(self, writing: ShardWriter, number: int, block: SceneHandle) -> SceneHandle:
        if self._threads is None:
            return block
        self._packing = self._packing or BlockPacker(self._threads, self._room, partial(_written, writing, number))
        self._packing.add(writing.ready(block))
        return None

    def write(self, writing: ShardWriter, number: int, pieces: int, blocks: Sequence[SceneHandle]) -> None:
        self._tell = writing.store.tell
        if self._threads is None:
            self._shards.append(writing(number, pieces, blocks))
            return
        assert self._packing is not None
        self._packing.finish()
        self._packed.append((self._packing, pieces))
        self._packing = None

    def written(self, *, wait: bool) -> Iterator[Shard]:
        while self._shards:
            yield self._shards.popleft()
        while self._packed and (wait or self._packed[0][0].done):
            packing, pieces = self._packed[0]
            shard, said = packing.result()
            self._packed.popleft()
            for line in said:
                if self._tell is not None:
                    self._tell(line)
            yield shard.model_copy(update={"pieces": pieces})

    def close(self) -> None:
        """Full shards are written, or fail, unseen."""
        if self._packing is not None:
            self._packing.give_up()
        if self._threads is not None:
            self._threads.shutdown(cancel_futures=True)


def _written(writing: ShardWriter, number: int, blocks: Iterator[Block]) -> Written:
    """Runs in a thread."""
    said: list[str] = []
    return replace(writing, store=writing.store.told_to(said.append)).write(number, 0, blocks, beside=True), said


def map_each(
    job: Callable[[Any], Any], items: Iterable[Any], workers: int | None, address: str | None
) -> Generator[Any, None, None]:
    """job(item) of every item, in their order; by one process per core, or as many as there are items."""
    items = list(items)
    count = check_workers(workers) if workers is not None else max(1, min(cores(), len(items) // 2))
    return run_pieces(job, items, count)


def start(workers: int | None, plan: Plan, address: str | None) -> Engine:
    """`workers` is that of the plan's request, if it has one."""
    return Local(jobs(plan))
