"""The engine of this machine: pieces are drawn by worker processes, shards are written in this process, by threads.

Packing and writing a shard takes longer than drawing its scenes where these are easy to find. Nearly all of it is in
libraries that let other threads run, so threads of this process do as well as processes, and nothing is sent to them.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures import wait as wait_for
from contextlib import closing
from dataclasses import replace
from itertools import count
from typing import Any

from scenegen.engine.drawing import Drawing
from scenegen.engine.engines import Drawn, Engine, Held, Writing, chosen
from scenegen.engine.run import jobs
from scenegen.formats.blocks import Array, Block
from scenegen.formats.sets import Shard
from scenegen.formats.stores import Tell
from scenegen.processes.pool import check_workers, run_pieces
from scenegen.processes.process import cores
from scenegen.processes.reserve import Reserve
from scenegen.sampling.plan import Plan

WRITERS = 2  # shards that are written at a time; each holds its scenes twice


class Local(Engine):
    """Holds scenes as blocks in memory. A single worker is this process, which then writes shards before it goes on."""

    def __init__(self, workers: int, reserve: Reserve | None = None) -> None:
        self._workers, self._reserve = workers, reserve
        self._threads = ThreadPoolExecutor(min(workers, WRITERS)) if workers > 1 else None
        self._tell: Tell | None = None
        self._writing: deque[Future[tuple[Shard, list[str]]]] = deque()

    def pieces(self, drawing: Drawing, first: int) -> Generator[Drawn, None, None]:
        with closing(run_pieces(drawing, count(first), self._workers, self._reserve)) as results:
            for scenes, cell, facts in results:
                yield Drawn(cell, facts, scenes)

    def choose(self, which: Array, parts: Mapping[int, Held]) -> Held:
        return chosen(which, parts)

    def fetch(self, scenes: Held) -> Block:
        assert isinstance(scenes, Block)
        return scenes

    def hold(self, scenes: Block) -> Held:
        return scenes

    def write(self, writing: Writing, number: int, pieces: int, blocks: Sequence[Held]) -> None:
        self._tell = writing.store.tell
        if self._threads is None:
            done: Future[tuple[Shard, list[str]]] = Future()
            done.set_result((writing(number, pieces, blocks), []))
            self._writing.append(done)
            return
        if len(self._writing) >= WRITERS:
            wait_for([self._writing[0]])
        self._writing.append(self._threads.submit(_write, writing, number, pieces, blocks))

    def written(self, *, wait: bool) -> list[Shard]:
        shards = []
        while self._writing and (wait or self._writing[0].done()):
            shard, said = self._writing.popleft().result()
            for line in said:
                if self._tell is not None:
                    self._tell(line)
            shards.append(shard)
        return shards

    def close(self) -> None:
        """`pieces` ends its processes; shards that were begun are written, or fail, unseen."""
        if self._threads is not None:
            self._threads.shutdown(cancel_futures=True)


def _write(writing: Writing, number: int, pieces: int, blocks: Sequence[Held]) -> tuple[Shard, list[str]]:
    """A shard, and what its store said on the way, for the main thread to tell."""
    said: list[str] = []
    return replace(writing, store=writing.store.told_to(said.append))(number, pieces, blocks), said


def map_each(
    job: Callable[[Any], Any], items: Iterable[Any], workers: int | None, address: str | None
) -> Generator[Any, None, None]:
    """job(item) of every item, in their order; by one process per core, or as many as there are items."""
    items = list(items)
    count = check_workers(workers) if workers is not None else max(1, min(cores(), len(items) // 2))
    return run_pieces(job, items, count)


def start(workers: int | None, plan: Plan, address: str | None, reserve: Reserve | None) -> Engine:
    """`workers` is that of the plan's request, if it has one."""
    return Local(jobs(plan), reserve)
