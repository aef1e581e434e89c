"""Everything that growing and moving scenes needs to know of a request, worked out once."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from scenegen.bounds.effort import StoppedError
from scenegen.sampling.growth.graph import Graph, make_graph
from scenegen.sampling.growth.order import insertion_order
from scenegen.sampling.growth.promise import promises
from scenegen.sampling.growth.room import Room, make_room
from scenegen.sampling.growth.touch import Touch, touches, within
from scenegen.sampling.growth.values import Values, make_values
from scenegen.sampling.problem import Problem
from scenegen.scene.workspace import TWO_PI

Array = npt.NDArray[np.float64]
Bool = npt.NDArray[np.bool_]
Index = npt.NDArray[np.intp]


@dataclass(slots=True, eq=False)
class Machine:
    """`order` is the order of placing, `at` its inverse, `groups` the objects that hang from each object, itself first.
    `begins`, `ends`: the stage at which a choice's first object is placed, and its last; `promises` say what its ways
    will cost, see promise.py. `kin` are classes of blocks that may take each other's places: single objects, or groups,
    member by member. `mixed` are few objects and others with the same footprints, but of other classes: to trade places
    with these brings the few across a full table. `whole` are the objects whose room is not worth contracting: a plan
    finds them out."""

    problem: Problem
    graph: Graph
    order: tuple[int, ...]
    at: Mapping[int, int]
    groups: Mapping[int, tuple[int, ...]]
    touch: Mapping[int, Touch]
    begins: tuple[int, ...]
    ends: tuple[int, ...]
    kin: tuple[tuple[tuple[int, ...], ...], ...]
    mixed: tuple[tuple[tuple[int, ...], tuple[int, ...]], ...]
    ways: tuple[Values, ...]
    promises: tuple[Array, ...]
    rooms: dict[tuple[int, int, tuple[int, ...]], Room] = field(default_factory=dict)
    whole: set[int] = field(default_factory=set)
    work: float = 0.0
    deadline: float = math.inf

    @property
    def cells(self) -> int:
        return self.problem.cells.count

    def room(self, thing: int, stage: int, *, placing: bool) -> Room:
        """The room of an object under the clauses in force at a stage: while it is placed there, or when it moves."""
        touch = self.touch[thing]
        if thing in self.whole:
            return make_room(self.problem, touch, (), ())
        clauses = touch.in_force(stage)
        last = stage if placing else stage + 1
        open_ = [index for index, end in enumerate(self.ends) if end >= last]
        ways = tuple(one for one in touch.way_clauses_in_force(stage) if one.choice in open_)
        key = thing, len(clauses), tuple(sorted({one.choice for one in ways} | {-len(ways)}))
        if key not in self.rooms:
            self.rooms[key] = make_room(self.problem, touch, clauses, ways)
        return self.rooms[key]

    def leave_whole(self, thing: int, stage: int) -> None:
        """Note that contraction leaves an object nearly all of its box, once all its clauses but pairs are in force."""
        touch = self.touch[thing]
        if len(touch.in_force(stage)) == len(touch.clauses) and not touch.way_clauses:
            self.whole.add(thing)

    def count(self, nodes: int, columns: int) -> None:
        """Note that so many nodes were evaluated over so many columns, in evaluations of the whole formula.

        Raises StoppedError once the deadline has passed: whatever runs asks here, often."""
        self.work += nodes * columns / max(1, len(self.problem.core.nodes))
        if time.monotonic() > self.deadline:
            raise StoppedError

    def circular(self, row: int) -> bool:
        """Whether a row is a heading that goes all the way round."""
        lowest, highest = self.problem.lowest[row], self.problem.highest[row]
        return row % 3 == 2 and abs(highest - lowest - TWO_PI) < 1e-12

    def held_ways(self, choice: int, scenes: Array, cell: Index) -> Bool:
        """Which ways of a choice hold in each of P scenes whose objects are all placed, (W, P)."""
        ways = self.graph.choices[choice].ways
        values = self.ways[choice](list(scenes))
        self.count(len(self.ways[choice].steps), scenes.shape[1])
        out = np.ones((len(ways), scenes.shape[1]), dtype=bool)
        for row, way, value in zip(out, ways, values, strict=True):
            inside = within(value, way.whole, cell)
            if inside is not None:
                row &= inside
        return out


def make_machine(problem: Problem) -> Machine:
    graph = make_graph(problem)
    order, parent = insertion_order(graph)
    at = {thing: place for place, thing in enumerate(order)}
    groups: dict[int, list[int]] = {thing: [thing] for thing in order}
    for thing in order:
        above = parent.get(thing)
        while above is not None:
            groups[above].append(thing)
            above = parent.get(above)
    begins = tuple(min(at[thing] for thing in choice.objects) for choice in graph.choices)
    ends = tuple(max(at[thing] for thing in choice.objects) for choice in graph.choices)
    ways = tuple(make_values(problem.core, [way.whole.node for way in choice.ways]) for choice in graph.choices)
    touch = touches(graph, order)
    hanging = {thing: tuple(group) for thing, group in groups.items()}
    roots = [thing for thing in order if thing not in parent]
    kin = _kin(touch, [(thing,) for thing in order], [hanging[thing] for thing in roots if len(hanging[thing]) > 1])
    return Machine(
        problem, graph, order, at, hanging, touch, begins, ends, kin, _mixed(touch), ways, promises(problem, graph, at)
    )


def _kin(touch: Mapping[int, Touch], *levels: Sequence[tuple[int, ...]]) -> tuple[tuple[tuple[int, ...], ...], ...]:
    """Blocks whose members have the same footprints and free rows, two or more together."""

    alike: dict[object, list[tuple[int, ...]]] = {}
    for blocks in levels:
        for block in blocks:
            alike.setdefault(tuple(_kind(touch[thing]) for thing in block), []).append(block)
    return tuple(tuple(blocks) for blocks in alike.values() if len(blocks) > 1)


def _mixed(touch: Mapping[int, Touch]) -> tuple[tuple[tuple[int, ...], tuple[int, ...]], ...]:
    """For every class of objects but the largest of those with the same footprints: its objects, and the others."""
    alike: dict[object, dict[object, list[int]]] = {}
    for thing, mine in touch.items():
        if mine.shapes:
            alike.setdefault(_kind(mine)[:2], {}).setdefault(_kind(mine), []).append(thing)
    found = []
    for classes in alike.values():
        ranked = sorted(classes.values(), key=len)
        for few in ranked[:-1]:
            found.append((tuple(few), tuple(thing for other in ranked if other is not few for thing in other)))
    return tuple(found)


def _kind(touch: Touch) -> tuple[object, ...]:
    return touch.shapes, tuple(row % 3 for row in touch.rows), len(touch.clauses)
