"""Which atom decides each label, for many scenes at once."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import cast

import torch
from torch import Tensor

from scenegen.geometry import PRIMITIVES, Footprint, Namespace
from scenegen.geometry.footprint import Box, Circle
from scenegen.geometry.namespace import Turning
from scenegen.lang.formula.core import Apply, Atom, Const, Coord, Core, Junction, Node, last_uses, part_of
from scenegen.lang.formula.interpret import Algebra, GapMinima, bare_rows, every, fold
from scenegen.learn.robustness.compile import EVALUATE_GAP, NO_MINIMA, TORCH, coordinates, minima_of, nearest, run
from scenegen.pose import SIZE, THETA

_DECIDED_AT_ONCE = 32_768


def deciding_atoms(core: Core, rows: Tensor) -> Tensor:
    """The node of the atom that decides each label, (3N, B) storage -> (L, B) int64, on the device of `rows`.

    An atom decides where its margin is the label's phi; of several, the first on the way down, as `eval` names it.
    """
    dead = last_uses(core)
    parts = [
        phi_and_deciders(core, dead, part.__getitem__, part)[1] for part in torch.split(rows, _DECIDED_AT_ONCE, dim=1)
    ]
    if not parts:
        return torch.empty(len(core.labels), 0, dtype=torch.int64, device=rows.device)
    return torch.cat(parts, dim=1).long()


@torch.no_grad()
def phi_and_deciders(
    core: Core,
    dead: list[list[int]],
    coordinate: Callable[[int], Tensor],
    rows: Tensor,
    minima: GapMinima = NO_MINIMA,
) -> tuple[Tensor, Tensor]:
    """phi (L, B) of storage (3N, B), and the node of the atom that decides it, (L, B) int32. coordinate(row) is a row
    of the storage. Of the gaps in `minima`, only those that may decide are computed, on the CPU; `dead` is as
    in scenegen.learn.robustness.compile. Which of several atoms decides is then open."""
    values: list[_Value] = []
    algebra = _ActiveAtoms(coordinate, rows, minima, values)
    fold(core.nodes, algebra, dead=dead, free=algebra.free, values=values)
    found = [values[node] for node in core.labels.values()]
    phi, atoms = ([value.expand(rows.shape[1]) for value in each] for each in zip(*found, strict=True))
    return torch.stack(phi), torch.stack(atoms)


_Value = tuple[Tensor, Tensor]
"""A node's number and, of a formula, the atom that it comes from."""


class _ActiveAtoms(Algebra[_Value]):
    """See `decided`; `values` are those of the nodes so far."""

    def __init__(
        self,
        coordinate: Callable[[int], Tensor],
        rows: Tensor,
        minima: GapMinima,
        values: list[_Value],
    ) -> None:
        self._coordinate, self._rows, self._minima, self._values = coordinate, rows, minima, values
        self._turning = Turning(TORCH)  # each heading is turned once
        self._none = torch.tensor(-1, dtype=torch.int32, device=rows.device)

    def free(self, value: _Value) -> None:
        self._turning.drop(value[0])

    def constant(self, index: int, node: Const) -> _Value:
        return self._rows.new_tensor(node.value), self._none

    def coordinate(self, index: int, node: Coord) -> _Value:
        value = self._coordinate(node.row)
        if node.axis == THETA:
            self._turning.keep(value)
        return value, self._none

    def apply(self, index: int, node: Apply, args: list[_Value]) -> _Value:
        if index in self._minima.skipped:
            return self._none, self._none
        numbers = [number for number, _ in args]
        return PRIMITIVES[node.primitive].evaluate(cast(Namespace, self._turning), *node.shapes, *numbers), self._none

    def atom(self, index: int, node: Atom, margin: _Value) -> _Value:
        return margin[0], torch.tensor(index, dtype=torch.int32, device=self._rows.device)

    def junction(self, index: int, node: Junction, args: list[_Value]) -> _Value:
        pairs = self._minima.by_node.get(index)
        if pairs is not None:

            def number(place: int) -> Tensor:
                return self._values[place][0]

            which = torch.full((self._rows.shape[1],), int(pairs.atoms[0]), dtype=torch.int32)
            least = nearest(pairs, number, which)
            gaps = [least] if least is not None else every(pairs, number, partial(EVALUATE_GAP, self._turning))
            atoms = [which] if least is not None else torch.from_numpy(pairs.atoms).to(torch.int32)
            args = [*zip(gaps, atoms, strict=True), *(self._values[arg] for arg in pairs.others)]
        (value, winner), *others = args
        for other, its in others:
            better = other < value if node.kind == "min" else other > value
            value, winner = torch.where(better, other, value), torch.where(better, its, winner)
        return value, winner


# phi of many scenes, and its gradient where it is wanted, through the atom that decides.
#
# Of a hard min or max only the deciding atom has a gradient, and it reads few objects. So phi is computed without
# gradients, which leaves out most clearances of a conjunction of many; then each atom is differentiated by itself, in
# the scenes that it decides. Atoms that are alike but for their objects and the sizes of these are differentiated
# together.


class Slopes:
    """Of the labels of a core formula, for plain tensors on the CPU."""

    def __init__(self, core: Core) -> None:
        self._core = part_of(core, tuple(core.labels))
        self._minima = minima_of(self._core)
        self._dead = self._minima.last_uses(self._core)
        self._bare = bare_rows(self._core)
        self._forms: dict[tuple[Node, ...], _Form] = {}
        self._pieces: dict[int, _MarginForm] = {}

    def __call__(self, rows: Tensor) -> tuple[Tensor, Tensor]:
        """(3N, B) storage -> phi (L, B), and the node of the atom that decides it, (L, B) int32."""
        return phi_and_deciders(self._core, self._dead, coordinates(rows.__getitem__, self._bare), rows, self._minima)

    def gradient(self, rows: Tensor, atoms: Tensor, where: Tensor) -> Tensor:
        """The gradients (3N, B) of the margins of atoms (B,), as a call names them, in scenes (3N, B), as far as they
        are wanted, `where` (B,); 0 elsewhere."""
        wanted = where.nonzero()[:, 0]
        wanted = wanted[atoms[wanted].argsort(stable=True)]
        counts = torch.bincount(atoms[wanted], minlength=1)
        together: dict[int, list[tuple[_MarginForm, Tensor]]] = {}
        found = counts.nonzero()[:, 0]
        for atom, scenes in zip(found.tolist(), torch.split(wanted, counts[found].tolist()), strict=True):
            piece = self._piece(atom)
            together.setdefault(piece.form.number, []).append((piece, scenes))
        result = torch.zeros_like(rows, memory_format=torch.contiguous_format)
        flat, stored = rows.contiguous().view(-1), result.view(-1)
        for pieces in together.values():
            form, counts = pieces[0][0].form, torch.tensor([len(scenes) for _, scenes in pieces])
            if not form.core.objects:
                continue  # a constant
            reads, sizes = (
                torch.tensor(numbers, dtype=dtype).repeat_interleave(counts, dim=0).T
                for numbers, dtype in (
                    ([piece.reads for piece, _ in pieces], torch.int64),
                    ([piece.sizes for piece, _ in pieces], rows.dtype),
                )
            )
            place = (reads * rows.shape[1] + torch.cat([scenes for _, scenes in pieces])).reshape(-1)
            here = flat.index_select(0, place).view(reads.shape).requires_grad_()
            with torch.enable_grad():
                # a sum: given slopes to begin with, torch imports sympy, which takes half a second
                (slope,) = torch.autograd.grad(form.margin(here, iter(sizes)).sum(), here)
            stored.scatter_(0, place, slope.reshape(-1))
        return result

    def _piece(self, atom: int) -> _MarginForm:
        """The margin of an atom as a formula of its own objects alone."""
        if atom not in self._pieces:
            margin = cast(Atom, self._core.nodes[atom]).margin
            alone = part_of(Core(self._core.nodes, {"": margin}, self._core.objects), [""])
            objects = list(dict.fromkeys(node.object for node in alone.nodes if isinstance(node, Coord)))
            sizes: list[float] = []
            nodes = tuple([without_sizes(node, objects, sizes) for node in alone.nodes])
            if nodes not in self._forms:
                self._forms[nodes] = _form(nodes, tuple(map(str, range(len(objects)))), len(self._forms))
            reads = [SIZE * which + axis for which in objects for axis in range(SIZE)]
            self._pieces[atom] = _MarginForm(self._forms[nodes], reads, sizes)
        return self._pieces[atom]


@dataclass(frozen=True, slots=True)
class _Form:
    """A formula of one margin, whose circles and boxes are of any size."""

    number: int
    core: Core
    dead: list[list[int]]
    bare: frozenset[int]

    def margin(self, rows: Tensor, sizes: Iterator[Tensor]) -> Tensor:
        """(B,) in scenes (3N, B), for circles and boxes of these `sizes` (B,), in the order of `general`."""
        nodes = tuple([with_sizes(node, sizes) for node in self.core.nodes])
        core = Core(nodes, self.core.labels, self.core.objects)
        coordinate = coordinates(rows.__getitem__, self.bare)
        value: Tensor = run(core, self.dead, coordinate, rows.new_tensor)[0]
        return value.expand(rows.shape[1])


def _form(nodes: tuple[Node, ...], objects: tuple[str, ...], number: int) -> _Form:
    core = Core(nodes, {"": len(nodes) - 1}, objects)
    return _Form(number, core, last_uses(core), bare_rows(core))


@dataclass(frozen=True, slots=True)
class _MarginForm:
    """An atom's margin: its form, the rows of the storage that it reads, and the sizes of its circles and boxes."""

    form: _Form
    reads: list[int]
    sizes: list[float]


def without_sizes(node: Node, objects: list[int], sizes: list[float]) -> Node:
    """The node with its objects by their places in `objects`, and without the sizes of its circles and boxes, which are
    put into `sizes`."""
    if isinstance(node, Coord):
        return Coord(objects.index(node.object), node.axis)
    if not isinstance(node, Apply) or not node.shapes:
        return node
    shapes: list[Footprint] = []
    for shape in node.shapes:
        if isinstance(shape, Circle):
            sizes.append(shape.radius)
            shape = Circle(0.0)
        elif isinstance(shape, Box):
            sizes += [shape.length, shape.width]
            shape = Box(0.0, 0.0)
        shapes.append(shape)
    return Apply(node.primitive, node.args, tuple(shapes))


class _Circles(Circle):
    """Circles of many sizes, as numbers of the namespace."""

    __slots__ = ()
    __eq__, __hash__ = object.__eq__, object.__hash__


class _MixedBoxes(Box):
    """Boxes of many sizes; the numbers of one and of another are not compared."""

    __slots__ = ()
    __eq__, __hash__ = object.__eq__, object.__hash__


def with_sizes(node: Node, sizes: Iterator[Tensor]) -> Node:
    """The node of `general` with its sizes."""
    if not isinstance(node, Apply) or not node.shapes:
        return node
    shapes: list[Footprint] = []
    for shape in node.shapes:
        if isinstance(shape, Circle):
            shape = _Circles(cast(float, next(sizes)))
        elif isinstance(shape, Box):
            shape = _MixedBoxes(cast(float, next(sizes)), cast(float, next(sizes)))
        shapes.append(shape)
    return Apply(node.primitive, node.args, tuple(shapes))
