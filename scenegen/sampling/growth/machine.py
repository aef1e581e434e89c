"""Everything that growing and moving scenes needs to know of a request, worked out once."""

from __future__ import annotations

import math
import time
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from scenegen.bounds.contract import ROUNDS
from scenegen.bounds.effort import GROWN, STEPPED, Effort, StoppedError, TooMuchError, per_scene, until
from scenegen.pose import TWO_PI, axis_of, is_angle, owner
from scenegen.sampling.growth.graph import Graph, make_graph
from scenegen.sampling.growth.implied import strengthened
from scenegen.sampling.growth.order import insertion_order
from scenegen.sampling.growth.outlook import outlooks, without_easy_ends
from scenegen.sampling.growth.room import Room, make_room
from scenegen.sampling.growth.stand import Standing, make_standing
from scenegen.sampling.growth.touch import Touch, touches
from scenegen.sampling.growth.values import Values, make_values
from scenegen.sampling.problem import Problem

Array = npt.NDArray[np.float64]
Bool = npt.NDArray[np.bool_]
Index = npt.NDArray[np.intp]


@dataclass(slots=True, eq=False)
class Machine:
    """`order` is the order of placing, `at` its inverse, `groups` the objects that hang from each object, itself first.
    `begins`: the stage at which a choice's first object is placed; `outlooks` say which chances its ways have, see
    outlook.py. `kin` are classes of blocks that may take each other's places: single objects, or groups,
    member by member. `mixed` are few objects and others with the same footprints, but of other classes: to trade places
    with these brings the few across a full table. `whole` are the objects whose room is not worth contracting: a plan
    finds them out. `standing` are the places of what stands. `begin` (C,) is how many scenes each cell begins with, in
    proportion, where they may leave their cell; None where they stay: see outlook.py. `each` is the work of scoring a
    scene, `steps_done` how often all scenes were evaluated. `furthest` is how many objects have been placed at
    once."""

    problem: Problem
    graph: Graph
    order: tuple[int, ...]
    at: Mapping[int, int]
    groups: Mapping[int, tuple[int, ...]]
    touch: Mapping[int, Touch]
    begins: tuple[int, ...]
    kin: tuple[tuple[tuple[int, ...], ...], ...]
    mixed: tuple[tuple[tuple[int, ...], tuple[int, ...]], ...]
    outlooks: tuple[Array, ...]
    evaluators: dict[object, Values] = field(default_factory=dict)
    notes: dict[object, Any] = field(default_factory=dict)
    rooms: dict[object, Room] = field(default_factory=dict)
    standing: Mapping[int, Standing] = field(default_factory=dict)
    whole: set[int] = field(default_factory=set)
    begin: Array | None = None
    work: float = 0.0
    steps_done: int = 0
    each: float = 0.0
    deadline: float = math.inf
    most: float = math.inf
    longest: float = math.inf
    furthest: int = 0

    @property
    def seconds(self) -> float:
        """What was done so far, in seconds of CPU by the constants of bounds.effort."""
        return GROWN * self.each * self.work + STEPPED * self.steps_done

    @property
    def cells(self) -> int:
        return self.problem.cells.count

    @property
    def effort(self) -> Effort:
        """Work that is stopped once the deadline has passed."""
        return until(self.deadline)

    def room(self, thing: int, stage: int) -> Room | Standing:
        """The room of an object under the clauses in force at a stage; of what stands, its surfaces."""
        if thing in self.standing:
            return self.standing[thing]
        touch = self.touch[thing]
        if thing in self.whole:
            return make_room(self.problem, touch, ())
        clauses = touch.in_force(stage)
        key = thing, len(clauses)
        if key not in self.rooms:
            # what others stand on, and how high: little comes of contracting that, at a high price
            narrowing = [one for one in clauses if one.node not in self.graph.switched]
            self.rooms[key] = make_room(self.problem, touch, narrowing)
        return self.rooms[key]

    def leave_whole(self, thing: int, stage: int) -> None:
        """Note that contraction leaves an object nearly all of its box, once all its clauses but pairs are in force."""
        touch = self.touch[thing]
        if len(touch.in_force(stage)) == len(touch.clauses) and not touch.ways:
            self.whole.add(thing)

    def count(self, nodes: int, columns: int) -> None:
        """Note that so many nodes were evaluated over so many columns, in evaluations of the whole formula.

        Raises StoppedError once the deadline has passed: whatever runs asks here, often. Raises TooMuchError beyond
        `most` evaluations and beyond `longest`, which is of `seconds`."""
        self.work += nodes * columns / max(1, len(self.problem.core.nodes))
        self.steps_done += 1
        if self.work > self.most or self.seconds > self.longest:
            raise TooMuchError
        if time.monotonic() > self.deadline:
            raise StoppedError

    def circular(self, row: int) -> bool:
        """Whether a row is a heading that goes all the way round."""
        lowest, highest = self.problem.lowest[row], self.problem.highest[row]
        return is_angle(row) and abs(highest - lowest - TWO_PI) < 1e-12

    def steps(self, key: object, nodes: Sequence[int]) -> int:
        """How many nodes the evaluator of some nodes takes."""
        if ("steps", key) not in self.notes:
            self.notes["steps", key] = len(self.values(key, nodes).steps)
        known: int = self.notes["steps", key]
        return known

    def values(self, key: object, nodes: Sequence[int]) -> Values:
        """The evaluator of some nodes, kept under a key."""
        if key not in self.evaluators:
            self.evaluators[key] = make_values(self.problem.core, nodes)
        return self.evaluators[key]


def make_machine(
    problem: Problem,
    last: Collection[int] = (),
    rounds: int = ROUNDS,
    deadline: float = math.inf,
    *,
    loose: bool = False,
) -> Machine:
    """The machine of a problem; its own problem holds what the formulas imply besides. Objects in `last` are placed
    after all others. `rounds` are those of contraction. `loose`: upper ends that most scenes meet are left out. Raises
    StoppedError after `deadline`, by the monotonic clock."""
    effort = until(deadline)
    problem = strengthened(problem, effort)
    graph, begin = make_graph(problem, rounds, effort), None
    if loose:
        graph, begin = without_easy_ends(problem, graph)
    order, parent = insertion_order(graph, last, effort)
    at = {thing: place for place, thing in enumerate(order)}
    groups: dict[int, list[int]] = {thing: [thing] for thing in order}
    for thing in order:
        above = parent.get(thing)
        while above is not None:
            groups[above].append(thing)
            above = parent.get(above)
    begins = tuple(min(at[thing] for thing in choice.objects) for choice in graph.choices)
    touch = touches(graph, order, effort)
    hanging = {thing: tuple(group) for thing, group in groups.items()}
    roots = [thing for thing in order if thing not in parent]
    kin = _kin(touch, [(thing,) for thing in order], [hanging[thing] for thing in roots if len(hanging[thing]) > 1])
    mixed = _mixed(touch)
    at |= {
        owner(one.switch): at[thing] for thing, one in graph.stands.items() if one.switch is not None and thing in at
    }
    standing = {
        thing: found
        for thing, one in graph.stands.items()
        if thing in touch and (found := make_standing(one, touch[thing])) is not None
    }
    seen = outlooks(problem, graph, at, effort)
    return Machine(
        problem,
        graph,
        order,
        at,
        hanging,
        touch,
        begins,
        kin,
        mixed,
        seen,
        standing=standing,
        begin=begin,
        each=per_scene(problem.core.nodes)[0],
        deadline=deadline,
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
    return touch.shapes, tuple(axis_of(row) for row in touch.rows), len(touch.clauses)
