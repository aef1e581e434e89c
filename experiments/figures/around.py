"""Fig. 3: three relations between a mug and a plate while the mug moves round it from left to right."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from PIL import Image

from experiments.charts import GRID, INK, LINES, QUIET, figure, plain, png
from experiments.measure import Array


def around(
    share: Array, curves: Mapping[str, Array], snapshots: Sequence[tuple[float, Image.Image]], place: Array
) -> bytes:
    """A PNG file: pictures of the way on top, phi (n,) of every relation over the share of the way (n,) below. `place`
    is x of the mug in metres (n,)."""
    drawn = figure(9.0, 5.2)
    grid = drawn.add_gridspec(2, len(snapshots), height_ratios=[1.0, 1.75])
    for column, (at, picture) in enumerate(snapshots):
        axes = drawn.add_subplot(grid[0, column])
        axes.imshow(np.asarray(picture))
        axes.set_axis_off()
        axes.set_title(f"{at:.0%} of the way".replace("%", " %"), fontsize=9, color=INK)
    axes = drawn.add_subplot(grid[1, :])
    plain(axes)
    axes.axhline(0.0, color=QUIET, linewidth=1.0)
    for at, _ in snapshots:
        axes.axvline(at, color=GRID, linewidth=1.2, linestyle="--")
    ends = []
    for color, (name, values) in zip(LINES, curves.items(), strict=False):
        axes.plot(share, values, color=color, linewidth=2.0)
        ends.append((float(values[-1]), name, color))
    for value, name, color in ends:
        axes.annotate(name, (1.0, value), (6, 0), textcoords="offset points", color=color, fontsize=9, va="center")
    axes.set_xlim(0.0, 1.0)
    axes.set_xlabel(f"share of the way (x of the mug from {place[0]:.1f} to {place[-1]:.1f} m)", color=INK, fontsize=9)
    axes.set_ylabel("phi in metres; satisfied from 0 up", color=INK, fontsize=9)
    return png(drawn)
