"""Success by the margin of the grasp that a suite gives with each start: a table in Markdown.

    python -m experiments.success.margins SUITE OUTCOMES.jsonl ...

The suite is one of `scenegen suite new --grasp`. Intervals are 95 %, Wilson's; AUC is that of the margin, by a
bootstrap over starts.
"""

from __future__ import annotations

import sys
from itertools import pairwise
from pathlib import Path

import numpy as np

from scenegen.arrays import Bool
from scenegen.learn.success.measures import auc_interval
from scenegen.learn.success.statistics import wilson
from scenegen.play.suites.outcomes import read_outcomes
from scenegen.play.suites.suite import Suite

ENDS = -0.02, -0.01, 0.0, 0.005, 0.01, 0.015, 0.0201  # metres, of bands of the margin


def main(folder: str, *paths: str) -> None:
    """Print a line for each file of outcomes and task."""
    suite = Suite.load(folder)
    bands = list(pairwise(ENDS))
    head = ["policy", "task", "all", *(f"{low * 100:g} to {high * 100:.2g} cm" for low, high in bands), "AUC"]
    print(f"| {' | '.join(head)} |\n|{'---|' * len(head)}")
    for path in paths:
        outcomes = read_outcomes(Path(path), suite)
        policy = outcomes.header.policy.rpartition(":")[2]
        margin = np.array([suite[one.episode].margin for one in outcomes.episodes], dtype=np.float64)
        success = np.array([one.success for one in outcomes.episodes])
        tasks = np.array([one.task for one in outcomes.episodes])
        for name in (*(task.name for task in suite.tasks), "all"):
            mine = (tasks == name) | (name == "all")
            cells = [share(success[mine])]
            cells += [share(success[mine & (margin >= low) & (margin < high)]) for low, high in bands]
            found = auc_interval(success[mine], margin[mine], np.arange(int(mine.sum())))
            print(f"| {' | '.join([policy, name, *cells, '{:.2f} ({:.2f} to {:.2f})'.format(*found)])} |")


def share(success: Bool) -> str:
    """Successes of how many, and the interval of their share."""
    if not success.size:
        return "-"
    low, high = wilson(float(success.mean()), success.size)
    return f"{success.sum()} of {success.size} ({low:.0%} to {high:.0%})"


if __name__ == "__main__":
    main(*sys.argv[1:])
