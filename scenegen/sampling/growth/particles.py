"""The scenes that grow: poses, cells, choices, and where each came from."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from scenegen.pose import rows_of
from scenegen.sampling.growth.machine import Machine

Array = npt.NDArray[np.float64]
Bool = npt.NDArray[np.bool_]
Index = npt.NDArray[np.intp]


@dataclass(slots=True)
class Particles:
    """P scenes, `scenes` (3N, P), each for one `cell` (P,), in islands, (P,), that know nothing of each other.

    `held[c]` (W, P) tells which ways of choice c are met as far as their objects are placed, None before the first of
    them is; `chances` (choices, P) are the chances that a way holds in the end, see machine.py. `families` are
    ancestors, (P,) each, at several times."""

    machine: Machine
    rng: np.random.Generator
    scenes: Array
    cell: Index
    island: Index
    held: list[Bool | None]
    chances: Array
    stage: int = -1
    families: list[Index] = field(default_factory=list)

    @classmethod
    def start(cls, machine: Machine, cell: Index, island: Index, rng: np.random.Generator) -> Particles:
        """Empty tables for the given cells and islands."""
        problem, count = machine.problem, len(cell)
        scenes = np.repeat(problem.lowest[:, None], count, axis=1)
        choices = len(machine.graph.choices)
        return cls(
            machine,
            rng,
            scenes,
            cell,
            island,
            [None] * choices,
            np.ones((choices, count)),
            families=[np.arange(count)],
        )

    @property
    def count(self) -> int:
        return int(self.scenes.shape[1])

    @property
    def group(self) -> Index:
        """A number for each pair of island and cell: resampling keeps within it."""
        return self.island * self.machine.cells + self.cell

    @property
    def placed(self) -> tuple[int, ...]:
        return self.machine.order[: self.stage + 1]

    def touching(self, things: Collection[int]) -> dict[int, tuple[int, ...]]:
        """For every choice that has begun: its ways that touch some of the things, if any."""
        touch = self.machine.touch
        found = {
            index: tuple(sorted({number for thing in things for number in touch[thing].ways.get(index, ())}))
            for index, known in enumerate(self.held)
            if known is not None
        }
        return {index: numbers for index, numbers in found.items() if numbers}

    def note_ancestors(self) -> None:
        self.families.append(np.arange(self.count))

    def take(self, index: Index) -> None:
        """Go on with copies of the given scenes, each in the place of one."""
        if len(index) == self.count and (index == np.arange(self.count)).all():
            return
        if len(index) == self.count:
            rows = [row for thing in self.placed for row in {*rows_of(thing), *self.machine.touch[thing].rows}]
            self.scenes[rows] = self.scenes[rows][:, index]
        else:
            self.scenes = self.scenes[:, index]
        self.cell, self.island = self.cell[index], self.island[index]
        self.held = [None if held is None else held[:, index] for held in self.held]
        self.chances = self.chances[:, index]
        self.families = [family[index] for family in self.families]


def resample(weights: Array, group: Index, rng: np.random.Generator) -> tuple[Index, Array]:
    """Systematic resampling within each group (Carpenter et al. 1999): whom to go on with, and the mean weight of each
    scene's group, (P,) each. Groups in which all weights are 0 are left out: they have died."""
    keep: list[Index] = []
    mean = np.zeros(len(weights))
    for which in np.unique(group):
        mine = np.flatnonzero(group == which)
        total = np.cumsum(weights[mine])
        mean[mine] = total[-1] / len(mine)
        if total[-1] <= 0.0:
            continue
        if (weights[mine] == weights[mine[0]]).all():
            keep.append(mine)
            continue
        marks = (np.arange(len(mine)) + rng.random()) * (total[-1] / len(mine))
        keep.append(mine[np.minimum(np.searchsorted(total, marks, side="right"), len(mine) - 1)])
    return (np.concatenate(keep) if keep else np.empty(0, dtype=np.intp)), mean


# --------------------------------------------------------------------------------------------------------------------
# What a plan learns about moves.


@dataclass(slots=True)
class MoveTally:
    """How often each kind of move was tried and taken, in scenes; and walks by the power of two of their step, for each
    object."""

    tried: dict[str, float] = field(default_factory=dict)
    taken: dict[str, float] = field(default_factory=dict)
    steps: dict[int, Array] = field(default_factory=dict)

    def note(self, kind: str, tried: int, taken: int) -> None:
        self.tried[kind] = self.tried.get(kind, 0.0) + tried
        self.taken[kind] = self.taken.get(kind, 0.0) + taken

    def rate(self, kind: str) -> float | None:
        tried = self.tried.get(kind, 0.0)
        return self.taken[kind] / tried if tried else None
