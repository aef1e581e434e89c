"""One piece of work in a process of its own, while this one goes on."""

from __future__ import annotations

import pickle
import queue
import threading
from collections.abc import Callable
from typing import Generic, TypeVar

from scenegen.errors import ScenegenError
from scenegen.processes.process import GONE, Message, Process
from scenegen.processes.worker import FAILED

Item = TypeVar("Item")
T = TypeVar("T")


class Beside(Generic[Item, T]):
    """job(item), begun at once; both must be picklable. A context manager, at the end of which the process ends,
    whether it is done or not. Where none can start, or it dies, the work is done here when the result is asked for."""

    def __init__(self, job: Callable[[Item], T], item: Item) -> None:
        self._job, self._item = job, item
        self._inbox: queue.SimpleQueue[Message] = queue.SimpleQueue()
        self._answer: Message | None = None
        self._process: Process | None = None
        try:
            self._process = Process(pickle.dumps(job, protocol=5), self._inbox, "a worker process")
        except ScenegenError:
            return
        self._thread = threading.Thread(target=self._wait, args=(self._process,), daemon=True)
        self._thread.start()

    def __enter__(self) -> Beside[Item, T]:
        return self

    def __exit__(self, *_: object) -> None:
        if self._process is not None:
            self._process.end()
            self._thread.join()

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
            process.order(0, self._item)
            message = self._inbox.get()
        if message.status != GONE:
            self._answer = message
