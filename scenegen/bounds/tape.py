"""The core formula in the form that contraction works on.

A tape holds the same numbers as the core, up to rounding, but sums and differences are brought to one form: where two
objects meet in `x(b) - x(a)`, in `dist(a, b)` or in a clearance, they share one node, the difference of the two
coordinates. An interval on that node is what boxes of absolute poses cannot say: how the objects lie to each other.
Atoms are their margins; coordinates of objects that are held in place are constants.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from scenegen.bounds.batches import Batches, make_batches
from scenegen.bounds.effort import PYTHON, Effort
from scenegen.lang.core import Apply, Atom, Const, Coord, Core, Junction, Node, children
from scenegen.lang.fold import Algebra, fold
from scenegen.primitives.footprint import Circle

Array = npt.NDArray[np.float64]

LONGEST = 8  # terms that a sum may have before it counts as one opaque number; keeps the work linear

MOST_LOOPS = 100
POLYGON = 5  # visits of nodes that a footprint with corners adds to what a primitive costs

# Primitives that depend on where two places lie to each other only: the arguments that are (x, y) of each.
RELATIVE: dict[str, tuple[tuple[int, int], tuple[int, int]]] = {
    "dist": ((0, 1), (2, 3)),
    "bearing": ((0, 1), (2, 3)),
    "gap": ((0, 1), (3, 4)),
    "room": ((0, 1), (3, 4)),
}


@dataclass(frozen=True, slots=True)
class Form:
    """constant + sum of coefficient times node: how a number depends on coordinates and on opaque numbers."""

    constant: float
    terms: tuple[tuple[int, float], ...] = ()

    def plus(self, other: Form, factor: float = 1.0) -> Form:
        terms = dict(self.terms)
        for node, coefficient in other.terms:
            terms[node] = terms.get(node, 0.0) + factor * coefficient
        kept = tuple((node, value) for node, value in sorted(terms.items()) if value != 0.0)
        return Form(self.constant + factor * other.constant, kept)

    def times(self, factor: float) -> Form:
        if factor == 0.0:
            return Form(0.0)
        return Form(self.constant * factor, tuple((node, value * factor) for node, value in self.terms))


@dataclass(frozen=True, slots=True)
class Contracted:
    """The intervals lo, hi of all nodes, (T,) each, that contraction leaves of one box; whether it may hold a solution;
    and the work of finding that. Others may have it, too: copy what you change."""

    lo: Array
    hi: Array
    alive: bool
    work: float


@dataclass(frozen=True, slots=True)
class Tape:
    """`where[i]` is the tape's node with the value of core node i. `rows` maps a storage row to its node;
    `differences` maps a node to the two rows (a, b) of which it is a - b. `affine` maps nodes that depend on one
    coordinate or one difference alone, and linearly, to that node. `loops` are nodes that are 0 in every scene: of
    three objects, two differences add up to the third. `batches` are those of a large tape; `contracted` are boxes that
    `contract_box` keeps."""

    nodes: tuple[Node, ...]
    where: tuple[int, ...]
    rows: dict[int, int]
    differences: dict[int, tuple[int, int]]
    affine: dict[int, int]
    loops: tuple[int, ...]
    batches: Batches | None = None
    contracted: dict[Hashable, Contracted] = field(default_factory=dict, compare=False, repr=False)

    def support(self, node: int) -> frozenset[int]:
        """The coordinates and differences that a node is computed from; what is below a difference is not looked at."""
        found: set[int] = set()
        seen: set[int] = set()
        stack = [node]
        while stack:
            index = stack.pop()
            if index in seen:
                continue
            seen.add(index)
            if index in self.differences or isinstance(self.nodes[index], Coord):
                found.add(index)
            else:
                stack.extend(children(self.nodes[index]))
        return frozenset(found)

    def restrict(self, wanted: Sequence[int]) -> tuple[tuple[Node, ...], dict[int, int]]:
        """The nodes that the wanted ones are computed from, renumbered, and the new number of each old one."""
        keep: set[int] = set()
        stack = list(wanted)
        while stack:
            index = stack.pop()
            if index not in keep:
                keep.add(index)
                stack.extend(children(self.nodes[index]))
        number = {old: new for new, old in enumerate(sorted(keep))}
        nodes = []
        for old in number:
            node = self.nodes[old]
            if isinstance(node, Apply):
                node = Apply(node.primitive, tuple(number[arg] for arg in node.args), node.shapes)
            elif isinstance(node, Junction):
                node = Junction(node.kind, tuple(number[arg] for arg in node.args), node.text)
            nodes.append(node)
        return tuple(nodes), number


@dataclass(slots=True)
class _Writer:
    """Collects nodes, each only once."""

    nodes: list[Node] = field(default_factory=list)
    number: dict[Node, int] = field(default_factory=dict)
    differences: dict[int, tuple[int, int]] = field(default_factory=dict)
    affine: dict[int, int] = field(default_factory=dict)

    def add(self, node: Node) -> int:
        index = self.number.get(node)
        if index is None:
            index = self.number[node] = len(self.nodes)
            self.nodes.append(node)
        return index

    def constant(self, value: float) -> int:
        return self.add(Const(value))

    def write(self, form: Form) -> int:
        """The node with the value of a form."""
        terms = self._with_differences(form)
        if not terms:
            return self.constant(form.constant)
        value = self._term(*terms[0], alone=True)
        for node, coefficient in terms[1:]:
            if coefficient < 0.0:
                value = self.add(Apply("sub", (value, self._term(node, -coefficient))))
            else:
                value = self.add(Apply("add", (value, self._term(node, coefficient))))
        if form.constant != 0.0:
            value = self.add(Apply("add", (value, self.constant(form.constant))))
        (node, _), *others = terms
        if not others and (node in self.differences or isinstance(self.nodes[node], Coord)):
            self.affine[value] = node
        return value

    def _term(self, node: int, coefficient: float, alone: bool = False) -> int:
        if coefficient == 1.0:
            return node
        if coefficient == -1.0 and alone:
            return self.add(Apply("neg", (node,)))
        return self.add(Apply("mul", (self.constant(coefficient), node)))

    def _with_differences(self, form: Form) -> list[tuple[int, float]]:
        """The terms of a form; two coordinates along one axis that are subtracted become their difference."""
        coords: list[tuple[Coord, int, float]] = []
        rest: list[tuple[int, float]] = []
        for node, coefficient in form.terms:
            at = self.nodes[node]
            if isinstance(at, Coord):
                coords.append((at, node, coefficient))
            else:
                rest.append((node, coefficient))
        coords.sort(key=lambda item: item[0].row)
        found: list[tuple[int, float]] = []
        while coords:
            first, node, coefficient = coords.pop(0)
            for position, (second, other, weight) in enumerate(coords):
                if second.axis == first.axis and weight == -coefficient:
                    pair = self.add(Apply("sub", (node, other)))
                    self.differences[pair] = (first.row, second.row)
                    found.append((pair, coefficient))
                    del coords[position]
                    break
            else:
                found.append((node, coefficient))
        return found + rest


def make_tape(core: Core, lowest: Array, highest: Array, effort: Effort | None = None) -> Tape:
    """The tape of a core over boxes within lowest..highest (3N,); rows whose ends are equal become constants.

    Raises what `effort` raises.
    """
    effort = Effort() if effort is None else effort
    algebra = _Forms(lowest, highest, effort)
    fold(core.nodes, algebra)
    writer = algebra.writer
    loops = _loops(writer, effort)
    nodes = tuple(writer.nodes)
    where = tuple(algebra.where)
    return Tape(nodes, where, algebra.rows, writer.differences, writer.affine, loops, make_batches(nodes))


class _Forms(Algebra[Form]):
    """Nodes as forms of what `writer` has written; `where` and `rows` are the tape's."""

    def __init__(self, lowest: Array, highest: Array, effort: Effort) -> None:
        self._lowest, self._highest, self._effort = lowest, highest, effort
        self.writer = _Writer()
        self.where: list[int] = []
        self.rows: dict[int, int] = {}

    def constant(self, index: int, node: Const) -> Form:
        return self._done(node, Form(node.value))

    def coordinate(self, index: int, node: Coord) -> Form:
        if self._lowest[node.row] == self._highest[node.row]:
            return self._done(node, Form(float(self._lowest[node.row])))
        place = self.rows[node.row] = self.writer.add(Coord(node.object, node.axis))
        return self._done(node, Form(0.0, ((place, 1.0),)))

    def apply(self, index: int, node: Apply, args: list[Form]) -> Form:
        return self._done(node, _apply(self.writer, node, args))

    def atom(self, index: int, node: Atom, margin: Form) -> Form:
        self._effort.spend(PYTHON * 2)
        margin = self._short(margin)
        self.where.append(self.writer.write(margin))
        return margin

    def junction(self, index: int, node: Junction, args: list[Form]) -> Form:
        self._effort.spend(PYTHON * (1 + len(node.args)))
        place = self.writer.add(Junction(node.kind, tuple([self.where[arg] for arg in node.args]), node.text))
        self.where.append(place)
        return Form(0.0, ((place, 1.0),))

    def _done(self, node: Node, form: Form) -> Form:
        """The form of a number, of which the tape has no place of its own."""
        self._effort.spend(PYTHON * (1 + len(children(node))))
        self.where.append(-1)
        return self._short(form)

    def _short(self, form: Form) -> Form:
        return Form(0.0, ((self.writer.write(form), 1.0),)) if len(form.terms) > LONGEST else form


def weight(nodes: Sequence[Node]) -> int:
    """What it costs to visit nodes once, in visits of simple ones."""
    return len(nodes) + POLYGON * sum(
        sum(not isinstance(shape, Circle) for shape in node.shapes) for node in nodes if isinstance(node, Apply)
    )


def _loops(writer: _Writer, effort: Effort) -> tuple[int, ...]:
    """A node (a - b) + (b - c) - (a - c) for every three rows whose differences all occur, up to a number."""
    node = {pair: index for index, pair in writer.differences.items()}
    after: dict[int, list[int]] = {}
    for a, b in sorted(node):
        after.setdefault(a, []).append(b)
    found: list[int] = []
    for (a, b), first in sorted(node.items()):
        effort.spend(PYTHON)
        for c in after.get(b, ()):
            if (a, c) in node:
                both = writer.add(Apply("add", (first, node[b, c])))
                found.append(writer.add(Apply("sub", (both, node[a, c]))))
                if len(found) >= MOST_LOOPS:
                    return tuple(found)
    return tuple(found)


def _apply(writer: _Writer, node: Apply, args: list[Form]) -> Form:
    """The form of a primitive applied to forms: sums stay open, everything else becomes a node."""
    match node.primitive, args:
        case "add", [a, b]:
            return a.plus(b)
        case "sub", [a, b]:
            return a.plus(b, -1.0)
        case "neg", [a]:
            return a.times(-1.0)
        case "mul", [a, b] if not a.terms:
            return b.times(a.constant)
        case "mul", [a, b] if not b.terms:
            return a.times(b.constant)
        case "div", [a, b] if not b.terms and b.constant != 0.0:
            return a.times(1.0 / b.constant)
    if node.primitive in RELATIVE:
        args = list(args)
        for first, second in zip(*RELATIVE[node.primitive], strict=True):
            args[first], args[second] = args[first].plus(args[second], -1.0), Form(0.0)
    return Form(0.0, ((writer.add(Apply(node.primitive, tuple(map(writer.write, args)), node.shapes)), 1.0),))
