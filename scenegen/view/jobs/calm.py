"""Work that gives way to what a person waits for."""

from __future__ import annotations

import contextlib
import os
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import TypeVar

T = TypeVar("T")

NICE = 10  # of 19: how far work gives way that nobody waits for
SLIGHTLY = 2  # and work that somebody waits for, after a first look


def calmly(work: Callable[[], T], nice: int = NICE) -> T:
    """Do work in a thread of its own that gives way to other processes. A process could not take that back afterwards,
    and its next job may be urgent; on Linux a thread has a priority of its own. Raises what the work raises."""
    _own()
    with ThreadPoolExecutor(1, initializer=give_way, initargs=(nice,)) as pool:
        return pool.submit(work).result()


def give_way(nice: int = NICE) -> None:
    """Let the thread that calls this give way by so much, for good."""
    with contextlib.suppress(OSError):  # elsewhere, threads are no processes: the work is urgent then
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), min(_own() + nice, 19))


@cache
def _own() -> int:
    """What this process began with."""
    return os.getpriority(os.PRIO_PROCESS, 0)
