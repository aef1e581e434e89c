"""Steps of several items, done by another process as soon as they are known: work that would only begin later."""

from __future__ import annotations

import contextlib
import pickle
import queue
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import Any, Generic, TypeVar

from scenegen.errors import ScenegenError
from scenegen.processes.process import GONE, WorkerMessage, WorkerProcess
from scenegen.processes.worker import FAILED

# --------------------------------------------------------------------------------------------------------------------
# Processes that start before there is work for them, and take up one job after another.


class IdleWorkers:
    """Idle processes: `count` of them start at once, `later` more when the first has loaded the modules of `load`, or
    with `fill`. Pools and others take processes from here, new ones if none is left, and bring them back when their job
    is done. A context manager, at the end of which the idle ones end. Workers start in 0.2 s; most of it is saved where
    that is while the plan is begun.

    One that keeps none serves those who have no reserve: each process is new, and ends when it is brought back."""

    def __init__(self, count: int = 0, load: Sequence[str] = (), *, later: int = 0, keeps: bool = True) -> None:
        self.keeps = keeps
        self._load, self._later = tuple(load), later
        self._idle: list[WorkerProcess] = []
        self._lock = threading.Lock()  # the thread of the first process starts others
        self._start(count)

    def __enter__(self) -> IdleWorkers:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def fill(self) -> None:
        """Those that were to start later start now."""
        with self._lock:
            count, self._later = self._later, 0
            self._start(count)

    def _start(self, count: int) -> None:
        with contextlib.suppress(ScenegenError):  # it is reported when one is needed
            for _ in range(count):
                loaded = self.fill if self._later else None
                self._idle.append(WorkerProcess("a worker process", self._load, loaded))

    def take(self, what: str) -> WorkerProcess:
        """A process. Raises ScenegenError if none can start."""
        with self._lock:
            if self._idle:
                return self._idle.pop(0)  # the first has loaded first
            self._later = max(0, self._later - 1)
            return WorkerProcess(what, self._load)

    def bring_back(self, process: WorkerProcess) -> None:
        """A process that may be used again, unless it is at work, or has ended: then it is ended."""
        if self.keeps and process.idle:
            self._idle.append(process)
        else:
            process.end()

    def close(self) -> None:
        """End the idle processes."""
        with self._lock:
            self._later = 0
        for process in self._idle:
            process.process.kill()
        while self._idle:
            self._idle.pop().end()


# --------------------------------------------------------------------------------------------------------------------
# A process that works for this one while it goes on, and the thread that talks to it.


Self = TypeVar("Self", bound="WorkerClient")

PATIENCE = 0.1  # seconds in which a process may give up its work; a new one takes longer to start


class WorkerClient(ABC):
    """A context manager, at the end of which the process gives up its work and goes back to the reserve that it comes
    from, or ends. Where none can start there is none, and nothing is done."""

    def __init__(self, job: Callable[[Any], Any], reserve: IdleWorkers | None) -> None:
        self._reserve = IdleWorkers(keeps=False) if reserve is None else reserve
        self._inbox: queue.SimpleQueue[WorkerMessage] = queue.SimpleQueue()
        self._process: WorkerProcess | None = None
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

    def _talk(self, process: WorkerProcess) -> None:
        """Runs in its own thread."""
        message = self._inbox.get()
        if message.ready and message.status != FAILED:
            process.ready = True
            self._work(process)
        elif message.status != GONE:
            self._refused(message)

    def _ask(self, process: WorkerProcess, order: Any) -> WorkerMessage | None:
        """The answer to an order, None if the process has died."""
        process.order(0, order)
        message = self._inbox.get()
        if message.status == GONE:
            return None
        process.orders.popleft()
        return message

    @abstractmethod
    def _work(self, process: WorkerProcess) -> None:
        """Orders for a process that is ready."""

    def _refused(self, message: WorkerMessage) -> None:  # noqa: B027 - most have nothing to do
        """The process could not read the job."""

    def _stop(self) -> None:  # noqa: B027 - the same
        """The process is to end: whatever the thread waits for does not come."""


Step = TypeVar("Step")


class Lookahead(WorkerClient, Generic[Step]):
    """Items 0 up to `items` go through the same steps, which become known one by one.

    The job, picklable, keeps the items' states: job((item, step)) does an item's next step, job((item, None)) returns
    its state. All items are kept equally far, so that what is left of them can be shared evenly. Where nothing can be
    done ahead, because no process starts, or one dies, or the job raises an error, there are fewer states.
    """

    def __init__(self, job: Callable[[tuple[int, Step | None]], Any], items: int, reserve: IdleWorkers | None) -> None:
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

    def _work(self, process: WorkerProcess) -> None:
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


# --------------------------------------------------------------------------------------------------------------------
# One piece of work in a process of its own, while this one goes on.


Item = TypeVar("Item")
T = TypeVar("T")


class BackgroundTask(WorkerClient, Generic[Item, T]):
    """job(item), begun at once; both must be picklable. Where no process can start, or it dies, the work is done here
    when the result is asked for."""

    def __init__(self, job: Callable[[Item], T], item: Item, reserve: IdleWorkers | None = None) -> None:
        self._job, self._item = job, item
        self._answer: WorkerMessage | None = None
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

    def _work(self, process: WorkerProcess) -> None:
        answer = self._ask(process, self._item)
        if not self._left:  # else it was given up
            self._answer = answer

    def _refused(self, message: WorkerMessage) -> None:
        self._answer = message
