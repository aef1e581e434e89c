"""A request as a factor graph: clauses, each with the objects that it touches.

What a request and the spec's requirements ask for is a conjunction of clauses: formula nodes that must lie between two
ends. A clause depends on the poses of a few objects only; growth scores it as soon as all of these are on the table,
and a move scores the clauses of what it moves. There are three kinds:

* a `Pair` keeps two footprints (or two points) at a distance. Only neighbours matter, and there may be thousands;
* a `Disjunction` is a disjunction over several objects: one of its `Way`s must hold, and what is placed first says
  which ways are still open;
* every other clause is evaluated as it is.

The ends of a clause depend on the cell of the range that a scene is for.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from scenegen.arrays import Array
from scenegen.geometry import Footprint
from scenegen.geometry.footprint import POINT, Circle
from scenegen.geometry.footprint_rules import narrows_poses
from scenegen.geometry.interval import Interval
from scenegen.geometry.primitives import PRIMITIVES, argument_kinds
from scenegen.lang.formula.core import (
    REQUIRE,
    Apply,
    Atom,
    Const,
    Coord,
    Core,
    Junction,
    Node,
    children,
    renumber,
    restrict,
)
from scenegen.pose import FLAT, PLACE, X, owner, row_of, rows_of
from scenegen.sampling.problem import Problem
from scenegen.search.contract import EVERYTHING, SWEEPS, Bounds, contract, intersect, node_bounds, push_down, start
from scenegen.search.effort import Effort
from scenegen.search.surfaces import Stand, stands_of
from scenegen.search.tape import make_tape


def nodes_read(node: Node) -> list[int]:
    """The nodes that a value depends on: a circle's heading is not one of them."""
    if not isinstance(node, Apply) or not PRIMITIVES[node.primitive].spatial:
        return list(children(node))
    read: list[int] = []
    at = 0
    shapes = iter(node.shapes)
    for kind in argument_kinds(node.primitive, len(node.shapes)):
        size = {"number": 1, "place": len(PLACE), "footprint": len(FLAT)}[kind]
        args = node.args[at : at + size]
        at += size
        read += args[: len(PLACE)] if kind == "footprint" and isinstance(next(shapes), Circle) else args
    return read


def needed_args(args: Sequence[int], shape: Footprint) -> Sequence[int]:
    """Arguments x, y and heading, of a round footprint the first two."""
    return args[: len(PLACE)] if isinstance(shape, Circle) else args


def set_bits(bits: int) -> list[int]:
    found = []
    while bits:
        lowest = bits & -bits
        found.append(lowest.bit_length() - 1)
        bits ^= lowest
    return found


def flat_args(core: Core, index: int) -> list[int]:
    """The arguments of a junction, those of junctions of the same kind within it instead of these; each only once."""
    top = core.nodes[index]
    assert isinstance(top, Junction)
    found: dict[int, None] = {}
    waiting = list(reversed(top.args))
    while waiting:
        arg = waiting.pop()
        node = core.nodes[arg]
        if isinstance(node, Junction) and node.kind == top.kind:
            waiting += reversed(node.args)
        else:
            found[arg] = None
    return list(found)


def ways_of(core: Core, index: int) -> list[int]:
    """The numbers of which a formula's value is the largest: those of a disjunction's atoms, and of a `max` in them."""
    found: dict[int, None] = {}
    waiting = [index]
    while waiting:
        index = waiting.pop()
        match core.nodes[index]:
            case Junction("max", args) | Apply("max", args):
                waiting += reversed(args)
            case Atom(margin=margin):
                waiting.append(margin)
            case _:
                found[index] = None
    return list(found)


def offset_of(nodes: Sequence[Node], index: int) -> tuple[int, float, float] | None:
    """An atom's margin, or a number, as sign times a clearance or distance, plus a constant: its node, the sign, the
    constant."""
    node = nodes[index]
    index, sign, constant = node.margin if isinstance(node, Atom) else index, 1.0, 0.0
    while True:
        node = nodes[index]
        if not isinstance(node, Apply):
            return None
        if node.primitive in ("gap", "dist"):
            return index, sign, constant
        values = [nodes[arg] for arg in node.args]
        match node.primitive, values:
            case "neg", _:
                index, sign = node.args[0], -sign
            case "add", [_, Const(value)]:
                index, constant = node.args[0], constant + sign * value
            case "add", [Const(value), _]:
                index, constant = node.args[1], constant + sign * value
            case "sub", [_, Const(value)]:
                index, constant = node.args[0], constant - sign * value
            case "sub", [Const(value), _]:
                index, constant, sign = node.args[1], constant + sign * value, -sign
            case _:
                return None


NO_STANDS: Mapping[int, Stand] = MappingProxyType({})
MAX_LOCAL_OBJECTS = 2  # objects up to which a disjunction is evaluated as a whole if each of its ways touches them all


@dataclass(frozen=True, slots=True, eq=False)
class Clause:
    """Formula node `node` of the core lies from `low` to `high`, (C,) each: one end per cell. `objects` are the free
    objects that it touches, as indices into the spec's."""

    node: int
    objects: frozenset[int]
    low: Array
    high: Array


@dataclass(frozen=True, slots=True, eq=False)
class Pair:
    """The clearance of two footprints is at least `low` (C,), in metres. `first` and `second` are objects, or fixed
    poses (x, y, theta)."""

    node: int
    shapes: tuple[Footprint, Footprint]
    first: int | tuple[float, float, float]
    second: int | tuple[float, float, float]
    low: Array

    @property
    def objects(self) -> frozenset[int]:
        return frozenset(end for end in (self.first, self.second) if isinstance(end, int))


@dataclass(frozen=True, slots=True, eq=False)
class Way:
    """One alternative of a choice: its node lies within the ends, which asks for all of `clauses`."""

    whole: Clause
    clauses: tuple[Clause, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Disjunction:
    """At least one way holds: `whole` does."""

    whole: Clause
    ways: tuple[Way, ...]
    objects: frozenset[int]


@dataclass(frozen=True, slots=True, eq=False)
class Graph:
    """`rows` are the rows of (3N, B) storage that any clause reads and that are free: all others are independent of
    everything and uniform. `low`, `high` (3N, C) is the box that contraction leaves to each cell. `stands` are the
    objects that are placed on their surfaces, each with its switch: these count as one object; `switched` are the
    nodes that read such a switch."""

    core: Core
    clauses: tuple[Clause, ...]
    pairs: tuple[Pair, ...]
    choices: tuple[Disjunction, ...]
    rows: frozenset[int]
    low: Array
    high: Array
    stands: Mapping[int, Stand] = field(default_factory=dict)
    switched: frozenset[int] = frozenset()

    @property
    def objects(self) -> frozenset[int]:
        """The free objects that phi depends on."""
        switches = {stand.switch for stand in self.stands.values()}
        return frozenset(owner(row) for row in self.rows if row not in switches)

    def rows_of(self, thing: int) -> tuple[int, ...]:
        """The free rows of an object that some clause reads, the switch of what stands first."""
        switch = self.stands[thing].switch if thing in self.stands else None
        return (*(() if switch is None else (switch,)), *(row for row in rows_of(thing) if row in self.rows))


def make_graph(problem: Problem, rounds: int = SWEEPS, effort: Effort | None = None) -> Graph:
    """The factor graph of a request, its box contracted in so many rounds. Raises what `effort` raises."""
    stands = {one.thing: one for one in stands_of(problem.spec, problem.lowest, problem.highest)}
    builder = _Builder(problem, rounds, stands, effort)
    clauses: list[Clause] = []
    pairs: list[Pair] = []
    choices: list[Disjunction] = []
    narrowing: list[Clause] = []
    for clause in builder.clauses(builder.demands()):
        pair = builder.pair(clause)
        if pair is not None:
            pairs.append(pair)
            continue
        if not clause.objects:  # the same in every scene
            continue
        narrowing.append(clause)
        choice = builder.choice(clause)
        if choice is not None:
            choices.append(choice)
        else:
            clauses.append(clause)
    rows = builder.rows_read([*narrowing, *pairs])
    low, high = builder.box(narrowing)
    return Graph(
        problem.core, tuple(clauses), tuple(pairs), tuple(choices), rows, low, high, stands, builder.switch_readers()
    )


def objects_by_node(problem: Problem, effort: Effort | None = None) -> dict[int, frozenset[int]]:
    """The free objects that each formula node touches of which something is asked; none where it is the same in every
    scene. Raises what `effort` raises."""
    builder = _Builder(problem, effort=effort)
    return {clause.node: clause.objects for clause in builder.clauses(builder.demands())}


def components(groups: Iterable[frozenset[int]]) -> tuple[frozenset[int], ...]:
    """Sets of objects joined where they share one, largest first."""
    parts: list[set[int]] = []
    for group in groups:
        joined = set(group)
        apart = []
        for part in parts:
            if part & joined:
                joined |= part
            else:
                apart.append(part)
        parts = [*apart, joined] if joined else apart
    return tuple(frozenset(part) for part in sorted(parts, key=lambda part: (-len(part), min(part))))


class _Builder:
    def __init__(
        self,
        problem: Problem,
        rounds: int = SWEEPS,
        stands: Mapping[int, Stand] = NO_STANDS,
        effort: Effort | None = None,
    ) -> None:
        self._effort = Effort() if effort is None else effort
        self._problem, self._core, self._rounds = problem, problem.core, rounds
        self._bounds: list[Interval] | None = None
        self._switches = {one.switch: thing for thing, one in stands.items() if one.switch is not None}
        free = problem.lowest < problem.highest
        self._reads: list[int] = []  # bit r of entry i: node i reads row r, and row r is free
        for node in self._core.nodes:
            if isinstance(node, Coord):
                self._reads.append(1 << node.row if free[node.row] else 0)
            else:
                bits = 0
                for child in nodes_read(node):
                    bits |= self._reads[child]
                self._reads.append(bits)

    def demands(self) -> dict[int, tuple[Array, Array]]:
        """Ends of formula nodes by cell: node -> lowest and highest value, (C,) each."""
        core, cells = self._core, self._problem.cells
        found: dict[int, tuple[Array, Array]] = {}
        required = core.labels.get(REQUIRE)
        if required is not None:
            for node, ends in push_down(core, {required: (0.0, np.inf)}).items():
                found[node] = np.full(cells.count, ends[0]), np.full(cells.count, ends[1])
        names = [name for name in core.labels if name != REQUIRE]
        for cell in range(cells.count):
            self._effort.check()
            low, high = cells.limits(cell)
            wanted: dict[int, Bounds] = {}
            for place, name in enumerate(names):
                node = core.labels[name]
                wanted[node] = intersect(wanted.get(node, EVERYTHING), (float(low[place]), float(high[place])))
            wanted = {node: ends for node, ends in wanted.items() if ends != EVERYTHING}
            for node, ends in push_down(core, wanted).items():
                mine = found.get(node)
                if mine is None:
                    mine = found[node] = np.full(cells.count, -np.inf), np.full(cells.count, np.inf)
                mine[0][cell], mine[1][cell] = max(mine[0][cell], ends[0]), min(mine[1][cell], ends[1])
            if not cells.bounded:  # all cells want the same
                break
        return {node: found[node] for node in sorted(found)}

    def clauses(self, demands: Mapping[int, tuple[Array, Array]]) -> list[Clause]:
        return [Clause(node, self._objects(node), low, high) for node, (low, high) in demands.items()]

    def _objects(self, node: int) -> frozenset[int]:
        return frozenset(self._switches.get(row, owner(row)) for row in set_bits(self._reads[node]))

    def rows_read(self, clauses: Iterable[Clause | Pair]) -> frozenset[int]:
        """The free rows that some clause reads."""
        bits = 0
        for one in clauses:
            bits |= self._reads[one.node]
        return frozenset(set_bits(bits))

    def pair(self, clause: Clause) -> Pair | None:
        """The clause as a pair, where it is one: a lower end of a clearance or a distance, and nothing else."""
        form = offset_of(self._core.nodes, clause.node)
        if form is None:
            return None
        at, sign, constant = form
        low, high = (clause.low, clause.high) if sign > 0.0 else (-clause.high, -clause.low)
        if np.isfinite(high).any() or not np.isfinite(low).all():
            return None
        node = self._core.nodes[at]
        assert isinstance(node, Apply)
        if node.primitive == "gap":
            shapes = node.shapes[0], node.shapes[1]
            first, second = node.args[: len(FLAT)], node.args[len(FLAT) :]
            a, b = self._place(needed_args(first, shapes[0])), self._place(needed_args(second, shapes[1]))
        else:
            a, b, shapes = self._place(node.args[: len(PLACE)]), self._place(node.args[len(PLACE) :]), (POINT, POINT)
        if a is None or b is None or a == b or not (isinstance(a, int) or isinstance(b, int)):
            return None
        return Pair(clause.node, shapes, a, b, low - sign * constant)

    def _place(self, args: Sequence[int]) -> int | tuple[float, float, float] | None:
        """The object, or the fixed pose, that arguments x, y and heading are; None for anything else."""
        nodes = [self._core.nodes[arg] for arg in args]
        owners = {node.object for node in nodes if isinstance(node, Coord)}
        if len(owners) == 1 and all(isinstance(node, Coord) and node.axis == axis for axis, node in enumerate(nodes)):
            (thing,) = owners
            rows = [row_of(thing, axis) for axis in range(len(args))]
            if (self._problem.lowest[rows] < self._problem.highest[rows]).any():
                return thing
        values = [self._constant(node) for node in nodes]
        if any(value is None for value in values):
            return None
        x, y, *theta = (value for value in values if value is not None)
        return x, y, theta[0] if theta else 0.0

    def _constant(self, node: Node) -> float | None:
        lowest, highest = self._problem.lowest, self._problem.highest
        if isinstance(node, Coord) and lowest[node.row] == highest[node.row]:
            return float(lowest[node.row])
        return node.value if isinstance(node, Const) else None

    def choice(self, clause: Clause) -> Disjunction | None:
        """The clause as a choice, where it is a disjunction that says something before all of its objects are
        placed."""
        node = self._core.nodes[clause.node]
        if not isinstance(node, Junction) or len(clause.objects) < 2:
            return None
        if self._is_about_surfaces(clause):
            return None
        ways = []
        for arg in flat_args(self._core, clause.node):
            self._effort.check()
            whole = Clause(arg, self._objects(arg), clause.low, clause.high)
            ways.append(Way(whole, tuple(self.clauses(demands_of(self._core, whole)))))
        if len(clause.objects) <= MAX_LOCAL_OBJECTS and all(way.whole.objects == clause.objects for way in ways):
            return None
        return Disjunction(clause, tuple(self._possible_ways(ways) or ways), clause.objects)

    def _is_about_surfaces(self, clause: Clause) -> bool:
        """Whether a disjunction says on which surface an object stands, or what keeps two bodies clear of each other
        on each: the object is drawn so that the one holds, and so few bodies are scored as a whole."""
        reads = self._reads[clause.node]
        if not any(reads >> switch & 1 for switch in self._switches):
            return False
        bodies = {owner(row) for row in set_bits(reads) if row not in self._switches}
        if len(bodies) <= MAX_LOCAL_OBJECTS:
            return True
        ways = [self._reads[arg] for arg in flat_args(self._core, clause.node)]
        return any(
            all(way >> switch & 1 and way >> row_of(thing, X) & 1 for way in ways)
            for switch, thing in self._switches.items()
        )

    def switch_readers(self) -> frozenset[int]:
        """The nodes that read the switch of something that stands."""
        bits = sum(1 << switch for switch in self._switches)
        return frozenset(node for node, reads in enumerate(self._reads) if reads & bits)

    def _possible_ways(self, ways: Sequence[Way]) -> list[Way]:
        """The ways that contraction does not rule out in all cells."""
        problem, rows, everything = self._problem, list(self._problem.tape.rows), ways
        idle = [way for way in ways if not narrows_any(problem, way.clauses, rows)]
        gone = {id(way) for way in idle if not self._lies_in_bounds(way)}
        ways = [way for way in ways if all(way is not one for one in idle)]
        if not ways:
            return [way for way in everything if id(way) not in gone]
        wanted = [{one.node: (float(one.low.min()), float(one.high.max())) for one in way.clauses} for way in ways]
        shape = (len(problem.lowest), len(ways))
        box = [np.broadcast_to(ends[:, None], shape) for ends in (problem.lowest, problem.highest)]
        lo, hi = start(problem.tape, wanted, *box)
        tape = problem.tape
        nodes, number = restrict(tape.nodes, [tape.where[node] for ends in wanted for node in ends])
        old = list(number)
        alive = contract(nodes, lo[old], hi[old], self._rounds, effort=self._effort)
        gone |= {id(way) for way, possible in zip(ways, alive, strict=True) if not possible}
        return [way for way in everything if id(way) not in gone]

    def _lies_in_bounds(self, way: Way) -> bool:
        """Whether bounds over all poses leave a way open."""
        if self._bounds is None:
            with np.errstate(all="ignore"):
                self._bounds = node_bounds(self._core, self._problem.lowest, self._problem.highest, self._effort)
        ends = [(self._bounds[one.node], one) for one in way.clauses]
        return all(bound.lo <= one.high.max() and bound.hi >= one.low.min() for bound, one in ends)

    def box(self, clauses: Sequence[Clause]) -> tuple[Array, Array]:
        """What contraction by the clauses that every scene meets leaves of the box of poses, for each cell: (3N, C)."""
        problem, tape = self._problem, self._problem.tape
        count = problem.cells.count
        clauses = [one for one in clauses if narrows_any(problem, [one], list(tape.rows))]
        lowest = np.repeat(problem.lowest[:, None], count, axis=1)
        highest = np.repeat(problem.highest[:, None], count, axis=1)
        wanted = [{one.node: (float(one.low[cell]), float(one.high[cell])) for one in clauses} for cell in range(count)]
        lo, hi = start(tape, wanted, lowest, highest)
        nodes, number = restrict(tape.nodes, [*(tape.where[one.node] for one in clauses), *tape.rows.values()])
        old = list(number)
        lo, hi = lo[old], hi[old]
        alive = contract(nodes, lo, hi, self._rounds, effort=self._effort)
        for row, node in tape.rows.items():
            lowest[row] = np.where(alive, lo[number[node]], lowest[row])
            highest[row] = np.where(alive, hi[number[node]], highest[row])
        return lowest, highest


def demands_of(core: Core, clause: Clause) -> dict[int, tuple[Array, Array]]:
    """What a clause asks of the formula nodes below it, pushed down cell by cell: node -> ends, (C,) each."""
    count = len(clause.low)
    found: dict[int, tuple[Array, Array]] = {}
    for cell in range(count):
        for node, (low, high) in push_down(
            core, {clause.node: (float(clause.low[cell]), float(clause.high[cell]))}
        ).items():
            ends = found.setdefault(node, (np.full(count, -np.inf), np.full(count, np.inf)))
            ends[0][cell], ends[1][cell] = low, high
    return found


def narrows_any(problem: Problem, clauses: Iterable[Clause], rows: Sequence[int]) -> bool:
    """Whether contraction by some clauses may narrow some of these rows: not where they read them through clearances
    alone that narrow nothing."""
    tape = problem.tape
    mine, seen, idle = {tape.rows[row] for row in rows}, set[int](), False
    waiting = [tape.where[one.node] for one in clauses]
    while waiting:
        place = waiting.pop()
        if place in mine:
            return True
        if place in seen:
            continue
        seen.add(place)
        node = tape.nodes[place]
        if isinstance(node, Apply) and node.primitive == "gap" and not narrows_poses(node.shapes[0]):
            idle = True
        else:
            waiting += children(node)
    return not idle


Even = tuple[int, int, float]
"""One number, the mean of several of which it is one (nodes), and how near they must be."""


def add_implied_clauses(problem: Problem, effort: Effort) -> Problem:
    """The problem with what its formulas imply and touches fewer objects than they do; phi of every scene is the same
    but for rounding. Raises what `effort` raises."""
    core = add_implied_atoms(problem.core)
    if core is problem.core:
        return problem
    return replace(problem, core=core, tape=make_tape(core, problem.lowest, problem.highest, effort))


def add_implied_atoms(core: Core) -> Core:
    """The core with an atom more for every two numbers that a conjunction holds against their mean; the core itself
    where there are none.

    `evenlySpaced` holds every gap of a row against the mean of all gaps: none of it can be scored before the last
    object of the row is placed, and by then it is too late. But two gaps that are each within e of the mean are within
    2 e of each other, and that touches three or four objects. The margin e - |a - b| / 2 is at least the mean of the
    two, so never below the smaller one: to add it to their conjunction changes no value of phi.
    """
    nodes: list[Node] = []
    place: dict[int, int] = {}
    for old, node in enumerate(core.nodes):
        new = renumber(node, place)
        if isinstance(node, Junction) and isinstance(new, Junction) and node.kind == "min":
            more = _implied_atoms(core.nodes, node, place, nodes)
            new = replace(new, args=(*new.args, *more)) if more else new
        place[old] = len(nodes)
        nodes.append(new)
    if len(nodes) == len(core.nodes):
        return core
    labels = {name: place[node] for name, node in core.labels.items()}
    required = None if core.requirement is None else place[core.requirement]
    return Core(tuple(nodes), labels, core.objects, required)


def _implied_atoms(old: Sequence[Node], junction: Junction, place: dict[int, int], nodes: list[Node]) -> list[int]:
    """Atoms for the pairs of one conjunction, appended to the nodes."""
    found: dict[int, list[tuple[Even, Atom]]] = {}
    for arg in junction.args:
        atom = old[arg]
        if isinstance(atom, Atom) and (even := _even_gap(old, atom)) is not None:
            found.setdefault(even[1], []).append((even, atom))
    added = []
    for group in found.values():
        for number, (one, atom) in enumerate(group):
            for other, _ in group[:number]:
                begin = len(nodes)
                nodes += [
                    Const(0.5 * (one[2] + other[2])),
                    Const(0.5),
                    Apply("sub", (place[one[0]], place[other[0]])),
                    Apply("abs", (begin + 2,)),
                    Apply("mul", (begin + 3, begin + 1)),
                    Apply("sub", (begin, begin + 4)),
                    Atom(begin + 5, atom.text, atom.unit, atom.spans),
                ]
                added.append(begin + 6)
    return added


def _even_gap(nodes: Sequence[Node], atom: Atom) -> Even | None:
    """The atom as e - |number - mean|, where it is one, and the number one of several of which the mean is."""
    match nodes[atom.margin]:
        case Apply("sub", (limit, size)):
            match nodes[limit], nodes[size]:
                case Const(value), Apply("abs", (difference,)):
                    match nodes[difference]:
                        case Apply("sub", (number, mean)):
                            match nodes[mean]:
                                case Apply("mean", args) if number in args and len(args) > 2:
                                    return number, mean, value
    return None
