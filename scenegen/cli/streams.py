"""Setup of standard streams and signals: no stream is missing, every character can be written, and SIGTERM and
SIGHUP end a command as cleanly as Ctrl-C."""

from __future__ import annotations

import contextlib
import functools
import io
import os
import select
import signal
import sys
import threading
from types import FrameType
from typing import TextIO

from scenegen.errors import OutputError
from scenegen.errors.files import CANNOT_WRITE
from scenegen.processes.process import ENDING, Terminated


def prepare() -> None:
    """Call once, before anything is printed."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:  # closed by the parent process: the next file that is opened must not take its place
            # Messages may be lost, data may not: a file opened for reading makes writing fail.
            mode = os.O_RDONLY if name == "stdout" else os.O_WRONLY
            setattr(sys, name, io.TextIOWrapper(io.FileIO(os.open(os.devnull, mode), "wb"), encoding="utf-8"))
        elif isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    if threading.current_thread() is threading.main_thread():
        begun: list[int] = []
        for number in ENDING:
            if number != signal.SIGINT and signal.getsignal(number) is not signal.SIG_IGN:  # as `nohup` leaves SIGHUP
                signal.signal(number, functools.partial(_terminate, begun))


def _terminate(begun: list[int], number: int, frame: FrameType | None) -> None:
    """The first of these signals ends the program. Further ones, as terminals send them, do not disturb its cleaning
    up."""
    begun.append(number)
    if len(begun) == 1:
        raise Terminated(number)


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
        raise OutputError(CANNOT_WRITE(reason=(error.strerror or str(error)).lower())) from error


def reader_left() -> bool:
    """After a broken pipe: whether the reader of the data has gone, as with `| head`, and not only the reader of the
    messages."""
    if not hasattr(select, "poll"):  # Windows, where pipes cannot be looked at
        return True
    look = select.poll()
    try:
        look.register(sys.stdout.fileno(), select.POLLOUT)
    except (OSError, ValueError):
        return False
    return any(found & select.POLLERR for _, found in look.poll(0))


def give_up(stream: TextIO) -> None:
    """The stream is gone or full; without this Python would report an error again when it closes the stream."""
    with contextlib.suppress(OSError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
