"""Work on several processes, the results in the order of the items.

A worker (`process`, `worker`) gets the job once and works on one thread. It has two items at a time, so that it never
waits for the next; but one item unless the last one was brief, since the second would wait for it though another
worker may have nothing to do. A result is a function of the job and the item, so which worker computes it does not
matter.

A worker costs the time its job's modules take to load: 0.1 s of a core with numpy alone, 1.5 s with torch. Requests
that take less than a few seconds are better off with `workers=1` of `run_pieces`, which starts nothing.
"""

from __future__ import annotations

import contextlib
import pickle
import queue
import sys
from collections.abc import Callable, Generator, Iterable, Iterator, Sized
from typing import Any, Generic, TypeVar

from scenegen.errors import RequestError, ScenegenError
from scenegen.errors.program import PROCESS_DIED
from scenegen.errors.requests import OUT_OF_RANGE
from scenegen.processes.process import FAILED, GONE, WorkerMessage, WorkerProcess
from scenegen.validation import as_int


@contextlib.contextmanager
def one_thread() -> Iterator[None]:
    """As many threads as in a worker: the number of threads affects how torch splits sums, and so the rounding; and for
    small batches a second thread costs more than it saves. If torch is not loaded, this does not load it."""
    torch: Any = sys.modules.get("torch")
    before = 1 if torch is None else torch.get_num_threads()
    if before == 1:
        yield
        return
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)


Item = TypeVar("Item")
Result = TypeVar("Result")

MAX_PROCESSES = 256  # each has pipes, a file and two threads of the command
ITEMS_AT_A_WORKER = 2  # items given to a worker at a time
BRIEF_SECONDS = 0.25  # seconds that its last item may have taken for that
MAX_ITEMS_PER_WORKER = 3  # items per worker that were sent, but whose results have not been returned yet
MAX_SMALL_ITEMS_PER_WORKER = 16  # the same for small results: where one item takes long, no worker waits for it
SMALL_RESULTS_BYTES = 1 << 26  # bytes of all of these
MAX_ATTEMPTS = 2  # an item whose worker died is given to another one once


def check_workers(workers: object) -> int:
    """A number of processes. Raises RequestError for fewer than 1 or more than 256, and for anything but an integer."""
    count = as_int("workers", workers)
    if not 1 <= count <= MAX_PROCESSES:
        raise RequestError(OUT_OF_RANGE(argument="workers", value=count, wanted=f"from 1 to {MAX_PROCESSES}"))
    return count


def run_pieces(
    job: Callable[[Item], Result], pieces: Iterable[Item], workers: int = 1
) -> Generator[Result, None, None]:
    """job(k) of every piece k, in the order of `pieces`, which may be endless; by one worker in this process.

    `job` and its results must be picklable if `workers` is above 1; arrays come back writable. At most 3 items per
    worker are in progress or waiting to be returned, up to 16 of small results (64 MB in all), so memory stays constant
    even with a slow consumer. Close the generator to stop early: it ends all processes, as does any error.

    An error of the job is raised in the order of the pieces, as if it had happened here. A piece whose process dies is
    repeated by another process; if that dies as well, ScenegenError is raised. Raises RequestError for fewer than 1 or
    more than 256 workers.
    """
    return _run_here(job, pieces) if check_workers(workers) == 1 else _run_shared(job, pieces, workers)


def _run_here(job: Callable[[Item], Result], pieces: Iterable[Item]) -> Generator[Result, None, None]:
    for piece in pieces:
        with one_thread():
            result = job(piece)
        yield result


def _run_shared(job: Callable[[Item], Result], pieces: Iterable[Item], workers: int) -> Generator[Result, None, None]:
    with Pool(job, workers) as pool, contextlib.closing(pool.map(pieces)) as results:
        yield from results


class Pool(Generic[Item, Result]):
    """Several processes that share the items of `map`, one call after another. They start with the first items and run
    until `close`, an error, or the early end of a `map`: use it as a context manager.

    `what` and `unit` name worker and item in errors: "{what} was killed by signal 9 at {unit} 3"; `spare` is the
    suggestion for using less memory.
    """

    def __init__(
        self,
        job: Callable[[Item], Result],
        workers: int,
        *,
        what: str = "a worker process",
        unit: str = "piece",
        spare: str = "fewer workers",
    ) -> None:
        self._job = pickle.dumps(job, protocol=5)
        self._size, self._what, self._unit, self._spare = workers, what, unit, spare
        self._workers: list[WorkerProcess] = []
        self._inbox: queue.SimpleQueue[WorkerMessage] = queue.SimpleQueue()
        self._stillborn = 0  # workers that died before they were ready

    def __enter__(self) -> Pool[Item, Result]:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End all processes, whatever they do."""
        for worker in self._workers:
            worker.process.kill()
        while self._workers:
            self._workers.pop().end()

    def map(self, items: Iterable[Item]) -> Generator[Result, None, None]:
        """job(item) of every item, in their order. One `map` at a time. Raises what the job raises, and ScenegenError
        if two processes die at the same item, or if none can start."""
        self._begin(items)
        wanted = min(self._size, len(items)) if isinstance(items, Sized) else self._size
        self._exhausted = not wanted
        over = False
        try:
            while len(self._workers) < wanted:
                self._start()
            while True:
                self._give_orders()
                while self._yielded in self._results:
                    status, value = self._results.pop(self._yielded)
                    if status == FAILED:
                        raise value
                    self._yielded += 1
                    yield value
                    self._give_orders()
                if self._exhausted and self._yielded == self._ordered:
                    over = True
                    return
                self._receive(self._inbox.get())
        finally:
            if not over:
                self.close()

    def _begin(self, items: Iterable[Item]) -> None:
        self._items: Iterator[tuple[int, Item]] = enumerate(items)  # numbered by turn, the order of results
        self._again: list[tuple[int, Item]] = []  # orders of workers that died; the last in the list is done first
        self._deaths: dict[int, int] = {}  # numbers of dead workers, by the turn of their item
        self._results: dict[int, tuple[int, Any]] = {}  # status and value of finished items that wait for earlier ones
        self._ordered = self._yielded = self._largest = 0
        self._exhausted = False

    def _start(self) -> None:
        self._workers.append(WorkerProcess(self._what, self._job, self._inbox, self._next_order()))

    def _give_orders(self) -> None:
        # A second order each only when all have begun: one that starts later would wait for what others have in hand.
        begun = len(self._workers) >= self._size and all(worker.ready for worker in self._workers)
        for number in range(1, 1 + (ITEMS_AT_A_WORKER if begun else 1)):
            for worker in self._workers:
                if worker.ready and len(worker.orders) < (number if worker.brief else 1):
                    order = self._next_order()
                    if order is not None:
                        worker.order(*order)

    def _next_order(self) -> tuple[int, Item] | None:
        if self._again:
            return self._again.pop()
        waiting = self._ordered - self._yielded
        most = MAX_SMALL_ITEMS_PER_WORKER if waiting * self._largest <= SMALL_RESULTS_BYTES else MAX_ITEMS_PER_WORKER
        if waiting >= most * self._size:
            return None
        order = next(self._items, None)
        self._ordered += order is not None
        self._exhausted = order is None
        return order

    def _receive(self, message: WorkerMessage) -> None:
        worker = message.worker
        if message.status == GONE:
            self._replace(worker)
        elif message.ready:
            if message.status == FAILED:
                raise message.value
            worker.ready = True
        else:
            turn, _ = worker.orders.popleft()
            self._results[turn] = message.status, message.value
            self._largest = max(self._largest, message.size)
            worker.brief = message.took <= BRIEF_SECONDS

    def _replace(self, worker: WorkerProcess) -> None:
        """A worker has died: another one takes its place and its orders. Raises ScenegenError if that has happened
        before at the same item, or if none can start."""
        if worker not in self._workers:
            return  # ended by `close`
        self._workers.remove(worker)
        said = worker.end()
        status = worker.process.returncode
        how = f"ended with status {status}" if status >= 0 else f"was killed by signal {-status}"
        remedy = f"was there enough memory? try {self._spare}" if status < 0 else "this is a bug; please report it"
        facts = {"what": self._what, "how": how, "remedy": remedy, "said": said}
        self._stillborn += not worker.ready
        if not worker.ready and (status >= 0 or self._stillborn == MAX_ATTEMPTS * self._size):
            raise ScenegenError(PROCESS_DIED(**facts))
        if worker.orders and worker.ready:
            turn, _ = worker.orders[0]
            self._deaths[turn] = self._deaths.get(turn, 0) + 1
            if self._deaths[turn] == MAX_ATTEMPTS:
                raise ScenegenError(PROCESS_DIED(**facts, unit=self._unit, item=turn))
        self._again = sorted([*self._again, *worker.orders], key=lambda order: order[0], reverse=True)
        self._start()
