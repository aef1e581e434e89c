"""Ctrl-C and SIGTERM in long work: recorded, and handled between two steps."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Iterator
from types import FrameType
from typing import Any


class Stop:
    """Whether a signal has asked to stop. The first signal sets this; a second one interrupts at once."""

    asked = False

    def ask(self, number: int, frame: FrameType | None) -> None:
        if self.asked:
            raise KeyboardInterrupt
        self.asked = True


@contextlib.contextmanager
def stop_signals() -> Iterator[Stop]:
    """Record SIGINT and SIGTERM instead of stopping, and restore the old handlers at the end. A signal that is ignored,
    as shells ignore SIGINT for commands in the background, stays ignored. Outside the main thread, where Python allows
    no handlers, nothing changes."""
    stop = Stop()
    if threading.current_thread() is not threading.main_thread():
        yield stop
        return
    before: dict[signal.Signals, Any] = {}
    try:
        for number in (signal.SIGINT, signal.SIGTERM):
            if signal.getsignal(number) is not signal.SIG_IGN:
                before[number] = signal.signal(number, stop.ask)
        yield stop
    finally:
        for number, handler in before.items():
            # A handler that was not set from Python cannot be put back; the default is the nearest thing.
            signal.signal(number, signal.SIG_DFL if handler is None else handler)
