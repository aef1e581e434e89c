"""Ctrl-C, SIGTERM and SIGHUP in long work: recorded, and handled between two steps."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Iterator
from types import FrameType
from typing import Any

# What asks a program to end: a user, another program, a terminal that is closed (Windows has no such signal).
ENDING = [signal.SIGINT, signal.SIGTERM, *([signal.SIGHUP] if hasattr(signal, "SIGHUP") else [])]


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


class Stop:
    """What a signal that asks to stop raises, but for its handling; None before that. The first signal sets this; a
    second one interrupts at once."""

    asked: KeyboardInterrupt | None = None

    def ask(self, number: int, frame: FrameType | None) -> None:
        again, self.asked = self.asked, KeyboardInterrupt() if number == signal.SIGINT else Terminated(number)
        if again is not None:
            raise self.asked


@contextlib.contextmanager
def stop_signals() -> Iterator[Stop]:
    """Record SIGINT, SIGTERM and SIGHUP instead of stopping, and restore the old handlers at the end. A signal that is
    ignored, as shells ignore SIGINT for commands in the background and `nohup` SIGHUP, stays ignored. Outside the main
    thread, where Python allows no handlers, nothing changes."""
    stop = Stop()
    if threading.current_thread() is not threading.main_thread():
        yield stop
        return
    before: dict[signal.Signals, Any] = {}
    try:
        for number in ENDING:
            if signal.getsignal(number) is not signal.SIG_IGN:
                before[number] = signal.signal(number, stop.ask)
        yield stop
    finally:
        for number, handler in before.items():
            # A handler that was not set from Python cannot be put back; the default is the nearest thing.
            signal.signal(number, signal.SIG_DFL if handler is None else handler)
