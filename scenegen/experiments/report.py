"""Reports: a Markdown file for people, a JSON file with every digit, figures beside them."""

from __future__ import annotations

import json
import statistics
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from typing import Any

from scenegen.experiments.plan import Plan
from scenegen.formats.files import ensure_folder, write_whole

WIDTH = 118  # characters of a line
QUICK_NOTE = "> **A quick run with tiny settings: it shows that the experiment works. The figures mean nothing.**"


@dataclass(frozen=True, slots=True)
class Report:
    """`blocks` are paragraphs, tables and pictures in Markdown; `figures` are PNG files by name."""

    name: str
    title: str
    blocks: Sequence[str]
    data: Mapping[str, Any]
    figures: Mapping[str, bytes] = field(default_factory=dict)


def write(plan: Plan, report: Report) -> list[str]:
    """Write the report into the plan's folder; returns the names of the files. Raises OutputError."""
    ensure_folder(plan.out)
    command = f"scenegen experiment {report.name}" + " --quick" * plan.quick
    seeds = ", ".join(map(str, plan.seeds))
    made = f"Made by `{command}` with the seeds {seeds}; scenegen {version('scenegen')}, torch {version('torch')}."
    head = [f"# {report.title}", *([QUICK_NOTE] if plan.quick else []), made]
    text = "\n\n".join(map(_wrapped, [*head, *report.blocks])) + "\n"
    document = {
        "format": "scenegen/experiment",
        "version": 1,
        "experiment": report.name,
        "quick": plan.quick,
        "seeds": list(plan.seeds),
        "scenegen": version("scenegen"),
        "torch": version("torch"),
        **report.data,
        "figures": sorted(report.figures),
    }
    for name, data in report.figures.items():
        write_whole(plan.out / name, data)
    write_whole(plan.out / f"{report.name}.json", (json.dumps(document, indent=1) + "\n").encode())
    write_whole(plan.out / f"{report.name}.md", text.encode())
    return [*report.figures, f"{report.name}.json", f"{report.name}.md"]


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in Markdown; the first column is words, the others are figures."""
    lines = [head, ["---", *["---:"] * (len(head) - 1)], *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def picture(name: str, heading: str, words: str) -> str:
    """A figure with its caption."""
    return f"![{heading}]({name})\n\n*{heading}. {words}*"


def listed(items: Iterable[str]) -> str:
    """A list in Markdown."""
    return "\n".join(f"* {item}" for item in items)


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


def _wrapped(block: str) -> str:
    """Words on lines that a person can read in a diff; tables and links stay as they are."""
    return "\n".join(line if line[:1] in "|!#>" else _fill(line) for line in block.split("\n"))


def _fill(line: str) -> str:
    indent = "  " if line.startswith("* ") else ""
    return textwrap.fill(line, WIDTH, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)
