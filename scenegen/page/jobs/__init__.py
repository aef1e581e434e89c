"""What worker processes do for the page: name -> "module:function", a file for what belongs together.

A job takes the message of the page and yields its answers, plain data that JSON holds. It raises ScenegenError for what
the user can mend.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator
from typing import Any

Job = Callable[[dict[str, Any]], Iterator[Any]]

JOBS: dict[str, str] = {
    "check": "scenegen.page.jobs.check:check",
    "assist": "scenegen.page.jobs.check:assist",
    "evaluate": "scenegen.page.jobs.evaluate:evaluate",
    "sample": "scenegen.page.jobs.sample:sample",
    "first": "scenegen.page.jobs.sample:first",
    "spread": "scenegen.page.jobs.sample:spread",
    "range": "scenegen.page.jobs.check:label_range",
    "download": "scenegen.page.jobs.sample:download",
}


MOTION_MODULES = ("scenegen.page.jobs.motions", "scenegen.sampling.motions.rarity", "scenegen.sampling.motions.sampler")
"""What jobs import only for specs over time."""


def job_of(name: str) -> Job:
    """The function of a job; its module is loaded when it is first wanted."""
    module, _, function = JOBS[name].partition(":")
    job: Job = getattr(importlib.import_module(module), function)
    return job


def load_all() -> None:
    """Import what the jobs need, so that no process has to do it again."""
    for name in JOBS:
        job_of(name)
    for module in MOTION_MODULES:
        importlib.import_module(module)
