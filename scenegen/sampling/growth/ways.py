"""Which ways of a choice hold, as far as their objects are placed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from scenegen.sampling.growth.graph import Clause
from scenegen.sampling.growth.machine import Machine
from scenegen.sampling.growth.touch import within

Array = npt.NDArray[np.float64]
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


def held_of_all(
    machine: Machine, touched: Mapping[int, Sequence[int]], rows: Sequence[Any], cell: Index, stage: int
) -> list[Bool]:
    """The same of some ways of several choices, (len(numbers), B) for each: what they share is computed once."""
    asked = {
        index: [placed_clauses(machine, index, number, stage) for number in numbers]
        for index, numbers in touched.items()
    }
    key = ("all ways", stage, *((index, *numbers) for index, numbers in touched.items()))
    nodes = [one.node for each in asked.values() for clauses in each for one in clauses]
    found = iter(machine.values(key, nodes)(rows, machine.effort.check))
    held = []
    for index, each in asked.items():
        alone = ("ways", index, stage, *touched[index])  # work is counted as if each choice were looked at by itself
        machine.count(machine.steps(alone, [one.node for clauses in each for one in clauses]), len(cell))
        held.append(_met(each, found, cell))
    return held


def met(machine: Machine, key: object, asked: Sequence[Sequence[Clause]], rows: Sequence[Any], cell: Index) -> Bool:
    """Which columns meet all clauses of each entry, (len(asked), B). `key` stands for these clauses."""
    values = machine.values(key, [one.node for clauses in asked for one in clauses])
    found = iter(values(rows))
    machine.count(len(values.steps), len(cell))
    return _met(asked, found, cell)


def _met(asked: Sequence[Sequence[Clause]], found: Iterator[Array], cell: Index) -> Bool:
    held = np.ones((len(asked), len(cell)), dtype=bool)
    for row, clauses in zip(held, asked, strict=True):
        for one in clauses:
            inside = within(next(found), one, cell)
            if inside is not None:
                row &= inside
    return held
