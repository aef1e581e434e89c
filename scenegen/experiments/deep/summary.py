"""Runs put together: what three seeds say of a task, a lesson and a source."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from scenegen.experiments.deep.lessons import EXACT, LESSONS, SOURCES
from scenegen.experiments.deep.runs import Record
from scenegen.experiments.deep.tasks import TASKS
from scenegen.experiments.report import short, spread, table

Key = tuple[str, str, str]
"""The keys of a task, a lesson and a source."""
Found = Mapping[Key, Sequence[Record]]

MARKS = (0.5, 0.8, 0.95)
JUDGED = 0.8  # the mark that the verdict is about
CURRICULA = ("linear", "self_paced")
MATTERS = 1.2  # times as many steps that count as a difference


def until(record: Record, mark: float) -> int | None:
    """After how many steps success was measured to have reached a mark for the first time."""
    return next((steps for steps, success in record.curve if success >= mark), None)


def usual(records: Sequence[Record], mark: float = JUDGED) -> float | None:
    """The mean of that over the seeds, None unless all of them reach the mark."""
    found = [until(record, mark) for record in records]
    return statistics.mean(steps for steps in found if steps is not None) if None not in found else None


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
    in phi, where both reach the mark. `words` are for people."""

    task: str
    best: str | None
    factor: float | None
    words: str


def verdict(found: Found, task: str) -> Verdict:
    """Curricula against scenes uniform in phi, and these against random scenes; judged by the exact sampler's."""
    steps = {
        source: {which[1]: usual(runs) for which, runs in found.items() if (which[0], which[2]) == (task, source)}
        for source in SOURCES
    }
    exact = steps[EXACT]
    reached = {lesson: count for lesson in CURRICULA if (count := exact[lesson]) is not None}
    best = min(reached, key=reached.__getitem__) if reached else None
    even, factor = exact["uniform"], None
    if best is None:
        judged = "no curriculum helps"
    elif even is None:
        judged = "learnt in all runs with a curriculum, not in all with scenes uniform in phi"
    else:
        factor = even / reached[best]
        judged = f"the best curriculum takes {factor:.1f} times fewer steps than scenes uniform in phi"
        if factor < MATTERS:
            judged = "curricula hardly matter" if factor > 1.0 / MATTERS else "curricula cost steps"
    told = (
        f"{SOURCES[source]}: {', '.join(f'{LESSONS[lesson].title} {_count(count)}' for lesson, count in row.items())}"
        for source, row in steps.items()
        if row
    )
    words = f"**{TASKS[task].title}: {judged}.** Steps until {JUDGED:.0%} of the held-out scenes are solved: "
    return Verdict(task, best, factor, words + "; ".join(told) + ".")


def without(found: Found) -> str:
    """What a dense reward does without any curriculum."""
    told = []
    for key, what in TASKS.items():
        steps, best = usual(found[key, "dense", EXACT]), verdict(found, key)
        against = None if best.best is None else usual(found[key, best.best, EXACT])
        times = f", {steps / against:.1f} times as many as the best curriculum's" if steps and against else ""
        told.append(f"{what.title}: {_count(steps)}{times}")
    return (
        "The other way out is a dense reward, the change of phi, with random scenes and no curriculum at all. Steps"
        f" until {JUDGED:.0%}: {'; '.join(told)}."
    )


def _count(steps: float | None) -> str:
    return "not in all runs" if steps is None else short(steps)
