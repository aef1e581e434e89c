"""The one loop over the tape of a core formula.

A reader says what each kind of node is worth in its own terms: a number, an array, a tensor, an interval, a number with
the atom it came from. That is an Algebra. `fold` walks the tape and gives every node its value, children first.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol, TypeVar, cast

from scenegen.lang.core import Apply, Atom, Const, Coord, Junction, Node

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
