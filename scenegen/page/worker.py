"""The processes that work for the page, and the program that they are forked from.

A worker does the jobs that come in over its socket, one after the other, until the socket is closed. A job is
`{"job": name, ...}`. The answers are any number of `{"part": ...}` and then one of `{"done": ...}`, `{"refused":
{...}}` for what the user can mend, and `{"failed": "..."}` for what is our own fault.
"""

from __future__ import annotations

import contextlib
import json
import logging
import math
import os
import resource
import select
import signal
import socket
import struct
import sys
from typing import Any

import numpy as np

from scenegen.errors import ScenegenError
from scenegen.errors.program import OUT_OF_MEMORY
from scenegen.page.jobs import job_of
from scenegen.page.jobs.source import refusal
from scenegen.page.limits import MAX_WORKER_MEMORY
from scenegen.processes.process import cannot_start, is_limit

MAX_MESSAGE_BYTES = 256 << 20  # bytes of one message: JSON, one a line


def dumps(value: Any) -> bytes:
    """JSON that browsers read: no NaN, no infinity."""
    try:
        return json.dumps(value, allow_nan=False, separators=(",", ":"), default=_plain).encode()
    except ValueError:
        return json.dumps(finite(value), allow_nan=False, separators=(",", ":"), default=_plain).encode()


def finite(value: Any) -> Any:
    """The value with null in the place of NaN and infinity."""
    if isinstance(value, np.ndarray):
        return finite(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: finite(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [finite(one) for one in value]
    return value


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return finite(value.tolist())
    raise TypeError(f"{type(value).__name__} is no JSON")


PAGE_LOG = logging.getLogger("scenegen.page")


def work(line: socket.socket) -> None:
    """Do jobs until the other end is closed."""
    with contextlib.suppress(BrokenPipeError, ConnectionResetError):  # nobody waits for the answer
        for message in line.makefile("rb"):
            do(line, json.loads(message))


def do(line: socket.socket, message: dict[str, Any]) -> None:
    """Do one job and send what comes of it."""

    def say(kind: str, value: Any) -> None:
        line.sendall(dumps({kind: value}) + b"\n")

    try:
        for part in job_of(message["job"])(message):
            say("part", part)
        say("done", None)
    except ScenegenError as error:
        say("refused", refusal(error, message.get("root")))
    except MemoryError:
        say("refused", refusal(ScenegenError(OUT_OF_MEMORY())))
    except (BrokenPipeError, ConnectionResetError):
        raise
    except Exception as error:  # nothing that a page sends may end the worker
        if is_limit(error):
            say("refused", refusal(cannot_start("a thread", error)))
            return
        PAGE_LOG.exception("the job %s failed", message.get("job"))
        say("failed", f"scenegen itself failed: {type(error).__name__}: {error}")


# The program that worker processes are forked from: it has loaded what they need, so that a new one costs some
# milliseconds and ending one that is no longer of use costs nothing.
#
# The server talks to it over a stream of fixed-size orders: fork a worker number k, whose socket comes with the
# order, or end number k. It lives as long as the server: when the stream ends, it ends all its workers and itself. It
# starts no thread, so that forking is safe.


WORKER_ORDER = struct.Struct("!cQ")
FORK, END = b"f", b"e"
REAP_SECONDS = 1.0  # seconds after which it looks for workers that have ended

_WARM = "object mug, plate\nrequire noOverlap()\ntask: leftOf(mug, plate)\n"


def main() -> None:
    """Serve the orders that come in over standard input, a Unix socket."""
    control = socket.socket(fileno=os.dup(0))
    null = os.open(os.devnull, os.O_RDWR)
    os.dup2(null, 0)
    os.dup2(2, 1)
    warm()
    with contextlib.suppress(BrokenPipeError):  # the server has ended: so do we
        control.sendall(b"r")  # ready
    workers: dict[int, int] = {}  # number -> process
    while True:
        ready, _, _ = select.select([control], [], [], REAP_SECONDS)
        reap(workers)
        if not ready:
            continue
        data, fds, _, _ = socket.recv_fds(control, WORKER_ORDER.size, 1)
        while data and len(data) < WORKER_ORDER.size:
            more = control.recv(WORKER_ORDER.size - len(data))
            data = data + more if more else b""
        if not data:
            break
        kind, number = WORKER_ORDER.unpack(data)
        if kind == FORK:
            sys.stdout.flush()
            with contextlib.suppress(OSError):  # no more processes: the server sees its socket closed
                process = os.fork()
                if process == 0:
                    live(control, fds[0])
                workers[number] = process
            os.close(fds[0])
        elif number in workers:
            with contextlib.suppress(ProcessLookupError):
                os.kill(workers[number], signal.SIGKILL)
    for process in workers.values():
        with contextlib.suppress(ProcessLookupError):
            os.kill(process, signal.SIGKILL)


def warm() -> None:
    """Load what jobs need and fill the caches that all of them share."""
    from scenegen.api.sample import glimpse, sample
    from scenegen.api.spec import parse
    from scenegen.page.jobs import load_all

    load_all()
    for method in ("auto", "growth"):
        sample(parse(_WARM), n=1, method=method, workers=1)
    glimpse(parse(_WARM), n=1)


def reap(workers: dict[int, int]) -> None:
    """Forget the workers that have ended."""
    for number, process in list(workers.items()):
        with contextlib.suppress(ChildProcessError):
            if os.waitpid(process, os.WNOHANG)[0] == 0:
                continue
        del workers[number]


def live(control: socket.socket, fd: int) -> None:
    """The life of a worker, in a process of its own; it never returns."""
    status = 1
    try:
        control.close()
        with contextlib.suppress(ValueError, OSError):
            resource.setrlimit(resource.RLIMIT_AS, (MAX_WORKER_MEMORY, MAX_WORKER_MEMORY))

        work(socket.socket(fileno=fd))
        status = 0
    finally:
        os._exit(status)
