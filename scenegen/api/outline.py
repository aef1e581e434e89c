"""The expanded formula of a spec as an outline: one line per sub-formula, with what phi can be there, or is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from scenegen.bounds import node_bounds
from scenegen.lang.core import REQUIRE, Apply, Atom, Const, Coord, Core, Junction, gated
from scenegen.lang.describe import describe
from scenegen.lang.interpret import deciding_atom
from scenegen.lang.spec import CheckedSpec
from scenegen.primitives.interval import Interval


@dataclass(frozen=True, slots=True)
class Line:
    """A sub-formula: its depth below the label, its text, the margin it stands for ("" for a conjunction or
    disjunction), the unit of phi ("" where units mix), and the interval bounds of phi in the workspace; for a scene
    also its value there, and whether it is the atom that decides."""

    depth: int
    text: str
    margin: str
    unit: str
    low: float
    high: float
    value: float | None = None
    decides: bool = False


class Checked(Protocol):
    """Anything that holds a checked spec: scenegen.Spec, which shows itself as an outline, does."""

    @property
    def checked(self) -> CheckedSpec: ...


class Outline:
    """The formulas of a spec, line by line. `labels` are its labels, and `require` where it requires something."""

    def __init__(self, spec: Checked) -> None:
        self._core: Core = gated(spec.checked.core)
        self._bounds: Sequence[Interval] = node_bounds(self._core, *spec.checked.box())
        self._choices = {one.switch: (which, one) for which, one in spec.checked.choices.items()}
        self.labels = tuple(self._core.labels)

    @property
    def core(self) -> Core:
        """The core whose nodes `values` are given for."""
        return self._core

    def lines(self, label: str, *, most: int = 200, values: Sequence[float] | None = None) -> tuple[list[Line], int]:
        """The lines of a label's formula, from the top, at most `most` of them; and how many more there are.

        `values` is the value of every node in one scene (lang.interpret.evaluate). A definition that is used twice is
        shown twice, so what is left out is only counted up to ten times `most`.
        """
        core = self._core
        decider = deciding_atom(core, label, values) if values is not None else None
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
            lines.append(self.line(index, depth, values, decider))
        return lines, count - len(lines)

    def line(
        self,
        index: int,
        depth: int = 0,
        values: Sequence[float] | None = None,
        decider: int | None = None,
        *,
        margin: bool = True,
    ) -> Line:
        """The line of one formula node. `margin=False` leaves the margin of an atom out: to write it takes longest."""
        core, node = self._core, self._core.nodes[index]
        low, high = float(self._bounds[index].lo), float(self._bounds[index].hi)
        value = None if values is None else float(values[index])
        if isinstance(node, Junction):
            words = "all of" if node.kind == "min" else "one of"
            text = f"{words}: {node.text}" if node.text and node.text != REQUIRE else words
            return Line(depth, text, "", "", low, high, value)
        assert isinstance(node, Atom), "a formula is a junction or an atom"
        chosen = self._chosen(node)
        if chosen:
            return Line(depth, chosen, "", "", low, high, value, index == decider)
        told = describe(core.nodes, core.objects, node.margin) if margin else ""
        return Line(depth, node.text, told, str(node.unit), low, high, value, index == decider)

    def _chosen(self, atom: Atom) -> str:
        """What an atom says that is about nothing but the surface that an object stands on: `mug stands on tray`; ""
        for others. Its margin is a number of the choice's switch, which means nothing to people."""
        match self._core.nodes[atom.margin]:
            case Apply("sub", (upper, lower)):
                sides = self._core.nodes[upper], self._core.nodes[lower]
            case _:
                return ""
        for early, (limit, switch) in ((True, sides), (False, sides[::-1])):
            if isinstance(limit, Const) and isinstance(switch, Coord) and switch.object in self._choices:
                which, choice = self._choices[switch.object]
                end = sum(one <= limit.value for one in choice.ends)
                options = choice.options[:end] if early else choice.options[end:]
                return f"{self._core.objects[which]} stands on {' or '.join(one.name for one in options)}"
        return ""
