"""A learner that keeps what it saw as a map, and explores what it does not know (in the manner of R-max, Brafman &
Tennenholtz 2002). Moves and table do not change, so one look is enough.

`known` has a bit for every action of a cell whose outcome is known. The board's moves say where an action leads, but
are only asked for actions that are known or being taken.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from experiments.tabular.check import ANY, FIRST, Table, solved
from experiments.tabular.grid import FREE, GOAL, OFF, Board, Cells
from experiments.tabular.jit import compiled
from experiments.tabular.qlearning import NEVER, Result, Stop
from experiments.tabular.rng import State, below
from experiments.tabular.starts import Starts

Bits = npt.NDArray[np.uint8]
UNKNOWN = -1


ANYWHERE, NEW, HARDEST = 0, 1, 2
NEAR = 4  # new cells of the hardest, of which one is taken


class Explorer(NamedTuple):
    """How it explores. `straight`: goes on in the direction in which it came to a cell that is new. `back`: learns
    which action undoes which, and that every way can be gone back. `limit`: steps of an episode at most. `where`
    episodes begin: ANYWHERE, in NEW cells, or in the HARDEST that are new, those with the least phi."""

    straight: bool
    back: bool
    limit: int
    where: int = ANYWHERE


@compiled
def plan(board: Board, known: Bits) -> Table:
    """Values (cells, 4): the shorter the known way to the goal behind an action, the greater; 0 for what is unknown or
    leads nowhere, -1 for a fall."""
    kind, moves = board
    count = len(kind)
    steps = np.full(count, -1, np.int64)
    queue = np.empty(count, np.int64)
    end = 0
    for cell in range(count):
        if kind[cell] == GOAL:
            steps[cell] = 0
            queue[end] = cell
            end += 1
    start = 0
    while start < end:
        cell = queue[start]
        start += 1
        for action in range(4):
            before = cell - moves[action]
            if 0 <= before < count and kind[before] == FREE and steps[before] < 0 and (known[before] >> action) & 1:
                steps[before] = steps[cell] + 1
                queue[end] = before
                end += 1
    q = np.zeros((count, 4))
    for cell in range(count):
        if kind[cell] == FREE:
            for action in range(4):
                after = cell + moves[action]
                if (known[cell] >> action) & 1:
                    if kind[after] == OFF:
                        q[cell, action] = -1.0
                    elif steps[after] >= 0:
                        q[cell, action] = 1.0 / (1.0 + steps[after])
    return q


@compiled
def towards_unknown(board: Board, known: Bits, cell: int, came: Cells, queue: Cells) -> int:
    """The first action of a shortest known way to a cell with an action that is not known; UNKNOWN where there is none.
    `came` (cells,) is -1 throughout, and is left so; `queue` (cells,) is scratch."""
    kind, moves = board
    start, end, found = 0, 1, -1
    queue[0] = cell
    came[cell] = 4
    while start < end and found < 0:
        at = queue[start]
        start += 1
        for action in range(4):
            after = at + moves[action]
            if (known[at] >> action) & 1 and kind[after] == FREE and came[after] < 0:
                came[after] = action
                queue[end] = after
                end += 1
                if known[after] != 15:
                    found = after
                    break
    first = UNKNOWN
    while found >= 0 and found != cell:
        first = came[found]
        found -= moves[first]
    for place in range(end):
        came[queue[place]] = -1
    return first


@compiled
def explore(
    board: Board, known: Bits, seen: Bits, undo: Cells, how: Explorer, start: int, rng: State, came: Cells, queue: Cells
) -> tuple[int, int]:
    """One episode; returns where it ended, FREE (out of steps), GOAL or OFF, and the steps. `known`, `seen` (cells that
    it stood in) and `undo` (the action that undoes each, or UNKNOWN) are changed in place."""
    kind, moves = board
    cell, last, came_from, fresh, hit = start, UNKNOWN, UNKNOWN, True, False
    for step in range(1, how.limit + 1):
        seen[cell] = 1
        action = UNKNOWN
        if known[cell] != 15:
            ahead = last if last >= 0 and not (known[cell] >> last) & 1 else UNKNOWN
            if how.straight and fresh and ahead >= 0 and (not how.back or undo[last] >= 0):
                action = ahead
            else:
                count = 0
                for one in range(4):  # any that is not known, straight on last
                    if not (known[cell] >> one) & 1 and not (hit and one == ahead):
                        count += 1
                        if below(rng, count) == 0:
                            action = one
        if action < 0:
            action = towards_unknown(board, known, cell, came, queue)
        if action < 0:
            action = last if last >= 0 else below(rng, 4)
        after = cell + moves[action]
        hit = how.straight and not (known[cell] >> action) & 1 and seen[after] != 0
        known[cell] |= 1 << action
        where = kind[after]
        if where != FREE:
            return where, step
        if how.back:
            if after == came_from and undo[last] < 0:
                undo[last], undo[action] = action, last
                for one in range(len(kind)):
                    if kind[one] == FREE:
                        for way in range(4):
                            if (known[one] >> way) & 1 and undo[way] >= 0 and kind[one + moves[way]] == FREE:
                                known[one + moves[way]] |= 1 << undo[way]
            if undo[action] >= 0:
                known[after] |= 1 << undo[action]
        fresh = seen[after] == 0
        came_from, last, cell = cell, action, after
    return FREE, how.limit


@compiled
def begin(how: Explorer, seen: Bits, starts: Starts, rng: State) -> int:
    """The cell in which an episode begins."""
    cells = starts.cells
    if how.where == NEW:
        for _ in range(1000):
            cell = starts.anywhere[below(rng, len(starts.anywhere))]
            if seen[cell] == 0:
                return cell  # type: ignore[no-any-return]
    elif how.where == HARDEST:
        found = np.empty(NEAR, np.int64)
        count = 0
        for place in range(len(cells) - 1, -1, -1):
            if seen[cells[place]] == 0:
                found[count] = cells[place]
                count += 1
                if count == NEAR:
                    break
        if count > 0:
            return found[below(rng, count)]  # type: ignore[no-any-return]
    return starts.anywhere[below(rng, len(starts.anywhere))]  # type: ignore[no-any-return]


@compiled
def train_map(board: Board, how: Explorer, starts: Starts, stop: Stop, rng: State) -> Result:
    """Explore until `stop`; the policy, the shortest known way to the goal, is checked after every episode."""
    count = len(board.kind)
    known, seen = np.zeros(count, np.uint8), np.zeros(count, np.uint8)
    undo, came, queue = np.full(4, UNKNOWN), np.full(count, -1), np.empty(count, np.int64)
    episodes, steps, resets = 0, 0, 0
    first_episodes, first_steps, first_resets = NEVER, NEVER, NEVER
    any_share = 0.0
    while episodes < stop.episodes:
        start = begin(how, seen, starts, rng)
        where, taken = explore(board, known, seen, undo, how, start, rng, came, queue)
        episodes += 1
        steps += taken
        if where == OFF:
            resets += 1
        q = plan(board, known)
        if solved(board, q, None, FIRST, how.limit) < stop.share:
            continue
        share = solved(board, q, None, ANY, how.limit)
        if first_episodes == NEVER:
            first_episodes, first_steps, first_resets, any_share = episodes, steps, resets, share
        if share >= stop.share:
            return Result(first_episodes, first_steps, first_resets, episodes, steps, resets, any_share, 0)
        if not stop.both:
            break
    return Result(first_episodes, first_steps, first_resets, NEVER, NEVER, NEVER, any_share, 0)
