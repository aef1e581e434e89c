"""Processes that start before there is work for them, and take up one job after another."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Sequence

from scenegen.errors import ScenegenError
from scenegen.processes.process import Process


class Reserve:
    """Idle processes: `count` of them start at once, `later` more when the first has loaded the modules of `load`, or
    with `fill`. Pools and others take processes from here, new ones if none is left, and bring them back when their job
    is done. A context manager, at the end of which the idle ones end. Workers start in 0.2 s; most of it is saved where
    that is while the plan is begun.

    One that keeps none serves those who have no reserve: each process is new, and ends when it is brought back."""

    def __init__(self, count: int = 0, load: Sequence[str] = (), *, later: int = 0, keeps: bool = True) -> None:
        self.keeps = keeps
        self._load, self._later = tuple(load), later
        self._idle: list[Process] = []
        self._lock = threading.Lock()  # the thread of the first process starts others
        self._start(count)

    def __enter__(self) -> Reserve:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def fill(self) -> None:
        """Those that were to start later start now."""
        with self._lock:
            count, self._later = self._later, 0
            self._start(count)

    def _start(self, count: int) -> None:
        with contextlib.suppress(ScenegenError):  # it is reported when one is needed
            for _ in range(count):
                loaded = self.fill if self._later else None
                self._idle.append(Process("a worker process", self._load, loaded))

    def take(self, what: str) -> Process:
        """A process. Raises ScenegenError if none can start."""
        with self._lock:
            if self._idle:
                return self._idle.pop(0)  # the first has loaded first
            self._later = max(0, self._later - 1)
            return Process(what, self._load)

    def bring_back(self, process: Process) -> None:
        """A process that may be used again, unless it is at work, or has ended: then it is ended."""
        if self.keeps and process.idle:
            self._idle.append(process)
        else:
            process.end()

    def close(self) -> None:
        """End the idle processes."""
        with self._lock:
            self._later = 0
        for process in self._idle:
            process.process.kill()
        while self._idle:
            self._idle.pop().end()
