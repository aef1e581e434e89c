"""Fig. 5: episodes until a learner has converged over the size of the table, a panel per setting and task."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from experiments.charts import INK, LINES, QUIET, figure, plain, png

STYLES = {  # by the name of a curve: its colour and its line
    "uniform": (LINES[0], "-"),
    "linear": (LINES[1], "-"),
    "self-paced": (LINES[2], "-"),
    "self-paced, model": (INK, ":"),
    "corridors": (LINES[3], "-"),
}
OTHER = (QUIET, "-")


@dataclass(frozen=True, slots=True)
class Panel:
    """`curves` maps a curriculum to the episodes of all seeds for each size; none for seeds that did not converge."""

    words: str
    curves: Mapping[str, Mapping[int, Sequence[int]]]


def episodes(panels: Sequence[Panel], across: int) -> bytes:
    """A PNG file: means as lines, the least to the greatest of the seeds as bands."""
    down = -(-len(panels) // across)
    drawn = figure(4.9 * across, 3.5 * down)
    axes = drawn.subplots(down, across, sharex=True, sharey=True, squeeze=False).ravel()
    for cell, panel in zip(axes, panels, strict=True):
        plain(cell)
        cell.set_yscale("log")
        cell.set_title(panel.words, fontsize=10, color=INK)
        for name, values in panel.curves.items():
            color, line = STYLES.get(name, OTHER)
            sizes = [size for size in values if values[size]]
            middle = [float(np.mean(values[size])) for size in sizes]
            cell.plot(sizes, middle, color=color, linestyle=line, linewidth=1.8, marker=".", markersize=4, label=name)
            low, high = [min(values[size]) for size in sizes], [max(values[size]) for size in sizes]
            cell.fill_between(sizes, low, high, color=color, alpha=0.18, linewidth=0.0)
        cell.legend(fontsize=8, frameon=False, labelcolor=INK)
    for cell in axes[-across:]:
        cell.set_xlabel("M (half the table's edge, in cells)", fontsize=9, color=INK)
    for cell in axes[::across]:
        cell.set_ylabel("episodes until converged", fontsize=9, color=INK)
    return png(drawn)
