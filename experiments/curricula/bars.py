"""What the project wanted of its learners and curricula, and whether it was reached."""

from __future__ import annotations

from experiments.curricula.cases import Case
from experiments.curricula.runs import Record
from experiments.curricula.tables import Found, grouped, mean
from experiments.page import table

TIMES = {"A": 20.0, "B": 15.0}  # times fewer episodes, self-paced against uniform, paper-like
FAIR, FAIR_GOAL = 20_000, 10_000  # episodes of the best one-step learner
ANY, ANY_GOAL = 500, 200  # of the best tabular learner
CHECKS = {"episodes": "ties to the first action", "any_episodes": "however ties go"}


def bars(found: Found, largest: int) -> str:
    """The table."""
    rows = [_paced(found, largest, task, least) for task, least in TIMES.items()]
    learners = grouped([pair for pair in found if pair[0].group == "beyond"], lambda case: case.name)
    one_step = {name: runs for name, runs in learners.items() if name.startswith("one step")}
    tabular = {name: runs for name, runs in learners.items() if not name.startswith("relations")}
    for words, some, bar, goal in (
        ("fair, A, one step: episodes", one_step, FAIR, FAIR_GOAL),
        ("any tabular learner, A: episodes", tabular, ANY, ANY_GOAL),
    ):
        rows += [_best(some, what, f"{words}, {how}", bar, goal) for what, how in CHECKS.items()]
    return table(["", "bar", "goal", "found", "by", "bar", "goal"], rows)


def _paced(found: Found, largest: int, task: str, least: float) -> list[str]:
    def by(case: Case) -> str:
        return case.name

    runs = grouped([(c, r) for c, r in found if (c.group, c.task, c.size) == ("fig5 paper-like", task, largest)], by)
    base, paced = (mean(runs[name], "episodes") for name in ("uniform", "self-paced"))
    times = 0.0 if base is None or not paced else base / paced
    words = f"paper-like, {task}: times fewer episodes than uniform"
    return [words, f">= {least:g}", "", f"{times:.1f}", "self-paced", _met(times >= least), ""]


def _best(runs: dict[str, list[Record]], what: str, words: str, bar: int, goal: int) -> list[str]:
    means = {name: value for name, some in runs.items() if (value := mean(some, what)) is not None}
    limits = [f"<= {bar:,}", f"<= {goal:,}"]
    if not means:
        return [words, *limits, "never", "", _met(False), _met(False)]
    name = min(means, key=lambda one: means[one])
    return [words, *limits, f"{means[name]:,.0f}", name, _met(means[name] <= bar), _met(means[name] <= goal)]


def _met(yes: bool) -> str:
    return "met" if yes else "missed"
