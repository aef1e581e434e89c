"""The engine of this machine: pieces are drawn by worker processes, shards are written in this process."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from contextlib import closing
from itertools import count
from typing import Any

from scenegen.engine.drawing import Drawing
from scenegen.engine.engines import Drawn, Engine, Held, Writing, chosen
from scenegen.engine.run import jobs
from scenegen.formats.blocks import Array, Block
from scenegen.formats.sets import Shard
from scenegen.processes.pool import check_workers, run_pieces
from scenegen.processes.process import cores
from scenegen.sampling.plan import Plan


class Local(Engine):
    """Holds scenes as blocks in memory."""

    def __init__(self, workers: int) -> None:
        self._workers = workers
        self._written: list[Shard] = []

    def pieces(self, drawing: Drawing, first: int) -> Generator[Drawn, None, None]:
        with closing(run_pieces(drawing, count(first), self._workers)) as results:
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
        self._written.append(writing(number, pieces, blocks))

    def written(self, *, wait: bool) -> list[Shard]:
        done, self._written = self._written, []
        return done

    def close(self) -> None:
        """Nothing to do: `pieces` ends its processes."""


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
