"""Corridors: a curriculum that goes cell by cell along lines which lead away from the goal, group after group."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from experiments.errors import GRID_TASK
from experiments.tabular.grid import GOAL, Cells, GridTask
from scenegen.errors import RequestError


class Lines(NamedTuple):
    """What compiled code goes along, int64 throughout: line i is cells[first[i]:first[i + 1]], group g the lines
    group[g] up to group[g + 1]; `steps` of every cell of the board to the goal, at least."""

    cells: Cells
    first: Cells
    group: Cells
    steps: Cells


NOTHING = np.zeros(1, np.int64)
NO_LINES = Lines(NOTHING[:0], NOTHING, NOTHING, NOTHING)


def corridors(task: GridTask, gap: int) -> Lines:
    """Lines for a task with one goal cell: its column, up and down; on one side every `gap`-th row, from the column
    outwards, then what lies between these rows, each cell a line of its own; then the other side.

    A one-step learner learns one cell when it comes to cells that it knows, and another whenever a random action takes
    it off its way and back: long ways along cells it does not know teach it most (docs/experiments/curriculum.md).
    Raises RequestError where the goal is not one cell.
    """
    goals = np.flatnonzero(task.board.kind == GOAL)
    if len(goals) != 1:
        problem = f"{len(goals)} cells satisfy the spec"
        raise RequestError(GRID_TASK(problem=problem, remedy="corridors lead to a single one"))
    middle, centre = divmod(int(goals[0]), task.deep + 2)
    groups = [
        [_line(task, [middle], range(centre + 1, task.deep + 1)), _line(task, [middle], range(centre - 1, 0, -1))]
    ]
    for columns in (range(middle + 1, task.across + 1), range(middle - 1, 0, -1)):
        rows = range(1, task.deep + 1)
        groups.append([_line(task, columns, [row]) for row in rows if (row - centre) % gap == 0])
        groups.append([_line(task, [column], [row]) for row in rows if (row - centre) % gap for column in columns])
    groups = [[line for line in group if len(line)] for group in groups]
    lines = [line for group in groups for line in group]
    first = np.cumsum([0, *map(len, lines)], dtype=np.int64)
    group = np.cumsum([0, *map(len, groups)], dtype=np.int64)
    column, row = np.divmod(np.arange(len(task.phi)), task.deep + 2)
    return Lines(np.concatenate(lines), first, group, abs(column - middle) + abs(row - centre))


def _line(task: GridTask, columns: Iterable[int], rows: Iterable[int]) -> Cells:
    return np.array([column * (task.deep + 2) + row for column in columns for row in rows], np.int64)
