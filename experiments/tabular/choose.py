"""Curricula in compiled code; the general ones, for any learner and any phi, are in `curriculum/strategies`.

A level is a band of phi as wide as a cell: level l holds the cells with phi in [-l, 1 - l) cell edges.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from experiments.tabular.grid import Cells
from experiments.tabular.jit import compiled
from experiments.tabular.lines import Lines
from experiments.tabular.rng import State, below, share
from experiments.tabular.starts import Starts

UNIFORM, LINEAR, SELF_PACED, LINES = 0, 1, 2, 3
LEVEL, STREAK, SINCE, OPEN, LISTED = 0, 1, 2, 3, 4  # places in a curriculum's memory


class Curriculum(NamedTuple):
    """`kind` and its settings. LINEAR goes through the levels in `length` episodes, then draws uniform scenes.
    SELF_PACED draws from the newest `band` levels, a share `mixed` of the episodes from anywhere, and goes on to the
    next level after `streak` successes in a row, or after `patience` episodes (0: never); behind the last, uniform.
    LINES begins at the tip of an open line, taken by lot, and moves the tip on after a success in at most `slack` times
    the least steps, and four more; the next group opens when all lines are at their end; behind the last, uniform."""

    kind: int
    length: int = 0
    streak: int = 40
    band: int = 2
    mixed: float = 0.0
    patience: int = 0
    slack: float = 1.4


def memory(lines: Lines) -> Cells:
    """What a curriculum remembers, before the first episode: the level or group it is at, counts, the number of levels
    or of open lines, which lines are open, the tips of all."""
    found = np.zeros(LISTED + 2 * (len(lines.first) - 1), np.int64)
    found[LEVEL] = 1 if len(lines.first) == 1 else 0
    return found


@compiled
def choose(how: Curriculum, lines: Lines, memory: Cells, starts: Starts, episode: int, rng: State) -> int:
    """The cell in which an episode begins."""
    if how.kind == LINES:
        while memory[OPEN] == 0 and memory[LEVEL] < len(lines.group) - 1:
            low = lines.group[memory[LEVEL]]
            memory[LEVEL] += 1
            memory[OPEN] = lines.group[memory[LEVEL]] - low
            for place in range(memory[OPEN]):
                memory[LISTED + place] = low + place
        if memory[OPEN] > 0:
            place, last = LISTED + below(rng, memory[OPEN]), LISTED + memory[OPEN] - 1
            memory[place], memory[last] = memory[last], memory[place]
            line = memory[last]
            tip = memory[LISTED + len(lines.first) - 1 + line]
            return lines.cells[lines.first[line] + tip]  # type: ignore[no-any-return]
        return starts.anywhere[below(rng, len(starts.anywhere))]  # type: ignore[no-any-return]
    top = memory[OPEN] = len(starts.first) - 2
    if how.kind == LINEAR:
        memory[LEVEL] = top + 1 if episode >= how.length else 1 + episode * top // how.length
    level = memory[LEVEL]
    low = high = 0
    if how.kind != UNIFORM and level <= top and not (how.mixed > 0.0 and share(rng) < how.mixed):
        low, high = starts.first[max(1, level + 1 - how.band)], starts.first[level + 1]
    if low == high:  # or no cell has a phi of these levels
        return starts.anywhere[below(rng, len(starts.anywhere))]  # type: ignore[no-any-return]
    return starts.cells[low + below(rng, high - low)]  # type: ignore[no-any-return]


@compiled
def hear(how: Curriculum, lines: Lines, memory: Cells, start: int, success: bool, steps: int) -> None:
    """How the episode that `choose` began went."""
    if how.kind == SELF_PACED:
        memory[STREAK] = memory[STREAK] + 1 if success else 0
        memory[SINCE] += 1
        if memory[STREAK] >= how.streak or (how.patience > 0 and memory[SINCE] >= how.patience):
            memory[LEVEL] = min(memory[LEVEL] + 1, memory[OPEN] + 1)
            memory[STREAK] = memory[SINCE] = 0
    elif how.kind == LINES and memory[OPEN] > 0 and success and steps <= how.slack * lines.steps[start] + 4:
        line = memory[LISTED + memory[OPEN] - 1]
        tip = LISTED + len(lines.first) - 1 + line
        memory[tip] += 1
        if memory[tip] == lines.first[line + 1] - lines.first[line]:
            memory[OPEN] -= 1
