"""Where the pieces of a set are drawn and its shards written: the interface of all engines, and this machine's.

An engine returns pieces in their order and carries out three more kinds of work on what it holds: choosing scenes of
pieces, writing a shard, and fetching scenes. Which process or machine does what never changes a byte.
"""

from __future__ import annotations

import contextlib
import functools
import importlib
import itertools
import queue
import threading
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextlib import closing
from dataclasses import dataclass, replace
from typing import Any, Generic, TypeVar

import numpy as np

from scenegen.arrays import Array, Index
from scenegen.errors import Diagnostic, RequestError, ScenegenError
from scenegen.errors.files import ADDRESS_WITHOUT_RAY, UNKNOWN_ENGINE
from scenegen.errors.program import PROCESS_DIED
from scenegen.processes.pool import check_workers, one_thread, run_pieces
from scenegen.processes.process import cores
from scenegen.sampling.engine.blocks import Cells, Drawing
from scenegen.sampling.engine.run import jobs
from scenegen.sampling.plan import Plan
from scenegen.scenes.blocks import Block, take_columns
from scenegen.scenes.motions import AnyFile
from scenegen.scenes.sets import PARQUET, Shard, pack_shard, shard_name
from scenegen.scenes.stores import Store, Tell

SceneHandle = Any
"""Scenes that an engine holds, here or elsewhere: only the engine looks into it."""

ENGINES = {"local": "", "ray": "scenegen.sampling.engine.ray"}  # where those are that are not this machine


DrawnPiece = tuple[SceneHandle, Cells, Array]
"""A piece without its candidates out of range: these, held by the engine, the cell of each (m,), and its facts."""


@dataclass(frozen=True, slots=True)
class ShardWriter:
    """The work of writing a shard from blocks of scenes: every scene is checked once more, then the file is written. It
    is sent to other processes. Raises AssertionError for a scene that fails the check, OutputError. `ahead` is called
    with every block, too."""

    plan: Plan
    store: Store
    header: AnyFile
    labels: tuple[str, ...]
    stored: Callable[[Array], Array] | None = None  # makes of the core's rows what files hold
    ending: str = PARQUET
    ahead: Callable[[Block], None] | None = None

    def __call__(self, number: int, pieces: int, blocks: Iterable[Block]) -> Shard:
        return self.write(number, pieces, map(self.ready, blocks))

    def write(self, number: int, pieces: int, blocks: Iterable[Block]) -> Shard:
        """A shard of blocks that are `ready`."""
        with self.store.whole(shard_name(number, self.ending)) as sink:
            return pack_shard(sink, number, self.header, self.labels, blocks, pieces=pieces, ending=self.ending)

    def ready(self, block: Block) -> Block:
        """A block as files hold it, checked."""
        if self.plan.is_verified:
            self.plan.check(block.rows, block.phi)
        found = block if self.stored is None else Block(self.stored(block.rows), block.phi)
        if self.ahead is not None:
            self.ahead(found)
        return found


def choose_scenes(which: Array, parts: Mapping[int, Block]) -> Block:
    """Scenes by the number of their part and their place in it, (2, m), as one block in that order."""
    part, place = which.astype(np.intp)
    first, numbers = part_numbers(which)
    blocks = [parts[first + number] for number in numbers.tolist()]
    start = np.zeros(int(numbers.max(initial=0)) + 1, dtype=np.intp)
    start[numbers] = np.cumsum([0, *(block.count for block in blocks[:-1])])
    place += start[part - first]
    return Block(
        take_columns([block.rows for block in blocks], place), take_columns([block.phi for block in blocks], place)
    )


def part_numbers(which: Array) -> tuple[int, Index]:
    """The numbers of the parts that scenes (2, m) are in: the least one, and all, counted from there, in order."""
    part = which[0].astype(np.intp)
    first = int(part.min(initial=0))
    return first, np.flatnonzero(np.bincount(part - first))  # they are close together, so nothing has to be sorted


class Engine(ABC):
    """One run's engine: a context manager that ends its processes. `threaded` says that threads of this process pack
    what the run gives them."""

    threaded = False

    def __enter__(self) -> Engine:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @abstractmethod
    def pieces(self, drawing: Drawing, first: int) -> Generator[DrawnPiece, None, None]:
        """The pieces from number `first` on, in order, without end. Raises what drawing raises."""

    @abstractmethod
    def choose(self, which: Array, parts: Mapping[int, SceneHandle]) -> SceneHandle:
        """Scenes of several parts as one: see `choose_scenes`."""

    def pick(self, which: Array, parts: Mapping[int, SceneHandle]) -> SceneHandle:
        """The same for `write` alone: they may stay where they are until then."""
        return self.choose(which, parts)

    def pack(self, writing: ShardWriter, number: int, block: SceneHandle) -> SceneHandle:
        """One more block of shard `number`, which may be packed already. Returns what `write` needs of it."""
        return block

    @abstractmethod
    def fetch(self, scenes: SceneHandle) -> Block:
        """Scenes that the engine holds, in this process."""

    @abstractmethod
    def hold(self, scenes: Block) -> SceneHandle:
        """Scenes of this process, for the engine to hold."""

    @abstractmethod
    def write(self, writing: ShardWriter, number: int, pieces: int, blocks: Sequence[SceneHandle]) -> None:
        """Begin to write shard `number`; `blocks` are what `pack` has returned. Waits if too many are being
        written."""

    @abstractmethod
    def finished_shards(self, *, wait: bool) -> Iterator[Shard]:
        """The shards that are complete, in order, each once; with `wait`, all that were begun. Raises what writing the
        next one raises, each time."""

    @abstractmethod
    def close(self) -> None:
        """End all processes of this engine, whatever they do."""


# This machine: pieces are drawn by worker processes, shards are packed in this process, by threads, block by block
# while they fill; so little of the last one is left when the last scene is drawn.


Packed = TypeVar("Packed")

POLL_SECONDS = 0.5  # seconds after which a thread that waits looks whether all is over


class BlockPacker(Generic[Packed]):
    """`work` gets the blocks in a thread, as they are added; one of them waits at most."""

    def __init__(self, threads: ThreadPoolExecutor, work: Callable[[Iterator[Block]], Packed]) -> None:
        self._blocks: queue.Queue[Block | None] = queue.Queue(1)
        self._over = threading.Event()
        self._result = threads.submit(lambda: work(self._blocks_added()))

    def add(self, block: Block) -> None:
        """One more block. Raises what the work has raised."""
        if not self._put(block):
            self._result.result()

    def finish(self) -> None:
        """There are no more blocks."""
        self._put(None)

    def _put(self, block: Block | None) -> bool:
        """Whether the work goes on: it has failed if it ends before its last block."""
        while not self._result.done():
            with contextlib.suppress(queue.Full):
                self._blocks.put(block, timeout=POLL_SECONDS)
                return True
        return False

    @property
    def is_done(self) -> bool:
        return self._result.done()

    def result(self) -> Packed:
        """What the work returns, once that is known. Raises what it raises."""
        return self._result.result()

    def give_up(self) -> None:
        """The work is not to be completed: its iterator of blocks raises CancelledError."""
        self._over.set()
        self._result.cancel()

    def _blocks_added(self) -> Iterator[Block]:
        while True:
            try:
                block = self._blocks.get(timeout=POLL_SECONDS)
            except queue.Empty:
                if self._over.is_set():
                    raise CancelledError from None
                continue
            if block is None:
                return
            yield block


MAX_SHARD_WRITERS = 3  # shards that are packed and written at a time

Written = tuple[Shard, list[str]]
"""A shard, and what its store said on the way, for the main thread to tell."""


class Local(Engine):
    """Holds scenes as blocks in memory. A single worker is this process, which then writes shards before it goes on."""

    def __init__(self, workers: int) -> None:
        self._workers = workers
        self._threads = ThreadPoolExecutor(MAX_SHARD_WRITERS) if workers > 1 else None
        self.threaded = workers > 1
        self._tell: Tell | None = None
        self._packing: BlockPacker[Written] | None = None  # the shard that is being filled
        self._packed: deque[tuple[BlockPacker[Written], int]] = deque()  # those that are full, and their pieces
        self._shards: deque[Shard] = deque()  # written by this process, in order

    def pieces(self, drawing: Drawing, first: int) -> Generator[DrawnPiece, None, None]:
        with closing(run_pieces(drawing, itertools.count(first), self._workers)) as pieces:
            for piece in pieces:
                yield piece, piece.cell, piece.facts

    def choose(self, which: Array, parts: Mapping[int, SceneHandle]) -> SceneHandle:
        return choose_scenes(which, parts)

    def fetch(self, scenes: SceneHandle) -> Block:
        assert isinstance(scenes, Block)
        return scenes

    def hold(self, scenes: Block) -> SceneHandle:
        return scenes

    def pack(self, writing: ShardWriter, number: int, block: SceneHandle) -> SceneHandle:
        if self._threads is None:
            return block
        self._packing = self._packing or BlockPacker(self._threads, functools.partial(_write_shard, writing, number))
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

    def finished_shards(self, *, wait: bool) -> Iterator[Shard]:
        while self._shards:
            yield self._shards.popleft()
        while self._packed and (wait or self._packed[0][0].is_done):
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


def _write_shard(writing: ShardWriter, number: int, blocks: Iterator[Block]) -> Written:
    """Runs in a thread."""
    said: list[str] = []
    return replace(writing, store=writing.store.with_progress(said.append)).write(number, 0, blocks), said


def map_each(
    name: str, job: Callable[[Any], Any], items: Iterable[Any], workers: int | None, address: str | None = None
) -> Generator[Any, None, None]:
    """job(item) of every item, in their order, by an engine. Raises what the job raises, and what `open_engine`
    does."""
    module = ENGINES[check_engine(name, address)]
    if module:
        results: Generator[Any, None, None] = importlib.import_module(module).map_each(job, items, workers, address)
        return results
    items = list(items)
    return run_pieces(
        job, items, check_workers(workers) if workers is not None else max(1, min(cores(), len(items) // 2))
    )


def check_engine(name: str, address: str | None = None) -> str:
    """The name. Raises RequestError for one that is not in the table, and an address that the engine has no use for."""
    if name not in ENGINES:
        raise RequestError(UNKNOWN_ENGINE(name=name, known=ENGINES))
    if address is not None and name != "ray":
        raise RequestError(ADDRESS_WITHOUT_RAY())
    return name


def open_engine(name: str, workers: int | None, plan: Plan, address: str | None = None) -> Engine:
    """An engine by its name. `workers` is the number of processes, None for as many as serve. Raises RequestError for
    an unknown name, a package that is not installed, and a cluster that cannot be reached."""
    module = ENGINES[check_engine(name, address)]
    if module:
        engine: Engine = importlib.import_module(module).start(workers, address)
        return engine
    return Local(jobs(plan))  # the plan's request has the number of workers, if somebody gave one


# Many independent jobs, each with a name: a job that fails is reported and does not stop the others.
#
# The one mechanism for whatever is many jobs: trainings, files to draw or to settle, experiments, shards of a data
# set. Jobs run on this machine's processes or on a cluster; results come in the order of the jobs, and each job works
# on one thread, so that neither the engine nor the number of workers changes a byte.


Named = tuple[str, Any]
"""A job's name and its item."""


@dataclass(frozen=True, slots=True)
class JobResult:
    """A job that is over: its value, or why it failed."""

    name: str
    value: Any = None
    errors: tuple[Diagnostic, ...] = ()


@dataclass(frozen=True, slots=True)
class Attempt:
    """A job whose errors are results. Bugs are raised as they are."""

    job: Callable[[Any], Any]

    def __call__(self, named: Named) -> JobResult:
        name, item = named
        try:
            with one_thread():
                return JobResult(name, self.job(item))
        except ScenegenError as error:
            return JobResult(name, errors=tuple(error.diagnostics))


def run_here(job: Callable[[Any], Any], items: Iterable[Named]) -> Generator[JobResult, None, None]:
    """Every job in this process, one after the other: for jobs that use all processes themselves."""
    for name, item in items:
        try:
            ended = JobResult(name, job(item))
        except ScenegenError as error:
            ended = JobResult(name, errors=tuple(error.diagnostics))
        yield ended


def run_each(
    job: Callable[[Any], Any],
    items: Sequence[Named],
    engine: str = "local",
    workers: int | None = None,
    address: str | None = None,
) -> Generator[JobResult, None, None]:
    """job(item) of every named item, in their order, by an engine; `job`, items and results must be picklable.

    `workers` is the number of processes, by default one per core; a job that ends its process twice has failed like any
    other. Raises RequestError for an unknown engine, a package that is not installed, a cluster that cannot be reached
    and a wrong number of workers; ScenegenError where processes cannot start or the cluster fails.
    """
    lost: dict[int, JobResult] = {}  # whose process died, by place
    place = 0
    while place < len(items):
        rest = [index for index in range(place, len(items)) if index not in lost]
        try:
            with closing(_results(Attempt(job), [items[index] for index in rest], engine, workers, address)) as results:
                for index, ended in zip(rest, results, strict=True):
                    yield from (lost[before] for before in range(place, index))
                    place = index + 1
                    yield ended
        except ScenegenError as error:
            which = _lost_item(error)
            if which is None:
                raise
            index = rest[which]
            lost[index] = JobResult(items[index][0], errors=tuple(error.diagnostics))
            continue
        yield from (lost[index] for index in range(place, len(items)))
        return


def _results(
    job: Attempt, items: list[Named], engine: str, workers: int | None, address: str | None
) -> Generator[JobResult, None, None]:
    if engine == "local" and address is None:  # needs no pyarrow
        count = check_workers(workers) if workers is not None else cores()
        return run_pieces(job, items, max(1, min(count, len(items))))

    return map_each(engine, job, items, workers, address)


def _lost_item(error: ScenegenError) -> int | None:
    """The number of the item at which processes died, None for another error."""
    first = error.diagnostics[0]
    which = first.facts.get("item")
    return which if first.code == PROCESS_DIED.code and isinstance(which, int) else None
