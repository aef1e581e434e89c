"""Success by band of phi, and how well phi of a start tells success from failure: a table in Markdown.

    python -m experiments.success.table SUITE OUTCOMES.jsonl ...

AUC: the probability that phi of a start that succeeds is above that of one that fails; 0.5 is none. Beside phi of
the goal, the same of the smallest gap of two things at the start. Intervals are 95 %: Wilson's for shares, of a
bootstrap for AUC.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from scenegen.api.spec import parse
from scenegen.arrays import Array
from scenegen.learn.success.measures import auc, bootstrap_interval
from scenegen.learn.success.statistics import wilson
from scenegen.play.suites.outcomes import read_outcomes
from scenegen.play.suites.suite import Suite


def both(phi: Array, success: npt.NDArray[np.bool_]) -> str:
    """The AUC with its interval."""
    return "{:.2f} ({:.2f} to {:.2f})".format(*bootstrap_interval(auc, success, phi, np.arange(len(phi))))


def rows(suite: Suite, paths: Sequence[Path]) -> list[str]:
    """A line for each task and policy."""
    found = []
    bands = [band.name for band in suite.tasks[0].bands]
    head = ["task", "policy", "episodes", "success", *bands, "AUC of phi", "AUC of the smallest gap"]
    found += [f"| {' | '.join(head)} |", f"|{' --- |' * len(head)}"]
    for task in suite.tasks:
        gaps = parse(f"{task.spec.checked.source}clear: forall p, q in objects: gap(p, q) >= 0 m\n")
        clear = gaps.scenes(task.scenes.poses).phi["clear"]
        for path in paths:
            outcomes = read_outcomes(path, suite)
            mine = [one for one in outcomes.episodes if one.task == task.name]
            success = np.array([one.success for one in mine])
            phi = np.array([suite[one.episode].phi[task.success] for one in mine])
            by_band = [success[[one.band == band for one in mine]] for band in bands]
            low, high = wilson(float(success.mean()), len(success))
            share = f"{success.mean():.0%} ({low:.0%} to {high:.0%})"
            gap = clear[[suite[one.episode].row for one in mine]]
            cells = [
                task.name,
                outcomes.header.policy.rpartition("/")[2],
                str(len(mine)),
                share,
                *(f"{one.mean():.0%}" for one in by_band),
            ]
            found.append(f"| {' | '.join([*cells, both(phi, success), both(gap, success)])} |")
    return found


if __name__ == "__main__":
    print("\n".join(rows(Suite.load(sys.argv[1]), [Path(one) for one in sys.argv[2:]])))
