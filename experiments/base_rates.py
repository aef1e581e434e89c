"""How well a fit predicts simulated policies, and how many rollouts strata of it save for the base rate.

    python -m experiments.base_rates SUITE OUT.jsonl
    python -m experiments.base_rates OUT.jsonl

The policies are known: of each start it is known how often they succeed. Some go by one margin, some by phi, some by
what phi does not see, some by nothing. A line of OUT for each task and policy; the second command
prints the table of docs/fit.md.
"""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import scenegen
from scenegen.api.scene_arrays import rows_of
from scenegen.arrays import Array, Index
from scenegen.fit import allocate, base_rate
from scenegen.learn.success.features import Feature, measure_features, things_of
from scenegen.learn.success.logistic import FEATURE_SETS, Outcomes, fit_logistic
from scenegen.learn.success.measures import auc, brier, calibration_error
from scenegen.learn.success.rates import cut_strata
from scenegen.play.suites.suite import Suite, SuiteTask
from scenegen.pose import X, Y, rows_along

POOL = 50_000  # base scenes
TESTED = 5_000  # held-out starts
ROLLOUTS = (1_000, 5_000)  # uniform ones; strata get a fifth of them
FITS, REPEATS = 10, 20  # fits, each of its own outcomes, and estimates with each: 200
IN_A_BAND = 50  # outcomes that a fit is made of, in each fifth of phi


@dataclass(frozen=True, slots=True, eq=False)
class Starts:
    """Starts of a task: their features, phi first, and where the first thing of the success formula stands."""

    features: tuple[Feature, ...]
    values: Array
    place: Array

    @property
    def phi(self) -> Array:
        return np.asarray(self.values[0])

    @property
    def margin(self) -> Array:
        """The margin that differs most."""
        rows = [k for k, one in enumerate(self.features) if one.kind == "margin"]
        return np.asarray(self.values[max(rows, key=lambda k: float(np.ptp(self.values[k])))])


def starts_of(task: SuiteTask) -> Starts:
    """Random starts of a task."""
    scenes = scenegen.sample(task.spec, n=POOL, seed=1, spread="base", timeout=600)
    spec = task.spec.checked
    rows = rows_of(spec, scenes)
    features, values = measure_features(spec, task.success, rows)
    first = things_of(spec, task.success)[0]
    return Starts(features, values, np.stack([rows[rows_along(X)][first], rows[rows_along(Y)][first]]))


def _sigmoid(odds: Array) -> Array:
    return np.asarray(1.0 / (1.0 + np.exp(-odds)))


def policies(starts: Starts) -> dict[str, Array]:
    """Success rates of starts, (n,), by policy."""
    phi, margin = _scaled(starts.phi, 0.5), _scaled(starts.margin, 0.5)
    arm = np.array([[starts.place[0].min()], [starts.place[1].mean()]])  # stands at the middle of the left edge
    return {
        "steep in one margin": _sigmoid(12.0 * margin),
        "gentle in phi": _sigmoid(3.0 * phi),
        "phi above a threshold, 3 % noise": np.where(phi > 0.0, 0.97, 0.03),
        "within reach, not seen by phi": _sigmoid(-12.0 * _scaled(np.hypot(*(starts.place - arm)), 0.6)),
        "independent of the start": np.full(len(phi), 0.6),
        "by what is not measured": np.where(np.sin(900.0 * starts.place[0]) > 0.0, 0.98, 0.02),
    }


def _scaled(values: Array, share: float) -> Array:
    """0 at the value that this share of the starts lies below; 1 is the distance of the quartiles."""
    low, middle, high = np.quantile(values, (0.25, share, 0.75))
    return np.asarray((values - middle) / (high - low))


def measure(task: SuiteTask, name: str, pool: Starts, true: Array) -> dict[str, Any]:
    """The row of a policy with the success rates `true`: fits of outcomes at some starts of the pool, as many in each
    fifth of phi, judged at others."""
    rng = np.random.default_rng([7, *name.encode(), *task.name.encode()])
    base = float(true.mean())
    row: dict[str, Any] = {"task": task.name, "policy": name, "episodes": 5 * IN_A_BAND, "base rate": base}
    row["ceiling"] = float(np.sqrt(true * (1.0 - true)).mean() ** 2 / (base * (1.0 - base)))
    bands = np.searchsorted(np.quantile(pool.phi, (0.2, 0.4, 0.6, 0.8)), pool.phi)
    found: dict[str, list[float]] = {}
    widths: dict[tuple[str, int], list[tuple[float, bool]]] = {}

    def estimated(way: str, which: Index, n: int, given: Index) -> None:
        """Estimates from so many rollouts in strata, where `which` says of each scene of the pool in which it is."""
        size = np.bincount(which)
        members = np.split(np.argsort(which, kind="stable"), np.cumsum(size)[:-1])
        for _ in range(REPEATS):
            drawn = [rng.choice(one, each) for one, each in zip(members, given, strict=True)]
            won = [int((rng.random(len(one)) < true[one]).sum()) for one in drawn]
            _, low, high = base_rate(won, given, size / len(which))
            widths.setdefault((way, n), []).append((high - low, low <= base <= high))

    for _ in range(FITS):
        some = np.concatenate([rng.choice(np.flatnonzero(bands == k), IN_A_BAND, replace=False) for k in range(5)])
        success = rng.random(len(some)) < true[some]
        outcomes = Outcomes(pool.features, pool.values[:, some], success, some)
        fit = fit_logistic(outcomes, monotone=False)
        predicted = fit([one.name for one in pool.features], pool.values)
        test = rng.choice(len(true), TESTED)
        y = rng.random(TESTED) < true[test]
        for measure, value in (
            ("calibration error", calibration_error(y, predicted[test])),
            ("Brier", brier(y, predicted[test])),
            ("least Brier", brier(y, true[test])),
            ("AUC", auc(y, predicted[test])),
            ("AUC of phi", auc(y, pool.phi[test])),
            ("reads", float([*FEATURE_SETS].index(fit.reads))),
        ):
            found.setdefault(measure, []).append(value)
        rates = (np.bincount(bands[some], success) + 1.0) / (IN_A_BAND + 2.0)
        for n in ROLLOUTS:
            ends, _, given = cut_strata(predicted, n // 5)
            estimated("uniform", np.zeros(len(true), dtype=np.intp), n, np.array([n]))
            estimated("fit", np.searchsorted(ends[1:-1], predicted), n, given)
            estimated("phi", bands, n, allocate(np.full(5, 0.2), rates, n // 5))
    row |= {key: float(np.mean(values)) for key, values in found.items()}
    row["largest calibration error"] = max(found["calibration error"])
    for (way, n), each in widths.items():
        row[f"{way} {n}: width"] = float(np.mean([width for width, _ in each]))
        row[f"{way} {n}: covers"] = float(np.mean([covers for _, covers in each]))
    return row


def main(suite: str, out: str) -> None:
    done = {(one["task"], one["policy"]) for one in map(json.loads, _lines(Path(out)))}
    for task in Suite.load(suite).tasks:
        pool = starts_of(task)
        for name, true in policies(pool).items():
            if (task.name, name) not in done:
                row = measure(task, name, pool, true)
                with Path(out).open("a") as file:
                    file.write(json.dumps(row) + "\n")


def _lines(path: Path) -> list[str]:
    return path.read_text().splitlines() if path.exists() else []


def table(out: str) -> None:
    """The least and the largest value of each column over the tasks, by policy, as Markdown."""
    rows = [json.loads(line) for line in _lines(Path(out))]
    for row in rows:
        for n in ROLLOUTS:
            row[f"width {n}"] = row[f"fit {n}: width"] / row[f"uniform {n}: width"]
    columns = {"ceiling": ".2f", "AUC of phi": ".2f", "AUC": ".2f", "calibration error": ".3f"}
    columns |= {"largest calibration error": ".3f"}
    columns |= {key: form for n in ROLLOUTS for key, form in ((f"width {n}", ".2f"), (f"fit {n}: covers", ".2f"))}
    print(f"| policy | {' | '.join(columns)} |\n|{'---|' * (len(columns) + 1)}")
    for policy in dict.fromkeys(row["policy"] for row in rows):
        cells = [policy]
        for key, form in columns.items():
            values = [row[key] for row in rows if row["policy"] == policy]
            ends = [format(end, form) for end in (min(values), max(values))]
            cells.append(ends[0] if ends[0] == ends[1] else " to ".join(ends))
        print(f"| {' | '.join(cells)} |")


if __name__ == "__main__":
    main(*sys.argv[1:]) if len(sys.argv) > 2 else table(*sys.argv[1:])
