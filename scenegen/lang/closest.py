"""The least of many clearances, without computing most of them.

`noOverlap()` takes the least clearance of all pairs. A clearance lies between the distance of the two centres less
both outer radii and that distance less both inner radii; so in any scene, only pairs whose distance is near the least
can decide. Distances cost a tenth of clearances: they are computed for all pairs and scenes, clearances for what is
left. The least is the same number, bit for bit.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from scenegen.lang.core import Apply, Atom, Coord, Core, Junction, children, last_uses
from scenegen.primitives.footprint import Circle, Footprint
from scenegen.primitives.outline import measures

Array = npt.NDArray[Any]
Shapes = tuple[Footprint, ...]
FEWEST = 3  # pairs; the distances of fewer cost more than they save


@dataclass(frozen=True, slots=True)
class Closest:
    """What a conjunction takes the least of: clearances, grouped by the footprints (pairs of nodes (x, y, theta, x, y,
    theta) for each two shapes), and the arguments `others`. `atoms` are the nodes of the clearances' atoms, one pair
    after another; `nodes` are the nodes that need no values of their own."""

    groups: tuple[tuple[Shapes, tuple[tuple[int, ...], ...]], ...]
    others: tuple[int, ...]
    atoms: tuple[int, ...]
    nodes: frozenset[int]

    @property
    def needs(self) -> set[int]:
        """The nodes whose values the clearances are computed from."""
        return {arg for _, pairs in self.groups for pair in pairs for arg in pair}

    @property
    def instead(self) -> tuple[int, ...]:
        """What the conjunction is computed from, its own arguments being left out."""
        return (*self.others, *sorted(self.needs))

    @property
    def count(self) -> int:
        return sum(len(pairs) for _, pairs in self.groups)


def find(core: Core) -> dict[int, Closest]:
    """The conjunctions of enough clearances, by node. Clearances that are wanted elsewhere, too, are no part of them,
    nor are those of two circles, which cost no more than a distance."""
    uses = Counter(child for node in core.nodes for child in children(node))
    kept = {*core.labels.values(), core.requirement}
    found = {}
    for index, node in enumerate(core.nodes):
        if not isinstance(node, Junction) or node.kind != "min":
            continue
        groups: dict[Shapes, dict[int, tuple[int, ...]]] = {}
        inner: set[int] = set()
        for arg in node.args:
            atom = core.nodes[arg]
            margin = core.nodes[atom.margin] if isinstance(atom, Atom) else None
            if isinstance(atom, Atom) and isinstance(margin, Apply) and margin.primitive == "gap":
                alone = uses[arg] == uses[atom.margin] == 1 and not kept & {arg, atom.margin}
                moves = any(isinstance(core.nodes[one], Coord) for one in margin.args)
                if alone and moves and not all(isinstance(shape, Circle) for shape in margin.shapes):
                    groups.setdefault(margin.shapes, {})[arg] = margin.args
                    inner |= {arg, atom.margin}
        if len(inner) >= 2 * FEWEST:
            others = tuple(arg for arg in node.args if arg not in inner)
            pairs = tuple((key, tuple(of.values())) for key, of in groups.items())
            atoms = tuple(atom for of in groups.values() for atom in of)
            found[index] = Closest(pairs, others, atoms, frozenset(inner))
    return found


def last_uses_of(core: Core, found: dict[int, Closest]) -> list[list[int]]:
    """last_uses(core), where the clearances in `found` are computed with their conjunctions."""
    instead: dict[int, tuple[int, ...]] = {node: () for closest in found.values() for node in closest.nodes}
    return last_uses(core, instead | {index: closest.instead for index, closest in found.items()})


def least(
    closest: Closest, values: Mapping[int, Any], gap: Callable[..., Array], which: Array | None = None
) -> Array | None:
    """(B,) the least of the clearances in each scene. `values` are those of the nodes `needs`, arrays (B,) or () of one
    dtype; gap(*shapes, *six arrays of any one length) computes clearances. None where most pairs may decide, so that
    computing all of them is cheaper. The atom of the least one is written into `which` (B,), where that is given."""
    dtype = next(value.dtype for value in values.values())
    count = max(value.size for value in values.values())
    squares = np.empty((closest.count, count), dtype)
    spare = np.empty(count, dtype)
    pairs = [(shapes, pair) for shapes, group in closest.groups for pair in group]
    for square, (_, (ax, ay, _, bx, by, _)) in zip(squares, pairs, strict=True):
        np.subtract(values[bx], values[ax], out=square)
        np.subtract(values[by], values[ay], out=spare)
        np.multiply(square, square, out=square)
        np.multiply(spare, spare, out=spare)
        np.add(square, spare, out=square)
    where = _deciding(closest, squares)
    if sum(len(scenes) for scenes in where) > squares.size // 2:
        return None
    result = np.full(count, np.inf, dtype)
    first = 0
    for shapes, group in closest.groups:
        scenes, atoms = where[first : first + len(group)], closest.atoms[first : first + len(group)]
        first += len(group)
        columns = zip(*(_taken(values, pair, some) for pair, some in zip(group, scenes, strict=True)), strict=True)
        found = gap(*shapes, *map(np.concatenate, columns))
        start = 0
        for atom, some in zip(atoms, scenes, strict=True):
            new, old = found[start : start + len(some)], result[some]
            result[some] = np.minimum(old, new)
            if which is not None:
                which[some[new < old]] = atom
            start += len(some)
    return result


def _taken(values: Mapping[int, Any], pair: tuple[int, ...], scenes: Array) -> list[Array]:
    return [values[arg].take(scenes) if values[arg].ndim else np.broadcast_to(values[arg], len(scenes)) for arg in pair]


def _deciding(closest: Closest, squares: Array) -> list[Array]:
    """For every pair, the scenes in which it may have the least clearance, given the squares of the distances."""
    radii = []
    for (a, b), _ in closest.groups:
        of_a, of_b = measures(a), measures(b)
        radii.append((of_a.inner + of_b.inner, of_a.outer + of_b.outer))
    rows, first = [], 0
    for _, group in closest.groups:
        rows.append(squares[first : first + len(group)])
        first += len(group)
    highest: Any = np.inf  # no clearance is more than the least of these
    for square, (inside, _) in zip(rows, radii, strict=True):
        highest = np.minimum(highest, np.sqrt(square.min(axis=0)) - inside)
    # Rounding: all steps, those of clearances included, together are off by far less than this.
    room = 64.0 * float(np.finfo(squares.dtype).eps)
    size = sum(max(abs(radius) for radius in column) for column in zip(*radii, strict=True))
    where: list[Array] = []
    for square, (_, outside) in zip(rows, radii, strict=True):
        limit = (highest + outside) * (1.0 + room) + room * size
        limit *= limit
        where += [np.flatnonzero(~(row > limit)) for row in square]  # NaN may decide
    return where
