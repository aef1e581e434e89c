"""Worker processes, seen from both sides: what runs in one, and what its parent has of it.

Workers are separate programs, not multiprocessing children: those would run the caller's main module again, which
breaks a script without `if __name__ == "__main__"`, and forking a program that has loaded torch is not safe. A worker
also keeps pybullet, its banner and its memory out of the caller. It gets jobs and their items on standard input, and
writes results to standard output.

An order is the size of a pickle and the pickle of (turn, item), or of (READY, pickled job). A result is a frame: turn,
status, seconds that it took, size of a pickle and number of its buffers, the sizes of these, the pickle, the buffers.
Arrays travel as the buffers of pickle protocol 5, straight from memory into a wide pipe. Measured for the 1.0 GB of ten
million scenes: 0.5 s (0.3 s of the reader's time), 1.3 s with arrays inside the pickle, 0.1 s through shared memory,
whose segments would outlive a kill -9. Sampling them takes ten seconds or more; so pipes it is.

Pickles pass between processes of one program here, never through files.
"""

from __future__ import annotations

import contextlib
import ctypes
import errno
import gc
import os
import pickle
import queue
import signal
import struct
import subprocess
import sys
import tempfile
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from types import FrameType
from typing import IO, Any, BinaryIO

from scenegen.errors import ScenegenError
from scenegen.errors.program import CANNOT_START_PROCESS

# Memory that is kept for the next arrays.
#
# Arrays of some MB come and go all the time. By default glibc gives their pages back to the system each time, and
# takes them again one by one: 7 of 22 s of a request with many small pieces (100,000 scenes of tea_party). Programs
# of ours therefore keep up to 256 MB that are free, and share them among their threads, whose own ones glibc would
# give back all the same. Python programs that use scenegen decide for themselves.


GC_THRESHOLD = 200_000  # objects that are made between two searches for cycles
KEPT_BYTES = 1 << 28  # bytes
MALLOC_VARIABLES = {  # for processes to be started
    "MALLOC_MMAP_THRESHOLD_": str(KEPT_BYTES),
    "MALLOC_TRIM_THRESHOLD_": str(KEPT_BYTES),
    "MALLOC_ARENA_MAX": "1",
}
_TRIM_THRESHOLD, _MMAP_THRESHOLD, _ARENA_MAX = -1, -3, -8  # of mallopt


def keep_memory() -> None:
    """The same for this process, unless its environment says otherwise. Other C libraries know nothing of it."""
    if not MALLOC_VARIABLES.keys().isdisjoint(os.environ):
        return
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None) if os.name == "posix" else None
    if mallopt is not None:
        mallopt(_TRIM_THRESHOLD, KEPT_BYTES)
        mallopt(_MMAP_THRESHOLD, KEPT_BYTES)
        mallopt(_ARENA_MAX, 1)


def raise_gc_threshold() -> None:
    """Search for cycles of garbage less often than Python does by itself. Loading makes a hundred thousand objects that
    stay: to search among them is a tenth of a small request. Lines of text are made a fifth faster."""
    gc.set_threshold(GC_THRESHOLD)


FRAME_HEAD = struct.Struct("<qqdqq")
FRAME_SIZE = struct.Struct("<Q")

READY = -1  # the turn of the frame that reports that the job was received
DONE, FAILED = 0, 1

PIPE_BYTES = 1 << 20  # bytes; the default of Linux, 64 KiB, costs twice as much time


def main() -> None:
    """Process orders until standard input ends; then the process ends at once. The first order, of turn READY, is the
    job."""
    raise_gc_threshold()
    results = os.fdopen(os.dup(1), "wb", buffering=0)
    os.dup2(2, 1)  # output that a job prints must not mix with the results
    widen(results)
    orders: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    # Reading continues during work on an item: when the parent dies, this process ends at once.
    threading.Thread(target=_listen, args=(sys.stdin.buffer, orders), daemon=True).start()
    job: Callable[[Any], Any] | None = None
    with contextlib.suppress(BrokenPipeError):  # the parent has died
        while True:
            turn, item = pickle.loads(orders.get())  # noqa: S301 - from the parent process
            begun, value = time.monotonic(), None
            try:
                if turn == READY:
                    job = pickle.loads(item)  # noqa: S301 - from the parent process
                    gc.freeze()  # the job stays: no collection has to look at it
                else:
                    assert job is not None
                    value = job(item)
            except Exception as error:
                _send_error(results, turn, error)
            else:
                _send(results, turn, DONE, value, time.monotonic() - begun)


def _listen(source: BinaryIO, orders: queue.SimpleQueue[bytes]) -> None:
    while True:
        orders.put(_exactly(source, FRAME_SIZE.unpack(_exactly(source, FRAME_SIZE.size))[0]))


def _exactly(source: BinaryIO, size: int) -> bytes:
    data = source.read(size)
    if len(data) < size:
        os._exit(0)
    return data


def _send_error(results: IO[bytes], turn: int, error: Exception) -> None:
    error.add_note("in a worker process:\n" + "".join(traceback.format_exception(error)))
    try:
        pickle.loads(pickle.dumps(error))  # noqa: S301 - some errors pickle, and fail when they are read back
    except Exception:
        error = RuntimeError("\n".join([repr(error), *error.__notes__]))
    _send(results, turn, FAILED, error)


def _send(results: IO[bytes], turn: int, status: int, value: object, took: float = 0.0) -> None:
    buffers: list[pickle.PickleBuffer] = []
    data = pickle.dumps(value, protocol=5, buffer_callback=buffers.append)
    raw = [buffer.raw() for buffer in buffers]
    head = FRAME_HEAD.pack(turn, status, took, len(data), len(raw)) + b"".join(FRAME_SIZE.pack(len(one)) for one in raw)
    for part in (memoryview(head + data), *raw):
        while len(part):
            part = part[results.write(part) :]


def widen(pipe: IO[bytes]) -> None:
    """A larger buffer for a pipe, if the system supports it."""
    with contextlib.suppress(ImportError, AttributeError, OSError):
        import fcntl

        fcntl.fcntl(pipe, fcntl.F_SETPIPE_SZ, PIPE_BYTES)


# What asks a program to end: a user, another program, a terminal that is closed (Windows has no such signal).
END_SIGNALS = [signal.SIGINT, signal.SIGTERM, *([signal.SIGHUP] if hasattr(signal, "SIGHUP") else [])]


class Terminated(KeyboardInterrupt):
    """A signal of another kind than Ctrl-C asks to end."""

    def __init__(self, number: int) -> None:
        super().__init__("terminated")
        self.number = number


def exit_status(error: BaseException | None) -> int:
    """What a shell expects of a program that a signal ends: 128 and its number, that of Ctrl-C where the error and what
    it was raised from name no other."""
    while error is not None:
        if isinstance(error, Terminated):
            return 128 + error.number
        error = error.__cause__
    return 128 + signal.SIGINT


class StopSignal:
    """What a signal that asks to stop raises, but for its handling; None before that. The first signal sets this; a
    second one interrupts at once."""

    asked: KeyboardInterrupt | None = None

    def ask(self, number: int, frame: FrameType | None) -> None:
        again, self.asked = self.asked, KeyboardInterrupt() if number == signal.SIGINT else Terminated(number)
        if again is not None:
            raise self.asked


@contextlib.contextmanager
def stop_signals() -> Iterator[StopSignal]:
    """Record SIGINT, SIGTERM and SIGHUP instead of stopping, and restore the old handlers at the end. A signal that is
    ignored, as shells ignore SIGINT for commands in the background and `nohup` SIGHUP, stays ignored. Outside the main
    thread, where Python allows no handlers, nothing changes."""
    stop = StopSignal()
    if threading.current_thread() is not threading.main_thread():
        yield stop
        return
    before: dict[signal.Signals, Any] = {}
    try:
        for number in END_SIGNALS:
            if signal.getsignal(number) is not signal.SIG_IGN:
                before[number] = signal.signal(number, stop.ask)
        yield stop
    finally:
        for number, handler in before.items():
            # A handler that was not set from Python cannot be put back; the default is the nearest thing.
            signal.signal(number, signal.SIG_DFL if handler is None else handler)


GONE = 2  # a status in addition to those of frames
SAFE_PATH = "PYTHONSAFEPATH"  # the variable that is Python's option -P
ZEROED_BYTES = 1 << 16  # bytes that may be filled with zeros before they are read


def command(module: str) -> list[str]:
    """Runs `main()` of a module in a new process, which has this one's `sys.path`. Every Python that scenegen starts is
    started so.

    -P: the folder that one works in, where a downloaded spec may have a `json.py` beside it, is no place for modules,
    unless this process has it on its own path. A signal to the whole group, as Ctrl-C or the end of a terminal sends
    it, is for the parent, which ends its workers.
    """
    ignored = [one.name for one in END_SIGNALS]
    program = (
        "import importlib, signal, sys;"
        f" [signal.signal(getattr(signal, name), signal.SIG_IGN) for name in {ignored!r}];"
        f" sys.path[:] = {[str(entry) for entry in sys.path]!a};"
        f" importlib.import_module({module!r}).main()"
    )
    return [sys.executable, "-P", "-c", program]


def environment() -> dict[str, str]:
    """This process's environment, with one thread for numerical libraries, and memory that is kept for the next
    arrays. Pythons that libraries start, as MuJoCo's windows do, get -P from it."""
    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS", SAFE_PATH)
    return {**MALLOC_VARIABLES, **os.environ, **dict.fromkeys(names, "1")}


def is_limit(error: Exception) -> bool:
    """Whether an error says that the system lets no more processes, threads or files begin."""
    if isinstance(error, OSError):
        return error.errno in (errno.EAGAIN, errno.EMFILE, errno.ENFILE)
    return isinstance(error, RuntimeError) and "can't start new thread" in str(error)


def cannot_start(what: str, error: Exception) -> ScenegenError:
    """The error for a process or thread that the system does not let start."""
    reason = getattr(error, "strerror", None) or str(error)
    return ScenegenError(CANNOT_START_PROCESS(what=what, reason=reason.lower()))


def cores() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@dataclass(frozen=True, slots=True)
class WorkerMessage:
    """A message from a worker, of so many bytes: the result of its oldest order, which took so many seconds, READY, or
    GONE."""

    worker: WorkerProcess
    status: int
    value: Any = None
    ready: bool = False
    size: int = 0
    took: float = 0.0


class WorkerProcess:
    """One process that works on one job, and the threads that talk to it. Its messages go to `inbox`, READY first.

    `order` is its first order, if it is known. What it writes to standard error goes to a file that is read only if it
    fails. `what` is its name in the error where none can start, ScenegenError."""

    def __init__(
        self, what: str, job: bytes, inbox: queue.SimpleQueue[WorkerMessage], order: tuple[int, Any] | None = None
    ) -> None:
        self.ready = False  # it has read the job
        self.brief = False  # its last order took little time
        self.orders: deque[tuple[int, Any]] = deque() if order is None else deque([order])  # (turn, item), in order
        self._inbox = inbox
        self._writes = threading.Lock()
        self._threads: list[threading.Thread] = []
        with contextlib.ExitStack() as undo:
            try:
                self.errors: IO[bytes] = undo.enter_context(tempfile.TemporaryFile())
                self.process = subprocess.Popen(
                    command("scenegen.processes.process"),
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=self.errors,
                    bufsize=0,
                    env=environment(),
                )
                undo.callback(self.process.wait)
                undo.callback(self.process.kill)
                assert self.process.stdin is not None and self.process.stdout is not None
                self.input, self.output = self.process.stdin, self.process.stdout
                self._begin(self._converse)
                # It is still starting, and a job can be larger than a pipe: a thread of its own waits until it is read.
                self._begin(self._give, [(READY, job), *self.orders])
            except (OSError, RuntimeError) as error:  # no more files, processes or threads
                raise cannot_start(what, error) from error
            undo.pop_all()  # what stays open is closed in `end`

    def _begin(self, work: Callable[..., None], *given: object) -> None:
        """A thread of this process's own."""
        thread = threading.Thread(target=work, args=given, daemon=True)
        thread.start()
        self._threads.append(thread)

    def order(self, turn: int, item: Any) -> None:
        """Give an item to a worker that is ready. It reads while it works, so this does not wait for it."""
        self.orders.append((turn, item))
        self._give([(turn, item)])

    def _give(self, messages: Sequence[tuple[int, Any]]) -> None:
        # A worker that has died is noticed by the thread that reads: the item is ordered again.
        with contextlib.suppress(OSError, ValueError), self._writes:
            for message in messages:
                data = pickle.dumps(message, protocol=5)
                part = memoryview(FRAME_SIZE.pack(len(data)) + data)
                while len(part):
                    part = part[self.input.write(part) :]

    def _converse(self) -> None:
        """Runs in its own thread: reads results, so that the worker never waits for a reader."""
        with contextlib.suppress(OSError, ValueError, EOFError):
            widen(self.output)
            while True:
                turn, status, took, size, count = FRAME_HEAD.unpack(self._exactly(FRAME_HEAD.size))
                sizes = [FRAME_SIZE.unpack(self._exactly(FRAME_SIZE.size))[0] for _ in range(count)]
                data = self._exactly(size)
                buffers = [self._exactly(one) for one in sizes]
                try:
                    value = pickle.loads(data, buffers=buffers)  # noqa: S301 - from our own worker
                except Exception as error:
                    status, value = FAILED, error
                self._inbox.put(WorkerMessage(self, status, value, turn == READY, size + sum(sizes), took))
        self._inbox.put(WorkerMessage(self, GONE))

    def _exactly(self, size: int) -> memoryview:
        import numpy as np  # commands that need no arrays load this module, too

        # Large buffers are not filled with zeros first.
        buffer = memoryview(bytearray(size)) if size < ZEROED_BYTES else np.empty(size, dtype=np.uint8).data
        done = 0
        while done < size:
            got = self.output.readinto(buffer[done:])  # type: ignore[attr-defined]  # a raw file, since bufsize is 0
            if not got:
                raise EOFError
            done += got
        return buffer

    def end(self) -> str:
        """End the process, if it still runs; returns the last line of its standard error."""
        self.process.kill()
        self.process.wait()
        for thread in self._threads:
            thread.join(timeout=5.0)  # the pipes are at their end
        self.input.close()
        self.output.close()
        self.errors.seek(0)
        said = self.errors.read().decode(errors="replace").strip().splitlines()
        self.errors.close()
        return said[-1] if said else ""
