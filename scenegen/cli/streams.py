"""Standard streams and signals, made fit for a program: no stream is missing, no character cannot be written, and
SIGTERM ends a command as cleanly as Ctrl-C does."""

from __future__ import annotations

import contextlib
import io
import os
import select
import signal
import sys
import threading
from types import FrameType
from typing import TextIO

from scenegen.errors import Diagnostic, OutputError


def prepare() -> None:
    """Call once, before anything is printed."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:  # closed by whoever started us: the next file that is opened must not take its place
            # What we say may go nowhere, data may not: the system refuses to write where it was opened for reading.
            mode = os.O_RDONLY if name == "stdout" else os.O_WRONLY
            setattr(sys, name, io.TextIOWrapper(io.FileIO(os.open(os.devnull, mode), "wb"), encoding="utf-8"))
        elif isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, _terminate)


def _terminate(number: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt("terminated")


def write_data(data: bytes) -> None:
    """Bytes on standard output, whatever its encoding."""
    sys.stdout.flush()
    buffer = getattr(sys.stdout, "buffer", None)
    if buffer is None:  # a stand-in without bytes, as in tests and notebooks
        sys.stdout.write(data.decode())
    else:
        buffer.write(data)


def check_output() -> None:
    """Refuse, before any work is done, a standard output that was closed. Raises OutputError."""
    try:
        os.write(sys.stdout.fileno(), b"")
    except io.UnsupportedOperation:  # a stand-in without a file, as in tests and notebooks
        return
    except OSError as error:
        title = f"cannot write to standard output: {(error.strerror or str(error)).lower()}"
        raise OutputError(Diagnostic(title, help="name a file with --out")) from error


def reader_left() -> bool:
    """After a broken pipe: whether it is whoever read the data that left, as `| head` does, and not whoever read the
    messages alone."""
    if not hasattr(select, "poll"):  # Windows, where pipes cannot be looked at
        return True
    look = select.poll()
    try:
        look.register(sys.stdout.fileno(), select.POLLOUT)
    except (OSError, ValueError):
        return False
    return any(found & select.POLLERR for _, found in look.poll(0))


def give_up(stream: TextIO) -> None:
    """The stream is gone or full; Python would complain once more when it closes it."""
    with contextlib.suppress(OSError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
