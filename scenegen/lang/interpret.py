"""The core formula, evaluated node by node over any array namespace.

With plain floats this is the oracle that the tests hold every other reader against; with numpy it scores scene files
without torch.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from functools import reduce
from typing import Any

import numpy as np

from scenegen.lang.core import Apply, Atom, Const, Coord, Core, Junction
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
    """The node of the atom whose margin is the label's phi, given the value of every node for one scene.

    An atom whose margin is the same in every scene decides nothing: where it is phi, the atom is the one that decides
    without it. There is such an atom only where all are the same.
    """
    found = _decider(core, core.labels[label], values)
    if not is_constant(core, found):
        return found
    rest = without_constants(core, core.labels[label], values)
    return _decider(core, core.labels[label], rest) if core.labels[label] in rest else found


def _decider(core: Core, index: int, values: Sequence[float] | Mapping[int, float]) -> int:
    while True:
        node = core.nodes[index]
        if not isinstance(node, Junction):
            return index
        args = [arg for arg in node.args if arg in values] if isinstance(values, Mapping) else node.args
        # The first that decides: readers of the spec look there first, too.
        index = next(arg for arg in args if values[arg] == values[index])


def is_constant(core: Core, atom: int) -> bool:
    """Whether an atom's margin is the same in every scene."""
    node = core.nodes[atom]
    return isinstance(node, Atom) and isinstance(core.nodes[node.margin], Const)


def without_constants(core: Core, root: int, values: Sequence[Any]) -> dict[int, Any]:
    """The values of the formulas up to `root`, floats or arrays, as they are without the atoms that are the same in
    every scene. A formula of nothing else has none."""
    found: dict[int, Any] = {}
    for index, node in enumerate(core.nodes[: root + 1]):
        if isinstance(node, Junction):
            parts = [found[arg] for arg in node.args if arg in found]
            if parts:
                found[index] = reduce(np.minimum if node.kind == "min" else np.maximum, parts)
        elif isinstance(node, Atom) and not is_constant(core, index):
            found[index] = values[index]
    return found
