"""Headings that a formula takes as numbers: where a turn more or less would change phi.

A heading is one number of [0, 2 pi), but 0 and 2 pi are the same direction. `wrap`, `sin`, `cos` and footprints know
that; a comparison of `theta(b)` by itself does not.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from scenegen.errors import Diagnostic, Span
from scenegen.errors.declarations import HEADING_COMPARED
from scenegen.geometry import PRIMITIVES
from scenegen.lang.formula.core import Apply, Atom, Const, Coord, Core, Node
from scenegen.pose import FLAT, PLACE, THETA, owner

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
    for kind in primitive.params:
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
