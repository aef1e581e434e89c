"""Reports: a page for people, a JSON file with every digit, figures beside them."""

from __future__ import annotations

import json
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from typing import Any

from experiments.errors import CANNOT_REPLACE_TABLES
from experiments.page import block, fill
from experiments.plan import Plan
from scenegen.errors import DataError
from scenegen.resources import __version__
from scenegen.scenes.files import ensure_folder, write_whole

SHOWN = 5  # seeds that are named one by one
QUICK_NOTE = "> **A quick run with tiny settings: it shows that the experiment works. The numbers mean nothing.**"


@dataclass(frozen=True, slots=True)
class Report:
    """`blocks` are tables and pictures in Markdown by name; `figures` are PNG files by name."""

    name: str
    title: str
    blocks: Mapping[str, str]
    data: Mapping[str, Any]
    figures: Mapping[str, bytes] = field(default_factory=dict)


def write(plan: Plan, report: Report) -> list[str]:
    """Write the report into the plan's folder; returns the names of the files. A page that is there keeps its text.
    Raises OutputError, DataError."""
    ensure_folder(plan.out)
    document = {
        "format": "scenegen/experiment",
        "version": 1,
        "experiment": report.name,
        "quick": plan.quick,
        "seeds": list(plan.seeds),
        "scenegen": __version__,
        "torch": version("torch"),
        **report.data,
        "figures": sorted(report.figures),
    }
    for name, data in report.figures.items():
        write_whole(plan.out / name, data)
    write_whole(plan.out / f"{report.name}.json", (json.dumps(document, indent=1) + "\n").encode())
    write_whole(plan.out / f"{report.name}.md", _page(plan, report).encode())
    return [*report.figures, f"{report.name}.json", f"{report.name}.md"]


def _page(plan: Plan, report: Report) -> str:
    path = plan.out / f"{report.name}.md"
    passes = f" --epochs {plan.epochs}" if plan.epochs is not None else ""
    command = f"python -m experiments {report.name}{passes}" + " --quick" * plan.quick
    seeds = _listed(plan.seeds)
    made = f"Tables and figures: `{command}`, seeds {seeds}; scenegen {__version__}, torch {version('torch')}."
    blocks = {"made": f"{made}\n\n{QUICK_NOTE}" if plan.quick else made, **report.blocks}
    try:
        old = path.read_text(encoding="utf-8") if path.exists() else f"# {report.title}\n\n{block('made', '')}\n"
    except (OSError, ValueError) as error:
        raise DataError(CANNOT_REPLACE_TABLES(path=path, name=report.name)) from error
    page, stale = fill(old, blocks)
    if stale:
        plan.tell(f"note: {path} has tables that this experiment does not make: {', '.join(stale)}; left as they were")
    return page


def _listed(seeds: Sequence[int]) -> str:
    whole = list(seeds) == list(range(seeds[0], seeds[-1] + 1)) and len(seeds) > SHOWN
    return f"{seeds[0]} to {seeds[-1]}" if whole else ", ".join(map(str, seeds))


def spread(values: Sequence[float], digits: int) -> str:
    """The mean, and the least and the greatest where they differ in what is shown; "-" for none."""
    if not values:
        return "-"
    mean, low, high = (f"{value:.{digits}f}" for value in (statistics.mean(values), min(values), max(values)))
    return mean if low == high else f"{mean} [{low}, {high}]"


def short(value: float) -> str:
    """A count for people, two or three digits of it: 433, 16.5k, 1.2M."""
    for size, letter in ((1e9, "G"), (1e6, "M"), (1e3, "k")):
        if value >= size:
            return f"{value / size:.3g}{letter}"
    return f"{value:.3g}"
