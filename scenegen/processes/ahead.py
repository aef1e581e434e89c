"""Steps of several items, done by another process as soon as they are known: work that would only begin later."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any, Generic, TypeVar

from scenegen.processes.companion import Companion
from scenegen.processes.process import Process
from scenegen.processes.reserve import Reserve
from scenegen.processes.worker import FAILED

Step = TypeVar("Step")


class Ahead(Companion, Generic[Step]):
    """Items 0 up to `items` go through the same steps, which become known one by one.

    The job, picklable, keeps the items' states: job((item, step)) does an item's next step, job((item, None)) returns
    its state. All items are kept equally far, so that what is left of them can be shared evenly. Where nothing can be
    done ahead, because no process starts, or one dies, or the job raises an error, there are fewer states.
    """

    def __init__(self, job: Callable[[tuple[int, Step | None]], Any], items: int, reserve: Reserve | None) -> None:
        self._steps: list[Step] = []
        self._done = [0] * items
        self._over = False
        self._more = threading.Condition()
        self._states: dict[int, Any] = {}
        super().__init__(job, reserve)

    def add(self, step: Step) -> None:
        """One more step is known."""
        with self._more:
            self._steps.append(step)
            self._more.notify()

    def states(self) -> dict[int, Any]:
        """The states of the items that were begun; waits for the step in progress. No more is done ahead then."""
        if self._process is not None:
            self._stop()
            self._thread.join()
        return self._states

    def _stop(self) -> None:
        with self._more:
            self._over = True
            self._more.notify()

    def _work(self, process: Process) -> None:
        """One order at a time."""
        while (order := self._next()) is not None:
            answer = self._ask(process, order)
            if answer is None or answer.status == FAILED:
                return
            self._done[order[0]] += 1
        for item, done in enumerate(self._done):
            if done:
                answer = self._ask(process, (item, None))
                if answer is None or answer.status == FAILED:
                    return
                self._states[item] = answer.value

    def _next(self) -> tuple[int, Step] | None:
        """What to do next; waits for it. None at the end."""
        with self._more:
            while not self._over:
                done = min(self._done)
                if done < len(self._steps):
                    return self._done.index(done), self._steps[done]
                self._more.wait()
            return None
