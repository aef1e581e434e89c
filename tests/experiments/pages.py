"""The tables of the reports in docs/experiments, made again from their JSON files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from experiments import rejection, space
from experiments.bench import Row
from experiments.compare import Comparison
from experiments.curricula import bars
from experiments.curricula import tables as curricula
from experiments.curricula.cases import WORDS, Case
from experiments.curricula.runs import Record
from experiments.deep import summary
from experiments.deep.runs import Record as DeepRecord
from experiments.problems import PROBLEMS
from experiments.tables import tables


def _comparisons(report: dict[str, Any]) -> dict[str, str]:
    problems = {problem.title: problem for problem in PROBLEMS.values()}
    made: dict[str, str] = {}
    for one in report["comparison"]:
        problem = problems[one["title"]]
        spec = problem.load()
        rows = tuple(Row(row["name"], tuple(row["runs"]), row["family"], row["recipe"]) for row in one["rows"])
        made |= tables(Comparison(problem, spec, rows, {}, {}, {}, np.empty((3 * len(spec.objects), 0))))
    return made


def _curriculum(report: dict[str, Any]) -> dict[str, str]:
    tasks = {words: task for task, words in WORDS.items()}
    found = []
    for row in report["runs"]:
        named = dict(row["strategy"] or {"name": ""})
        strategy = named.pop("name")
        for place, seed in enumerate(row["seeds"]):
            learner: Any = None  # no table looks at it
            case = Case(row["part"], row["name"], tasks[row["task"]], row["M"], seed, learner, strategy=strategy,
                        options=tuple(named.items()))  # fmt: skip
            found.append((case, Record(**{name: row[name][place] for name in Record.model_fields})))
    sizes = sorted({case.size for case, _ in found if case.group.startswith("fig5")})
    return curricula.tables(found, sizes, report["bound"]) | {"bars": bars.bars(found, sizes[-1])}


def _deep(report: dict[str, Any]) -> dict[str, str]:
    found: dict[summary.Key, list[DeepRecord]] = {}
    for run in report["runs"]:
        key = (run["task"], run["lesson"], run["source"])
        found.setdefault(key, []).append(DeepRecord(**{name: run[name] for name in DeepRecord.model_fields}))
    return summary.tables(found)


MAKERS = {
    "exp1": _comparisons,
    "exp2": _comparisons,
    "exp3": _comparisons,
    "rejection": lambda report: rejection.tables(report["problems"]),
    "space": lambda report: space.tables(report["problems"]),
    "curriculum": _curriculum,
    "curriculum-deep": _deep,
}


def tables_of(path: Path) -> dict[str, str]:
    """The tables by name that the JSON file of a report stands for."""
    return MAKERS[path.stem](json.loads(path.read_text(encoding="utf-8")))
