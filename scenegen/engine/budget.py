"""What a request may use: time, and processes of this machine that serve its plan and its run one after the other.

It loads nothing that processes can load meanwhile.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import TYPE_CHECKING

from scenegen.processes.pool import check_workers
from scenegen.processes.process import cores
from scenegen.processes.reserve import Reserve

if TYPE_CHECKING:
    from scenegen.sampling.problem import Budget
    from scenegen.sampling.request import SampleRequest

SCENES = ("scenegen.engine.drawing", "scenegen.sampling.contest")
MOTIONS = ("scenegen.engine.drawing", "scenegen.motions.plan")
MODELS = ("scenegen.engine.drawing", "scenegen.sampling.guided", "scenegen.models.proposer")


def start_processes(
    workers: int | None, engine: str = "local", *, settle: bool = False, load: tuple[str, ...] = SCENES
) -> Reserve:
    """If a request asks for several processes, they start at once and load what most plans need, but as long as this
    one loads it has a core of its own; none if another engine draws its pieces, or a simulator settles them. Raises
    RequestError for an invalid number."""
    count = 1 if workers is None else check_workers(workers)
    if count == 1 or engine != "local" or settle:
        return Reserve()
    now = max(1, min(count, cores() - 1))
    return Reserve(now, load, later=min(count, cores()) - now)


@contextlib.contextmanager
def open_budget(
    request: SampleRequest, engine: str = "local", *, load: tuple[str, ...] = SCENES, reserve: Reserve | None = None
) -> Iterator[Budget]:
    """The budget of a request, as a context manager. Its processes start now, unless there is a `reserve` already."""
    from scenegen.sampling.problem import Budget

    with contextlib.ExitStack() as stack:
        if reserve is None:
            reserve = start_processes(request.workers, engine, settle=request.settle, load=load)
            stack.enter_context(reserve)
        yield Budget(request.timeout, reserve=reserve)
