"""Which cells does the greedy policy solve? Exactly, by going back from the goal."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from experiments.tabular.grid import FREE, GOAL, Board, Cells
from experiments.tabular.jit import compiled

Table = npt.NDArray[np.float64]
FIRST, ANY = 0, 1  # which of several best actions the policy takes: the first; or any, and all of them must lead there


@compiled
def row_of(rows: Cells | None, cell: int) -> int:
    """Where the values of a cell are in a table: by itself, or in a row that cells share."""
    return cell if rows is None else rows[cell]


@compiled
def distances(board: Board, q: Table, rows: Cells | None, ties: int) -> Cells:
    """Steps (cells,) in which the greedy policy comes from each cell to the goal, the most that ties allow; -1 where it
    may leave the table or go round in circles. The values of cell c are q[row_of(rows, c)].

    Breadth first: a cell is done when the last of its best actions leads to one that is. Time is linear in the cells.
    """
    kind, moves = board
    count = len(kind)
    best = np.zeros(count, np.int8)  # bits: actions that the policy may take
    open_ = np.zeros(count, np.int8)  # how many of them do not yet lead to the goal
    steps = np.full(count, -1, np.int64)
    queue = np.empty(count, np.int64)
    end = 0
    for cell in range(count):
        if kind[cell] == GOAL:
            steps[cell] = 0
            queue[end] = cell
            end += 1
        elif kind[cell] == FREE:
            row = row_of(rows, cell)
            value = max(max(q[row, 0], q[row, 1]), max(q[row, 2], q[row, 3]))
            for action in range(4):
                if q[row, action] == value and (ties == ANY or open_[cell] == 0):
                    best[cell] |= 1 << action
                    open_[cell] += 1
    start = 0
    while start < end:
        cell = queue[start]
        start += 1
        for action in range(4):
            before = cell - moves[action]
            if before < 0 or before >= count or kind[before] != FREE or not (best[before] >> action) & 1:
                continue
            open_[before] -= 1
            if open_[before] == 0:
                steps[before] = steps[cell] + 1
                queue[end] = before
                end += 1
    return steps


@compiled
def solved(board: Board, q: Table, rows: Cells | None, ties: int, within: int) -> float:
    """The share of the free cells that the greedy policy solves in at most `within` steps (0: in any number)."""
    found = distances(board, q, rows, ties)
    free, good = 0, 0
    for cell in range(len(found)):
        if board.kind[cell] == FREE:
            free += 1
            if found[cell] >= 0 and (within == 0 or found[cell] <= within):
                good += 1
    return good / free
