"""Q-learning (Watkins 1989) on a grid, compiled: reward 10 at the goal, -10 off the table, else 0."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from experiments.tabular.check import ANY, FIRST, Table, row_of, solved
from experiments.tabular.choose import LEVEL, Curriculum, choose, hear
from experiments.tabular.grid import FREE, GOAL, OFF, Board, Cells
from experiments.tabular.jit import compiled
from experiments.tabular.lines import Lines
from experiments.tabular.rng import State, below, bits, field
from experiments.tabular.starts import Starts

REWARD = 10.0
NEVER = -1


class Learner(NamedTuple):
    """Step size, discount, share of random actions; whether equal values are decided by lot or for the first action;
    steps of an episode at most; whether it learns when an episode is over, from its end to its beginning (backward
    replay, Lin 1992), or step by step."""

    alpha: float
    gamma: float
    epsilon: float
    lots: bool
    limit: int
    replay: bool = False


class Stop(NamedTuple):
    """Converged when the greedy policy solves `share` of the free cells within as many steps as an episode has; given
    up after so many episodes. `both`: goes on until it does so however ties are decided."""

    share: float = 0.95
    both: bool = False
    episodes: int = 50_000_000


class Result(NamedTuple):
    """What it took until the greedy policy converged, ties going to the first action, and (`any_`) however they go;
    NEVER where it did not. `resets` are episodes that ended off the table. `level` is where the curriculum was at the
    end, `any_share` what any decision of ties solved when it first converged."""

    episodes: int
    steps: int
    resets: int
    any_episodes: int
    any_steps: int
    any_resets: int
    any_share: float
    level: int


_LOWEST = np.array([0, 0, 1, 0, 2, 0, 1, 0, 3, 0, 1, 0, 2, 0, 1, 0], np.int64)  # place of the lowest bit of 0 to 15
_BITS = np.array([0, 1, 1, 2, 1, 2, 2, 3, 1, 2, 2, 3, 2, 3, 3, 4], np.int64)


@compiled
def best(q: Table, row: int, lots: bool, rng: State) -> tuple[int, float]:
    """The greedy action and its value; without branches where no lots are cast: no processor guesses which it is."""
    a, b, c, d = q[row, 0], q[row, 1], q[row, 2], q[row, 3]
    value = max(max(a, b), max(c, d))
    equal = (a == value) | ((b == value) << 1) | ((c == value) << 2) | ((d == value) << 3)
    if lots and _BITS[equal] > 1:
        for _ in range(below(rng, _BITS[equal])):
            equal &= equal - 1  # drops the lowest
    return _LOWEST[equal], value


@compiled
def stepwise(board: Board, q: Table, rows: Cells | None, how: Learner, start: int, rng: State) -> tuple[int, int]:
    """Act from a cell on and learn from every step; returns where it ended, FREE (out of steps), GOAL or OFF, and the
    steps. The values of cell c are q[row_of(rows, c)], changed in place."""
    kind, moves = board
    random = np.uint64(how.epsilon * 16777216.0)
    cell, row = start, row_of(rows, start)
    action, value = best(q, row, how.lots, rng)
    for step in range(1, how.limit + 1):
        draw = bits(rng)
        if draw >> np.uint64(40) < random:
            action = field(draw, 38, 2)
        after = cell + moves[action]
        where = kind[after]
        if where != FREE:
            reward = REWARD if where == GOAL else -REWARD
            q[row, action] += how.alpha * (reward - q[row, action])
            return where, step
        old, taken = row, action
        cell, row = after, row_of(rows, after)
        action, value = best(q, row, how.lots, rng)
        q[old, taken] += how.alpha * (how.gamma * value - q[old, taken])
        if rows is not None and row == old:  # cells that share their values
            action, value = best(q, row, how.lots, rng)
    return FREE, how.limit


@compiled
def replayed(board: Board, q: Table, rows: Cells | None, how: Learner, start: int, rng: State) -> tuple[int, int]:
    """The same, but it learns from the last step to the first when the episode is over."""
    kind, moves = board
    random = np.uint64(how.epsilon * 16777216.0)
    cells = np.empty(how.limit + 1, np.int64)
    actions = np.empty(how.limit, np.int64)
    cells[0] = start
    where, steps = FREE, 0
    while steps < how.limit and where == FREE:
        action, _ = best(q, row_of(rows, cells[steps]), how.lots, rng)
        draw = bits(rng)
        if draw >> np.uint64(40) < random:
            action = field(draw, 38, 2)
        actions[steps] = action
        cells[steps + 1] = cells[steps] + moves[action]
        where = kind[cells[steps + 1]]
        steps += 1
    for step in range(steps - 1, -1, -1):
        row, after = row_of(rows, cells[step]), cells[step + 1]
        if kind[after] == GOAL:
            target = REWARD
        elif kind[after] == OFF:
            target = -REWARD
        else:
            there = row_of(rows, after)
            target = how.gamma * max(max(q[there, 0], q[there, 1]), max(q[there, 2], q[there, 3]))
        q[row, actions[step]] += how.alpha * (target - q[row, actions[step]])
    return where, steps


@compiled
def train(
    board: Board,
    q: Table,
    rows: Cells | None,
    how: Learner,
    curriculum: Curriculum,
    lines: Lines,
    memory: Cells,
    starts: Starts,
    stop: Stop,
    rng: State,
) -> Result:
    """Learn until `stop`; the values q are changed in place. The greedy policy is checked after every 1 % of the
    episodes so far, so that the numbers are at most so much too large."""
    episodes, steps, resets, check = 0, 0, 0, 0
    first_episodes, first_steps, first_resets = NEVER, NEVER, NEVER
    any_share = 0.0
    while episodes < stop.episodes:
        start = choose(curriculum, lines, memory, starts, episodes, rng)
        if how.replay:
            where, taken = replayed(board, q, rows, how, start, rng)
        else:
            where, taken = stepwise(board, q, rows, how, start, rng)
        hear(curriculum, lines, memory, start, where == GOAL, taken)
        episodes += 1
        steps += taken
        if where == OFF:
            resets += 1
        if episodes < check:
            continue
        check = episodes + 1 + episodes // 100
        if solved(board, q, rows, FIRST, how.limit) < stop.share:
            continue
        share = solved(board, q, rows, ANY, how.limit)
        if first_episodes == NEVER:
            first_episodes, first_steps, first_resets, any_share = episodes, steps, resets, share
        if share >= stop.share:
            return Result(first_episodes, first_steps, first_resets, episodes, steps, resets, any_share, memory[LEVEL])
        if not stop.both:
            break
    return Result(first_episodes, first_steps, first_resets, NEVER, NEVER, NEVER, any_share, memory[LEVEL])
