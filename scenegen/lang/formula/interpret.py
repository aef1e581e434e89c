"""The core formula, evaluated node by node over any array namespace.

With plain floats this is the oracle that the tests hold every other reader against; with numpy it scores scene files
without torch. The least of many gaps, of which only few can be the least, is found by an index, which torch and motions
use, too.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial, reduce
from typing import Any, Protocol, TypeVar, cast

import numpy as np
import numpy.typing as npt

from scenegen.arrays import Index
from scenegen.errors import Diagnostic, Span
from scenegen.errors.declarations import HEADING_COMPARED
from scenegen.geometry import MATH, NUMPY, PRIMITIVES, Namespace
from scenegen.geometry.footprint import Circle, Footprint, measures
from scenegen.geometry.namespace import turning
from scenegen.geometry.primitives import argument_kinds
from scenegen.lang.formula.capped import NO_CAPPED, CappedMinima, CappedNumbers, find_capped
from scenegen.lang.formula.core import (
    Apply,
    Atom,
    Const,
    Coord,
    Core,
    Junction,
    Node,
    children,
    is_coordinate,
    last_uses,
)
from scenegen.pose import FLAT, PLACE, THETA, owner, rows_along

# The least of many gaps, of which only those are computed that can be the least.
#
# `noOverlap()` of N objects is the minimum of N (N - 1) / 2 gaps. The gap of two footprints lies between the distance
# of their centres less both outer radii and that distance less both inner radii: discs round the centres, around the
# footprints and within them. So in any scene only pairs whose distance is near the least can decide. Distances cost a
# tenth of gaps: they are computed for all pairs and scenes, gaps for what is left. The least is the same number, bit
# for bit. Numbers are arrays of numpy; what computes a gap is given, so that tensors go the same way.


AnyArray = npt.NDArray[Any]
Gap = Callable[..., Any]
"""gap(*shapes, *six arrays of one length): x, y and heading of both."""

FEWEST_GAPS, DOZEN = 30, 12  # gaps of a minimum, and for each pair of shapes; fewer are computed without detours
SEVERAL = 2  # scenes from which on gaps are left out
BLOCK, FEWEST_SCENES = 1 << 16, 64  # distances computed at a time, which stay in cache; and scenes, at least


@dataclass(frozen=True, slots=True)
class Alike:
    """The pairs of two shapes from whose gaps the same is taken off, and the inner and outer radii of both shapes
    together, with that."""

    shapes: tuple[Footprint, ...]
    less: float
    inner: float
    outer: float
    pairs: slice


@dataclass(frozen=True, slots=True, eq=False)
class NearestPairs:
    """The P gaps of one minimum: the nodes of x, y and heading of both places, `args` (6, P), and the `atoms` (P,).
    `others` are the other arguments of the minimum, `within` the nodes that need no values of their own."""

    args: Index
    atoms: Index
    alike: tuple[Alike, ...]
    others: tuple[int, ...]
    within: frozenset[int]

    @property
    def places(self) -> list[int]:
        """The nodes whose values the gaps are computed from."""
        return [int(node) for node in np.unique(self.args)]


@dataclass(frozen=True, slots=True)
class GapMinima:
    """The minima of a tape that are worth it, by node, and the nodes whose values nobody needs."""

    by_node: Mapping[int, NearestPairs]
    skipped: frozenset[int]
    capped: CappedMinima = NO_CAPPED  # for numpy alone

    @property
    def absent(self) -> int:
        """How many nodes have no values of their own in numpy."""
        return len(self.skipped | self.capped.skipped)

    def last_uses(self, core: Core) -> list[list[int]]:
        """last_uses(core), where gaps are computed with their minimum."""
        instead: dict[int, Sequence[int]] = dict.fromkeys(self.skipped, ())
        return last_uses(core, instead | {index: (*one.others, *one.places) for index, one in self.by_node.items()})


def find_groups(
    core: Core, needed: Collection[int], fewest: int = FEWEST_GAPS, dozen: int = DOZEN, *, fixed: bool = False
) -> GapMinima:
    """The minima of a tape where the values of the nodes `needed` will be read, and no others. Those of fewer gaps than
    `fewest`, or than `dozen` for each pair of shapes, are none; gaps to what is `fixed` count where that is set."""
    uses = [0] * len(core.nodes)
    for index in needed:
        uses[index] += 1
    for index in range(len(core.nodes) - 1, -1, -1):  # parents before children
        if uses[index]:
            for child in children(core.nodes[index]):
                uses[child] += 1
    minima, skipped = {}, {index for index, count in enumerate(uses) if not count}
    for index, node in enumerate(core.nodes):
        if not (uses[index] and isinstance(node, Junction) and node.kind == "min" and len(node.args) >= fewest):
            continue
        found = {arg: one for arg in node.args if (one := _gap_below(core, arg, uses, fixed)) is not None}
        if len(found) < fewest:
            continue
        pairs = _make_pairs(tuple(arg for arg in node.args if arg not in found), found)
        if len(found) >= dozen * len({one.shapes for one in pairs.alike}):
            minima[index] = pairs
            skipped |= pairs.within
    return GapMinima(minima, frozenset(skipped), find_capped(core.nodes, needed))


_Found = tuple[tuple[int, ...], Apply, float]


def _gap_below(core: Core, index: int, uses: Sequence[int], fixed: bool) -> _Found | None:
    """Of an atom `gap(...)` or `gap(...) - constant` of two objects that nothing else needs: the nodes below it, the
    gap, and the constant."""
    atom = core.nodes[index]
    if not isinstance(atom, Atom) or uses[index] > 1:
        return None
    below: tuple[int, ...] = (atom.margin,)
    less, node = 0.0, core.nodes[atom.margin]
    if isinstance(node, Apply) and node.primitive == "sub":
        constant = core.nodes[node.args[1]]
        if not isinstance(constant, Const) or uses[atom.margin] > 1:
            return None
        below, less, node = (*below, node.args[0]), constant.value, core.nodes[node.args[0]]
    if not (isinstance(node, Apply) and node.primitive == "gap") or uses[below[-1]] > 1 or not math.isfinite(less):
        return None
    if all(isinstance(shape, Circle) for shape in node.shapes):
        return None  # as cheap as its bounds
    moving = [is_coordinate(core.nodes, arg) for arg in node.args]
    return (below, node, less) if (any(moving) if fixed else all(moving)) else None


def _make_pairs(others: tuple[int, ...], found: Mapping[int, _Found]) -> NearestPairs:
    by_identity: dict[tuple[float, ...], list[int]] = {}  # hashing shapes for each pair takes longer than all else
    for atom, (_, gap, less) in found.items():
        by_identity.setdefault((less, *map(id, gap.shapes)), []).append(atom)
    groups: dict[tuple[tuple[Footprint, ...], float], list[int]] = {}
    for atoms in by_identity.values():
        _, gap, less = found[atoms[0]]
        groups.setdefault((gap.shapes, less), []).extend(atoms)
    alike, end = [], 0
    for (shapes, less), atoms in groups.items():
        begin, end = end, end + len(atoms)
        inner, outer = sum(measures(one).inner for one in shapes), sum(measures(one).outer for one in shapes)
        alike.append(Alike(shapes, less, less + inner, less + outer, slice(begin, end)))
    order = [atom for atoms in groups.values() for atom in atoms]
    args = np.array([found[atom][1].args for atom in order], dtype=np.intp).T
    within = frozenset(found).union(*(nodes for nodes, _, _ in found.values()))
    return NearestPairs(args, np.array(order, dtype=np.intp), tuple(alike), others, within)


def minimum(
    pairs: NearestPairs,
    values: Callable[[int], Any],
    gap: Gap,
    *,
    below: float = math.inf,
    share: float = 1.0,
    which: npt.NDArray[np.int32] | None = None,
) -> AnyArray | None:
    """(B,) the least of the gaps in each scene. `values` gives numbers or arrays (B,) of one dtype for the nodes
    `places`. Gaps of which none is less than `below` may be left out: then something that is not less, infinity at
    most. None where more than a `share` of all would be computed. A scene with a number that is infinite or NaN has the
    value that all its gaps give. The atom of one that is the least is written into `which` (B,), where that is
    given."""
    nodes, at = np.unique(pairs.args, return_inverse=True)
    at = at.reshape(pairs.args.shape)
    given = [np.asarray(values(int(node))) for node in nodes]
    count = max(one.size for one in given)
    table = np.empty((len(nodes), count), next(one.dtype for one in given if one.ndim))
    for row, one in zip(table, given, strict=True):
        row[:] = one
    near = np.empty((len(pairs.atoms), count), dtype=bool)
    step = max(FEWEST_SCENES, BLOCK // len(near))
    for start in range(0, count, step):
        _can_decide(pairs, table[:, start : start + step], at, below, near[:, start : start + step])
    near |= ~np.isfinite(table.sum(axis=0))
    if share < 1.0 and np.count_nonzero(near) > share * near.size:
        return None
    least = np.full(count, np.inf, table.dtype)
    flat = table.reshape(-1)
    for alike in pairs.alike:
        some = near[alike.pairs]
        found, many = np.flatnonzero(some), np.count_nonzero(some, axis=1)
        first = np.arange(len(some)) * count
        numbers = [flat.take(found + (row * count - first).repeat(many)) for row in at[:, alike.pairs]]
        value = gap(*alike.shapes, *numbers) - least.dtype.type(alike.less)
        scene = found - first.repeat(many)
        before = None if which is None else least.copy()
        np.minimum.at(least, scene, value)
        if which is not None and before is not None:
            new = np.flatnonzero((value == least[scene]) & (value < before[scene]))[::-1]  # the first is written last
            which[scene[new]] = pairs.atoms[alike.pairs].repeat(many)[new]
    return least


def _can_decide(pairs: NearestPairs, table: AnyArray, at: Index, below: float, near: npt.NDArray[np.bool_]) -> None:
    """Writes into `near` (P, b) which pairs may have the least gap, or a gap of NaN."""
    square, spare = table[at[3]], table[at[4]]
    square -= table[at[0]]
    spare -= table[at[1]]
    square *= square
    spare *= spare
    square += spare
    highest: Any = below  # no gap is more than the least of these
    for alike in pairs.alike:
        highest = np.minimum(highest, np.sqrt(square[alike.pairs].min(axis=0)) - alike.inner)
    # Rounding: all steps, those of gaps included, together are off by far less than this.
    room = 64.0 * float(np.finfo(square.dtype).eps)
    size = max(abs(alike.inner) for alike in pairs.alike) + max(abs(alike.outer) for alike in pairs.alike)
    for alike in pairs.alike:
        limit = (highest + alike.outer) * (1.0 + room) + room * size
        np.greater(square[alike.pairs], limit * np.abs(limit), out=near[alike.pairs])
    np.logical_not(near, out=near)


def every(pairs: NearestPairs, values: Callable[[int], Any], gap: Gap) -> list[Any]:
    """All the gaps, in the order of `atoms`, less what is taken off."""
    found = []
    for alike in pairs.alike:
        for args in pairs.args[:, alike.pairs].T.tolist():
            value = gap(*alike.shapes, *map(values, args))
            found.append(value - alike.less if alike.less else value)
    return found


def with_others(pairs: NearestPairs, least: Any, values: Callable[[int], Any], step: Callable[[Any, Any], Any]) -> Any:
    """The value of the minimum's node, given that of its gaps and those of the nodes before it."""
    return reduce(step, map(values, pairs.others), least)


# The one loop over the tape of a core formula.
#
# A reader says what each kind of node is worth in its own terms: a number, an array, a tensor, an interval, a number
# with the atom it came from. That is an Algebra. `fold` walks the tape and gives every node its value, children
# first.


Value = TypeVar("Value")


class Algebra(Protocol[Value]):
    """What nodes are worth. Each method gets the place of the node on the tape, the node, and the values of its
    arguments, in order."""

    def constant(self, index: int, node: Const) -> Value: ...
    def coordinate(self, index: int, node: Coord) -> Value: ...
    def apply(self, index: int, node: Apply, args: list[Value]) -> Value: ...
    def junction(self, index: int, node: Junction, args: list[Value]) -> Value: ...

    def atom(self, index: int, node: Atom, margin: Value) -> Value:
        """An atom is worth its margin, for most readers."""
        return margin


def fold(
    nodes: Sequence[Node],
    algebra: Algebra[Value],
    *,
    before: Callable[[], None] | None = None,
    dead: Sequence[Sequence[int]] | None = None,
    free: Callable[[Value], None] | None = None,
    values: list[Value] | None = None,
) -> list[Value]:
    """The value of every node. `before` is called before each node: what it raises breaks off.

    With `dead` (see core.last_uses), values are dropped after their last use, and None is in their places; `free` is
    called with each before. `values`, an empty list, is what values are put into: for an algebra that looks at others
    than a node's arguments.
    """
    values = [] if values is None else values
    # Looked up once: tapes have thousands of nodes, and a node of floats takes a microsecond.
    apply, coordinate, junction = algebra.apply, algebra.coordinate, algebra.junction
    add, dropped = values.append, cast(list[Any], values)
    for index, node in enumerate(nodes):
        if before is not None:
            before()
        if isinstance(node, Apply):
            add(apply(index, node, [values[arg] for arg in node.args]))
        elif isinstance(node, Coord):
            add(coordinate(index, node))
        elif isinstance(node, Atom):
            add(algebra.atom(index, node, values[node.margin]))
        elif isinstance(node, Junction):
            add(junction(index, node, [values[arg] for arg in node.args]))
        elif isinstance(node, Const):
            add(algebra.constant(index, node))
        else:
            raise TypeError(f"a formula over time has no value in one scene: {type(node).__name__}")
        if dead is not None:
            for child in dead[index]:
                if free is not None:
                    free(values[child])
                dropped[child] = None
    return values


class Numbers(Algebra[Any]):
    """Nodes as numbers of a namespace: floats, arrays or tensors. `rows[row]` is a coordinate."""

    def __init__(self, namespace: Namespace, rows: Sequence[Any]) -> None:
        self.namespace, self.rows = namespace, rows

    def constant(self, index: int, node: Const) -> Any:
        return node.value

    def coordinate(self, index: int, node: Coord) -> Any:
        return self.rows[node.row]

    def apply(self, index: int, node: Apply, args: list[Any]) -> Any:
        return PRIMITIVES[node.primitive].evaluate(self.namespace, *node.shapes, *args)

    def junction(self, index: int, node: Junction, args: list[Any]) -> Any:
        return reduce(self.namespace.minimum if node.kind == "min" else self.namespace.maximum, args)


class PrunedNumbers(Numbers):
    """Arrays of numpy, (B,), of the nodes that are needed, without the gaps that cannot be the least of many."""

    def __init__(self, namespace: Namespace, rows: Sequence[Any], groups: GapMinima, values: list[Any]) -> None:
        super().__init__(namespace, rows)
        self.groups, self.values = groups, values
        self.capped = CappedNumbers(groups.capped, values.__getitem__)
        self.skipped = groups.skipped | groups.capped.skipped

    def apply(self, index: int, node: Apply, args: list[Any]) -> Any:
        if index in self.skipped:
            return None
        capped = self.groups.capped.by_node.get(index)
        return super().apply(index, node, args) if capped is None else self.capped.minimum(capped)

    def junction(self, index: int, node: Junction, args: list[Any]) -> Any:
        if index in self.groups.skipped:
            return None
        pairs = self.groups.by_node.get(index)
        if pairs is None:
            return super().junction(index, node, args)
        return with_others(pairs, self.least(pairs), self.values.__getitem__, np.minimum)

    def least(self, pairs: NearestPairs) -> Any:
        """The least of the gaps."""
        least = minimum(pairs, self.values.__getitem__, partial(PRIMITIVES["gap"].evaluate, NUMPY))
        assert least is not None
        return least


def evaluate(
    core: Core,
    rows: Sequence[Any],
    namespace: Namespace = MATH,
    check: Callable[[], None] | None = None,
    needed: Collection[int] | GapMinima | None = None,
) -> list[Any]:
    """The value of every node. `rows` holds 3N coordinates, floats or equally shaped arrays of the namespace.
    `check` is called before every node: what it raises breaks off. With `needed`, other nodes than those may lack a
    value, which is faster in many scenes; `find_groups` prepares it for many runs."""
    many = namespace is NUMPY and np.ndim(rows[0]) == 1 and len(rows[0]) >= SEVERAL
    if namespace is not MATH:
        namespace = turning(namespace, rows[rows_along(THETA)])
    if needed is not None and many:
        groups = needed if isinstance(needed, GapMinima) else find_groups(core, needed)
        if groups.skipped or groups.capped.skipped:
            values: list[Any] = []
            return fold(core.nodes, PrunedNumbers(namespace, rows, groups, values), before=check, values=values)
    return fold(core.nodes, Numbers(namespace, rows), before=check)


def phi(
    core: Core, rows: Sequence[Any], namespace: Namespace = MATH, check: Callable[[], None] | None = None
) -> dict[str, Any]:
    """The satisfaction value of each label (Definition 2 of the paper). `check` is as for `evaluate`."""
    values = evaluate(core, rows, namespace, check, core.labels.values())
    return {name: values[index] for name, index in core.labels.items()}


# Which atom decides phi: the one whose margin is the label's phi. It alone would have to change for phi to change.
#
# An atom whose margin is the same in every scene decides nothing: where it is phi, the atom counts that decides without
# it. There is such an atom only where not all are the same. Of several that tie, the first decides: readers of the spec
# look there first, too.


Floats = npt.NDArray[np.float64]


def deciding_atom(core: Core, label: str, values: Sequence[float], same: Collection[int] | None = None) -> int:
    """The node of the atom that decides a label's phi, given the value of every node for one scene. `same` are the
    atoms that count as the same in every scene; None: those whose margin is a number."""
    (atom,) = _deciding(core, core.labels[label], np.array(values, dtype=np.float64)[:, None], same)
    return atom


def deciding_atoms(core: Core, rows: Floats, label: str) -> dict[int, int]:
    """How often each atom decides phi of a label over B scenes stored as (3N, B): atom's node -> count, most first."""
    values = [np.broadcast_to(value, rows.shape[1]) for value in evaluate(core, list(rows), NUMPY)]
    counts = {atom: len(scenes) for atom, scenes in _deciding(core, core.labels[label], values).items()}
    return dict(sorted(counts.items(), key=lambda item: -item[1]))


def _deciding(
    core: Core, root: int, values: Sequence[Floats] | Floats, same: Collection[int] | None = None
) -> dict[int, Index]:
    """For each atom that decides the formula `root`, in which scenes; of values (B,) of every node."""
    found = _deciders(core, root, dict(enumerate(values)), np.arange(len(values[root])))
    constant = [atom for atom in found if (is_constant(core, atom) if same is None else atom in same)]
    rest = _without_constants(core, root, values, same) if constant else {}
    if root in rest:
        scenes = np.concatenate([found.pop(atom) for atom in constant])
        for atom, more in _deciders(core, root, rest, scenes).items():
            found[atom] = np.concatenate([found.get(atom, np.empty(0, dtype=np.intp)), more])
    return found


def is_constant(core: Core, atom: int) -> bool:
    """Whether an atom's margin is the same in every scene."""
    node = core.nodes[atom]
    return isinstance(node, Atom) and isinstance(core.nodes[node.margin], Const)


def settled_atoms(core: Core, count: int) -> frozenset[int]:
    """The atoms whose margin no move of one of the `count` objects changes: numbers, and what depends on the chosen
    surfaces alone."""
    moves: list[bool] = []
    for node in core.nodes:
        place = isinstance(node, Coord) and node.object < count
        moves.append(place or any(moves[child] for child in children(node)))
    return frozenset(at for at, node in enumerate(core.nodes) if isinstance(node, Atom) and not moves[at])


def _without_constants(
    core: Core, root: int, values: Sequence[Floats] | Floats, same: Collection[int] | None
) -> dict[int, Floats]:
    """The values of the formulas up to `root` as they are without the atoms that are the same in every scene. A formula
    of nothing else has none."""
    found: dict[int, Floats] = {}
    for index, node in enumerate(core.nodes[: root + 1]):
        if isinstance(node, Junction):
            parts = [found[arg] for arg in node.args if arg in found]
            if parts:
                found[index] = reduce(np.minimum if node.kind == "min" else np.maximum, parts)
        elif isinstance(node, Atom) and not (is_constant(core, index) if same is None else index in same):
            found[index] = values[index]
    return found


def _deciders(core: Core, root: int, values: Mapping[int, Floats], scenes: Index) -> dict[int, Index]:
    """For each atom those of the scenes in which it decides the formula `root`."""
    waiting = {root: scenes}
    found: dict[int, Index] = {}
    # Parents come after their children on the tape, so going downwards meets every node after all who point to it.
    for index in range(root, -1, -1):
        here = waiting.pop(index, None)
        if here is None:
            continue
        node = core.nodes[index]
        if not isinstance(node, Junction):
            found[index] = here
            continue
        for arg in node.args:
            if arg not in values:
                continue
            mine = values[arg][here] == values[index][here]
            if mine.any():
                waiting[arg] = np.concatenate([waiting.get(arg, np.empty(0, dtype=np.intp)), here[mine]])
                here = here[~mine]
    return found


# Headings that a formula takes as numbers: where a turn more or less would change phi.
#
# A heading is one number of [0, 2 pi), but 0 and 2 pi are the same direction. `wrap`, `sin`, `cos` and footprints
# know that; a comparison of `theta(b)` by itself does not.


_Turns = Mapping[int, float]  # heading's row -> what a number grows by with it, nan where it does not grow evenly


def bare_headings(core: Core) -> dict[int, frozenset[int]]:
    """The atoms whose margin changes when a turn is added to a heading, each with the rows of those headings."""
    # A loop of its own: few nodes have to do with a heading, and it looks at no others.
    turns: list[_Turns | None] = []
    found: dict[int, frozenset[int]] = {}
    for index, node in enumerate(core.nodes):
        own: _Turns | None = None
        if isinstance(node, Apply):
            if any(map(turns.__getitem__, node.args)):
                own = _through(node, core.nodes, [turns[arg] or {} for arg in node.args])
        elif isinstance(node, Coord):
            own = {node.row: 1.0} if node.axis == THETA else None
        elif isinstance(node, Atom) and turns[node.margin]:
            found[index] = frozenset(turns[node.margin] or ())
        turns.append(own)
    return found


def bare_rows(core: Core) -> frozenset[int]:
    """The rows of all headings that some atom takes as numbers."""
    return frozenset(row for rows in bare_headings(core).values() for row in rows)


def _through(node: Apply, nodes: Sequence[Node], parts: Sequence[_Turns]) -> _Turns:
    slopes = PRIMITIVES[node.primitive].slopes
    values = [one.value if isinstance(one := nodes[arg], Const) else None for arg in node.args]
    factors = None if slopes is None else slopes(values)
    total: dict[int, float] = {}
    if factors is None:
        for part, whole in zip(parts, _whole_turns(node), strict=True):
            for row, growth in part.items():
                if not (whole and growth.is_integer()):
                    total[row] = math.nan
        return total
    for part, factor in zip(parts, factors, strict=True):
        for row, growth in part.items():
            total[row] = total.get(row, 0.0) + growth * factor
    return {row: growth for row, growth in total.items() if growth != 0.0}


def _whole_turns(node: Apply) -> Iterator[bool]:
    """Of each argument of a primitive, whether a turn more makes no difference."""
    primitive = PRIMITIVES[node.primitive]
    if primitive.variadic:
        yield from (False for _ in node.args)
        return
    for kind in argument_kinds(node.primitive, len(node.shapes)):
        if kind == "number":
            yield primitive.of_angle
        else:
            yield from (axis == THETA for axis in (FLAT if kind == "footprint" else PLACE))


def headings_compared(core: Core) -> list[Diagnostic]:
    """A warning for each comparison of a heading that does not know where a turn ends."""
    places: dict[Span, str] = {}
    for index, rows in bare_headings(core).items():
        atom = core.nodes[index]
        assert isinstance(atom, Atom)
        places.setdefault(atom.spans[0], core.objects[owner(min(rows))])
    return [HEADING_COMPARED(place, name=name) for place, name in places.items()]
