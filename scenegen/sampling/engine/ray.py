"""The engine of a Ray cluster: pieces and shards are tasks, scenes stay in the cluster's object store.

A task that is lost with its worker or its node is run again by Ray, and gives the same scenes. The driver sees the
cells of candidates only; scenes pass through it when they wait for more than one shard, which keeps the history that
Ray would have to repeat after a loss short. At most `TASKS_PER_CORE` tasks for each core and `MAX_SHARD_TASKS` shards
are under way, so memory is flat.
"""

from __future__ import annotations

import contextlib
import gc
import itertools
import os
import pickle
import sys
import time
import uuid
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import numpy as np

from scenegen.arrays import Array
from scenegen.errors import RequestError, ScenegenError
from scenegen.errors.files import CLUSTER_FAILED, CLUSTER_NOT_FOUND
from scenegen.errors.requests import NOT_INSTALLED
from scenegen.processes.pool import one_thread
from scenegen.processes.process import MALLOC_VARIABLES, SAFE_PATH, raise_gc_threshold
from scenegen.sampling.engine.blocks import Cells, Drawing
from scenegen.sampling.engine.engines import DrawnPiece, Engine, SceneHandle, ShardWriter, choose_scenes, part_numbers
from scenegen.scenes.blocks import Block
from scenegen.scenes.sets import Shard
from scenegen.search.effort import StoppedError

TASKS_PER_CORE = 3  # tasks for each core that draw pieces, or wait for their turn
# seconds that a task should take, and at most so many pieces: each task costs some ms
TASK_SECONDS, MAX_TASK_PIECES = 0.15, 8
MAX_SHARD_TASKS = 2  # shards that are written at a time
MAX_WHOLE_CANDIDATES = 1.5  # candidates for each scene up to which pieces stay whole until their scenes are written
NICENESS = "RAY_worker_niceness"  # 15 where it is not set
MAX_RETRIES = -1  # a task whose process or node dies is repeated, however often that happens; errors of a task are not


@dataclass(frozen=True, slots=True)
class _Stored:
    """Scenes in the object store."""

    reference: Any


@dataclass(frozen=True, slots=True)
class _Picked:
    """Scenes that are still in their parts, `which` (2, m) of them as in `choose_scenes`."""

    which: Array
    parts: Mapping[int, Any]


class Cluster(Engine):
    """Holds scenes as references to Ray's object store."""

    def __init__(self, ray: Any, workers: int | None, leave: Callable[[], None]) -> None:
        self._ray = ray
        self._leave = leave
        cores = max(1, int(ray.cluster_resources().get("CPU", 1)))
        self._ahead = TASKS_PER_CORE * min(workers or cores, cores)
        options = {"num_cpus": 1, "max_retries": MAX_RETRIES, "retry_exceptions": False}
        self._draw = ray.remote(**options)(draw)
        self._choose = ray.remote(**options)(choose)
        self._write = ray.remote(**options)(write)
        self._writing: deque[Any] = deque()
        self._tell: Callable[[str], None] = lambda line: None
        self._jobs: dict[int, tuple[object, Any]] = {}  # what was sent once, by identity
        self._candidates = self._picked = 0  # of this run, so far

    def pieces(self, drawing: Drawing, first: int) -> Generator[DrawnPiece, None, None]:
        job = self._send(drawing)
        waiting: deque[tuple[Any, Any]] = deque()
        k, together = first, 1
        try:
            while True:
                while len(waiting) < self._ahead * together:
                    made = self._draw.options(num_returns=2 * together).remote(job, k, together)
                    waiting.extend(zip(made[::2], made[1::2], strict=True))
                    k += together
                counts, scenes = waiting.popleft()
                found = self._get(counts, "a piece")
                if isinstance(found, StoppedError):
                    raise found
                cell, facts, seconds = found
                together = max(1, min(MAX_TASK_PIECES, round(TASK_SECONDS / max(seconds, 1e-3))))
                self._candidates += len(cell)
                yield _Stored(scenes), cell, facts.copy()
        finally:
            for counts, _ in waiting:
                self._ray.cancel(counts, force=False)

    def choose(self, which: Array, parts: Mapping[int, SceneHandle]) -> SceneHandle:
        mine = _parts(which, parts)
        return _Stored(self._choose.remote(which, list(mine), *mine.values()))

    def pick(self, which: Array, parts: Mapping[int, SceneHandle]) -> SceneHandle:
        """The task that writes them chooses them, which saves storing them twice; unless few candidates become scenes:
        pieces would take much memory until then."""
        self._picked += which.shape[1]
        if self._candidates > MAX_WHOLE_CANDIDATES * self._picked:
            return self.choose(which, parts)
        return _Picked(which, _parts(which, parts))

    def fetch(self, scenes: SceneHandle) -> Block:
        block: Block = self._get(scenes.reference, "scenes")
        return block

    def hold(self, scenes: Block) -> SceneHandle:
        return _Stored(self._ray.put(scenes))

    def write(self, writing: ShardWriter, number: int, pieces: int, blocks: Sequence[SceneHandle]) -> None:
        if len(self._writing) >= MAX_SHARD_TASKS:
            self._ray.wait([self._writing[0]])
        if writing.store.tell is not None:  # listeners stay here
            self._tell = writing.store.tell
        picks = [block.which if isinstance(block, _Picked) else None for block in blocks]
        parts = dict(itertools.chain(*(block.parts.items() for block in blocks if isinstance(block, _Picked))))
        whole = [block.reference for block in blocks if isinstance(block, _Stored)]
        self._writing.append(
            self._write.remote(self._send(writing), number, pieces, picks, list(parts), *parts.values(), *whole)
        )

    def finished_shards(self, *, wait: bool) -> Iterator[Shard]:
        while self._writing and (wait or self._ray.wait([self._writing[0]], timeout=0)[0]):
            shard, said = self._get(self._writing[0], "a shard")
            self._writing.popleft()
            for line in said:
                self._tell(line)
            yield shard

    def close(self) -> None:
        self._jobs.clear()
        self._writing.clear()
        self._leave()

    def _send(self, job: object) -> Any:
        if id(job) not in self._jobs:
            sent = replace(job, store=job.store.with_progress(None)) if isinstance(job, ShardWriter) else job
            self._jobs[id(job)] = job, self._ray.put(pack_job(sent))
        return self._jobs[id(job)][1]

    def _get(self, reference: Any, what: str) -> Any:
        return result_of(self._ray, reference, what)


def _parts(which: Array, parts: Mapping[int, SceneHandle]) -> dict[int, Any]:
    """References to the parts that these scenes are in, by number."""
    first, numbers = part_numbers(which)
    return {number: parts[number].reference for number in (first + numbers).tolist()}


def result_of(ray: Any, reference: Any, what: str) -> Any:
    """A task's result. Raises what the task raised, and ScenegenError for what Ray cannot repeat."""
    from ray.exceptions import RayError, RayTaskError

    try:
        return ray.get(reference)
    except RayTaskError as error:
        cause = error.cause
        raise (cause if isinstance(cause, Exception) else error) from None
    except RayError as error:
        said = (str(error).splitlines() or [type(error).__name__])[0]
        raise ScenegenError(CLUSTER_FAILED(what=what, reason=said)) from error


@contextlib.contextmanager
def joined_cluster(workers: int | None, address: str | None) -> Iterator[Any]:
    """The cluster at `address`, that of the environment (RAY_ADDRESS), or one on this machine until the end of the
    block. A cluster that this process has joined already is used as it is. Raises RequestError."""
    ray = _ray()
    if ray.is_initialized():
        yield ray
        return
    _join(ray, workers, address)
    try:
        yield ray
    finally:
        ray.shutdown()


def map_each(
    job: Callable[[Any], Any], items: Iterable[Any], workers: int | None, address: str | None
) -> Generator[Any, None, None]:
    """job(item) of every item, in their order; each is a task."""
    with joined_cluster(workers, address) as ray:
        data = ray.put(pack_job(job))
        task = ray.remote(num_cpus=1, max_retries=MAX_RETRIES, retry_exceptions=False)(apply)
        ahead = TASKS_PER_CORE * max(1, int(ray.cluster_resources().get("CPU", 1)))
        waiting: deque[Any] = deque()
        left = iter(items)
        while True:
            waiting.extend(task.remote(data, item) for item in itertools.islice(left, ahead - len(waiting)))
            if not waiting:
                return
            yield result_of(ray, waiting.popleft(), "a shard")


def start(workers: int | None, address: str | None) -> Engine:
    """An engine of the cluster: see `joined_cluster`. Raises RequestError."""
    stack = contextlib.ExitStack()
    return Cluster(stack.enter_context(joined_cluster(workers, address)), workers, stack.close)


def _ray() -> Any:
    try:
        import ray
    except ModuleNotFoundError as error:
        command = 'pip install "scenegen-dsl[ray]"'
        raise RequestError(NOT_INSTALLED(package="ray", purpose="for <engine=ray>", command=command)) from error
    return ray


def _join(ray: Any, workers: int | None, address: str | None) -> None:
    given = address or os.environ.get("RAY_ADDRESS")
    own: contextlib.AbstractContextManager[None] = _for_children() if given is None else contextlib.nullcontext()
    try:
        with own:
            ray.init(
                address=given or "local",  # None would join any cluster that runs on this machine
                num_cpus=workers if given is None else None, log_to_driver=False, configure_logging=False,
                include_dashboard=None if given else False,
            )  # fmt: skip
    except (ConnectionError, OSError, ValueError, RuntimeError) as error:
        said = (str(error).splitlines() or [type(error).__name__])[0].rstrip(".")
        raise RequestError(CLUSTER_NOT_FOUND(address=given, reason=said)) from error


@contextlib.contextmanager
def _for_children() -> Iterator[None]:
    """The environment that Ray's processes on this machine inherit. Workers import what this process imports (other
    machines have scenegen installed): a `runtime_env` would say the same, but Ray does not use the workers that it has
    started for one, and asks another process to prepare it. And workers are as nice as those of the local engine, and
    keep as much memory: by itself, Ray lets all other work on the machine go first."""
    path = os.pathsep.join(entry for entry in sys.path if entry)
    usual = {NICENESS: "0", SAFE_PATH: "1", **MALLOC_VARIABLES}
    given = {"PYTHONPATH": path, **{name: os.environ.get(name, value) for name, value in usual.items()}}
    before = {name: os.environ.get(name) for name in given}
    os.environ.update(given)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


@dataclass(frozen=True, slots=True)
class StoredJob:
    """A pickled job that many tasks share, as bytes in the object store; only its name tells it from others."""

    name: str
    data: np.ndarray[Any, Any] = field(compare=False)


def pack_job(job: object) -> StoredJob:
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
                piece = job(k)
            except StoppedError as stopped:
                return found + [stopped, None] * (first + count - k)
            found += [(piece.cell, piece.facts, time.perf_counter() - begun), Block(piece.rows, piece.phi)]
    return found


def apply(sent: StoredJob, item: Any) -> Any:
    return _job(sent)(item)


def choose(which: Array, numbers: list[int], *parts: Block) -> Block:
    return choose_scenes(which, dict(zip(numbers, parts, strict=True)))


def write(
    sent: StoredJob, number: int, pieces: int, picks: list[Array | None], numbers: list[int], *scenes: Block
) -> tuple[Shard, list[str]]:
    """A shard, and what its store said on the way. `scenes` are parts, by their `numbers`, then whole blocks, which
    stand where a pick is None."""
    said: list[str] = []
    parts, whole = dict(zip(numbers, scenes, strict=False)), iter(scenes[len(numbers) :])
    blocks = [next(whole) if which is None else choose_scenes(which, parts) for which in picks]
    writing: ShardWriter = _job(sent)
    return replace(writing, store=writing.store.with_progress(said.append))(number, pieces, blocks), said
