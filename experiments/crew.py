"""Jobs on several processes: whoever is free takes the next one."""

from __future__ import annotations

import dataclasses
import json
import threading
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, TypeVar

from experiments.plan import Plan
from experiments.worker import ANSWER
from scenegen.errors import ScenegenError
from scenegen.render.process import Process

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Some = TypeVar("Some", bound="DataclassInstance")


def share(jobs: Sequence[Some], plan: Plan, perform: Callable[[Some], float], done: str, task: str) -> None:
    """Perform jobs of one kind on the plan's processes, in this one if that is one, and tell of each.

    `perform` is a function of the module that the kind of job is of, and returns CPU seconds. `done` is what a job is
    when it is over, `task` completes "a process that ...". Raises the first ScenegenError.
    """
    began, over, lock = time.monotonic(), 0, threading.Lock()

    def told(job: Some, seconds: float) -> None:
        nonlocal over
        with lock:
            over += 1
            left = (time.monotonic() - began) / over * (len(jobs) - over) / 60.0
            more = f"; {len(jobs) - over} to go, about {left:.0f} min" if over < len(jobs) else ""
            plan.tell(f"{job}: {done} in {seconds:.0f} CPU seconds{more}")

    workers = min(plan.workers, len(jobs))
    if workers > 1:
        what = {"module": perform.__module__, "function": perform.__name__, "kind": type(jobs[0]).__name__}
        crew = [Process("experiments.worker", what, task, "fewer --workers") for _ in range(workers)]
        _serve(jobs, crew, told)
        return
    for job in jobs:
        told(job, perform(job))


def _serve(jobs: Sequence[Some], crew: Sequence[Process], told: Callable[[Some, float], None]) -> None:
    waiting = iter(jobs)
    lock = threading.Lock()
    failures: list[ScenegenError] = []

    def serve(process: Process) -> None:
        while not failures:
            with lock:
                job = next(waiting, None)
            if job is None:
                return
            process.send(json.dumps(dataclasses.asdict(job)).encode() + b"\n")
            try:
                told(job, ANSWER.unpack(process.read(ANSWER.size))[0])
            except ScenegenError as error:
                failures.append(error)

    threads = [threading.Thread(target=serve, args=(process,), daemon=True) for process in crew]
    try:
        for thread in threads:
            thread.start()
        for thread in threads:
            while thread.is_alive():  # a join without an end would not let Ctrl-C through everywhere
                thread.join(1.0)
    finally:
        for process in crew:
            process.end()
    if failures:
        raise failures[0]
