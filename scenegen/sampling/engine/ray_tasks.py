"""What a cluster's tasks do: they run in Ray's worker processes."""

from __future__ import annotations

import gc
import pickle
import time
import uuid
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import numpy as np

from scenegen.processes.pool import one_thread
from scenegen.processes.worker import raise_gc_threshold
from scenegen.sampling.engine.blocks import Cells
from scenegen.sampling.engine.engines import ShardWriter, chosen
from scenegen.scenes.blocks import Array, Block
from scenegen.scenes.sets import Shard
from scenegen.search.effort import StoppedError


@dataclass(frozen=True, slots=True)
class StoredJob:
    """A pickled job that many tasks share, as bytes in the object store; only its name tells it from others."""

    name: str
    data: np.ndarray[Any, Any] = field(compare=False)


def packed(job: object) -> StoredJob:
    return StoredJob(uuid.uuid4().hex, np.frombuffer(pickle.dumps(job, protocol=5), dtype=np.uint8))


@lru_cache(maxsize=4)
def _job(sent: StoredJob) -> Any:
    """A plan is read, or a model loaded, once in each process."""
    job = pickle.loads(sent.data.data)  # noqa: S301 - from the driver of this run
    gc.freeze()  # it stays: no collection has to look at it
    raise_gc_threshold()
    return job


def draw(sent: StoredJob, first: int, count: int) -> list[tuple[Cells, Array, float] | StoppedError | Block | None]:
    """Of each of `count` pieces from `first` on: cells, facts and the seconds that it took; then its scenes. From the
    piece on that a time limit cuts short: what that raises, and None."""
    found: list[tuple[Cells, Array, float] | StoppedError | Block | None] = []
    with one_thread():
        job = _job(sent)
        for k in range(first, first + count):
            begun = time.perf_counter()
            try:
                scenes, cell, facts = job(k)
            except StoppedError as stopped:
                return found + [stopped, None] * (first + count - k)
            found += [(cell, facts, time.perf_counter() - begun), scenes]
    return found


def apply(sent: StoredJob, item: Any) -> Any:
    return _job(sent)(item)


def choose(which: Array, numbers: list[int], *parts: Block) -> Block:
    return chosen(which, dict(zip(numbers, parts, strict=True)))


def write(
    sent: StoredJob, number: int, pieces: int, picks: list[Array | None], numbers: list[int], *scenes: Block
) -> tuple[Shard, list[str]]:
    """A shard, and what its store said on the way. `scenes` are parts, by their `numbers`, then whole blocks, which
    stand where a pick is None."""
    said: list[str] = []
    parts, whole = dict(zip(numbers, scenes, strict=False)), iter(scenes[len(numbers) :])
    blocks = [next(whole) if which is None else chosen(which, parts) for which in picks]
    writing: ShardWriter = _job(sent)
    return replace(writing, store=writing.store.told_to(said.append))(number, pieces, blocks), said
