"""The expanded formula of a spec as an outline: one line per sub-formula, with what phi can be there, or is."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from scenegen.errors import RequestError
from scenegen.errors.requests import UNKNOWN_LABEL
from scenegen.geometry.interval import Interval
from scenegen.lang.formula.builder import describe, number_text
from scenegen.lang.formula.core import REQUIRE, Apply, Atom, Const, Coord, Core, Junction, gate
from scenegen.lang.formula.interpret import deciding_atom
from scenegen.lang.spec import CheckedSpec
from scenegen.search import node_bounds


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


class Outline:
    """The formulas of a spec, line by line. `labels` are its labels, and `require` where it requires something."""

    def __init__(self, spec: CheckedSpec) -> None:
        self._core: Core = gate(spec.core)
        self._bounds: Sequence[Interval] = node_bounds(self._core, *spec.box())
        self._choices = {one.switch: (which, one) for which, one in spec.choices.items()}
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
        chosen = self._surface_text(node)
        if chosen:
            return Line(depth, chosen, "", "", low, high, value, index == decider)
        told = describe(core.nodes, core.objects, node.margin) if margin else ""
        return Line(depth, node.text, told, str(node.unit), low, high, value, index == decider)

    def _surface_text(self, atom: Atom) -> str:
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


# Formulas that repeat, folded: one line for `120 x gap(block[i], block[j]) >= 0`.
#
# Sub-formulas are alike where they came from one place of the spec and differ only in the names of objects and in
# numbers: the rounds of a quantifier, the pairs of `noOverlap()`. A folded line has variables for what differs, and
# an index where it is elements of one array.


MIN_FOLD = 3  # sub-formulas that make a fold; two are shown as they are
MAX_FOLDED = 2000  # sub-formulas of a fold whose margins are looked at; the margin of more is left out
INDICES, NAMES = "ijklmn", "pqrstuvw"  # of variables

_TOKENS = re.compile(r"[A-Za-z_]\w*(?:\[\d+\])?|\d+(?:\.\d+)?(?:e[+-]?\d+)?|.", re.DOTALL)
_ELEMENT = re.compile(r"(\w+)\[(\d+)\]")


@dataclass(frozen=True, slots=True)
class OutlinePart:
    """Sub-formulas that share a line: their nodes in the core, each once, how many there are in each formula that they
    are part of ("" for one), and the line, at depth 0."""

    nodes: tuple[int, ...]
    count: str
    line: Line


class FormulaTree:
    """The formulas of a spec as a tree of parts. `fold=False` keeps every sub-formula apart."""

    def __init__(self, outline: Outline, *, fold: bool = True) -> None:
        self._outline, self._core = outline, outline.core
        self._objects = set(outline.core.objects)
        self._alike = _alike(outline.core, self._objects) if fold else None

    def root(self, label: str) -> OutlinePart:
        return self._part((self._core.labels[label],), "")

    def children(self, part: OutlinePart) -> list[OutlinePart]:
        """What a part is made of, in the order of the spec; of an atom nothing."""
        parents = [node.args for index in part.nodes if isinstance(node := self._core.nodes[index], Junction)]
        if self._alike is None or not parents:
            return [self._part((arg,), "") for args in parents for arg in args]
        classes: dict[tuple[int, int], list[int]] = {}
        counts: dict[tuple[int, int], Counter[int]] = {}
        for number, args in enumerate(parents):
            for arg in args:
                classes.setdefault(self._alike[arg], []).append(arg)
                counts.setdefault(self._alike[arg], Counter())[number] += 1
        found = []
        for key, nodes in classes.items():
            if len(parents) > 1 or len(nodes) >= MIN_FOLD:
                found.append((nodes[0], self._part(tuple(dict.fromkeys(nodes)), _times(counts[key], len(parents)))))
            else:
                found += [(node, self._part((node,), "")) for node in nodes]
        order = {arg: place for place, arg in reversed(list(enumerate(arg for args in parents for arg in args)))}
        return [one for _, one in sorted(found, key=lambda pair: order[pair[0]])]

    def _part(self, indices: tuple[int, ...], count: str) -> OutlinePart:
        lines = [self._outline.line(index, margin=len(indices) <= MAX_FOLDED) for index in indices]
        text, margin = lines[0].text, lines[0].margin
        if len(lines) > 1:
            text, margin = _common([(line.text, line.margin) for line in lines], self._objects)
        low, high = min(line.low for line in lines), max(line.high for line in lines)
        return OutlinePart(indices, count, Line(0, text, margin, lines[0].unit, low, high))


def _times(counts: Counter[int], parents: int) -> str:
    low, high = min(counts.values()) if len(counts) == parents else 0, max(counts.values())
    return "" if low == high == 1 else str(low) if low == high else f"{low} to {high}"


def _alike(core: Core, objects: set[str]) -> list[tuple[int, int]]:
    """For every formula node two numbers, equal where sub-formulas are alike: how it reads, and where it came from."""
    known: dict[object, int] = {}

    def number(key: object) -> int:
        return known.setdefault(key, len(known))

    found = [(-1, -1)] * len(core.nodes)
    for index, node in enumerate(core.nodes):
        if isinstance(node, Atom):
            places = tuple((span.source.name, span.start, span.end) for span in node.spans)
            found[index] = (number(_shape(node.text, objects)), number(places))
        elif isinstance(node, Junction):
            inner = tuple(dict.fromkeys(found[arg] for arg in node.args))
            found[index] = (number((node.kind, _shape(node.text, objects), inner)), found[node.args[0]][1])
    return found


def _shape(text: str, objects: set[str]) -> tuple[str, ...]:
    return tuple(_kind(token, objects) for token in _TOKENS.findall(text))


def _kind(token: str, objects: set[str]) -> str:
    """What may differ from token to token becomes its kind."""
    return "\0object" if token in objects else "\0number" if token[0].isdigit() else token


def _common(texts: Sequence[tuple[str, str]], objects: set[str]) -> tuple[str, str]:
    """The text and the margin that sub-formulas have in common; the margin is "" where they have none."""
    rows = [[_TOKENS.findall(text) for text in pair] for pair in texts]
    names = _Names(objects)
    found = []
    for which in (0, 1):
        columns = [row[which] for row in rows]
        shapes = {tuple(_kind(token, objects) for token in column) for column in columns}
        if len(shapes) > 1:
            found.append("")
            continue
        found.append("".join(names.text_of(tokens) for tokens in zip(*columns, strict=True)))
    return found[0], found[1]


class _Names:
    """Variables for what differs between sub-formulas: the same everywhere in a line for the same objects."""

    def __init__(self, objects: set[str]) -> None:
        self._objects = objects
        self._indices: list[tuple[str, tuple[int, ...]]] = []
        self._known: dict[tuple[str, ...], str] = {}
        taken = {name.split("[")[0] for name in objects}
        self._free_indices = _free(INDICES, taken)
        self._free_names = _free(NAMES, taken)

    def text_of(self, tokens: tuple[str, ...]) -> str:
        first = tokens[0]
        if all(token == first for token in tokens):
            return first
        if first not in self._objects:
            low, high = min(tokens, key=float), max(tokens, key=float)
            return f"{number_text(float(low))}..{number_text(float(high))}"
        elements = [_ELEMENT.fullmatch(token) for token in tokens]
        arrays = {element[1] if element else None for element in elements}
        if len(arrays) == 1 and None not in arrays:
            return f"{arrays.pop()}[{self._index(tuple(int(element[2]) for element in elements if element))}]"
        if tokens not in self._known:
            self._known[tokens] = next(self._free_names)
        return self._known[tokens]

    def _index(self, numbers: tuple[int, ...]) -> str:
        """`i`, or `i+1` where the numbers are always one more than those that are called i."""
        for name, others in self._indices:
            apart = {one - other for one, other in zip(numbers, others, strict=True)}
            if len(apart) == 1:
                step = apart.pop()
                return f"{name}{step:+d}" if step else name
        name = next(self._free_indices)
        self._indices.append((name, numbers))
        return name


def _free(letters: str, taken: set[str]) -> Iterator[str]:
    yield from (letter for letter in letters if letter not in taken)
    number = 1
    while True:
        number += 1
        yield f"{letters[0]}{number}"


def chosen_label(labels: Sequence[str], label: str | None) -> str:
    """The label asked for, or the first. Raises RequestError for one that the spec does not have."""
    if label is None:
        return labels[0]
    if label not in labels:
        raise RequestError(UNKNOWN_LABEL(name=label, known=labels))
    return label
