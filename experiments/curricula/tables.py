"""What was found, as tables."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from experiments.curricula.cases import SETTINGS, WORDS, Case
from experiments.curricula.runs import Record
from experiments.page import table
from experiments.report import short

Found = Sequence[tuple[Case, Record]]
FEW = 1_000  # from which on numbers are shown by their first digits


def grouped(found: Found, by: Callable[[Case], Any]) -> dict[Any, list[Record]]:
    """The records of the cases that are alike, in the order of the cases."""
    groups: dict[Any, list[Record]] = {}
    for case, record in found:
        groups.setdefault(by(case), []).append(record)
    return groups


def mean(runs: Iterable[Record], what: str) -> float | None:
    """The mean over the seeds; None if one of them did not converge, or there is none."""
    values = [getattr(run, what) for run in runs]
    return None if not values or min(values) < 0 else statistics.mean(values)


def told(runs: Sequence[Record], what: str) -> str:
    """The mean over the seeds, in brackets the least and the greatest; how many did not converge."""
    values = [getattr(run, what) for run in runs]
    missing = sum(value < 0 for value in values)
    if missing:
        return "never" if missing == len(values) else f"never in {missing} of {len(values)}"
    low, middle, high = map(_figures, (min(values), statistics.mean(values), max(values)))
    return middle if low == high else f"{middle} [{low}, {high}]"


def ratio(base: float | None, other: float | None) -> str:
    """How many times fewer."""
    return "-" if base is None or not other else f"{base / other:.1f}"


def tables(found: Found, sizes: Sequence[int], bound: int) -> dict[str, str]:
    """All tables by name, for tables of the given sizes; `bound` is the least number of episodes there can be."""
    return {
        "largest": at_largest(found, sizes[-1]),
        **{f"sizes-{setting}": by_size(found, setting, sizes) for setting in SETTINGS},
        "sensitivity": sensitivity(found),
        "knobs": knobs(found),
        "strategies": strategies(found),
        "beyond": beyond(found, bound),
    }


def at_largest(found: Found, size: int) -> str:
    """Episodes, steps, resets and time of Fig. 5 at the largest table."""
    head = ["setting, task, curriculum", "episodes", "times fewer", "however ties go", "times fewer"]
    head += ["steps", "resets", "CPU s"]
    groups = grouped(_at(found, size), lambda case: (case.group, case.task, case.name))
    rows = []
    for (group, task, name), runs in groups.items():
        base = groups[group, task, "uniform"]
        fair = group.endswith("fair")
        rows.append(
            [
                f"{group.removeprefix('fig5 ')}, {task}, {name}",
                told(runs, "episodes"),
                ratio(mean(base, "episodes"), mean(runs, "episodes")),
                told(runs, "any_episodes") if fair else f"{statistics.mean(run.any_share for run in runs):.0%} solved",
                ratio(mean(base, "any_episodes"), mean(runs, "any_episodes")) if fair else "",
                told(runs, "steps"),
                told(runs, "resets"),
                f"{statistics.mean(run.cpu for run in runs):.2g}",
            ]
        )
    return table(head, rows)


def by_size(found: Found, setting: str, sizes: Sequence[int]) -> str:
    """Mean episodes for every size."""
    groups = grouped(
        [pair for pair in found if pair[0].group == f"fig5 {setting}"], lambda case: (case.task, case.name, case.size)
    )
    curves = dict.fromkeys((task, name) for task, name, _ in groups)
    rows = [
        [f"{task}, {name}", *(_cell(mean(groups[task, name, size], "episodes")) for size in sizes)]
        for task, name in curves
    ]
    return table([f"{setting}: task, curriculum", *(f"M = {size}" for size in sizes)], rows)


def sensitivity(found: Found) -> str:
    """One thing changed at a time."""
    groups = grouped(_of(found, "sensitivity "), lambda case: (case.group, case.name))
    rows = []
    for group in dict.fromkeys(group for group, _ in groups):
        means = {name: mean(groups[group, name], "episodes") for name in ("uniform", "linear", "self-paced")}
        rows.append(
            [
                group.removeprefix("sensitivity "),
                *map(_cell, means.values()),
                ratio(means["uniform"], means["linear"]),
                ratio(means["uniform"], means["self-paced"]),
            ]
        )
    head = ["setting: what is changed", "uniform", "linear", "self-paced", "linear: times fewer"]
    return table([*head, "self-paced: times fewer"], rows)


def knobs(found: Found) -> str:
    """The settings of the curricula themselves."""
    groups = grouped(
        [*_of(found, "schedule "), *_of(found, "streak ")], lambda case: (*case.group.split(maxsplit=1), case.name)
    )
    words = {"schedule": "linear, {} of the schedule", "streak": "self-paced, {} successes in a row"}
    lines = dict.fromkeys((kind, name) for kind, _, name in groups)
    rows = [
        [words[kind].format(name), *(told(groups[kind, setting, name], "episodes") for setting in SETTINGS)]
        for kind, name in lines
    ]
    return table(["task A", *SETTINGS], rows)


def beyond(found: Found, bound: int) -> str:
    """Learners that make more of an episode."""
    groups = grouped(_of(found, "beyond"), lambda case: case.name)
    rows = []
    for name, runs in groups.items():
        episodes, strict = mean(runs, "episodes"), mean(runs, "any_episodes")
        rows.append(
            [
                name,
                told(runs, "episodes"),
                told(runs, "any_episodes"),
                "-" if strict is None else f"{strict / bound:.2g}",
                told(runs, "any_steps" if strict is not None else "steps"),
                told(runs, "any_resets" if strict is not None else "resets"),
                "-" if episodes is None else f"{statistics.mean(run.cpu for run in runs):.2g}",
            ]
        )
    head = ["learner, where episodes begin", "episodes, ties to the first action", "however ties go"]
    return table([*head, f"in bounds ({bound})", "steps", "resets", "CPU s"], rows)


def strategies(found: Found) -> str:
    """What any learner can use."""
    groups = grouped(_of(found, "strategies"), lambda case: (case.strategy, case.options))
    base = next(iter(groups.values()))
    rows = [
        [
            ", ".join([name, *(f"{key} {value:g}" for key, value in options)]),
            told(runs, "episodes"),
            ratio(mean(base, "episodes"), mean(runs, "episodes")),
            told(runs, "any_episodes"),
            ratio(mean(base, "any_episodes"), mean(runs, "any_episodes")),
            told(runs, "resets"),
        ]
        for (name, options), runs in groups.items()
    ]
    return table(["strategy", "episodes", "times fewer", "however ties go", "times fewer", "resets"], rows)


def data(found: Found) -> list[dict[str, Any]]:
    """Every run, with every digit."""
    kept = ("episodes", "steps", "resets", "any_episodes", "any_steps", "any_resets")
    rows: dict[tuple[object, ...], dict[str, Any]] = {}
    for case, record in found:
        one = rows.setdefault(
            (case.group, case.name, case.task, case.size),
            {
                "part": case.group,
                "name": case.name,
                "task": WORDS[case.task],
                "M": case.size,
                "scenes": case.source,
                "learner": _plain(case.learner),
                "curriculum": _plain(case.curriculum) if not case.strategy else None,
                "strategy": {"name": case.strategy, **dict(case.options)} if case.strategy else None,
                "order": list(case.order),
                "shared_by_relations": case.relations,
                "until_right_however_ties_go": case.both,
                "most_episodes": case.most,
                "seeds": [],
                **{what: [] for what in (*kept, "level", "any_share", "cpu")},
            },
        )
        one["seeds"].append(case.seed)
        for what in kept:
            one[what].append(getattr(record, what))
        one["level"].append(record.level)
        one["any_share"].append(record.any_share)
        one["cpu"].append(record.cpu)
    return list(rows.values())


def _plain(settings: Any) -> Mapping[str, Any]:
    values: Mapping[str, Any] = settings._asdict()
    return values


def _of(found: Found, prefix: str) -> list[tuple[Case, Record]]:
    return [pair for pair in found if pair[0].group.startswith(prefix)]


def _at(found: Found, size: int) -> list[tuple[Case, Record]]:
    return [pair for pair in _of(found, "fig5 ") if pair[0].size == size]


def _figures(value: float) -> str:
    return short(value) if value >= FEW else f"{value:.0f}"


def _cell(value: float | None) -> str:
    return "never" if value is None else _figures(value)
