"""The core formula in the form that contraction works on.

A tape holds the same numbers as the core, up to rounding, but sums and differences are brought to one form: where two
objects meet in `x(b) - x(a)`, in `dist(a, b)` or in a clearance, they share one node, the difference of the two
coordinates. An interval on that node is what boxes of absolute poses cannot say: how the objects lie to each other.
Atoms are their margins; coordinates of objects that are held in place are constants.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from scenegen.arrays import Array, Bool, Index
from scenegen.geometry import PRIMITIVES, Interval
from scenegen.geometry.footprint import Circle
from scenegen.geometry.quantile import QUANTILE
from scenegen.lang.formula.core import (
    Apply,
    Atom,
    Const,
    Coord,
    Core,
    Junction,
    Node,
    TapeWriter,
    children,
    nodes_below,
)
from scenegen.lang.formula.interpret import Algebra, fold
from scenegen.search.effort import PYTHON_WORK, Effort, bounding_work

# A tape as intervals go over it, up from the coordinates and down from what is wanted: the nodes in batches, each of
# which only refers to earlier ones.
#
# On small arrays a call of numpy costs far more than the arithmetic. Forty boxes that do not overlap are 780 gaps of
# one kind: as one batch, their rule is called once, with the nodes as a further axis before that of the boxes. In
# small tapes each node is a batch.


BATCHED_NODES = 500  # nodes from which on batches are made; smaller tapes are walked node by node
MIN_BATCH_NODES = 4  # nodes that a batch must have on average: long chains of nodes gain nothing
ELEMENTS_IN_CACHE = 1 << 13  # nodes times boxes of one call: what a rule computes on the way stays in cache


@dataclass(frozen=True, slots=True)
class Batch:
    """Nodes of one primitive and the same footprints, of which any may be computed before any other: their places `at`
    (m,) and those of their arguments, `args` (n, m); or one node, and its arguments (n,)."""

    kind: Node
    at: Index | int
    args: Index

    def pieces(self, boxes: int, effort: Effort) -> Iterable[Batch]:
        """The batch in pieces that are worth a call each, for so many boxes; their work is counted."""
        if isinstance(self.at, int):
            effort.spend(bounding_work(self.kind, boxes))
            return (self,)
        return self._pieces(self.at, boxes, effort)

    def _pieces(self, places: Index, boxes: int, effort: Effort) -> Iterator[Batch]:
        size = max(1, ELEMENTS_IN_CACHE // max(1, boxes * max(1, len(self.args) // 8)))
        for begin in range(0, len(places), size):
            at = places[begin : begin + size]
            effort.spend(bounding_work(self.kind, len(at) * boxes))
            yield self if size >= len(places) else Batch(self.kind, at, self.args[:, begin : begin + size])

    def value(self, lo: Array, hi: Array) -> Interval:
        """The bounds of the nodes, (m, K) or (K,), from the intervals of all, (T, K)."""
        match self.kind:
            case Apply(primitive, _, shapes):
                return PRIMITIVES[primitive].interval(*shapes, *self._parts(lo, hi))
            case Junction("min"):
                return Interval(lo[self.args].min(axis=0), hi[self.args].min(axis=0))
            case Junction():
                return Interval(lo[self.args].max(axis=0), hi[self.args].max(axis=0))
        return Interval(lo[self.args[0]], hi[self.args[0]])

    def revise(self, lo: Array, hi: Array) -> None:
        """Narrow the intervals of the arguments, in place, to what those of the nodes leave."""
        result = Interval(lo[self.at], hi[self.at])
        if isinstance(self.kind, Junction):
            self._narrow(*_junction(self.kind.kind, result, lo[self.args], hi[self.args]), lo, hi)
        elif isinstance(self.kind, Apply):
            rule = PRIMITIVES[self.kind.primitive].backward
            if rule is not None:
                parts = self._parts(lo, hi)
                narrower = rule(*self.kind.shapes, result, *parts)
                # most rules leave some arguments, such as headings, as they are
                kept = [k for k, (new, old) in enumerate(zip(narrower, parts, strict=True)) if new is not old]
                if isinstance(self.at, int):
                    for k in kept:
                        np.fmax(parts[k].lo, narrower[k].lo, out=parts[k].lo)
                        np.fmin(parts[k].hi, narrower[k].hi, out=parts[k].hi)
                elif kept:
                    low, high = (np.stack([narrower[k][end] for k in kept]) for end in (0, 1))
                    Batch(self.kind, self.at, self.args[kept])._narrow(low, high, lo, hi)

    def _parts(self, lo: Array, hi: Array) -> tuple[Interval, ...]:
        return tuple([Interval(lo[arg], hi[arg]) for arg in self.args])

    def _narrow(self, low: Array, high: Array, lo: Array, hi: Array) -> None:
        """Meet the intervals of the arguments with low and high, (n, m, K) or (n, K); several may be of one place."""
        flat = self.args.ravel()
        order = np.argsort(flat, kind="stable")
        place = flat[order]
        starts = np.flatnonzero(np.concatenate([[True], place[1:] != place[:-1]]))
        place = place[starts]
        low, high = low.reshape(len(flat), -1)[order], high.reshape(len(flat), -1)[order]
        lo[place] = np.fmax(lo[place], np.fmax.reduceat(low, starts, axis=0))
        hi[place] = np.fmin(hi[place], np.fmin.reduceat(high, starts, axis=0))


def _junction(kind: str, result: Interval, low: Array, high: Array) -> tuple[Array, Array]:
    """What is left of the parts, (n, m, K) or (n, K) each, of junctions (m, K); see interval.back_minimum."""
    shape = low.shape
    if kind == "min":
        can = low <= result.hi
        return np.broadcast_to(result.lo, shape), np.where(can.sum(axis=0) == can, result.hi, np.inf)
    can = high >= result.lo
    return np.where(can.sum(axis=0) == can, result.lo, -np.inf), np.broadcast_to(result.hi, shape)


@dataclass(frozen=True, slots=True)
class BatchedTape:
    """A tape in the order of its batches; `places` and `values` (C,) are those of its constants, `coords` the places of
    the coordinates. Methods change intervals lo, hi (T, K) in place, and raise what `effort` raises."""

    places: Index
    values: Array
    coords: Index
    batches: tuple[Batch, ...]

    def bounds(self, lo: Array, hi: Array, effort: Effort, known: Bool | None = None) -> None:
        """The bounds of all nodes from those of the coordinates; what is `known` (T,) is met with the old interval."""
        lo[self.places] = hi[self.places] = self.values[:, None]
        for batch in self.batches:
            for piece in batch.pieces(lo.shape[1], effort):
                low, high = piece.value(lo, hi)
                if known is not None and known[piece.at].any():
                    met = known[piece.at, None]
                    low = np.where(met, np.fmax(low, lo[piece.at]), low)
                    high = np.where(met, np.fmin(high, hi[piece.at]), high)
                lo[piece.at], hi[piece.at] = low, high

    def meet_up(self, lo: Array, hi: Array, effort: Effort) -> None:
        """Meet every node's interval with the bounds of its arguments."""
        lo[self.places] = np.fmax(lo[self.places], self.values[:, None])
        hi[self.places] = np.fmin(hi[self.places], self.values[:, None])
        for batch in self.batches:
            for piece in batch.pieces(lo.shape[1], effort):
                low, high = piece.value(lo, hi)
                lo[piece.at] = np.fmax(lo[piece.at], low)
                hi[piece.at] = np.fmin(hi[piece.at], high)

    def meet_down(self, lo: Array, hi: Array, effort: Effort) -> None:
        """Meet every argument's interval with what the nodes that use it leave."""
        for batch in reversed(self.batches):
            for piece in batch.pieces(lo.shape[1], effort):
                piece.revise(lo, hi)


def one_by_one(nodes: Sequence[Node]) -> BatchedTape:
    """A tape in which each node is a batch."""
    leaves = [isinstance(node, Const | Coord) for node in nodes]
    alone = tuple([Batch(nodes[at], at, _index(children(nodes[at]))) for at, leaf in enumerate(leaves) if not leaf])
    return _in_batches(nodes, alone)


def make_batches(nodes: Sequence[Node], fewest: int = BATCHED_NODES, worth: float = MIN_BATCH_NODES) -> BatchedTape:
    """The batches of a tape: one by one for fewer nodes than `fewest`, or fewer than `worth` in a batch on average."""
    if len(nodes) < fewest:
        return one_by_one(nodes)
    depth = [0] * len(nodes)
    members: dict[tuple[int, Hashable], list[int]] = {}
    for index, node in enumerate(nodes):
        match node:
            case Const() | Coord():
                continue
            case Apply(primitive, args, shapes):
                key: Hashable = (primitive, len(args), shapes)
            case Junction(kind, args):
                key = (kind, len(args))
            case Atom():
                key = "atom"
        depth[index] = 1 + max(depth[arg] for arg in children(node))
        members.setdefault((depth[index], key), []).append(index)
    if len(members) * worth > len(nodes):
        return one_by_one(nodes)
    batches = tuple(
        Batch(nodes[found[0]], _index(found), np.array([children(nodes[one]) for one in found], dtype=np.intp).T)
        for (_, _), found in sorted(members.items(), key=lambda item: (item[0][0], item[1][0]))
    )
    return _in_batches(nodes, batches)


def _in_batches(nodes: Sequence[Node], batches: tuple[Batch, ...]) -> BatchedTape:
    constants = [index for index, node in enumerate(nodes) if isinstance(node, Const)]
    values = np.array([node.value for node in nodes if isinstance(node, Const)], dtype=np.float64)
    coords = [index for index, node in enumerate(nodes) if isinstance(node, Coord)]
    return BatchedTape(_index(constants), values, _index(coords), batches)


def _index(values: Sequence[int]) -> Index:
    return np.array(values, dtype=np.intp)


MAX_SUM_TERMS = 8  # terms that a sum may have before it counts as one opaque number; keeps the work linear

MAX_LOOPS = 100
POLYGON_VISITS = 5  # visits of nodes that a footprint with corners adds to what a primitive costs


@dataclass(frozen=True, slots=True)
class AffineForm:
    """constant + sum of coefficient times node: how a number depends on coordinates and on opaque numbers."""

    constant: float
    terms: tuple[tuple[int, float], ...] = ()

    def plus(self, other: AffineForm, factor: float = 1.0) -> AffineForm:
        terms = dict(self.terms)
        for node, coefficient in other.terms:
            terms[node] = terms.get(node, 0.0) + factor * coefficient
        kept = tuple((node, value) for node, value in sorted(terms.items()) if value != 0.0)
        return AffineForm(self.constant + factor * other.constant, kept)

    def times(self, factor: float) -> AffineForm:
        if factor == 0.0:
            return AffineForm(0.0)
        return AffineForm(self.constant * factor, tuple((node, value * factor) for node, value in self.terms))


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
    three objects, two differences add up to the third. `crowded` are the nodes that depend on primitives of any number
    of things, `middles` the coordinates that quantiles are relative to. `batches` are the nodes as intervals go over
    them; `contracted` are boxes that `contract_box` keeps."""

    nodes: tuple[Node, ...]
    where: tuple[int, ...]
    rows: dict[int, int]
    differences: dict[int, tuple[int, int]]
    affine: dict[int, int]
    loops: tuple[int, ...]
    batches: BatchedTape
    crowded: frozenset[int] = frozenset()
    middles: frozenset[int] = frozenset()
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


@dataclass(slots=True)
class _TapeBuilder(TapeWriter):
    """Also knows which nodes are differences of rows, and which depend on one of these or a coordinate alone."""

    differences: dict[int, tuple[int, int]] = field(default_factory=dict)
    affine: dict[int, int] = field(default_factory=dict)

    def constant(self, value: float) -> int:
        return self.add(Const(value))

    def write(self, form: AffineForm) -> int:
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

    def _with_differences(self, form: AffineForm) -> list[tuple[int, float]]:
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
    crowded: set[int] = set()
    given: set[int] = set()
    for at, node in enumerate(nodes):
        if isinstance(node, Apply) and node.primitive == QUANTILE:
            given.update(node.args[2:])
        if (isinstance(node, Apply) and PRIMITIVES[node.primitive].crowd) or (
            crowded and not crowded.isdisjoint(children(node))
        ):
            crowded.add(at)
    batches = make_batches(nodes)
    middles = (
        frozenset([at for at in nodes_below(nodes, given) if isinstance(nodes[at], Coord)]) if given else frozenset()
    )
    return Tape(
        nodes, where, algebra.rows, writer.differences, writer.affine, loops, batches, frozenset(crowded), middles
    )


class _Forms(Algebra[AffineForm]):
    """Nodes as forms of what `writer` has written; `where` and `rows` are the tape's."""

    def __init__(self, lowest: Array, highest: Array, effort: Effort) -> None:
        self._lowest, self._highest, self._effort = lowest, highest, effort
        self.writer = _TapeBuilder()
        self.where: list[int] = []
        self.rows: dict[int, int] = {}

    def constant(self, index: int, node: Const) -> AffineForm:
        return self._finish(node, AffineForm(node.value))

    def coordinate(self, index: int, node: Coord) -> AffineForm:
        if self._lowest[node.row] == self._highest[node.row]:
            return self._finish(node, AffineForm(float(self._lowest[node.row])))
        place = self.rows[node.row] = self.writer.add(Coord(node.object, node.axis))
        return self._finish(node, AffineForm(0.0, ((place, 1.0),)))

    def apply(self, index: int, node: Apply, args: list[AffineForm]) -> AffineForm:
        return self._finish(node, _apply(self.writer, node, args))

    def atom(self, index: int, node: Atom, margin: AffineForm) -> AffineForm:
        self._effort.spend(PYTHON_WORK * 2)
        margin = self._short(margin)
        self.where.append(self.writer.write(margin))
        return margin

    def junction(self, index: int, node: Junction, args: list[AffineForm]) -> AffineForm:
        self._effort.spend(PYTHON_WORK * (1 + len(node.args)))
        place = self.writer.add(Junction(node.kind, tuple([self.where[arg] for arg in node.args]), node.text))
        self.where.append(place)
        return AffineForm(0.0, ((place, 1.0),))

    def _finish(self, node: Node, form: AffineForm) -> AffineForm:
        """The form of a number, of which the tape has no place of its own."""
        self._effort.spend(PYTHON_WORK * (1 + len(children(node))))
        self.where.append(-1)
        return self._short(form)

    def _short(self, form: AffineForm) -> AffineForm:
        return AffineForm(0.0, ((self.writer.write(form), 1.0),)) if len(form.terms) > MAX_SUM_TERMS else form


def weight(nodes: Sequence[Node]) -> int:
    """What it costs to visit nodes once, in visits of simple ones."""
    return len(nodes) + POLYGON_VISITS * sum(
        sum(not isinstance(shape, Circle) for shape in node.shapes) for node in nodes if isinstance(node, Apply)
    )


def _loops(writer: _TapeBuilder, effort: Effort) -> tuple[int, ...]:
    """A node (a - b) + (b - c) - (a - c) for every three rows whose differences all occur, up to a number."""
    node = {pair: index for index, pair in writer.differences.items()}
    after: dict[int, list[int]] = {}
    for a, b in sorted(node):
        after.setdefault(a, []).append(b)
    found: list[int] = []
    for (a, b), first in sorted(node.items()):
        effort.spend(PYTHON_WORK)
        for c in after.get(b, ()):
            if (a, c) in node:
                both = writer.add(Apply("add", (first, node[b, c])))
                found.append(writer.add(Apply("sub", (both, node[a, c]))))
                if len(found) >= MAX_LOOPS:
                    return tuple(found)
    return tuple(found)


def _apply(writer: _TapeBuilder, node: Apply, args: list[AffineForm]) -> AffineForm:
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
    primitive = PRIMITIVES[node.primitive]
    if primitive.relative:
        args = list(args)
        for first, second in zip(*primitive.places, strict=True):
            args[first], args[second] = args[first].plus(args[second], -1.0), AffineForm(0.0)
    return AffineForm(0.0, ((writer.add(Apply(node.primitive, tuple(map(writer.write, args)), node.shapes)), 1.0),))
