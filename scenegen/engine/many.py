"""Many independent jobs, each with a name: a job that fails is reported and does not stop the others.

The one mechanism for whatever is many jobs: trainings, files to draw or to settle, experiments, shards of a data set.
Jobs run on this machine's processes or on a cluster; results come in the order of the jobs, and each job works on one
thread, so that neither the engine nor the number of workers changes a byte.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import closing
from dataclasses import dataclass
from typing import Any

from scenegen.errors import Diagnostic, ScenegenError
from scenegen.errors.program import PROCESS_DIED
from scenegen.processes.pool import check_workers, run_pieces
from scenegen.processes.process import cores
from scenegen.processes.threads import one_thread

Named = tuple[str, Any]
"""A job's name and its item."""


@dataclass(frozen=True, slots=True)
class Ended:
    """A job that is over: its value, or why it failed."""

    name: str
    value: Any = None
    errors: tuple[Diagnostic, ...] = ()


@dataclass(frozen=True, slots=True)
class Attempt:
    """A job whose errors are results. Bugs are raised as they are."""

    job: Callable[[Any], Any]

    def __call__(self, named: Named) -> Ended:
        name, item = named
        try:
            with one_thread():
                return Ended(name, self.job(item))
        except ScenegenError as error:
            return Ended(name, errors=tuple(error.diagnostics))


def here(job: Callable[[Any], Any], items: Iterable[Named]) -> Generator[Ended, None, None]:
    """Every job in this process, one after the other: for jobs that use all processes themselves."""
    for name, item in items:
        try:
            ended = Ended(name, job(item))
        except ScenegenError as error:
            ended = Ended(name, errors=tuple(error.diagnostics))
        yield ended


def each(
    job: Callable[[Any], Any],
    items: Sequence[Named],
    engine: str = "local",
    workers: int | None = None,
    address: str | None = None,
) -> Generator[Ended, None, None]:
    """job(item) of every named item, in their order, by an engine; `job`, items and results must be picklable.

    `workers` is the number of processes, by default one per core; a job that ends its process twice has failed like any
    other. Raises RequestError for an unknown engine, a package that is not installed, a cluster that cannot be reached
    and a wrong number of workers; ScenegenError where processes cannot start or the cluster fails.
    """
    lost: dict[int, Ended] = {}  # whose process died, by place
    place = 0
    while place < len(items):
        rest = [index for index in range(place, len(items)) if index not in lost]
        try:
            with closing(_results(Attempt(job), [items[index] for index in rest], engine, workers, address)) as results:
                for index, ended in zip(rest, results, strict=True):
                    yield from (lost[before] for before in range(place, index))
                    place = index + 1
                    yield ended
        except ScenegenError as error:
            which = _lost(error)
            if which is None:
                raise
            index = rest[which]
            lost[index] = Ended(items[index][0], errors=tuple(error.diagnostics))
            continue
        yield from (lost[index] for index in range(place, len(items)))
        return


def _results(
    job: Attempt, items: list[Named], engine: str, workers: int | None, address: str | None
) -> Generator[Ended, None, None]:
    if engine == "local" and address is None:  # needs no pyarrow
        count = check_workers(workers) if workers is not None else cores()
        return run_pieces(job, items, max(1, min(count, len(items))))
    from scenegen.engine.engines import map_each

    return map_each(engine, job, items, workers, address)


def _lost(error: ScenegenError) -> int | None:
    """The number of the item at which processes died, None for another error."""
    first = error.diagnostics[0]
    which = first.facts.get("item")
    return which if first.code == PROCESS_DIED.code and isinstance(which, int) else None
