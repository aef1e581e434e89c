"""The engine of a Ray cluster: pieces and shards are tasks, scenes stay in the cluster's object store.

A task that is lost with its worker or its node is run again by Ray, and gives the same scenes. The driver sees the
cells of candidates only; scenes pass through it when they wait for more than one shard, which keeps the history that
Ray would have to repeat after a loss short. At most `AHEAD` pieces for each core and `SHARDS` shards are under way, so
memory is flat.
"""

from __future__ import annotations

import contextlib
import itertools
import os
import pickle
import sys
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from scenegen.engine.drawing import Drawing
from scenegen.engine.engines import Drawn, Engine, Held, Writing, chosen
from scenegen.errors import RequestError, ScenegenError
from scenegen.errors.requests import NOT_INSTALLED
from scenegen.errors.stores import CLUSTER_FAILED, CLUSTER_NOT_FOUND
from scenegen.formats.blocks import Array, Block
from scenegen.formats.sets import Shard
from scenegen.processes.threads import one_thread
from scenegen.sampling.plan import Index, Plan

AHEAD = 3  # pieces for each core that are drawn, or wait for their turn
SHARDS = 2  # shards that are written at a time
RETRIES = -1  # a task whose process or node dies is repeated, however often that happens; errors of a task are not


@lru_cache(maxsize=4)
def _job(data: bytes) -> Any:
    """A job that several tasks of one process share: a plan is read, or a model loaded, once."""
    return pickle.loads(data)  # noqa: S301 - from the driver of this run


def _draw(data: np.ndarray[Any, Any], k: int) -> tuple[tuple[Index, Array], Block]:
    with one_thread():
        scenes, cell, facts = _job(data.tobytes())(k)
    return (cell, facts), scenes


def _apply(data: np.ndarray[Any, Any], item: Any) -> Any:
    return _job(data.tobytes())(item)


def _choose(which: Array, numbers: list[int], *parts: Block) -> Block:
    return chosen(which, dict(zip(numbers, parts, strict=True)))


def _write(data: np.ndarray[Any, Any], number: int, pieces: int, *blocks: Block) -> tuple[Shard, list[str]]:
    """A shard, and what its store said on the way."""
    said: list[str] = []
    writing: Writing = _job(data.tobytes())
    return replace(writing, store=writing.store.told_to(said.append))(number, pieces, blocks), said


class Cluster(Engine):
    """Holds scenes as references to Ray's object store."""

    def __init__(self, ray: Any, workers: int | None, leave: Callable[[], None]) -> None:
        self._ray = ray
        self._leave = leave
        cores = max(1, int(ray.cluster_resources().get("CPU", 1)))
        self._ahead = AHEAD * min(workers or cores, cores)
        options = {"num_cpus": 1, "max_retries": RETRIES, "retry_exceptions": False}
        self._draw = ray.remote(num_returns=2, **options)(_draw)
        self._choose = ray.remote(**options)(_choose)
        self._write = ray.remote(**options)(_write)
        self._writing: deque[Any] = deque()
        self._tell: Callable[[str], None] = lambda line: None
        self._jobs: dict[int, tuple[object, Any]] = {}  # what was sent once, by identity

    def pieces(self, drawing: Drawing, first: int) -> Generator[Drawn, None, None]:
        job = self._sent(drawing)
        waiting: deque[tuple[Any, Any]] = deque()
        k = first
        try:
            while True:
                while len(waiting) < self._ahead:
                    waiting.append(tuple(self._draw.remote(job, k)))
                    k += 1
                counts, scenes = waiting.popleft()
                cell, facts = self._get(counts, "a piece")
                yield Drawn(cell, facts.copy(), scenes)
        finally:
            for counts, _ in waiting:
                self._ray.cancel(counts, force=False)

    def choose(self, which: Array, parts: Mapping[int, Held]) -> Held:
        numbers = np.unique(which[0].astype(np.intp)).tolist()
        return self._choose.remote(which, numbers, *(parts[number] for number in numbers))

    def fetch(self, scenes: Held) -> Block:
        block: Block = self._get(scenes, "scenes")
        return block

    def hold(self, scenes: Block) -> Held:
        return self._ray.put(scenes)

    def write(self, writing: Writing, number: int, pieces: int, blocks: Sequence[Held]) -> None:
        if len(self._writing) >= SHARDS:
            self._ray.wait([self._writing[0]])
        if writing.store.tell is not None:  # listeners stay here
            self._tell = writing.store.tell
        self._writing.append(self._write.remote(self._sent(writing), number, pieces, *blocks))

    def written(self, *, wait: bool) -> list[Shard]:
        done = []
        while self._writing:
            if not wait and not self._ray.wait([self._writing[0]], timeout=0)[0]:
                break
            shard, said = self._get(self._writing.popleft(), "a shard")
            for line in said:
                self._tell(line)
            done.append(shard)
        return done

    def close(self) -> None:
        self._jobs.clear()
        self._writing.clear()
        self._leave()

    def _sent(self, job: object) -> Any:
        if id(job) not in self._jobs:
            sent = replace(job, store=job.store.told_to(None)) if isinstance(job, Writing) else job
            data = np.frombuffer(pickle.dumps(sent, protocol=5), dtype=np.uint8)
            self._jobs[id(job)] = job, self._ray.put(data)
        return self._jobs[id(job)][1]

    def _get(self, reference: Any, what: str) -> Any:
        return result_of(self._ray, reference, what)


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
        data = ray.put(np.frombuffer(pickle.dumps(job, protocol=5), dtype=np.uint8))
        task = ray.remote(num_cpus=1, max_retries=RETRIES, retry_exceptions=False)(_apply)
        ahead = AHEAD * max(1, int(ray.cluster_resources().get("CPU", 1)))
        waiting: deque[Any] = deque()
        left = iter(items)
        while True:
            waiting.extend(task.remote(data, item) for item in itertools.islice(left, ahead - len(waiting)))
            if not waiting:
                return
            yield result_of(ray, waiting.popleft(), "a shard")


def start(workers: int | None, plan: Plan, address: str | None) -> Engine:
    """An engine of the cluster: see `joined_cluster`. Raises RequestError."""
    stack = contextlib.ExitStack()
    return Cluster(stack.enter_context(joined_cluster(workers, address)), workers, stack.close)


def _ray() -> Any:
    try:
        import ray
    except ModuleNotFoundError as error:
        command = 'pip install "scenegen[ray]"'
        raise RequestError(NOT_INSTALLED(package="ray", purpose="for <engine=ray>", command=command)) from error
    return ray


def _join(ray: Any, workers: int | None, address: str | None) -> None:
    given = address or os.environ.get("RAY_ADDRESS")
    own: contextlib.AbstractContextManager[None] = (
        _search_path_for_children() if given is None else contextlib.nullcontext()
    )
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
def _search_path_for_children() -> Iterator[None]:
    """Workers on this machine import what this process imports; other machines have scenegen installed. Ray's processes
    inherit it: a `runtime_env` would say the same, but Ray does not use the workers that it has started for one, and
    asks another process to prepare it."""
    before = os.environ.get("PYTHONPATH")
    os.environ["PYTHONPATH"] = os.pathsep.join(entry for entry in sys.path if entry)
    try:
        yield
    finally:
        if before is None:
            del os.environ["PYTHONPATH"]
        else:
            os.environ["PYTHONPATH"] = before
