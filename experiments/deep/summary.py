"""Runs put together: what three seeds say of a task, a lesson and a source."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from experiments.deep.lessons import EXACT, LESSONS, SOURCES
from experiments.deep.runs import Record
from experiments.deep.tasks import TASKS
from experiments.page import table
from experiments.report import short, spread

Key = tuple[str, str, str]
"""The keys of a task, a lesson and a source."""
Found = Mapping[Key, Sequence[Record]]

MARKS = (0.5, 0.8, 0.95)
JUDGED = 0.8  # the mark that the verdict is about
CURRICULA = ("linear", "self_paced")


def until(record: Record, mark: float) -> int | None:
    """After how many steps success was measured to have reached a mark for the first time."""
    return next((steps for steps, success in record.curve if success >= mark), None)


def usual(records: Sequence[Record], mark: float = JUDGED) -> float | None:
    """The mean of that over the seeds, None unless all of them reach the mark."""
    found = [until(record, mark) for record in records]
    return statistics.mean(steps for steps in found if steps is not None) if None not in found else None


def tables(found: Found) -> dict[str, str]:
    """All tables by name, and the specs that they are about."""
    made = {"verdicts": judged(found)}
    for task, what in TASKS.items():
        made[f"{task}-spec"] = "```spec\n" + what.load().source.strip() + "\n```"
        made[f"{task}-runs"] = results(found, task)
    return made


def results(found: Found, task: str) -> str:
    """The table of a task."""
    head = ["", *(f"steps to {mark:.0%}" for mark in MARKS), "success at the end", "episodes"]
    head += ["CPU s", "wall s", "of it for scenes"]
    return table(head, [_row(key, records) for key, records in found.items() if key[0] == task])


def _row(key: Key, records: Sequence[Record]) -> list[str]:
    def mean(what: Callable[[Record], float]) -> float:
        return statistics.mean(what(record) for record in records)

    return [
        f"{LESSONS[key[1]].title}; {SOURCES[key[2]]}",
        *(_reached(records, mark) for mark in MARKS),
        spread([record.curve[-1][1] for record in records], 2),
        short(mean(lambda record: record.episodes)),
        f"{mean(lambda record: record.cpu):.1f}",
        f"{mean(lambda record: record.wall):.1f}",
        f"{mean(lambda record: record.sampling / record.cpu):.0%}",
    ]


def _reached(records: Sequence[Record], mark: float) -> str:
    steps = [found for record in records if (found := until(record, mark)) is not None]
    if not steps:
        return "not within"
    words = short(statistics.mean(steps))
    if min(steps) < max(steps):
        words += f" [{short(min(steps))}, {short(max(steps))}]"
    return words if len(steps) == len(records) else f"{words}, {len(steps)} of {len(records)}"


@dataclass(frozen=True, slots=True)
class Verdict:
    """Whether curricula help in a task. `factor` is how many times fewer steps the best one takes than scenes uniform
    in phi, where both reach the mark."""

    task: str
    best: str | None
    factor: float | None


def verdict(found: Found, task: str) -> Verdict:
    """Curricula against scenes uniform in phi, by the exact sampler's scenes."""
    exact = {lesson: usual(found[task, lesson, EXACT]) for lesson in LESSONS}
    reached = {lesson: count for lesson in CURRICULA if (count := exact[lesson]) is not None}
    best = min(reached, key=reached.__getitem__) if reached else None
    even = exact["uniform"]
    return Verdict(task, best, None if best is None or even is None else even / reached[best])


def judged(found: Found) -> str:
    """Steps to the mark by lesson, and the verdict, one column per task and source."""
    columns = [(task, source) for task in TASKS for source in SOURCES]
    rows = [
        [lesson.title, *(_steps(found.get((task, key, source))) for task, source in columns)]
        for key, lesson in LESSONS.items()
    ]
    verdicts = {task: verdict(found, task) for task in TASKS}

    def fewer(task: str, source: str) -> str:
        factor = verdicts[task].factor
        return "-" if source != EXACT or factor is None else f"{factor:.1f}"

    rows.append(["times fewer: best curriculum, uniform in phi", *(fewer(*column) for column in columns)])
    return table(["", *(f"{TASKS[task].title}; {SOURCES[source]}" for task, source in columns)], rows)


def _steps(records: Sequence[Record] | None) -> str:
    if records is None:
        return "-"
    steps = usual(records)
    return "not in all runs" if steps is None else short(steps)
