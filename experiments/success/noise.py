"""How much of a policy's outcomes no function of the start can tell: runs of the same starts with other errors.

    python -m experiments.success.noise SUITE OUTCOMES.jsonl AGAIN.jsonl ...

`noise` is the mean of p (1 - p), by how often two runs of a start end differently, over that of a policy which
succeeds as often at every start: the share of the variance that is not of the start. `AUC of another run` is how well
the mean of the other runs tells success: what a start decides can be told at least so well. `ceiling` is the AUC of p
itself if p were distributed over starts by Beta with this mean and this noise. Intervals are 95 %, of a bootstrap over
starts.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from scenegen.arrays import Array
from scenegen.learn.success.measures import auc
from scenegen.play.suites.outcomes import read_outcomes
from scenegen.play.suites.suite import Suite

REPEATS, DRAWS = 1000, 4096  # of the bootstrap, and of a Beta distribution


def main(folder: str, *paths: str) -> None:
    """Print a line for each task."""
    suite = Suite.load(folder)
    runs = [{one.episode: one.success for one in read_outcomes(Path(path), suite).episodes} for path in paths]
    both = sorted(set.intersection(*(set(run) for run in runs)))
    tasks = np.array([suite[number].task.name for number in both])
    success = np.array([[run[number] for number in both] for run in runs], dtype=np.float64)
    rng = np.random.default_rng(0)
    print("| task | starts | success | noise | AUC of another run | ceiling |\n|---|---|---|---|---|---|")
    for name in (*(task.name for task in suite.tasks), "all"):
        mine = success[:, (tasks == name) | (name == "all")]
        count = mine.shape[1]
        drawn = np.array([measures(mine[:, rng.integers(count, size=count)]) for _ in range(REPEATS)])
        low, high = np.nanquantile(drawn, (0.025, 0.975), axis=0)
        cells = ["{:.2f} ({:.2f} to {:.2f})".format(*one) for one in zip(measures(mine), low, high, strict=True)]
        print(f"| {name} | {count} | {' | '.join(cells)} |")


def measures(success: Array) -> tuple[float, float, float, float]:
    """Of R runs of n starts (R, n): success, noise, the AUC of another run, and the ceiling; NaN where all ended
    alike."""
    runs = len(success)
    mean = float(success.mean())
    if mean in (0.0, 1.0):
        return mean, np.nan, np.nan, np.nan
    won = success.sum(axis=0)
    within = float((won * (runs - won)).mean()) / (runs * (runs - 1))  # the mean of p (1 - p), unbiased
    noise = min(1.0, within / (mean * (1.0 - mean)))
    others = (won - success) / (runs - 1)
    told = auc(success.ravel() > 0.0, others.ravel())
    return mean, noise, told, ceiling(mean, noise)


def ceiling(mean: float, noise: float) -> float:
    """The AUC of p, where p is Beta with this mean, and mean of p (1 - p) the share `noise` of mean (1 - mean)."""
    size = noise / max(1.0 - noise, 1e-6)  # a + b
    p = np.random.default_rng(1).beta(max(mean * size, 1e-6), max((1.0 - mean) * size, 1e-6), DRAWS)
    order = np.argsort(p)
    fails = np.cumsum((1.0 - p)[order]) - (1.0 - p)[order] / 2.0
    return float((p[order] * fails).sum() / (p.sum() * (1.0 - p).sum()))


if __name__ == "__main__":
    main(*sys.argv[1:])
