"""Standard streams and signals, made fit for a program: no stream is missing, no character cannot be written, and
SIGTERM ends a command as cleanly as Ctrl-C does."""

from __future__ import annotations

import io
import os
import signal
import sys
import threading
from types import FrameType


def prepare() -> None:
    """Call once, before anything is printed."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:  # closed by whoever started us: what we say goes nowhere, and that is no failure
            setattr(sys, name, io.TextIOWrapper(io.FileIO(os.open(os.devnull, os.O_WRONLY), "wb"), encoding="utf-8"))
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


def give_up_output() -> None:
    """Standard output is gone or full; Python would complain once more when it closes the stream."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
