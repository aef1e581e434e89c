"""Fig. 9: blocks in each of the four orders at two values of phi, the closest pair marked by a bar as long as phi."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from experiments.charts import INK, LINES, QUIET, RED, bare, figure, needed, png
from experiments.measure import Array, margins
from experiments.problems import ORDERINGS
from scenegen.pose import THETA, X, Y, rows_along

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SIDE = 0.05  # metres: the block of the asset library


def orderings(sets: Mapping[float, Array], words: str) -> bytes:
    """A PNG file with a row per wanted phi: the first scene of each ordering among those scenes (3N, n)."""
    drawn = figure(10.0, 2.75 * len(sets) + 0.4)
    drawn.suptitle(words, fontsize=11, color=INK)
    axes = drawn.subplots(len(sets), len(ORDERINGS), squeeze=False)
    for line, (wanted, rows) in zip(axes, sets.items(), strict=True):
        ranks = margins(rows)
        nearest = ranks.argmax(axis=0)
        for place, (cell, name) in enumerate(zip(line, ORDERINGS, strict=True)):
            bare(cell)
            mine = np.flatnonzero(nearest == place)
            if not len(mine):
                cell.text(0.5, 0.5, f"none among\n{rows.shape[1]:,} scenes", ha="center", va="center", color=QUIET)
                cell.set_title(f"wanted {wanted:g}\n{name}", fontsize=9, color=INK)
            else:
                phi = float(ranks[place, mine[0]])
                cell.set_title(f"wanted {wanted:g}, reached {phi:.3f}\n{name}", fontsize=9, color=INK)
                _scene(cell, rows[:, mine[0]], place, phi)
            cell.set_xlim(-SIDE, 1.0 + SIDE)  # centres lie in the unit square, blocks may stick out of it
            cell.set_ylim(-SIDE, 1.0 + SIDE)
            cell.set_aspect("equal")
    return png(drawn)


def _scene(axes: Axes, scene: Array, place: int, phi: float) -> None:
    patches = needed("matplotlib.patches")
    x, y, theta = scene[rows_along(X)], scene[rows_along(Y)], scene[rows_along(THETA)]
    for number in range(len(x)):
        corner = math.sqrt(0.5) * SIDE
        block = patches.RegularPolygon(
            (x[number], y[number]),
            4,
            radius=corner,
            orientation=theta[number] + math.pi / 4,
            facecolor=LINES[0],
            alpha=0.35,
            edgecolor=LINES[0],
        )
        axes.add_patch(block)
        axes.text(x[number], y[number], str(number + 1), fontsize=8, ha="center", va="center", color=INK)
    _bar(axes, x, y, place, phi)


def _bar(axes: Axes, x: Sequence[float] | Array, y: Sequence[float] | Array, place: int, phi: float) -> None:
    """Along the axis of the order, from one block of the closest pair towards the other."""
    along, sign = (x if place < 2 else y), (1.0 if place % 2 == 0 else -1.0)
    first = int((sign * np.diff(np.asarray(along))).argmin())
    start = np.array([x[first], y[first]])
    step = np.array([sign * phi, 0.0]) if place < 2 else np.array([0.0, sign * phi])
    ends = np.stack([start, start + step])
    axes.plot(ends[:, 0], ends[:, 1], color=RED, linewidth=3.0, solid_capstyle="butt")
    far = ends[1]
    other = np.array([x[first + 1], y[first + 1]])
    axes.plot([far[0], other[0]], [far[1], other[1]], color=RED, linewidth=0.7, linestyle=":")
