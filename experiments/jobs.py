"""Jobs on several processes, or on a cluster."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import TypeVar

from experiments.plan import Plan
from scenegen.errors import ScenegenError, render_all
from scenegen.errors.files import SOME_FAILED
from scenegen.sampling.engine.engines import run_each

Job = TypeVar("Job")


def share(jobs: Sequence[Job], plan: Plan, perform: Callable[[Job], float], done: str) -> None:
    """Perform jobs by the plan's engine, and report each, in order.

    `perform` is a function of a module, and returns CPU seconds; `done` is what a job is when it is over. A job that
    fails is reported by its name and does not stop the others; ScenegenError at the end names them once more.
    """
    began = time.monotonic()
    failed: list[str] = []
    named = [(str(job), job) for job in jobs]
    for over, ended in enumerate(run_each(perform, named, plan.engine, plan.workers, plan.address), 1):
        left = (time.monotonic() - began) / over * (len(jobs) - over) / 60.0
        more = f"; {len(jobs) - over} to go, about {left:.0f} min" if over < len(jobs) else ""
        if ended.errors:
            failed.append(ended.name)
            plan.tell(f"{ended.name} failed:\n{render_all(ended.errors, color=False)}")
        else:
            plan.tell(f"{ended.name}: {done} in {ended.value:.0f} CPU seconds{more}")
    if failed:
        raise ScenegenError(SOME_FAILED(failed=tuple(failed), count=len(jobs)))
