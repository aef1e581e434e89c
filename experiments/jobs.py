"""Jobs on several processes."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import TypeVar

from experiments.plan import Plan
from scenegen.processes.pool import Pool

Job = TypeVar("Job")


def share(jobs: Sequence[Job], plan: Plan, perform: Callable[[Job], float], done: str, task: str) -> None:
    """Perform jobs on the plan's processes, in this one if that is one, and report each, in order.

    `perform` is a function of a module, and returns CPU seconds. `done` is what a job is when it is over, `task`
    completes "a process that ...". Raises the first ScenegenError.
    """
    began = time.monotonic()
    workers = min(plan.workers, len(jobs))
    with Pool(perform, workers, what=f"a process that {task}", unit="job", spare="fewer --workers") as pool:
        found = pool.map(jobs) if workers > 1 else map(perform, jobs)
        for over, (job, seconds) in enumerate(zip(jobs, found, strict=True), 1):
            left = (time.monotonic() - began) / over * (len(jobs) - over) / 60.0
            more = f"; {len(jobs) - over} to go, about {left:.0f} min" if over < len(jobs) else ""
            plan.tell(f"{job}: {done} in {seconds:.0f} CPU seconds{more}")
