"""Pieces of work on several processes, their results in the order of the pieces.

Workers are programs of their own, not multiprocessing children: those would run the caller's main module again, which
breaks a script without `if __name__ == "__main__"`, and forking a program that has loaded torch is not safe. A worker
gets the job once, works on one thread, and is told piece by piece what to do next, two at a time so that it never waits
for an answer. What comes in is a function of the job and the number of the piece, so who works on it does not matter.

A worker costs the time its job's modules take to load: 0.1 s of a core with numpy alone, 1.5 s with torch. Requests
that take less than a few seconds are better off with `workers=1`, which starts nothing.
"""

from __future__ import annotations

import contextlib
import json
import os
import pickle
import queue
import subprocess
import sys
import tempfile
import threading
from collections import deque
from collections.abc import Callable, Generator, Iterable
from dataclasses import dataclass
from typing import IO, Any, TypeVar

import numpy as np

from scenegen.engine.threads import one_thread
from scenegen.engine.worker import FAILED, FRAME, NUMBER, READY, SIZE, widen
from scenegen.errors import Diagnostic, RequestError, ScenegenError
from scenegen.given import whole

T = TypeVar("T")

MAX_WORKERS = 256
AHEAD = 2  # pieces given to a worker at a time
WAITING = 3  # pieces per worker that are ordered and whose turn has not come
GONE = 2  # a status, beside those of frames
ATTEMPTS = 2  # a piece whose worker died is given to another one once

# An interrupt from the keyboard reaches the whole group: the parent answers it and ends its workers.
_PROGRAM = (
    "import json, signal, sys; signal.signal(signal.SIGINT, signal.SIG_IGN);"
    " sys.path[:] = json.loads(sys.stdin.buffer.readline()); from scenegen.engine.worker import main; main()"
)
_SINGLE = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS"), "1")


def run_pieces(job: Callable[[int], T], pieces: Iterable[int], workers: int = 1) -> Generator[T, None, None]:
    """job(k) of every piece k, in the order of `pieces`, which may be endless.

    `job` and its results must pickle where `workers` is above 1; arrays come back writable. At most 3 results per
    worker are under way or waiting for their turn, so memory stays flat however slow the consumer is. Close the
    generator to stop early: it ends all processes, as does any error.

    An error of the job is raised when its piece has its turn, as if it had happened here. A piece whose process dies is
    done once more by another process; if that dies as well, ScenegenError says so. Raises RequestError for fewer than 1
    or more than 256 workers.
    """
    workers = whole("workers", workers)
    if not 1 <= workers <= MAX_WORKERS:
        title = f"{workers} worker processes cannot share the work"
        raise RequestError(Diagnostic(title, help=f"ask for 1 to {MAX_WORKERS}"))
    return _here(job, pieces) if workers == 1 else _Crew(job, pieces, workers).results()


def _here(job: Callable[[int], T], pieces: Iterable[int]) -> Generator[T, None, None]:
    for piece in pieces:
        with one_thread():
            result = job(piece)
        yield result


@dataclass(frozen=True, slots=True)
class _Message:
    """What a worker has to say: the result of its oldest order, or READY, or that it is GONE."""

    worker: _Worker
    status: int
    value: Any = None
    ready: bool = False


class _Worker:
    """One process and the thread that reads its results. Its standard error goes to a file, read only if it fails."""

    def __init__(self, job: bytes, inbox: queue.SimpleQueue[_Message]) -> None:
        self.ready = False
        self.orders: deque[tuple[int, int]] = deque()  # (turn, piece), in the order in which they are worked on
        self.errors: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115 - closed in `end`
        try:
            self.process = subprocess.Popen(
                [sys.executable, "-c", _PROGRAM],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self.errors,
                bufsize=0,
                env={**os.environ, **_SINGLE},
            )
        except OSError as error:
            self.errors.close()
            raise ScenegenError(Diagnostic(f"cannot start a worker process: {error.strerror}")) from error
        assert self.process.stdin is not None and self.process.stdout is not None
        self.input, self.output = self.process.stdin, self.process.stdout
        self._thread = threading.Thread(target=self._converse, args=(job, inbox), daemon=True)
        self._thread.start()

    def order(self, turn: int, piece: int) -> None:
        """Give a piece to a worker that is ready."""
        self.orders.append((turn, piece))
        with contextlib.suppress(OSError):  # of one that has died: the thread notices, and the piece is ordered again
            self.input.write(NUMBER.pack(piece))

    def _converse(self, job: bytes, inbox: queue.SimpleQueue[_Message]) -> None:
        """In a thread of its own: hand over the job, then read results, so that the worker never waits for a reader."""
        with contextlib.suppress(OSError, ValueError, EOFError):
            widen(self.output)
            path = json.dumps([str(entry) for entry in sys.path]).encode() + b"\n"
            part = memoryview(path + SIZE.pack(len(job)) + job)
            while len(part):
                part = part[self.input.write(part) :]
            while True:
                piece, status, size, count = FRAME.unpack(self._exactly(FRAME.size))
                sizes = [SIZE.unpack(self._exactly(SIZE.size))[0] for _ in range(count)]
                data = self._exactly(size)
                buffers = [self._exactly(one) for one in sizes]
                try:
                    value = pickle.loads(data, buffers=buffers)  # noqa: S301 - from our own worker
                except Exception as error:
                    status, value = FAILED, error
                inbox.put(_Message(self, status, value, piece == READY))
        inbox.put(_Message(self, GONE))

    def _exactly(self, size: int) -> memoryview:
        buffer = np.empty(size, dtype=np.uint8).data  # unlike a bytearray, it is not filled with zeros first
        done = 0
        while done < size:
            got = self.output.readinto(buffer[done:])  # type: ignore[attr-defined]  # a raw file, since bufsize is 0
            if not got:
                raise EOFError
            done += got
        return buffer

    def end(self) -> str:
        """End the process, if it still runs; the last line of its standard error."""
        self.process.kill()
        self.process.wait()
        self._thread.join(timeout=5.0)  # the pipe is at its end
        self.input.close()
        self.output.close()
        self.errors.seek(0)
        said = self.errors.read().decode(errors="replace").strip().splitlines()
        self.errors.close()
        return said[-1] if said else ""


class _Crew:
    """Some workers and the pieces under way. A piece's turn is its place in the order of results."""

    def __init__(self, job: Callable[[int], Any], pieces: Iterable[int], workers: int) -> None:
        self._job = pickle.dumps(job, protocol=5)
        self._pieces = enumerate(pieces)
        self._size = workers
        self._workers: list[_Worker] = []
        self._inbox: queue.SimpleQueue[_Message] = queue.SimpleQueue()
        self._again: list[tuple[int, int]] = []  # orders of workers that died, the first to be done last in the list
        self._deaths: dict[int, int] = {}  # of workers, by the turn of the piece they were at
        self._results: dict[int, tuple[int, Any]] = {}  # status and value of finished pieces whose turn has not come
        self._ordered = self._yielded = 0
        self._exhausted = False
        self._stillborn = 0  # workers that died before they began

    def results(self) -> Generator[Any, None, None]:
        try:
            for _ in range(self._size):
                self._workers.append(_Worker(self._job, self._inbox))
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
                    return
                self._hear(self._inbox.get())
        finally:
            for worker in self._workers:
                worker.process.kill()
            for worker in self._workers:
                worker.end()

    def _give_orders(self) -> None:
        for _ in range(AHEAD):  # one each, then another one each
            for worker in self._workers:
                if worker.ready and len(worker.orders) < AHEAD:
                    order = self._next_order()
                    if order is not None:
                        worker.order(*order)

    def _next_order(self) -> tuple[int, int] | None:
        if self._again:
            return self._again.pop()
        if self._ordered - self._yielded >= WAITING * self._size:
            return None
        order = next(self._pieces, None)
        self._ordered += order is not None
        self._exhausted = order is None
        return order

    def _hear(self, message: _Message) -> None:
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

    def _replace(self, worker: _Worker) -> None:
        """A worker has died: another one takes its place and its orders. Raises ScenegenError where that has happened
        before at the same piece, or where none begins."""
        self._workers.remove(worker)
        said = worker.end()
        status = worker.process.returncode
        how = f"ended with status {status}" if status >= 0 else f"was killed by signal {-status}"
        help_ = "was there enough memory? ask for fewer workers" if status < 0 else "this is a bug; please report it"
        self._stillborn += not worker.ready
        if not worker.ready and (status >= 0 or self._stillborn == ATTEMPTS * self._size):
            raise ScenegenError(Diagnostic(f"a worker process {how} before it began", help=help_, note=said))
        if worker.orders:
            turn, piece = worker.orders[0]
            self._deaths[turn] = self._deaths.get(turn, 0) + 1
            if self._deaths[turn] == ATTEMPTS:
                title = f"a worker process {how} at piece {piece}, and so did another one before"
                raise ScenegenError(Diagnostic(title, help=help_, note=said))
        self._again = sorted([*self._again, *worker.orders], reverse=True)
        self._workers.append(_Worker(self._job, self._inbox))
