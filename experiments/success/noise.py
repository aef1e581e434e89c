"""How much of a policy's outcomes no function of the start can tell: runs of the same starts with other errors.

    python -m experiments.success.noise SUITE OUTCOMES.jsonl AGAIN.jsonl ...

The first run is of all starts, the others of all or of some, such as those of `experiments.success.again`: within a
task, those that failed stand for all that failed in the first run, and so do those that succeeded.

Three shares make up the variance of success, which is mean (1 - mean). `noise` is the mean of p (1 - p), by how often
two runs of a start end differently: it is not of the start. `told` is of the start, and told by the fit of
`experiments.success.grasp`, which has not seen it; `untold` is of the start, and not told by it: the mean of (p - fit)
squared, by two runs of a start. `AUC of another run` is how well the mean of the other runs tells success: what a start
decides can be told at least so well. `ceiling` is the AUC of p itself if p were distributed over starts by Beta with
this mean and this noise. Intervals are 95 %, of a bootstrap over starts.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from experiments.success.grasp import held_out, scores
from scenegen.arrays import Array
from scenegen.play.suites.outcomes import read_outcomes
from scenegen.play.suites.suite import Suite

REPEATS, DRAWS = 1000, 4096  # of the bootstrap, and of a Beta distribution
HEAD = ("task", "starts", "run again", "success", "noise", "told", "untold", "AUC of another run", "ceiling")


def main(folder: str, *paths: str) -> None:
    """Print a line for each task."""
    suite = Suite.load(folder)
    runs = [{one.episode: one.success for one in read_outcomes(Path(path), suite).episodes} for path in paths]
    both = set.intersection(*(set(run) for run in runs))
    print(f"| {' | '.join(HEAD)} |\n|{'---|' * len(HEAD)}")
    parts, starts = [], 0
    for task in suite.tasks:
        mine = [number for number in sorted(runs[0]) if suite[number].task is task]
        first, chosen = np.array([runs[0][number] for number in mine]), np.array([number in both for number in mine])
        fit = held_out(scores(task, [suite[number].row for number in mine]), first)
        weight = np.where(first, first.sum() / (first & chosen).sum(), (~first).sum() / (~first & chosen).sum())
        success = np.array([[run[number] for number in mine if number in both] for run in runs], dtype=np.float64)
        parts.append((success, weight[chosen], fit[chosen]))
        starts += len(mine)
        print(line(task.name, len(mine), *parts[-1]))
    print(line("all", starts, *(np.concatenate(some, axis=-1) for some in zip(*parts, strict=True))))


def line(name: str, starts: int, success: Array, weight: Array, fit: Array) -> str:
    rng, count = np.random.default_rng(0), len(weight)
    picked = [rng.integers(count, size=count) for _ in range(REPEATS)]
    drawn = np.array([measures(success[:, some], weight[some], fit[some]) for some in picked])
    low, high = np.nanquantile(drawn, (0.025, 0.975), axis=0)
    found = zip(measures(success, weight, fit), low, high, strict=True)
    cells = ["{:.2f} ({:.2f} to {:.2f})".format(*one) for one in found]
    return f"| {name} | {starts} | {count} | {' | '.join(cells)} |"


def measures(success: Array, weight: Array, fit: Array) -> tuple[float, ...]:
    """Of R runs of n starts (R, n), each start with its weight: success, noise, told, untold, the AUC of another run,
    and the ceiling; NaN where all ended alike."""
    runs = len(success)
    mean = float(np.average(success.mean(axis=0), weights=weight))
    if mean in (0.0, 1.0):
        return mean, *[np.nan] * 5
    won, off = success.sum(axis=0), success - fit
    within = won * (runs - won)  # unbiased for p (1 - p), as the next is for (p - fit) squared
    between = off.sum(axis=0) ** 2 - (off**2).sum(axis=0)
    noise, untold = (
        float(np.average(one, weights=weight)) / (runs * (runs - 1)) / (mean * (1.0 - mean))
        for one in (within, between)
    )
    others = (won - success) / (runs - 1)
    told = weighted_auc(success.ravel(), others.ravel(), np.tile(weight, runs))
    return mean, noise, 1.0 - noise - untold, untold, told, ceiling(mean, min(1.0, noise))


def weighted_auc(success: Array, score: Array, weight: Array) -> float:
    _, level = np.unique(score, return_inverse=True)
    good, bad = np.bincount(level, weight * success), np.bincount(level, weight * (1.0 - success))
    return float((good * (np.cumsum(bad) - bad / 2.0)).sum() / (good.sum() * bad.sum()))


def ceiling(mean: float, noise: float) -> float:
    """The AUC of p, where p is Beta with this mean, and mean of p (1 - p) the share `noise` of mean (1 - mean)."""
    size = noise / max(1.0 - noise, 1e-6)  # a + b
    p = np.random.default_rng(1).beta(max(mean * size, 1e-6), max((1.0 - mean) * size, 1e-6), DRAWS)
    order = np.argsort(p)
    fails = np.cumsum((1.0 - p)[order]) - (1.0 - p)[order] / 2.0
    return float((p[order] * fails).sum() / (p.sum() * (1.0 - p).sum()))


if __name__ == "__main__":
    main(*sys.argv[1:])
