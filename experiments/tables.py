"""A comparison as tables: accuracy, diversity, cost, and the bars."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from typing import Any

from experiments.bench import Row
from experiments.compare import Comparison
from experiments.page import table
from experiments.problems import BAND, ORDERINGS
from experiments.report import short, spread


def tables(found: Comparison) -> dict[str, str]:
    """The tables of a comparison by name, which begins with the problem's key."""
    made = {"accuracy": _accuracy(found), "diversity": _diversity(found)}
    if found.problem.blocks:
        made["orderings"] = _orderings(found)
    made |= {"cost": _cost(found), "bars": _bars(found)}
    return {f"{found.problem.key}-{name}": text for name, text in made.items()}


def data(found: Comparison) -> dict[str, Any]:
    """The same with every digit."""
    rows = [
        {"name": row.name, "family": row.family, "recipe": row.recipe, "runs": [dict(run) for run in row.runs]}
        for row in found.rows
    ]
    problem = found.problem
    return {"title": problem.title, "spec": problem.spec, "wanted": dict(problem.wanted), "band": BAND, "rows": rows}


def values(row: Row, key: str) -> list[float]:
    """A value of every seed that has it."""
    return [run[key] for run in row.runs if key in run]


def mean(row: Row, key: str) -> float | None:
    found = values(row, key)
    return statistics.mean(found) if found else None


def best(found: Comparison) -> Row:
    """Of our own recipes the model that misses the bars for error, coverage and speed by least, whichever it misses
    most; of those that miss none, the most accurate."""
    bar = found.problem.bar

    def standing(row: Row) -> tuple[float, float]:
        errors = [mean(row, f"error:{label}") or 0.0 for label in found.spec.labels]
        coverage, speed = (max(mean(row, key) or 0.0, 1e-6) for key in ("coverage", "speed"))
        error = max(errors) / bar.error
        return max(1.0, error, bar.coverage / coverage, bar.speed / speed), error

    return min((row for row in found.rows if row.recipe == "default"), key=standing)


def _cells(row: Row, keys: Sequence[str], digits: int) -> str:
    cells = [spread(values(row, key), digits) for key in keys]
    return "-" if set(cells) == {"-"} else "; ".join(cells)


def _signed(row: Row, label: str) -> str:
    middle, around = mean(row, f"mean:{label}"), mean(row, f"std:{label}")
    return "-" if middle is None or around is None else f"{middle:+.3f} ({around:.3f})"


def _some(found: Comparison, *keys: str) -> list[Row]:
    """The rows that have one of the values."""
    return [row for row in found.rows if any(values(row, key) for key in keys)]


def _accuracy(found: Comparison) -> str:
    labels = found.spec.labels
    keys = [f"error:{label}" for label in labels]
    head = ["", *(f"{label}: mean (std)" for label in labels), f"mean abs. error, {'; '.join(labels)}", "within 0.025"]
    rows = [
        [row.name, *(_signed(row, label) for label in labels), _cells(row, keys, 4), _cells(row, ["within"], 3)]
        for row in _some(found, f"mean:{labels[0]}", keys[0])
    ]
    return table(head, rows)


def _diversity(found: Comparison) -> str:
    head = ["", "coverage, raw", "coverage, returned", "KS, raw", "KS, returned", "in range", "found"]
    head.append("nearest training scene (truth)")
    keys = ("coverage", "handed_coverage", "ks", "handed_ks", "handed_in_range", "handed")
    rows = []
    for row in _some(found, "coverage", "handed_coverage"):
        near, truth = mean(row, "near"), mean(row, "near_truth")
        distance = "-" if near is None or truth is None else f"{near:.3f} ({truth:.3f})"
        parts = [_cells(row, [key], 2) for key in keys]
        rows.append([row.name, *parts, distance])
    return table(head, rows)


def _orderings(found: Comparison) -> str:
    rows = []
    for row in found.rows:
        for kind, words in (("raw", "raw"), ("handed", "returned")):
            keys = [f"{kind}:{name}" for name in ORDERINGS]
            if values(row, keys[0]):
                rows.append([f"{row.name}, {words}", *(_cells(row, [key], 3) for key in keys)])
    return table(["", *ORDERINGS], rows)


def _cost(found: Comparison) -> str:
    head = ["", "raw scenes/s", "scenes/s in range, returned", "file, kB", "training, CPU s"]
    rows = []
    for row in _some(found, "speed", "handed_speed"):
        speed, handed, size = mean(row, "speed"), mean(row, "handed_speed"), mean(row, "bytes")
        cells = [
            "-" if speed is None else short(speed),
            "-" if handed is None else short(handed),
            "-" if size is None else f"{size / 1e3:.1f}" if size < 1e4 else f"{size / 1e3:.0f}",
            spread(values(row, "cpu"), 0),
        ]
        rows.append([row.name, *cells])
    return table(head, rows)


def _bars(found: Comparison) -> str:
    bar, labels = found.problem.bar, found.spec.labels
    head = ["", f"error <= {bar.error:g}", f"coverage >= {bar.coverage:g}", f"scenes/s >= {short(bar.speed)}"]
    head += [f"returned: coverage >= {bar.handed_coverage:g}", "beats the published weights"]
    head.append(f"file < {bar.size / 1e6:g} MB")
    if bar.training is not None:
        head.append(f"trained in {bar.training / 60:g} min")
    if bar.orderings is not None:
        head.append(f"orderings {bar.orderings[0]:g} to {bar.orderings[1]:g}")
    rows = []
    for row in found.rows:
        if row.recipe != "default":
            continue
        errors = [mean(row, f"error:{label}") or 0.0 for label in labels]
        cells = [
            _met(all(error <= bar.error for error in errors)),
            _met((mean(row, "coverage") or 0.0) >= bar.coverage),
            _met((mean(row, "speed") or 0.0) >= bar.speed),
            _met((mean(row, "handed_coverage") or 0.0) >= bar.handed_coverage),
            _met(_beats(found, row)),
            _met((mean(row, "bytes") or 0.0) < bar.size),
        ]
        if bar.training is not None:
            cells.append(_met((mean(row, "cpu") or 0.0) <= bar.training))
        if bar.orderings is not None:
            share = [mean(row, f"raw:{name}") or 0.0 for name in ORDERINGS]
            cells.append(_met(all(bar.orderings[0] <= one <= bar.orderings[1] for one in share)))
        rows.append([row.name, *cells])
    return table(head, rows)


def _met(yes: bool) -> str:
    return "yes" if yes else "no"


def _beats(found: Comparison, row: Row) -> bool:
    """Whether a model is better on error and coverage than the published weights of its kind, or of every kind where
    there are none of its own."""
    published = [one for one in found.rows if not one.recipe and values(one, "coverage") and one.family]
    rivals = [one for one in published if one.family == row.family] or published
    keys = [f"error:{label}" for label in found.spec.labels]
    less = all((mean(row, key) or 0.0) < (mean(one, key) or 0.0) for one in rivals for key in keys)
    return less and all((mean(row, "coverage") or 0.0) > (mean(one, "coverage") or 0.0) for one in rivals)
