"""The worker process: jobs and their items on standard input, results on standard output.

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
import gc
import os
import pickle
import queue
import struct
import sys
import threading
import time
import traceback
from collections.abc import Callable
from typing import IO, Any, BinaryIO

# --------------------------------------------------------------------------------------------------------------------
# Memory that is kept for the next arrays.
#
# Arrays of some MB come and go all the time. By default glibc gives their pages back to the system each time, and
# takes them again one by one: 7 of 22 s of a request with many small pieces (100,000 scenes of tea_party). Programs
# of ours therefore keep up to 256 MB that are free, and share them among their threads, whose own ones glibc would
# give back all the same. Python programs that use scenegen decide for themselves.


GARBAGE = 200_000  # objects that are made between two searches for cycles
KEPT = 1 << 28  # bytes
VARIABLES = {  # for processes to be started
    "MALLOC_MMAP_THRESHOLD_": str(KEPT),
    "MALLOC_TRIM_THRESHOLD_": str(KEPT),
    "MALLOC_ARENA_MAX": "1",
}
_TRIM_THRESHOLD, _MMAP_THRESHOLD, _ARENA_MAX = -1, -3, -8  # of mallopt


def keep_memory() -> None:
    """The same for this process, unless its environment says otherwise. Other C libraries know nothing of it."""
    if not VARIABLES.keys().isdisjoint(os.environ):
        return
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None) if os.name == "posix" else None
    if mallopt is not None:
        mallopt(_TRIM_THRESHOLD, KEPT)
        mallopt(_MMAP_THRESHOLD, KEPT)
        mallopt(_ARENA_MAX, 1)


def raise_gc_threshold() -> None:
    """Search for cycles of garbage less often than Python does by itself. Loading makes a hundred thousand objects that
    stay: to search among them is a tenth of a small request. Lines of text are made a fifth faster."""
    gc.set_threshold(GARBAGE)


FRAME = struct.Struct("<qqdqq")
SIZE = struct.Struct("<Q")

READY = -1  # the turn of the frame that reports that the job was received
DONE, FAILED = 0, 1

PIPE = 1 << 20  # bytes; the default of Linux, 64 KiB, costs twice as much time


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
        orders.put(_message(source))


def _message(source: BinaryIO) -> bytes:
    return _exactly(source, SIZE.unpack(_exactly(source, SIZE.size))[0])


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
    head = FRAME.pack(turn, status, took, len(data), len(raw)) + b"".join(SIZE.pack(len(one)) for one in raw)
    for part in (memoryview(head + data), *raw):
        while len(part):
            part = part[results.write(part) :]


def widen(pipe: IO[bytes]) -> None:
    """A larger buffer for a pipe, if the system supports it."""
    with contextlib.suppress(ImportError, AttributeError, OSError):
        import fcntl

        fcntl.fcntl(pipe, fcntl.F_SETPIPE_SZ, PIPE)
