"""One worker process: it does the jobs that come in over its socket, one after the other, until the socket is closed.

A job is `{"job": name, ...}`. The answers are any number of `{"part": ...}` and then one of `{"done": ...}`,
`{"refused": {...}}` for what the user can mend, and `{"failed": "..."}` for what is our own fault.
"""

from __future__ import annotations

import json
import logging
import math
import socket
import struct
from typing import Any

import numpy as np

from scenegen.errors import ScenegenError
from scenegen.errors.program import OUT_OF_MEMORY
from scenegen.processes.process import cannot_start, is_limit
from scenegen.show.view.jobs import JOBS
from scenegen.show.view.jobs.source import refusal

# --------------------------------------------------------------------------------------------------------------------
# Messages between the server and its worker processes: JSON, each behind its length.


SIZE = struct.Struct("!I")
LARGEST = 256 << 20  # bytes of one message


def packed(value: Any) -> bytes:
    """A message as it travels. Numbers that JSON cannot hold become null."""
    data = dumps(value)
    return SIZE.pack(len(data)) + data


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


LOG = logging.getLogger("scenegen.show.view")


def work(line: socket.socket) -> None:
    """Do jobs until the other end is closed."""
    while True:
        head = _exactly(line, SIZE.size)
        if head is None:
            return
        body = _exactly(line, SIZE.unpack(head)[0])
        if body is None:
            return
        try:
            do(line, json.loads(body))
        except (BrokenPipeError, ConnectionResetError):  # nobody waits for the answer
            return


def do(line: socket.socket, message: dict[str, Any]) -> None:
    """Do one job and send what comes of it."""
    try:
        for part in JOBS[message["job"]](message):
            line.sendall(packed({"part": part}))
        line.sendall(packed({"done": None}))
    except ScenegenError as error:
        line.sendall(packed({"refused": refusal(error, message.get("root"))}))
    except MemoryError:
        line.sendall(packed({"refused": refusal(ScenegenError(OUT_OF_MEMORY()))}))
    except (BrokenPipeError, ConnectionResetError):
        raise
    except Exception as error:  # nothing that a page sends may end the worker
        if is_limit(error):
            line.sendall(packed({"refused": refusal(cannot_start("a thread", error))}))
            return
        LOG.exception("the job %s failed", message.get("job"))
        line.sendall(packed({"failed": f"scenegen itself failed: {type(error).__name__}: {error}"}))


def _exactly(line: socket.socket, size: int) -> bytes | None:
    """So many bytes; None where the stream ends before."""
    parts = []
    while size:
        part = line.recv(min(size, 1 << 20))
        if not part:
            return None
        parts.append(part)
        size -= len(part)
    return b"".join(parts)
