"""Everything that growing and moving scenes needs to know of a request, worked out once; and the scenes themselves."""

from __future__ import annotations

import math
import time
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from scenegen.arrays import Array, Bool, Index
from scenegen.geometry.footprint import measures
from scenegen.pose import TWO_PI, axis_of, is_angle, keep_below_turn, owner, rows_of
from scenegen.sampling.growth.constraints import ObjectConstraints, Values, is_within, make_constraints, make_values
from scenegen.sampling.growth.graph import Clause, Disjunction, Graph, add_implied_clauses, make_graph
from scenegen.sampling.growth.room import FreePoses, SupportPoses, make_room, make_support_poses
from scenegen.sampling.problem import Problem
from scenegen.search.contract import SWEEPS
from scenegen.search.effort import (
    DRAW_SECONDS,
    GROWTH_SCORE_SECONDS,
    GROWTH_STEP_SECONDS,
    Effort,
    StoppedError,
    TooMuchError,
    dear_nodes,
    effort_until,
    work_per_scene,
)

ORDER_SCENES = 1024  # random scenes that tell how often clauses are met
LEAST_ORDER_SHARE = 0.25 / ORDER_SCENES  # share taken for clauses that none of them meets
MAX_CLOSE_OBJECTS = 3  # objects of a clause or a choice up to which it says something of any two of them


def insertion_order(
    graph: Graph, last: Collection[int] = (), effort: Effort | None = None
) -> tuple[tuple[int, ...], dict[int, int]]:
    """The objects that phi depends on in the order of their placing, those in `last` after all others, and for each the
    object that it hangs from, if any.

    What hangs together follows one another, the large and the tightly held first, while moves are cheap and nothing
    stands in the way. How tightly an object is held shows in the box that contraction leaves of it, and in how many
    random scenes meet the clauses and choices that touch it.

    An object hangs from the first placed one with which it shares a clause that attracts: it is placed near that one,
    and moves together with it. Deterministic: ties go by size, then by place in the spec. Raises what `effort` raises.
    """
    effort = Effort() if effort is None else effort
    # what stands on a surface moves with what carries it by moves of its own: see support_moves.py
    near = _neighbours(graph, [clause.objects for clause in graph.clauses if clause.node not in graph.switched])
    groups = [clause.objects for clause in graph.clauses] + [choice.objects for choice in graph.choices]
    linked = _neighbours(graph, groups)
    size = _sizes(graph)
    room = _log_room(graph)
    for thing, share in _log_share(graph, effort).items():
        room[thing] += share
    left, none = set(graph.objects), frozenset[int]()
    waits = {  # what stands is placed on what carries it
        thing: {one.carrier for one in stand.options if one.carrier is not None}
        for thing, stand in graph.stands.items()
    }
    order: list[int] = []
    parent: dict[int, int] = {}
    depth: dict[int, int] = {}
    while left:
        effort.check()
        # the neighbours of what was placed last come first: a group is finished before the next one begins
        ready = {thing for thing in left if waits.get(thing, none).isdisjoint(left)}
        now = ready.difference(last) or ready
        held = [thing for thing in now if linked[thing] & depth.keys()]
        pool = held or sorted(now)

        def rank(thing: int) -> tuple[float, float, float, int]:
            last = max((depth[other] for other in linked[thing] & depth.keys()), default=-1)
            root = -float(len(near[thing])) if last < 0 else 0.0
            return root, round(room[thing] - 2.0 * math.log(size[thing] + 1e-3), 1), -float(last), thing

        chosen = min(pool, key=rank)
        above = near[chosen] & depth.keys()
        if above:
            parent[chosen] = min(above, key=depth.__getitem__)
        depth[chosen] = len(order)
        order.append(chosen)
        left.remove(chosen)
    return tuple(order), parent


def _neighbours(graph: Graph, groups: Iterable[frozenset[int]]) -> dict[int, set[int]]:
    """Objects that share one of some groups; those of many objects say little about any two of them."""
    near: dict[int, set[int]] = {thing: set() for thing in graph.objects}
    for group in groups:
        for thing in group if len(group) <= MAX_CLOSE_OBJECTS else ():
            near[thing] |= group - {thing}
    return near


def _log_share(graph: Graph, effort: Effort) -> dict[int, float]:
    """The logarithm of the share of random scenes that meet what touches each object, pairs apart; of what touches
    several objects, each gets a part."""
    asked: list[Clause] = [*graph.clauses, *(choice.whole for choice in graph.choices)]
    share = dict.fromkeys(graph.objects, 0.0)
    cell = np.arange(ORDER_SCENES) % graph.low.shape[1]
    low, high = graph.low[:, cell], graph.high[:, cell]
    scenes = low + np.random.default_rng(0).random(low.shape) * (high - low)
    with np.errstate(all="ignore"):
        values = make_values(graph.core, [clause.node for clause in asked])(list(scenes), effort.check)
        for clause, value in zip(asked, values, strict=True):
            effort.check()
            inside = is_within(np.broadcast_to(value, ORDER_SCENES), clause, cell)
            if inside is not None:
                for thing in clause.objects:
                    share[thing] += math.log(max(LEAST_ORDER_SHARE, float(np.mean(inside)))) / len(clause.objects)
    return share


def _sizes(graph: Graph) -> dict[int, float]:
    size = dict.fromkeys(graph.objects, 0.0)
    for pair in graph.pairs:
        for end, shape in ((pair.first, pair.shapes[0]), (pair.second, pair.shapes[1])):
            if isinstance(end, int):
                size[end] = max(size[end], measures(shape).outer)
    return size


def _log_room(graph: Graph) -> dict[int, float]:
    """The logarithm of what contraction leaves of each object's box, in the widest cell."""
    out = {}
    for thing in graph.objects:
        rows = [row for row in rows_of(thing) if row in graph.rows]
        widths = np.maximum((graph.high[rows] - graph.low[rows]).max(axis=1), 1e-12)
        out[thing] = float(np.log(widths).sum())
    return out


OUTLOOK_SCENES = 2048  # random scenes that tell how often a clause is met
OUTLOOK_POWER = 0.75  # power of the estimate: one neighbour may meet the clauses of several objects
LEAST_WAY_SHARE = 0.25 / OUTLOOK_SCENES  # share taken for clauses that none of them meets
EASY_CHANCE = 0.15  # chance that a scene meets an upper end from which on growth does not mind it
MIN_SCENES_ABOVE = 16  # random scenes that meet a lower end, at least, to tell how many of them meet the upper one
LOG_CERTAIN = -40.0  # logarithm of 1 - p for ways that hold: 1 - exp of it is 1


def outlooks(problem: Problem, graph: Graph, at: Mapping[int, int], effort: Effort) -> tuple[Array, ...]:
    """What choices are worth while their objects are being placed. For each, (W, stages, C or 1): log(1 - p), p the
    chance that a way will hold which no object placed by that stage rules out; LOG_CERTAIN once all its objects are
    placed. Raises what `effort` raises.

    A way of a choice asks for clauses, some of which touch objects that come later. Populations that are indifferent to
    that would be full of scenes that have more to meet than they can, and lose them with the last object. So a scene
    counts by the chance that at least one of its ways comes to hold: those that nothing placed so far has ruled out,
    each with the share of random poses that meet the rest of it (a twisted target, as in look-ahead particle filters:
    Guarniero et al. 2017). Ways that hold once all their objects are there count 1, and a scene in which several hold
    counts no more than one in which one does. In the end the factor is 1 where the choice is met and 0 elsewhere, so
    what the chances are worth decides how even the weights are, never what the scenes are like.
    """
    if not graph.choices:
        return ()
    scenes = _random_scenes(problem, graph)
    return tuple(_outlook(problem, choice, at, scenes, graph.low.shape[1], effort) for choice in graph.choices)


def drop_easy_ends(problem: Problem, graph: Graph) -> tuple[Graph, Array | None]:
    """The graph without the choices that are upper ends which most scenes of every cell meet by themselves; and how
    many scenes each cell should begin with, (C,) in proportion, None where nothing is left out.

    The upper end of a range is a choice, too: some atom of a conjunction must be no better than that. Where atoms are
    many, most scenes that meet the lower end meet it anyway. Scenes out of the range are dropped in the end, which
    costs less than to steer every move by it.

    A scene that is better than its cell falls into one above, so all but the lowest cells lose as many as they get.
    """
    ends = [choice for choice in graph.choices if not np.isfinite(choice.whole.low).any()]
    scenes, lower = _random_scenes(problem, graph), {one.node: one.low for one in graph.clauses}
    lower |= {one.node: one.low for one in graph.pairs}
    begin, easy = np.ones(graph.low.shape[1]), set[int]()
    for choice in ends:
        met = _share_in_range(problem, choice, lower, scenes, len(begin))
        if met.min() >= EASY_CHANCE:
            easy.add(choice.whole.node)
            high = choice.whole.high
            begin[high == high.min()] /= met[high == high.min()]
    if not easy:
        return graph, None
    return replace(graph, choices=tuple(one for one in graph.choices if one.whole.node not in easy)), begin


def _share_in_range(
    problem: Problem, choice: Disjunction, lower: Mapping[int, Array], scenes: Array, cells: int
) -> Array:
    """About which share of the scenes that meet the lower ends meet some way of an upper end, in each cell, (C,)."""
    missed = np.ones(cells)
    with np.errstate(all="ignore"):
        found = make_values(problem.core, [way.whole.node for way in choice.ways])(list(scenes))
    for way, value in zip(choice.ways, found, strict=True):
        value, low = np.broadcast_to(value, OUTLOOK_SCENES), np.broadcast_to(lower.get(way.whole.node, -np.inf), cells)
        for cell in range(cells):
            above = value >= low[cell]
            if np.count_nonzero(above) >= MIN_SCENES_ABOVE:
                missed[cell] *= np.mean(value[above] > way.whole.high[cell])
    return 1.0 - missed


def _random_scenes(problem: Problem, graph: Graph) -> Array:
    """Scenes (3N, OUTLOOK_SCENES) uniform over what contraction leaves of the box, of all cells in turn."""
    rng = np.random.default_rng(np.random.SeedSequence([problem.request.seed, len(graph.choices)]))
    cell = np.arange(OUTLOOK_SCENES) % graph.low.shape[1]
    low, high = graph.low[:, cell], graph.high[:, cell]
    scenes: Array = low + rng.random(low.shape) * (high - low)
    return scenes


def _outlook(
    problem: Problem, choice: Disjunction, at: Mapping[int, int], scenes: Array, cells: int, effort: Effort
) -> Array:
    clauses = {(clause.node, id(clause)): clause for way in choice.ways for clause in way.clauses if clause.objects}
    same = all((ends == ends[0]).all() for one in clauses.values() for ends in (one.low, one.high))
    table = np.zeros((len(choice.ways), len(at), 1 if same else cells))
    with np.errstate(all="ignore"):
        found = make_values(problem.core, [node for node, _ in clauses])(list(scenes), effort.check)
        shares = {
            key: np.log(_shares_within(value, clause, table.shape[2], effort))
            for (key, clause), value in zip(clauses.items(), found, strict=True)
        }
    for row, way in zip(table, choice.ways, strict=True):
        for clause in way.clauses:
            if clause.objects:
                row[: max(at[thing] for thing in clause.objects)] += OUTLOOK_POWER * shares[clause.node, id(clause)]
        done = max((at[thing] for thing in way.whole.objects), default=0)
        row[:done] = np.log1p(-np.minimum(np.exp(row[:done]), 1.0 - 1e-9))
        row[done:] = LOG_CERTAIN
    return table


def _shares_within(value: Array, clause: Clause, cells: int, effort: Effort) -> Array:
    """The share of values within the clause's ends, for each cell, (C,)."""
    value = np.broadcast_to(value, OUTLOOK_SCENES)
    share = np.ones(cells)
    for cell in range(cells):
        effort.check()
        inside = is_within(value, clause, np.full(OUTLOOK_SCENES, cell))
        if inside is not None:
            share[cell] = max(LEAST_WAY_SHARE, float(np.mean(inside)))
    return share


def chance(held: Bool, table: Array, cell: Index) -> Array:
    """The chance that some way holds in the end, (B,): `held` (W, B) tells which ways nothing rules out so far, `table`
    (W, C or 1) is the outlook's for this stage, `cell` (B,)."""
    total = table[:, 0] @ held if table.shape[1] == 1 else (table[:, cell] * held).sum(axis=0)
    out: Array = -np.expm1(total)
    return out


@dataclass(slots=True, eq=False)
class GrowthModel:
    """`order` is the order of placing, `at` its inverse, `groups` the objects that hang from each object, itself first.
    `begins`: the stage at which a choice's first object is placed; `outlooks` say which chances its ways have, see
    `outlooks` below. `kin` are classes of blocks that may take each other's places: single objects, or groups,
    member by member. `mixed` are few objects and others with the same footprints, but of other classes: to trade places
    with these brings the few across a full table. `whole` are the objects whose room is not worth contracting: a plan
    finds them out. `standing` are the places of what stands. `begin` (C,) is how many scenes each cell begins with, in
    proportion, where they may leave their cell; None where they stay: see `outlooks`. `each` is the work of scoring a
    scene but for dear nodes, of which `dear` are the seconds, `steps_done` how often all scenes were evaluated, `drawn`
    the coordinates of poses that were tried. `furthest` is how many objects have been placed at once."""

    problem: Problem
    graph: Graph
    order: tuple[int, ...]
    at: Mapping[int, int]
    groups: Mapping[int, tuple[int, ...]]
    constraints: Mapping[int, ObjectConstraints]
    begins: tuple[int, ...]
    kin: tuple[tuple[tuple[int, ...], ...], ...]
    mixed: tuple[tuple[tuple[int, ...], tuple[int, ...]], ...]
    outlooks: tuple[Array, ...]
    evaluators: dict[object, Values] = field(default_factory=dict)
    notes: dict[object, Any] = field(default_factory=dict)
    rooms: dict[object, FreePoses] = field(default_factory=dict)
    standing: Mapping[int, SupportPoses] = field(default_factory=dict)
    whole: set[int] = field(default_factory=set)
    begin: Array | None = None
    work: float = 0.0
    steps_done: int = 0
    drawn: float = 0.0
    dear: float = 0.0
    each: float = 0.0
    deadline: float = math.inf
    most: float = math.inf
    longest: float = math.inf
    furthest: int = 0

    @property
    def seconds(self) -> float:
        """What was done so far, in seconds of CPU by the constants of search.effort."""
        return (
            GROWTH_SCORE_SECONDS * self.each * self.work
            + GROWTH_STEP_SECONDS * self.steps_done
            + DRAW_SECONDS * self.drawn
            + self.dear
        )

    @property
    def cells(self) -> int:
        return self.problem.cells.count

    @property
    def effort(self) -> Effort:
        """Work that is stopped once the deadline has passed."""
        return effort_until(self.deadline)

    def room(self, thing: int, stage: int) -> FreePoses | SupportPoses:
        """The room of an object under the clauses in force at a stage; of what stands, its surfaces."""
        if thing in self.standing:
            return self.standing[thing]
        constraints = self.constraints[thing]
        if thing in self.whole:
            return make_room(self.problem, constraints, ())
        clauses = constraints.clauses_at(stage)
        key = thing, len(clauses)
        if key not in self.rooms:
            # what others stand on, and how high: little comes of contracting that, at a high price
            narrowing = [one for one in clauses if one.node not in self.graph.switched]
            self.rooms[key] = make_room(self.problem, constraints, narrowing)
        return self.rooms[key]

    def leave_whole(self, thing: int, stage: int) -> None:
        """Note that contraction leaves an object nearly all of its box, once all its clauses but pairs are in force."""
        constraints = self.constraints[thing]
        if len(constraints.clauses_at(stage)) == len(constraints.clauses) and not constraints.ways:
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

    def count_values(self, values: Values, columns: int) -> None:
        """Note that some were evaluated over so many columns, as `count` does."""
        self.dear += values.dear[0] * columns + values.dear[1]
        self.count(len(values.steps), columns)

    def complete(self, rows: Array, rng: np.random.Generator) -> Array:
        """Whole scenes (3N, P): rows that no clause reads are drawn afresh, in place; headings are brought below a
        turn."""
        lowest, highest = self.problem.lowest, self.problem.highest
        for row in range(len(lowest)):
            if row not in self.graph.rows and lowest[row] < highest[row]:
                rows[row] = lowest[row] + rng.random(rows.shape[1]) * (highest[row] - lowest[row])
        keep_below_turn(rows)
        return rows

    def is_circular(self, row: int) -> bool:
        """Whether a row is a heading that goes all the way round."""
        lowest, highest = self.problem.lowest[row], self.problem.highest[row]
        return is_angle(row) and abs(highest - lowest - TWO_PI) < 1e-12

    def values(self, key: object, nodes: Sequence[int]) -> Values:
        """The evaluator of some nodes, kept under a key."""
        if key not in self.evaluators:
            self.evaluators[key] = make_values(self.problem.core, nodes)
        return self.evaluators[key]


def make_growth_model(
    problem: Problem,
    last: Collection[int] = (),
    rounds: int = SWEEPS,
    deadline: float = math.inf,
    *,
    loose: bool = False,
) -> GrowthModel:
    """The model of a problem; its own problem holds what the formulas imply besides. Objects in `last` are placed
    after all others. `rounds` are those of contraction. `loose`: upper ends that most scenes meet are left out. Raises
    StoppedError after `deadline`, by the monotonic clock."""
    effort = effort_until(deadline)
    problem = add_implied_clauses(problem, effort)
    graph, begin = make_graph(problem, rounds, effort), None
    if loose:
        graph, begin = drop_easy_ends(problem, graph)
    order, parent = insertion_order(graph, last, effort)
    at = {thing: place for place, thing in enumerate(order)}
    groups: dict[int, list[int]] = {thing: [thing] for thing in order}
    for thing in order:
        above = parent.get(thing)
        while above is not None:
            groups[above].append(thing)
            above = parent.get(above)
    begins = tuple(min(at[thing] for thing in choice.objects) for choice in graph.choices)
    constraints = make_constraints(graph, order, effort)
    hanging = {thing: tuple(group) for thing, group in groups.items()}
    blocks = [hanging[thing] for thing in order if thing not in parent and len(hanging[thing]) > 1]
    kin = _kin_classes(constraints, [*((thing,) for thing in order), *blocks])
    at |= {
        owner(one.switch): at[thing] for thing, one in graph.stands.items() if one.switch is not None and thing in at
    }
    standing = {
        thing: found
        for thing, one in graph.stands.items()
        if thing in constraints and (found := make_support_poses(one, constraints[thing])) is not None
    }
    return GrowthModel(
        problem, graph, order, at, hanging, constraints, begins, kin, _mixed_classes(constraints),
        outlooks(problem, graph, at, effort), standing=standing, begin=begin,
        each=work_per_scene(problem.core.nodes)[0] - work_per_scene(dear_nodes(problem.core.nodes))[0],
        deadline=deadline,
    )  # fmt: skip


def _kin_classes(
    constraints: Mapping[int, ObjectConstraints], blocks: Iterable[tuple[int, ...]]
) -> tuple[tuple[tuple[int, ...], ...], ...]:
    """Blocks whose members have the same footprints and free rows, two or more together."""
    alike: dict[object, list[tuple[int, ...]]] = {}
    for block in blocks:
        alike.setdefault(tuple(_kind(constraints[thing]) for thing in block), []).append(block)
    return tuple(tuple(found) for found in alike.values() if len(found) > 1)


def _mixed_classes(constraints: Mapping[int, ObjectConstraints]) -> tuple[tuple[tuple[int, ...], tuple[int, ...]], ...]:
    """For every class of objects but the largest of those with the same footprints: its objects, and the others."""
    alike: dict[object, dict[object, list[int]]] = {}
    for thing, mine in constraints.items():
        if mine.shapes:
            alike.setdefault(_kind(mine)[:2], {}).setdefault(_kind(mine), []).append(thing)
    found = []
    for classes in alike.values():
        ranked = sorted(classes.values(), key=len)
        for few in ranked[:-1]:
            found.append((tuple(few), tuple(thing for other in ranked if other is not few for thing in other)))
    return tuple(found)


def _kind(constraints: ObjectConstraints) -> tuple[object, ...]:
    return constraints.shapes, tuple(axis_of(row) for row in constraints.rows), len(constraints.clauses)


@dataclass(slots=True)
class Particles:
    """P scenes, `scenes` (3N, P), each for one `cell` (P,), in islands, (P,), that know nothing of each other.

    `held[c]` (W, P) tells which ways of choice c are met as far as their objects are placed, None before the first of
    them is; `chances` (choices, P) are the chances that a way holds in the end, see `outlooks`. `families` are
    ancestors, (P,) each, at several times."""

    model: GrowthModel
    rng: np.random.Generator
    scenes: Array
    cell: Index
    island: Index
    held: list[Bool | None]
    chances: Array
    stage: int = -1
    families: list[Index] = field(default_factory=list)

    @classmethod
    def start(cls, model: GrowthModel, cell: Index, island: Index, rng: np.random.Generator) -> Particles:
        """Empty tables for the given cells and islands."""
        problem, count = model.problem, len(cell)
        scenes = np.repeat(problem.lowest[:, None], count, axis=1)
        choices = len(model.graph.choices)
        return cls(
            model, rng, scenes, cell, island, [None] * choices, np.ones((choices, count)), families=[np.arange(count)]
        )

    @property
    def count(self) -> int:
        return int(self.scenes.shape[1])

    @property
    def group(self) -> Index:
        """A number for each pair of island and cell: resampling keeps within it."""
        return self.island * self.model.cells + self.cell

    @property
    def placed_objects(self) -> tuple[int, ...]:
        return self.model.order[: self.stage + 1]

    def touching(self, things: Collection[int]) -> dict[int, tuple[int, ...]]:
        """For every choice that has begun: its ways that touch some of the things, if any."""
        constraints = self.model.constraints
        found = {
            index: tuple(sorted({number for thing in things for number in constraints[thing].ways.get(index, ())}))
            for index, known in enumerate(self.held)
            if known is not None
        }
        return {index: numbers for index, numbers in found.items() if numbers}

    def take(self, index: Index) -> None:
        """Go on with copies of the given scenes, each in the place of one."""
        if len(index) == self.count and (index == np.arange(self.count)).all():
            return
        if len(index) == self.count:
            rows = [
                row for thing in self.placed_objects for row in {*rows_of(thing), *self.model.constraints[thing].rows}
            ]
            self.scenes[rows] = self.scenes[rows][:, index]
        else:
            self.scenes = self.scenes[:, index]
        self.cell, self.island = self.cell[index], self.island[index]
        self.held = [None if held is None else held[:, index] for held in self.held]
        self.chances = self.chances[:, index]
        self.families = [family[index] for family in self.families]


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
