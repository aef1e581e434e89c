"""Fig. 7: scenes of experiment 1 at two queries on a plane, by Isomap, coloured by phi of the task.

Isomap (Tenenbaum, de Silva & Langford 2000) is fitted to true scenes and one map serves all panels of a query, so that
places can be compared. It sees the positions of both objects; the headings, on which phi does not depend, would be
noise.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from experiments.charts import INK, QUIET, RED, bare, figure, needed, png
from experiments.measure import Array
from scenegen.pose import X, Y, rows_along

MAP = "viridis"
ACROSS = 4  # panels


@dataclass(frozen=True, slots=True)
class Query:
    """A part of the figure: what was wanted, in words and as phi of the task; (scenes (3N, n), phi of the task (n,)) by
    name, `fit` among them the scenes that Isomap is fitted to."""

    words: str
    wanted: float
    sets: Mapping[str, tuple[Array, Array]]
    fit: str


def isomap(queries: Sequence[Query], dots: int, neighbours: int) -> bytes:
    """A PNG file, a part per query, at most `dots` scenes a panel."""
    down = [-(-len(query.sets) // ACROSS) for query in queries]
    drawn = figure(2.45 * ACROSS, 2.3 * sum(down) + 0.5 * len(queries))
    parts = drawn.subfigures(len(queries), 1, squeeze=False, height_ratios=down).ravel()
    for part, query, lines in zip(parts, queries, down, strict=True):
        part.suptitle(query.words, fontsize=11, color=INK)
        axes = part.subplots(lines, ACROSS, sharex=True, sharey=True, squeeze=False).ravel()
        for cell in axes[len(query.sets) :]:
            cell.set_visible(False)
        _row(part, axes, query, dots, neighbours)
    return png(drawn)


def _row(part: Any, axes: Sequence[Any], query: Query, dots: int, neighbours: int) -> None:
    embed = needed("sklearn.manifold").Isomap(n_neighbors=neighbours, n_components=2)
    embed.fit(_positions(query.sets[query.fit][0][:, :dots]))
    truth = query.sets[query.fit][1]
    half = max(0.05, 4.0 * float(np.abs(truth - query.wanted).max()))
    low, high = query.wanted - half, query.wanted + half
    shown: Any = None
    for panel, (name, (rows, phi)) in zip(axes, query.sets.items(), strict=False):
        bare(panel)
        panel.set_title(f"{name} ({min(rows.shape[1], dots)})", fontsize=9, color=INK)
        if rows.shape[1]:
            points = embed.transform(_positions(rows[:, :dots]))
            shown = panel.scatter(
                points[:, 0], points[:, 1], c=phi[:dots], s=6.0, cmap=MAP, vmin=low, vmax=high, linewidths=0.0
            )
        else:
            panel.text(0.5, 0.5, "none", ha="center", va="center", color=QUIET, transform=panel.transAxes)
    bar = part.colorbar(shown, ax=list(axes), extend="both", fraction=0.03, pad=0.01)
    bar.ax.axhline(query.wanted, color=RED, linewidth=4.0)
    bar.set_label("phi of task (red: wanted)", fontsize=8, color=QUIET)
    bar.ax.tick_params(labelsize=7, colors=QUIET)


def _positions(rows: Array) -> Array:
    """(3N, n) -> (n, 2N)."""
    return np.ascontiguousarray(np.concatenate([rows[rows_along(X)], rows[rows_along(Y)]]).T)
