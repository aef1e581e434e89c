"""The cells in which episodes begin: every cell of a level alike, or those of verified scenes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from experiments.errors import GRID_TASK
from experiments.tabular.grid import Cells, GridTask
from scenegen.api.sample import sample
from scenegen.api.spec import Spec
from scenegen.errors import RequestError, quote_names
from scenegen.learn.model import Model

PATIENCE = 60.0  # seconds for the scenes of a level


class Starts(NamedTuple):
    """What compiled code draws from, int64 throughout: `cells` by level, those of level l at first[l] up to
    first[l + 1], l from 1; and `anywhere`, from the base distribution. A cell counts as often as it is there."""

    cells: Cells
    first: Cells
    anywhere: Cells


def every_cell(task: GridTask) -> Starts:
    """Each free cell once."""
    cells = task.unsatisfied
    return _by_level(task, cells, cells)


def of_scenes(task: GridTask, source: Spec | Model, each: int = 12, seed: int = 0) -> Starts:
    """Cells of verified scenes, on average `each` for a cell: drawn level by level, from the band of phi that belongs
    to a level, by the exact sampler or from a model. `anywhere` is always of the exact sampler.

    The middle of a cell has a phi of its own, and that is what counts: a scene from the edge of a cell may end up one
    level from where it was drawn. A level for which a model has no scene gets none. Raises RequestError where the exact
    sampler fails, and for a spec with several labels.
    """
    if len(task.spec.labels) > 1:
        problem = f"levels of phi are drawn of one label; the spec has {quote_names(task.spec.labels)}"
        raise RequestError(GRID_TASK(problem=problem, remedy="join them with & under one label"))
    edge, label = task.edge, task.spec.labels[0]
    counts = np.bincount(task.level[task.unsatisfied], minlength=task.levels + 1)
    found = []
    for level in range(1, task.levels + 1):
        wanted = max(64, each * int(counts[level]))
        band = (-level * edge, -(level - 1) * edge)
        found.append(_cells(task, source, label, band, wanted, seed + level))
    total = each * len(task.unsatisfied)
    return _by_level(task, np.concatenate(found), _cells(task, task.spec, label, (None, 0.0), total, seed))


def _cells(
    task: GridTask, source: Spec | Model, label: str, band: tuple[float | None, float], count: int, seed: int
) -> Cells:
    model = isinstance(source, Model)
    try:
        scenes = sample(
            source, {label: band}, count, seed=seed, spread="base", workers=1, timeout=PATIENCE, keep_partial=model
        )
    except RequestError:
        if model:
            return np.empty(0, np.int64)
        raise
    return task.cell_of(scenes.poses)


def _by_level(task: GridTask, cells: Cells, anywhere: Cells) -> Starts:
    cells = cells[task.level[cells] > 0]
    cells = cells[np.argsort(task.level[cells], kind="stable")]
    first = np.searchsorted(task.level[cells], np.arange(task.levels + 2))
    return Starts(cells, first.astype(np.int64), anywhere[task.level[anywhere] > 0])
