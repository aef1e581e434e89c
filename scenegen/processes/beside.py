"""One piece of work in a process of its own, while this one goes on."""

from __future__ import annotations

import pickle
import queue
import threading
from collections.abc import Callable
from typing import Generic, TypeVar

from scenegen.errors import ScenegenError
from scenegen.processes.process import GONE, Message, Process
from scenegen.processes.reserve import Reserve
from scenegen.processes.worker import FAILED

Item = TypeVar("Item")
T = TypeVar("T")


class Beside(Generic[Item, T]):
    """job(item), begun at once; both must be picklable. A context manager, at the end of which the process ends, or
    goes back to the `reserve` that it comes from if it is done. Where none can start, or it dies, the work is done here
    when the result is asked for."""

    def __init__(self, job: Callable[[Item], T], item: Item, reserve: Reserve | None = None) -> None:
        self._job, self._item = job, item
        self._reserve = Reserve() if reserve is None else reserve
        self._own = reserve is None
        self._inbox: queue.SimpleQueue[Message] = queue.SimpleQueue()
        self._answer: Message | None = None
        self._process: Process | None = None
        try:
            self._process = self._reserve.take("a worker process")
        except ScenegenError:
            return
        self._process.take_up(pickle.dumps(job, protocol=5), self._inbox)
        self._thread = threading.Thread(target=self._wait, args=(self._process,), daemon=True)
        self._thread.start()

    def __enter__(self) -> Beside[Item, T]:
        return self

    def __exit__(self, *_: object) -> None:
        if self._process is None:
            return
        if self._thread.is_alive():
            self._process.process.kill()
        self._thread.join()
        self._reserve.bring_back(self._process)
        if self._own:
            self._reserve.close()

    def result(self) -> T:
        """Waits for it. Raises what the job raises."""
        if self._process is not None:
            self._thread.join()
        if self._answer is None:
            return self._job(self._item)
        if self._answer.status == FAILED:
            raise self._answer.value
        value: T = self._answer.value
        return value

    def _wait(self, process: Process) -> None:
        """Runs in its own thread: an order for a process that is ready, then its answer."""
        message = self._inbox.get()
        if message.ready and message.status != FAILED:
            process.ready = True
            process.order(0, self._item)
            message = self._inbox.get()
            process.orders.popleft()
        if message.status != GONE:
            self._answer = message
