"""The core formula, evaluated node by node over any array namespace.

With plain floats this is the oracle that the tests hold every other reader against; with numpy it scores scene files
without torch.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from functools import reduce
from typing import Any

import numpy as np

from scenegen.lang.core import Apply, Const, Coord, Core, Junction
from scenegen.lang.fold import Algebra, fold
from scenegen.lang.least_gap import SEVERAL, Groups, find_groups, minimum
from scenegen.pose import THETA, along
from scenegen.primitives import MATH, NUMPY, PRIMITIVES, Namespace
from scenegen.primitives.namespace import turning


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


class Fewer(Numbers):
    """Arrays of numpy, (B,), of the nodes that are needed, without the gaps that cannot be the least of many."""

    def __init__(self, namespace: Namespace, rows: Sequence[Any], groups: Groups, values: list[Any]) -> None:
        super().__init__(namespace, rows)
        self.groups, self.values = groups, values

    def apply(self, index: int, node: Apply, args: list[Any]) -> Any:
        return None if index in self.groups.skipped else super().apply(index, node, args)

    def junction(self, index: int, node: Junction, args: list[Any]) -> Any:
        if index in self.groups.skipped:
            return None
        group = self.groups.by_node.get(index)
        if group is None:
            return super().junction(index, node, args)
        return minimum(group, self.rows, self.namespace.turn, self.values)


def evaluate(
    core: Core,
    rows: Sequence[Any],
    namespace: Namespace = MATH,
    check: Callable[[], None] | None = None,
    needed: Collection[int] | Groups | None = None,
) -> list[Any]:
    """The value of every node. `rows` holds 3N coordinates, floats or equally shaped arrays of the namespace.
    `check` is called before every node: what it raises breaks off. With `needed`, other nodes than those may lack a
    value, which is faster in many scenes; `find_groups` prepares it for many runs."""
    many = namespace is NUMPY and np.ndim(rows[0]) == 1 and len(rows[0]) >= SEVERAL
    if namespace is not MATH:
        namespace = turning(namespace, rows[along(THETA)])
    if needed is not None and many:
        groups = needed if isinstance(needed, Groups) else find_groups(core, needed)
        if groups.skipped:
            values: list[Any] = []
            return fold(core.nodes, Fewer(namespace, rows, groups, values), before=check, values=values)
    return fold(core.nodes, Numbers(namespace, rows), before=check)


def phi(core: Core, rows: Sequence[Any], namespace: Namespace = MATH) -> dict[str, Any]:
    """The satisfaction value of each label (Definition 2 of the paper)."""
    values = evaluate(core, rows, namespace, needed=core.labels.values())
    return {name: values[index] for name, index in core.labels.items()}


def deciding_atom(core: Core, label: str, values: Sequence[float]) -> int:
    """The node of the atom whose margin is the label's phi, given the value of every node for one scene."""
    index = core.labels[label]
    while True:
        node = core.nodes[index]
        if not isinstance(node, Junction):
            return index
        # The first that decides: readers of the spec look there first, too.
        index = next(arg for arg in node.args if values[arg] == values[index])
