"""Processes that start before there is work for them, and take up one job after another."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence

from scenegen.errors import ScenegenError
from scenegen.processes.process import Process


class Reserve:
    """Idle processes: `count` of them start at once, `later` more with `fill`, and load the modules of `load`. Pools
    and others take processes from here, new ones if none is left, and bring them back when their job is done. A context
    manager, at the end of which the idle ones end. Workers start in 0.2 s; most of it is saved where that is while the
    plan is begun.

    One that keeps none serves those who have no reserve: each process is new, and ends when it is brought back."""

    def __init__(self, count: int = 0, load: Sequence[str] = (), *, later: int = 0, keeps: bool = True) -> None:
        self.keeps = keeps
        self._load, self._later = tuple(load), later
        self._idle: list[Process] = []
        self._start(count)

    def __enter__(self) -> Reserve:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def fill(self) -> None:
        """Those that were to start later start now."""
        self._start(self._later)
        self._later = 0

    def _start(self, count: int) -> None:
        with contextlib.suppress(ScenegenError):  # it is reported when one is needed
            for _ in range(count):
                self._idle.append(Process("a worker process", self._load))

    def take(self, what: str) -> Process:
        """A process. Raises ScenegenError if none can start."""
        return self._idle.pop(0) if self._idle else Process(what, self._load)  # the first has loaded first

    def bring_back(self, process: Process) -> None:
        """A process that may be used again, unless it is at work, or has ended: then it is ended."""
        if self.keeps and process.idle:
            self._idle.append(process)
        else:
            process.end()

    def close(self) -> None:
        """End the idle processes."""
        for process in self._idle:
            process.process.kill()
        while self._idle:
            self._idle.pop().end()
