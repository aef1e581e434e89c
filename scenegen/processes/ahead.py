"""Steps of several items, done by another process as soon as they are known: work that would only begin later."""

from __future__ import annotations

import pickle
import queue
import threading
from collections.abc import Callable
from typing import Any, Generic, TypeVar

from scenegen.errors import ScenegenError
from scenegen.processes.process import GONE, Message, Process
from scenegen.processes.reserve import Reserve
from scenegen.processes.worker import FAILED

Step = TypeVar("Step")


class Ahead(Generic[Step]):
    """Items 0 up to `items` go through the same steps, which are told one by one.

    The job, picklable, keeps the items' states: job((item, step)) does an item's next step, job((item, None)) returns
    its state. All items are kept equally far, so that what is left of them can be shared evenly. Where nothing can be
    done ahead, because no process starts, or one dies, or the job raises an error, there are fewer states. A context
    manager, at the end of which the process goes back to the reserve, or ends.
    """

    def __init__(self, job: Callable[[tuple[int, Step | None]], Any], items: int, reserve: Reserve | None) -> None:
        self._reserve = Reserve() if reserve is None else reserve
        self._own = reserve is None
        self._steps: list[Step] = []
        self._done = [0] * items
        self._over = False
        self._more = threading.Condition()
        self._states: dict[int, Any] = {}
        self._inbox: queue.SimpleQueue[Message] = queue.SimpleQueue()
        self._process: Process | None = None
        try:
            self._process = self._reserve.take("a worker process")
        except ScenegenError:
            return
        self._process.take_up(pickle.dumps(job, protocol=5), self._inbox)
        self._thread = threading.Thread(target=self._work, args=(self._process,), daemon=True)
        self._thread.start()

    def __enter__(self) -> Ahead[Step]:
        return self

    def __exit__(self, *_: object) -> None:
        if self._process is None:
            return
        if self._thread.is_alive():
            self._process.process.kill()
            self._end()
        self._thread.join()
        self._reserve.bring_back(self._process)
        if self._own:
            self._reserve.close()

    def add(self, step: Step) -> None:
        """One more step is known."""
        with self._more:
            self._steps.append(step)
            self._more.notify()

    def states(self) -> dict[int, Any]:
        """The states of the items that were begun; waits for the step in progress. No more is done ahead then."""
        if self._process is not None:
            self._end()
            self._thread.join()
        return self._states

    def _end(self) -> None:
        with self._more:
            self._over = True
            self._more.notify()

    def _work(self, process: Process) -> None:
        """Runs in its own thread: one order at a time."""
        message = self._inbox.get()
        if not message.ready or message.status == FAILED:
            return
        process.ready = True
        while (order := self._next()) is not None:
            if self._ask(process, order) is None:
                return
            self._done[order[0]] += 1
        for item, done in enumerate(self._done):
            if done:
                answer = self._ask(process, (item, None))
                if answer is None:
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

    def _ask(self, process: Process, order: tuple[int, Step | None]) -> Message | None:
        """The answer, None if there is none."""
        process.order(0, order)
        message = self._inbox.get()
        if message.status == GONE:
            return None
        process.orders.popleft()
        return None if message.status == FAILED else message
