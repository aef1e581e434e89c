"""Cells that look alike to a learner: those for which the same relations hold share their values."""

from __future__ import annotations

import numpy as np

from experiments.errors import GRID_TASK
from experiments.tabular.grid import Cells, GridTask
from scenegen.api.spec import Spec
from scenegen.errors import RequestError, quote_names
from scenegen.geometry import NUMPY
from scenegen.lang.formula.interpret import phi as score


def by_relations(task: GridTask, relations: Spec) -> tuple[Cells, int]:
    """The row (cells,) of a table for every cell, and how many rows there are. `relations` has a label for each
    relation between the task's objects; a row stands for a combination of signs of phi: holds, just holds, does not.

    Raises RequestError where the objects differ.
    """
    if relations.objects != task.spec.objects:
        problem = f"relations of {quote_names(relations.objects)} for a task of {quote_names(task.spec.objects)}"
        raise RequestError(GRID_TASK(problem=problem, remedy="name the same objects, in the same order"))
    inside = np.flatnonzero(~np.isnan(task.phi))
    rows = [np.full(len(inside), value) for value in task.held.ravel()]
    rows[3 * task.moved : 3 * task.moved + 2] = task.place_of(inside).T
    values = score(relations.checked.core, rows, NUMPY)
    signs = np.stack([np.sign(np.round(values[label] / task.edge, 6)) for label in relations.labels])
    kinds, which = np.unique(signs, axis=1, return_inverse=True)
    found = np.zeros(len(task.phi), np.int64)
    found[inside] = which.ravel()
    return found, kinds.shape[1]
