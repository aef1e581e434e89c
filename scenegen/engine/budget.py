"""What a request may use: time, and processes of this machine that serve its plan and its run one after the other."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

from scenegen.processes.process import cores
from scenegen.processes.reserve import Reserve
from scenegen.sampling.problem import Budget
from scenegen.sampling.request import SampleRequest

SCENES = ("scenegen.engine.drawing", "scenegen.sampling.auto")
MOTIONS = ("scenegen.engine.drawing", "scenegen.motions.plan")


@contextlib.contextmanager
def open_budget(request: SampleRequest, engine: str = "local", *, over_time: bool = False) -> Iterator[Budget]:
    """The budget of a request, as a context manager. If the request asks for several processes, they start at once and
    load what most plans need meanwhile; unless another engine draws its pieces, or a simulator settles them."""
    workers = request.workers or 1
    ahead = min(workers, cores()) if workers > 1 and engine == "local" and not request.settle else 0
    with Reserve(ahead, MOTIONS if over_time else SCENES) as reserve:
        yield Budget(request.timeout, reserve=reserve)
