"""The core formula, evaluated node by node over any array namespace.

With plain floats this is the oracle that the tests hold every other reader against; with numpy it scores scene files
without torch.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from scenegen.lang.core import Apply, Atom, Const, Coord, Core, Junction
from scenegen.primitives import MATH, PRIMITIVES, Namespace
from scenegen.primitives.namespace import turning


def evaluate(
    core: Core, rows: Sequence[Any], namespace: Namespace = MATH, check: Callable[[], None] | None = None
) -> list[Any]:
    """The value of every node. `rows` holds 3N coordinates, floats or equally shaped arrays of the namespace.
    `check` is called before every node: what it raises breaks off."""
    values: list[Any] = []
    if namespace is not MATH:
        namespace = turning(namespace, rows[2::3])
    for node in core.nodes:
        if check is not None:
            check()
        match node:
            case Const(value):
                values.append(value)
            case Coord():
                values.append(rows[node.row])
            case Apply(primitive, args, shapes):
                values.append(PRIMITIVES[primitive].evaluate(namespace, *shapes, *(values[arg] for arg in args)))
            case Atom(margin):
                values.append(values[margin])
            case Junction(kind, args):
                step = namespace.minimum if kind == "min" else namespace.maximum
                value = values[args[0]]
                for arg in args[1:]:
                    value = step(value, values[arg])
                values.append(value)
    return values


def phi(core: Core, rows: Sequence[Any], namespace: Namespace = MATH) -> dict[str, Any]:
    """The satisfaction value of each label (Definition 2 of the paper)."""
    values = evaluate(core, rows, namespace)
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
