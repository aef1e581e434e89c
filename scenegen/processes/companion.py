"""A process that works for this one while it goes on, and the thread that talks to it."""

from __future__ import annotations

import pickle
import queue
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, TypeVar

from scenegen.errors import ScenegenError
from scenegen.processes.process import GONE, Message, Process
from scenegen.processes.reserve import Reserve
from scenegen.processes.worker import FAILED

Self = TypeVar("Self", bound="Companion")

PATIENCE = 0.1  # seconds in which a process may give up its work; a new one takes longer to start


class Companion(ABC):
    """A context manager, at the end of which the process gives up its work and goes back to the reserve that it comes
    from, or ends. Where none can start there is none, and nothing is done."""

    def __init__(self, job: Callable[[Any], Any], reserve: Reserve | None) -> None:
        self._reserve = Reserve(keeps=False) if reserve is None else reserve
        self._inbox: queue.SimpleQueue[Message] = queue.SimpleQueue()
        self._process: Process | None = None
        self._left = False
        try:
            self._process = self._reserve.take("a worker process")
        except ScenegenError:
            return
        self._process.take_up(pickle.dumps(job, protocol=5), self._inbox)
        self._thread = threading.Thread(target=self._talk, args=(self._process,), daemon=True)
        self._thread.start()

    def __enter__(self: Self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._process is None or self._left:
            return
        self._left = True
        if self._thread.is_alive():
            self._stop()
            if self._process.ready and self._reserve.keeps:
                self._process.give_up()
                self._thread.join(PATIENCE)
        if self._thread.is_alive():
            self._process.process.kill()
        self._thread.join()
        self._reserve.bring_back(self._process)

    def _talk(self, process: Process) -> None:
        """Runs in its own thread."""
        message = self._inbox.get()
        if message.ready and message.status != FAILED:
            process.ready = True
            self._work(process)
        elif message.status != GONE:
            self._refused(message)

    def _ask(self, process: Process, order: Any) -> Message | None:
        """The answer to an order, None if the process has died."""
        process.order(0, order)
        message = self._inbox.get()
        if message.status == GONE:
            return None
        process.orders.popleft()
        return message

    @abstractmethod
    def _work(self, process: Process) -> None:
        """Orders for a process that is ready."""

    def _refused(self, message: Message) -> None:  # noqa: B027 - most have nothing to do
        """The process could not read the job."""

    def _stop(self) -> None:  # noqa: B027 - the same
        """The process is to end: whatever the thread waits for does not come."""
