"""Learning curves: success on the held-out scenes against steps."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from experiments.charts import INK, LINES, QUIET, figure, needed, plain, png
from experiments.deep.lessons import LESSONS, SOURCES
from experiments.deep.summary import Found
from experiments.deep.tasks import TASKS
from experiments.measure import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

STYLES = {
    "random": (QUIET, "-"),
    "dense": (QUIET, ":"),
    "uniform": (LINES[0], "-"),
    "linear": (LINES[1], "-"),
    "self_paced": (LINES[2], "-"),
}
CONFIDENCE = 0.95

Curve = Sequence[tuple[int, float]]


def curves(found: Found) -> bytes:
    """A PNG file: a row per task, a panel per source."""
    drawn = figure(9.6, 3.1 * len(TASKS) + 0.4)
    axes = drawn.subplots(len(TASKS), len(SOURCES), squeeze=False, sharey=True)
    for row, (task, what) in zip(axes, TASKS.items(), strict=True):
        for cell, (source, words) in zip(row, SOURCES.items(), strict=True):
            plain(cell)
            cell.set_title(f"{what.title}; {words}", fontsize=9, color=INK)
            cell.set_ylim(-0.03, 1.03)
            cell.set_xlabel("thousand steps", fontsize=8, color=QUIET)
            for lesson in LESSONS:
                if (task, lesson, source) in found:
                    _curve(cell, lesson, [record.curve for record in found[task, lesson, source]])
        row[0].set_ylabel("held-out scenes solved", fontsize=8, color=QUIET)
    lines = needed("matplotlib.lines")
    keys = [
        lines.Line2D([], [], color=STYLES[key][0], linestyle=STYLES[key][1], label=lesson.title)
        for key, lesson in LESSONS.items()
    ]
    drawn.legend(handles=keys, loc="outside lower center", ncols=3, frameon=False, fontsize=8)
    return png(drawn)


def _curve(axes: Axes, lesson: str, seeds: Sequence[Curve]) -> None:
    color, style = STYLES[lesson]
    steps, values = together(seeds)
    mean, half = band(values)
    axes.plot(steps / 1000.0, mean, color=color, linestyle=style, linewidth=1.5)
    low, high = np.maximum(mean - half, 0.0), np.minimum(mean + half, 1.0)
    axes.fill_between(steps / 1000.0, low, high, color=color, alpha=0.15, linewidth=0.0)


def together(seeds: Sequence[Curve]) -> tuple[Array, Array]:
    """The steps (points,) of the longest curve and the success (seeds, points); a run that was over earlier keeps what
    it had reached."""
    longest = max(seeds, key=len)
    values = [[success for _, success in seed] + [seed[-1][1]] * (len(longest) - len(seed)) for seed in seeds]
    return np.array([float(step) for step, _ in longest]), np.array(values)


def band(values: Array) -> tuple[Array, Array]:
    """Mean and half-width of its 95 % confidence interval by Student's t, of the rows of (seeds, points); 0 for one."""
    count = len(values)
    mean = values.mean(axis=0)
    if count < 2:
        return mean, np.zeros_like(mean)
    quantile = float(needed("scipy.stats").t.ppf(0.5 + CONFIDENCE / 2, count - 1))
    return mean, quantile * values.std(axis=0, ddof=1) / math.sqrt(count)
