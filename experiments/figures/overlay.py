"""Fig. 8: hundreds of scenes on top of each other, seen from above."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from experiments.charts import INK, LINES, QUIET, bare, figure, needed, png
from experiments.measure import Array
from scenegen.api.spec import Spec

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PLACEMAT = (0.3, 0.0, 0.4, 0.2)  # x, y, width and height in metres
TICK = 0.03  # metres: the heading of a knife


def overlay(spec: Spec, sets: Mapping[str, Array], most: int) -> bytes:
    """A PNG file, a panel per set of scenes (3N, n), the first `most` of each: every object's centre, and the knife's
    heading, which the spec is about."""
    across = 4
    down = -(-len(sets) // across)
    drawn = figure(2.7 * across, 2.95 * down + 0.35)
    axes = drawn.subplots(down, across, squeeze=False).ravel()
    for cell in axes[len(sets) :]:
        cell.set_visible(False)
    for cell, (name, rows) in zip(axes, sets.items(), strict=False):
        bare(cell)
        shown = rows[:, :most]
        cell.set_title(f"{name} ({shown.shape[1]})", fontsize=9, color=INK)
        _table(cell, spec, shown)
    lines = needed("matplotlib.lines")
    keys = [
        lines.Line2D([], [], color=color, marker="o", linestyle="", markersize=6, label=name)
        for name, color in zip(spec.objects, LINES, strict=False)
    ]
    drawn.legend(handles=keys, loc="outside lower center", ncols=len(keys), frameon=False, fontsize=9)
    return png(drawn)


def _table(axes: Axes, spec: Spec, rows: Array) -> None:
    patches = needed("matplotlib.patches")
    x, y, width, height = PLACEMAT
    axes.add_patch(patches.Rectangle((x, y), width, height, facecolor="#f3f1e9", edgecolor=QUIET, linewidth=0.8))
    for place, (name, color) in enumerate(zip(spec.objects, LINES, strict=False)):
        px, py, theta = rows[3 * place : 3 * place + 3]
        if name == "knife":
            ends_x = np.stack([px - TICK * np.cos(theta), px + TICK * np.cos(theta)])
            ends_y = np.stack([py - TICK * np.sin(theta), py + TICK * np.sin(theta)])
            axes.plot(ends_x, ends_y, color=color, linewidth=0.5, alpha=0.4)
        else:
            axes.scatter(px, py, s=4.0, color=color, alpha=0.35, linewidths=0.0)
    axes.set_xlim(*spec.workspace.x)
    axes.set_ylim(*spec.workspace.y)
    axes.set_aspect("equal")
