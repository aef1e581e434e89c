"""Several inputs of one command, each a job of its own: their names and places, what is said of each, the exit
status."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenegen.cli.output import complain, note, print_error, print_message, progress_bar
from scenegen.errors import RequestError
from scenegen.errors.files import FOLDER_FOR_SEVERAL, ONLY_FOR_SEVERAL, SAME_NAME, SOME_FAILED
from scenegen.scenes.locations import is_url, names_set

if TYPE_CHECKING:
    from scenegen.errors import Diagnostic
    from scenegen.sampling.engine.engines import JobResult


@dataclass(frozen=True, slots=True)
class JobMessages:
    """What a job says when it is over: lines for people, and warnings and notes."""

    lines: tuple[str, ...] = ()
    diagnostics: tuple[Diagnostic, ...] = ()


def names_of(sources: Sequence[Path]) -> list[str]:
    """The name of each input, which its output gets, too. Raises RequestError for two of one name."""
    names = [source.stem for source in sources]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise RequestError(SAME_NAME(name=twice))
    return names


def folder_for(out: str | None, count: int, *, urls: bool = False) -> str:
    """The folder of several outputs, without the slash at its end. Raises RequestError for another place."""
    if out is None or not names_set(out) or (is_url(out) and not urls):
        raise RequestError(FOLDER_FOR_SEVERAL(count=count))
    return out.rstrip("/") or "/"


def refuse_engine(engine: str, address: str | None) -> None:
    """For one input, whose parts this machine's processes share. Raises RequestError."""
    for argument, given in (("engine", engine != "local"), ("address", address is not None)):
        if given:
            raise RequestError(ONLY_FOR_SEVERAL(argument=argument))


def shared_work(
    job: Callable[[Any], JobMessages],
    items: Sequence[tuple[str, Any]],
    engine: str,
    workers: int | None,
    address: str | None,
    unit: str,
) -> int:
    """Do jobs by an engine, say of each what it says, and return the exit status. Raises what `engine.many.run_each`
    raises, and KeyboardInterrupt that says how many jobs are done."""
    from scenegen.sampling.engine.engines import run_each

    done = 0
    with progress_bar() as bar:
        task = bar.add_task(unit, total=len(items))

        def report_job(ended: JobResult) -> None:
            nonlocal done
            done += 1
            bar.update(task, completed=done, description=f"{unit}: {done} of {len(items)}")
            if isinstance(ended.value, JobMessages):
                for line in ended.value.lines:
                    print_error(f"{ended.name}: {line}")
                for diagnostic in ended.value.diagnostics:
                    (note if diagnostic.severity == "note" else complain)(diagnostic)

        try:
            return finish_jobs(run_each(job, items, engine, workers, address), len(items), report_job)
        except KeyboardInterrupt as error:
            raise KeyboardInterrupt(f"interrupted: {done} of {len(items)} are done") from error


def finish_jobs(
    results: Iterable[JobResult], count: int, on_job: Callable[[JobResult], None] = lambda ended: None
) -> int:
    """Name each job that failed, as soon as it has, and return the exit status: 1 if one did."""
    failed = []
    for ended in results:
        on_job(ended)
        if ended.errors:
            say_why(ended)
            failed.append(ended.name)
    return exit_status(failed, count)


def say_why(ended: JobResult) -> None:
    """A job that failed, by its name, and its errors."""
    print_message(f"{ended.name} failed:")
    complain(*ended.errors)


def exit_status(failed: Sequence[str], count: int) -> int:
    """At the end of `count` jobs: 1 if some failed, which are named once more."""
    if failed:
        complain(SOME_FAILED(failed=tuple(failed), count=count))
    return 1 if failed else 0
