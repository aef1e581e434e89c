"""The expanded formula of a spec as an outline: one line per sub-formula, with what phi can be there."""

from __future__ import annotations

from dataclasses import dataclass

from scenegen.api.spec import Spec
from scenegen.bounds import node_bounds
from scenegen.lang.core import Atom, Junction
from scenegen.lang.describe import describe


@dataclass(frozen=True, slots=True)
class Line:
    """A sub-formula: its depth below the label, its text, the margin it stands for ("" for a conjunction or
    disjunction), the unit of phi ("" where units mix), and the interval bounds of phi in the workspace."""

    depth: int
    text: str
    margin: str
    unit: str
    low: float
    high: float


def outline(spec: Spec, label: str, most: int = 200) -> tuple[list[Line], int]:
    """The lines of a label's formula, from the top, at most `most` of them; and how many more there are.

    A definition that is used twice is shown twice, so what is left out is only counted up to ten times `most`.
    """
    core = spec.checked.core
    bounds = node_bounds(core, *spec.checked.box())
    lines: list[Line] = []
    count = 0
    stack = [(core.labels[label], 0)]
    while stack and count < 11 * most:
        index, depth = stack.pop()
        node = core.nodes[index]
        count += 1
        if isinstance(node, Junction):
            stack.extend((arg, depth + 1) for arg in reversed(node.args))
        if count > most:
            continue
        low, high = float(bounds[index].lo), float(bounds[index].hi)
        if isinstance(node, Junction):
            words = "all of" if node.kind == "min" else "one of"
            lines.append(Line(depth, f"{words}: {node.text}" if node.text else words, "", "", low, high))
        elif isinstance(node, Atom):
            margin = describe(core.nodes, core.objects, node.margin)
            lines.append(Line(depth, node.text, margin, str(node.unit), low, high))
    return lines, count - len(lines)
