"""Recorded policies: does phi predict success, and what would strata of a fit have saved?

    python -m experiments.recorded SUITE OUTCOMES.jsonl...
    python -m experiments.recorded SUITE OUTCOMES.jsonl... --base SUITE OUTCOMES.jsonl...

A row for each task and policy. The bands of the suite have to be equally probable, with as many starts each, so that
its starts are a sample of the base distribution. Predictions are held out: each fifth of the starts is predicted by a
fit of the others. For the base rate, n uniform rollouts and n / 5 in strata of these predictions are drawn from the
recorded ones, 1,000 times, with replacement; what they estimate is the rate of all that were recorded. `least` is the
share of rollouts that strata need at least, if the predictions are right. Beside them, scikit-learn's gradient boosting
on the same features, cross-validated in the same way.

With `--base`: fits of the first outcomes, judged at those of a suite of one band, whose starts are plain draws of the
base distribution; and the base rate, by the bands of the first, and as counted in the second. Policies in the same
order.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from scenegen.arrays import Array, Bool
from scenegen.fit import base_rate
from scenegen.learn.success.logistic import fit_logistic, predict_held_out
from scenegen.learn.success.measures import auc, bootstrap_interval, brier, calibration_error, chance_error
from scenegen.learn.success.rates import cut_strata
from scenegen.learn.success.statistics import wilson
from scenegen.play.fit import fit_outcomes, outcomes_of
from scenegen.play.suites.outcomes import read_outcomes
from scenegen.play.suites.suite import Suite

ROLLOUTS, REPEATS = 1_000, 1_000
HEADS = (
    "task", "policy", "episodes", "success", "AUC of phi", "AUC", "Brier", "calibration error (by chance, at most)",
    "reads", "boosting: AUC", "calibration error", "least", "width", "covers",
)  # fmt: skip
BASE_HEADS = (
    "task", "policy", "episodes", "plain draws", "AUC of phi", "AUC", "calibration error (by chance, at most)", "reads",
    "base rate, by bands", "counted",
)  # fmt: skip


def row(suite: Suite, number: int, path: Path) -> list[str]:
    """The row of a task, by its number, and a policy."""
    task, run = suite.tasks[number], read_outcomes(path, suite)
    ended = {one.episode: [one.success] for one in run.episodes if one.task == task.name}
    data = outcomes_of(suite, task, ended)
    y, p, phi = data.success, predict_held_out(data, False), data.values[0]
    other, rate, rng = boosted(data.values.T, y), float(y.mean()), np.random.default_rng(number)
    ends, probability, given = cut_strata(p, ROLLOUTS // 5)
    which = np.searchsorted(ends[1:-1], p)
    strata = [np.flatnonzero(which == k) for k in range(len(given))]
    found, uniform = [], []
    for _ in range(REPEATS):
        won = [int(y[rng.choice(one, n)].sum()) for one, n in zip(strata, given, strict=True)]
        found.append(base_rate(won, given, probability)[1:])
        uniform.append(base_rate([int(y[rng.choice(len(y), ROLLOUTS)].sum())], [ROLLOUTS], [1.0])[1:])
    width = np.diff(found).mean() / np.diff(uniform).mean()
    least = np.sqrt(p * (1.0 - p)).mean() ** 2 / max(1e-9, rate * (1.0 - rate))
    covers = np.mean([low <= rate <= high for low, high in found])
    mine, of_phi = (bootstrap_interval(auc, y, one, data.start) for one in (p, phi))
    interval = "{:.2f} ({:.2f} to {:.2f})"
    return [
        task.name, run.header.policy, f"{len(y)}", f"{rate:.2f}", interval.format(*of_phi), interval.format(*mine),
        f"{brier(y, p):.3f}", "{:.3f} ({:.3f}, {:.3f})".format(calibration_error(y, p), *chance_error(p)),
        fit_logistic(data, False).reads, f"{auc(y, other):.2f}", f"{calibration_error(y, other):.3f}",
        f"{least:.2f}", f"{width:.2f}", f"{covers:.2f}",
    ]  # fmt: skip


def boosted(x: Array, y: Bool) -> Array:
    """Success at starts with the features x (n, F) as scikit-learn's boosting predicts it from four fifths of them."""
    from sklearn.ensemble import HistGradientBoostingClassifier
    from sklearn.model_selection import StratifiedKFold, cross_val_predict

    model = HistGradientBoostingClassifier(max_depth=3, max_iter=60, learning_rate=0.05)
    folds = StratifiedKFold(5, shuffle=True, random_state=0)
    return np.asarray(cross_val_predict(model, x, y, cv=folds, method="predict_proba")[:, 1])


def judged(folder: str, path: Path, base: Suite, other: Path) -> list[list[str]]:
    """A row for each task: a fit of a policy's outcomes, held against its outcomes at plain draws."""
    fit, run, rows = fit_outcomes([path], folder), read_outcomes(other, base), []
    for one in fit.tasks:
        task = next(task for task in base.tasks if task.name == one.name)
        ended = {each.episode: [each.success] for each in run.episodes if each.task == task.name}
        data = outcomes_of(base, task, ended)
        y, p, interval = data.success, data.predict(one.model), "{:.2f} ({:.2f} to {:.2f})"
        of_phi, mine = (bootstrap_interval(auc, y, values, data.start) for values in (data.values[0], p))
        rows.append([
            one.name, fit.run.policy, f"{one.episodes}", f"{len(y)}", interval.format(*of_phi), interval.format(*mine),
            "{:.3f} ({:.3f}, {:.3f})".format(calibration_error(y, p), *chance_error(p)), one.model.reads,
            interval.format(*one.base_rate), interval.format(y.mean(), *wilson(float(y.mean()), len(y))),
        ])  # fmt: skip
    return rows


def main(folder: str, *paths: str) -> None:
    """Print the table."""
    suite = Suite.load(folder)
    if "--base" in paths:
        count = paths.index("--base")
        base, others = Suite.load(paths[count + 1]), paths[count + 2 :]
        pairs = list(zip(paths[:count], others, strict=True))
        _print(BASE_HEADS, (line for one, other in pairs for line in judged(folder, Path(one), base, Path(other))))
        return
    _print(HEADS, (row(suite, number, Path(path)) for number in range(len(suite.tasks)) for path in paths))


def _print(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    print(f"| {' | '.join(heads)} |\n|{'---|' * len(heads)}")
    for one in rows:
        print(f"| {' | '.join(one)} |", flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
