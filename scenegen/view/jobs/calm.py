"""Work that gives way to what a person waits for."""

from __future__ import annotations

import contextlib
import os
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

T = TypeVar("T")

NICE = 5  # of 19: how far work gives way


def calmly(work: Callable[[], T]) -> T:
    """Do work in a thread of its own that gives way to other processes. A process could not take that back afterwards,
    and its next job may be urgent; on Linux a thread has a priority of its own. Raises what the work raises."""
    with ThreadPoolExecutor(1, initializer=_give_way) as pool:
        return pool.submit(work).result()


def _give_way() -> None:
    with contextlib.suppress(OSError):  # elsewhere, threads are no processes: the work is urgent then
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), NICE)
