"""One piece of work in a process of its own, while this one goes on."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Generic, TypeVar

from scenegen.processes.companion import Companion
from scenegen.processes.process import Message, Process
from scenegen.processes.reserve import Reserve
from scenegen.processes.worker import FAILED

Item = TypeVar("Item")
T = TypeVar("T")


class Beside(Companion, Generic[Item, T]):
    """job(item), begun at once; both must be picklable. Where no process can start, or it dies, the work is done here
    when the result is asked for."""

    def __init__(self, job: Callable[[Item], T], item: Item, reserve: Reserve | None = None) -> None:
        self._job, self._item = job, item
        self._answer: Message | None = None
        super().__init__(job, reserve)

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

    def then(self, call: Callable[[], object]) -> None:
        """`call` is called when the result is there, by another thread. Then this can be left: nothing is awaited."""

        def wait() -> None:
            if self._process is not None:
                self._thread.join()
            call()

        threading.Thread(target=wait, daemon=True).start()

    def _work(self, process: Process) -> None:
        answer = self._ask(process, self._item)
        if not self._left:  # else it was given up
            self._answer = answer

    def _refused(self, message: Message) -> None:
        self._answer = message
