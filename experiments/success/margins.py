"""Success by the margin of the grasp that suites give with each start: a table in Markdown.

    python -m experiments.success.margins SUITE OUTCOMES.jsonl [SUITE OUTCOMES.jsonl ...]

The suites are of `scenegen suite new --grasp`. Intervals are 95 %, Wilson's.
"""

from __future__ import annotations

import sys
from itertools import pairwise
from pathlib import Path

import numpy as np

from scenegen.arrays import Bool
from scenegen.learn.success.statistics import wilson
from scenegen.play.suites.outcomes import read_outcomes
from scenegen.play.suites.suite import Suite

ENDS = -0.02, -0.002, 0.005, 0.01, 0.015, 0.0201  # metres, of bands of the margin


def main(*places: str) -> None:
    """Print a line for each task."""
    bands, rows = list(pairwise(ENDS)), list[tuple[str, float, bool]]()
    for folder, path in zip(places[::2], places[1::2], strict=True):
        suite = Suite.load(folder)
        for one in read_outcomes(Path(path), suite).episodes:
            margin = suite[one.episode].margin
            assert margin is not None
            rows.append((one.task, margin, one.success))
    tasks, margins, success = (np.array(column) for column in zip(*rows, strict=True))
    head = ["task", *(f"{low * 100:g} to {high * 100:.2g} cm" for low, high in bands)]
    print(f"| {' | '.join(head)} |\n|{'---|' * len(head)}")
    for name in (*dict.fromkeys(tasks.tolist()), "all"):
        mine = (tasks == name) | (name == "all")
        cells = [share(success[mine & (margins >= low) & (margins < high)]) for low, high in bands]
        print(f"| {name} | {' | '.join(cells)} |")


def share(success: Bool) -> str:
    """Successes of how many, and the interval of their share."""
    if not success.size:
        return "-"
    low, high = wilson(float(success.mean()), success.size)
    return f"{success.sum()} of {success.size} ({low:.0%} to {high:.0%})"


if __name__ == "__main__":
    main(*sys.argv[1:])
