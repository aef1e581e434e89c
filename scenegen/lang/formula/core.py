"""The core formula: what the checker leaves of a spec, and what every reader walks.

A core is a tape. A node refers only to nodes before it, so a reader is one loop over `nodes`, without recursion, and a
sub-formula that occurs twice is stored and computed once. Numbers are Const, Coord and Apply; formulas are Atom (a
margin: satisfied where it is >= 0) and Junction (hard min or max of formulas). Negation is already pushed to the atoms.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Literal

from scenegen.errors import Span
from scenegen.geometry.footprint import Footprint
from scenegen.geometry.primitives import Unit
from scenegen.geometry.quantile import QUANTILE
from scenegen.pose import SIZE


@dataclass(frozen=True, slots=True)
class Const:
    value: float


@dataclass(frozen=True, slots=True)
class Coord:
    """Row `row_of(object, axis)` of (3N, B) storage; `axis` is an index of scenegen.pose.AXES."""

    object: int
    axis: int

    @property
    def row(self) -> int:
        return SIZE * self.object + self.axis  # row_of, without a call: readers ask for it at every node


@dataclass(frozen=True, slots=True)
class Apply:
    """A primitive of PRIMITIVES applied to numbers, and to the footprints `shapes` before them, if any."""

    primitive: str
    args: tuple[int, ...]
    shapes: tuple[Footprint, ...] = ()


@dataclass(frozen=True, slots=True)
class Atom:
    """phi of an atom is the number at `margin`. `text` says what it is; `spans` where: the relation's use first, then
    outwards through the definitions that it was expanded from."""

    margin: int
    text: str
    unit: Unit
    spans: tuple[Span, ...]


@dataclass(frozen=True, slots=True)
class Junction:
    """Conjunction ("min") or disjunction ("max") of at least two formulas; `text` names the definition it came from."""

    kind: Literal["min", "max"]
    args: tuple[int, ...]
    text: str = ""


@dataclass(frozen=True, slots=True)
class Window:
    """The least ("min") or largest ("max") value of a formula at the moments t + lowest to t + highest, both included;
    moments after the last do not take part, and the least of none is infinity."""

    kind: Literal["min", "max"]
    arg: int
    lowest: int
    highest: int
    text: str = ""


@dataclass(frozen=True, slots=True)
class BoundedUntil:
    """The largest value ("max"), over the moments t' from t + lowest to t + highest, of the minimum of `right` at t'
    and of `left` from t to before t'; where it is `closed`, to t' itself. "min" is its dual: minimum and maximum change
    places everywhere."""

    kind: Literal["min", "max"]
    left: int
    right: int
    lowest: int
    highest: int
    closed: bool
    text: str = ""


@dataclass(frozen=True, slots=True)
class Moment:
    """The value of a formula at the first or at the last moment, whatever t is; "steps": its value at t, but at moment
    0, before which there is no step, infinity."""

    which: Literal["first", "last", "steps"]
    arg: int
    text: str = ""


@dataclass(frozen=True, slots=True)
class Everywhere:
    """A formula that holds at every moment, with infinity, or at none, with minus infinity."""

    holds: bool


Temporal = Window | BoundedUntil | Moment | Everywhere
"""Formulas over time. Only the core of a spec over time has them; scenegen.lang.formula.timed takes them out of it, and
no reader of a core formula ever meets one."""


@dataclass(frozen=True, slots=True)
class Variable:
    """The numbers that a variable of a quantifier stands for, all at once. Only a builder has it: in no core is one."""

    name: str


Node = Const | Coord | Apply | Atom | Junction | Temporal | Variable


@dataclass(frozen=True, slots=True)
class Core:
    """`labels` maps each label, in order, to its formula's node; `objects` names the N objects in storage order.

    `requirement` is the node of what holds in every scene (the conjunction of all `require` statements), if there is
    any: it is no part of phi.
    """

    nodes: tuple[Node, ...]
    labels: Mapping[str, int]
    objects: tuple[str, ...]
    requirement: int | None = None


@dataclass(slots=True)
class TapeWriter:
    """Collects nodes, each only once; `number` maps them to their places."""

    nodes: list[Node] = field(default_factory=list)
    number: dict[Node, int] = field(default_factory=dict)

    def add(self, node: Node) -> int:
        """The place of a node."""
        index = self.number.get(node)
        if index is None:
            index = self.number[node] = len(self.nodes)
            self.nodes.append(node)
        return index


REQUIRE = "require"  # a keyword, so no label of a spec has this name


def gate(core: Core) -> Core:
    """The core with its requirement as one label more, the last: what samplers hold every scene against."""
    if core.requirement is None:
        return core
    return replace(core, labels={**core.labels, REQUIRE: core.requirement}, requirement=None)


def is_coordinate(nodes: Sequence[Node], index: int) -> bool:
    """Whether a node is a coordinate: of storage, or one with a prior as samplers write it, alone or added to what it
    is relative to."""
    node = nodes[index]
    if isinstance(node, Coord):
        return True
    if isinstance(node, Apply) and node.primitive == "add":
        node = nodes[node.args[1]]
    return isinstance(node, Apply) and node.primitive == QUANTILE


def needed_nodes(core: Core) -> set[int]:
    """The nodes that phi of any label depends on."""
    return nodes_below(core.nodes, core.labels.values())


def read_rows(core: Core) -> set[int]:
    """The rows of (3N, B) storage that phi of any label depends on."""
    nodes = [core.nodes[index] for index in needed_nodes(core)]
    return {node.row for node in nodes if isinstance(node, Coord)}


def nodes_below(nodes: Sequence[Node], wanted: Iterable[int]) -> set[int]:
    """The nodes that the wanted ones are computed from, themselves included."""
    found, waiting = set[int](), list(wanted)
    while waiting:
        index = waiting.pop()
        if index not in found:
            found.add(index)
            waiting.extend(children(nodes[index]))
    return found


def restrict(nodes: Sequence[Node], wanted: Iterable[int]) -> tuple[tuple[Node, ...], dict[int, int]]:
    """The nodes that the wanted ones are computed from as a tape of their own, and the new number of each, in order."""
    place = {old: new for new, old in enumerate(sorted(nodes_below(nodes, wanted)))}
    return tuple([renumber(nodes[old], place) for old in place]), place


def part_of(core: Core, labels: Sequence[str]) -> Core:
    """The core of some of its labels: what they do not need is left out, the order of the rest is kept."""
    nodes, place = restrict(core.nodes, [core.labels[name] for name in labels])
    return Core(nodes, {name: place[core.labels[name]] for name in labels}, core.objects)


def renumber(node: Node, place: Mapping[int, int]) -> Node:
    """The node of a tape whose nodes have got other numbers."""
    if isinstance(node, Apply):
        return Apply(node.primitive, tuple([place[arg] for arg in node.args]), node.shapes)
    if isinstance(node, Atom):
        return Atom(place[node.margin], node.text, node.unit, node.spans)
    if isinstance(node, Junction):
        return Junction(node.kind, tuple([place[arg] for arg in node.args]), node.text)
    if isinstance(node, Window | Moment):
        return replace(node, arg=place[node.arg])
    if isinstance(node, BoundedUntil):
        return replace(node, left=place[node.left], right=place[node.right])
    return node


def atoms_below(core: Core, root: int) -> list[int]:
    """The atoms below a formula, each once, in the order of the formula."""
    found, seen, waiting = list[int](), set[int](), [root]
    while waiting:
        index = waiting.pop()
        if index in seen:
            continue
        seen.add(index)
        node = core.nodes[index]
        if isinstance(node, Atom):
            found.append(index)
        elif isinstance(node, Junction):
            waiting.extend(reversed(node.args))
    return found


def children(node: Node) -> Sequence[int]:
    """The nodes that a node is computed from."""
    if isinstance(node, Apply | Junction):
        return node.args
    if isinstance(node, Atom):
        return (node.margin,)
    if isinstance(node, Window | Moment):
        return (node.arg,)
    return (node.left, node.right) if isinstance(node, BoundedUntil) else ()


def last_uses(core: Core, instead: Mapping[int, Sequence[int]] = MappingProxyType({})) -> list[list[int]]:
    """For every node, the nodes whose value nobody needs after it: what a reader may free to keep memory small.
    Nodes in `instead` are computed from those, not from their children."""
    keep = {*core.labels.values(), core.requirement}
    last = {}
    for index, node in enumerate(core.nodes):
        for child in instead.get(index, children(node)):
            last[child] = index
    dead: list[list[int]] = [[] for _ in core.nodes]
    for child, index in last.items():
        if child not in keep:
            dead[index].append(child)
    return dead
