"""Which ways of a choice hold, as far as their objects are placed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from scenegen.sampling.growth.graph import Clause
from scenegen.sampling.growth.machine import Machine
from scenegen.sampling.growth.touch import within

Bool = npt.NDArray[np.bool_]
Index = npt.NDArray[np.intp]


def placed_clauses(machine: Machine, choice: int, number: int, stage: int) -> tuple[Clause, ...]:
    """What a way asks of the objects placed by a stage: the whole of it once all of its objects are there."""
    way = machine.graph.choices[choice].ways[number]
    if all(machine.at[thing] <= stage for thing in way.whole.objects):
        return (way.whole,)
    return tuple(one for one in way.clauses if one.objects and all(machine.at[thing] <= stage for thing in one.objects))


def held_ways(
    machine: Machine, choice: int, numbers: Sequence[int], rows: Sequence[Any], cell: Index, stage: int
) -> Bool:
    """Which of some ways of a choice nothing placed by a stage rules out, (len(numbers), B). `rows` are 3N arrays or
    numbers that broadcast to (B,), `cell` (B,)."""
    asked = [placed_clauses(machine, choice, number, stage) for number in numbers]
    return met(machine, ("ways", choice, stage, *numbers), asked, rows, cell)


def met(machine: Machine, key: object, asked: Sequence[Sequence[Clause]], rows: Sequence[Any], cell: Index) -> Bool:
    """Which columns meet all clauses of each entry, (len(asked), B). `key` stands for these clauses."""
    values = machine.values(key, [one.node for clauses in asked for one in clauses])
    found = iter(values(rows))
    machine.count(len(values.steps), len(cell))
    held = np.ones((len(asked), len(cell)), dtype=bool)
    for row, clauses in zip(held, asked, strict=True):
        for one in clauses:
            inside = within(next(found), one, cell)
            if inside is not None:
                row &= inside
    return held
