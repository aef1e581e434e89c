"""The body of a quantifier, expanded once for many rounds.

A template is a builder whose variables are placeholders: it writes down what the expansion does instead of doing it,
and `Template.make` then repeats that for each round, at a tenth of the cost. What the expansion does may depend on a
variable's value (`block[i]`, a division by i): then `DependsOnValue` is raised, and every round is expanded by itself.
So is a round whose constants simplify the formula, or where two placeholders stand for the same object.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import count
from typing import Any, Literal, TypeVar, cast

from scenegen.errors import Span
from scenegen.geometry import PRIMITIVES, Footprint
from scenegen.geometry.primitives import Unit
from scenegen.lang.formula.builder import LONGEST, CoreBuilder, describe, number_text
from scenegen.lang.formula.core import Apply, Atom, Const, Coord, Junction, Node

T = TypeVar("T")

FIRST = 1 << 40  # placeholders are numbered from here on, far above all nodes and objects

NUMBER_LENGTH = 13  # characters of a constant in a text, at most
_MARK = re.compile("\ue000([on])([0-9]+)\ue001")  # a placeholder in a text: of an object's name, of a number


class DependsOnValue(Exception):  # noqa: N818 - a signal to the quantifier
    """What the body means depends on the value of a variable."""


def _mark(kind: str, slot: int) -> str:
    return f"\ue000{kind}{slot - FIRST}\ue001"


class _Unknown(float):
    """A constant that differs from round to round, and its mark in texts."""

    mark: str

    def __new__(cls, slot: int) -> _Unknown:
        number = super().__new__(cls, "nan")
        number.mark = _mark("n", slot)
        return number

    def __format__(self, spec: str) -> str:
        return self.mark


class _Overlay(Sequence[T]):
    """The entries below, and those of the template: nodes, or names and marks of objects."""

    def __init__(self, below: Sequence[T], own: dict[int, T]) -> None:
        self._below, self._own = below, own

    def __len__(self) -> int:
        return len(self._below)

    def __getitem__(self, index: Any) -> Any:
        own = self._own.get(index)
        return self._below[index] if own is None else own


Text = tuple[str, tuple[tuple[str, int], ...]]  # a format, and the placeholders that fill it


class Template(CoreBuilder):
    """Records what is built of placeholders; what is built of anything else goes to `below` at once.

    `number()` and `thing()` make the placeholders, in the order in which `make` is given their values: the node of a
    constant, the index of an object.
    """

    def __init__(self, below: CoreBuilder, numbers: Iterator[int], longest_name: int) -> None:
        self.below = below
        self._numbers = numbers
        self._longest = longest_name
        self.own: dict[int, Node] = {}
        self.steps: list[tuple[Any, ...]] = []  # (slot, kind, ...): see _do
        self.constant: set[int] = set()  # numbers that are constants in every round
        self._names: dict[int, str] = {}
        self.given: list[int] = []
        self._known: dict[object, int] = {}
        self._texts: dict[str, Text] = {}
        self.called = below.called
        self.moving = below.moving
        self.nodes = cast(list[Node], _Overlay(below.nodes, self.own))
        self.objects = cast(tuple[str, ...], _Overlay(below.objects, self._names))

    # ---- placeholders

    def number(self) -> int:
        slot = next(self._numbers)
        self.given.append(slot)
        self.own[slot] = Const(_Unknown(slot))
        self.constant.add(slot)
        return slot

    def thing(self) -> int:
        slot = next(self._numbers)
        self.given.append(slot)
        self._names[slot] = _mark("o", slot)
        return slot

    def _step(self, key: tuple[Any, ...], node: Node, *more: Any) -> int:
        slot = self._known.get(key)
        if slot is None:
            slot = self._known[key] = next(self._numbers)
            self.own[slot] = node
            self.steps.append((slot, *key, *more))
        return slot

    # ---- what CoreBuilder does

    def const(self, value: float) -> int:
        return self.below.const(value)

    def coord(self, index: int, axis: int) -> int:
        if index not in self._names:
            return self.below.coord(index, axis)
        return self._step(("coord", index, axis), Coord(index, axis))

    def before(self, index: int, axis: int) -> int:
        raise DependsOnValue  # which step is taken from which object: every round by itself

    def everywhere(self, holds: bool) -> int:
        return self.below.everywhere(holds)

    def window(self, kind: Literal["min", "max"], part: int, lowest: int, highest: int, text: str = "") -> int:
        if part in self.own or self._format(text)[1]:
            raise DependsOnValue
        return self.below.window(kind, part, lowest, highest, text)

    def until(
        self, kind: Literal["min", "max"], left: int, right: int, lowest: int, highest: int, closed: bool, text: str
    ) -> int:
        if left in self.own or right in self.own or self._format(text)[1]:
            raise DependsOnValue
        return self.below.until(kind, left, right, lowest, highest, closed, text)

    def moment(self, which: Literal["first", "last", "steps"], part: int, text: str = "") -> int:
        if part in self.own or self._format(text)[1]:
            raise DependsOnValue
        return self.below.moment(which, part, text)

    def value(self, number: int) -> float | None:
        if number in self.constant:
            raise DependsOnValue
        return None if number in self.own else self.below.value(number)

    def divisor(self, number: int) -> float | None:
        return 1.0 if number in self.constant else self.below.divisor(number)  # `make` looks at the one of the round

    def apply(self, primitive: str, args: Sequence[int], shapes: tuple[Footprint, ...] = ()) -> int:
        if not any(arg in self.own for arg in args):
            return self.below.apply(primitive, args, shapes)
        if len(args) == 1 and PRIMITIVES[primitive].variadic:
            return args[0]
        short = self.shortened(primitive, args, [None if arg in self.own else self.below.value(arg) for arg in args])
        if short is not None:
            return short
        constant = [arg in self.constant or isinstance(self.nodes[arg], Const) for arg in args]
        if not all(constant):
            plain = not any(constant) and not PRIMITIVES[primitive].vanishes
            key = ("plain" if plain else "apply", primitive, tuple(args), shapes)
            return self._step(key, Apply(primitive, tuple(args), shapes))
        slot = self._step(("constant", primitive, tuple(args), shapes), Apply(primitive, tuple(args), shapes))
        if slot not in self.constant:
            self.own[slot] = Const(_Unknown(slot))
            self.constant.add(slot)
        return slot

    def plain(self, primitive: str, args: tuple[int, ...], shapes: tuple[Footprint, ...]) -> int:
        return self.apply(primitive, args, shapes)

    def atom(self, lower: int, upper: int, text: str, unit: Unit, spans: tuple[Span, ...]) -> int:
        if lower not in self.own and upper not in self.own:
            return self.below.atom(lower, upper, text, unit, spans)
        return self.atom_of(self.apply("sub", (upper, lower)), lower, upper, text, unit, spans)

    def atom_of(self, margin: int, lower: int, upper: int, text: str, unit: Unit, spans: tuple[Span, ...]) -> int:
        if margin not in self.own and not self._format(text)[1]:
            return self.below.atom_of(margin, lower, upper, text, unit, spans)
        key = ("atom", margin, lower, upper, self._format(text))
        return self._step(key, Atom(margin, text, unit, spans), unit, spans)

    def junction(self, kind: Literal["min", "max"], parts: Sequence[int], text: str = "") -> int:
        if not any(part in self.own for part in parts) and not self._format(text)[1]:
            return self.below.junction(kind, parts, text)
        kept = tuple(dict.fromkeys(parts))
        if len(kept) == 1:
            return kept[0]
        return self._step(("junction", kind, kept, self._format(text)), Junction(kind, kept, text))

    def negate(self, formula: int) -> int:
        if formula not in self.own:
            return self.below.negate(formula)
        return self._step(("negate", formula), Junction("min", (formula,)))

    def text(self, number: int) -> str:
        text = self.called.get(number) or describe(self.nodes, self.objects, number)
        marks = list(_MARK.finditer(text))
        more = sum((self._longest if mark[1] == "o" else NUMBER_LENGTH) - len(mark[0]) for mark in marks)
        if text.endswith("...") or (marks and len(text) + more > LONGEST):
            raise DependsOnValue  # how much of it is shown depends on the round
        return text

    def _format(self, text: str) -> Text:
        known = self._texts.get(text)
        if known is None:
            places = [(kind, FIRST + int(slot)) for kind, slot in _MARK.findall(text)]
            mine = tuple((kind, slot) for kind, slot in places if slot in self.own or slot in self._names)
            marks = {_mark(*one) for one in mine}
            form = _MARK.sub(lambda mark: "%s" if mark[0] in marks else mark[0], text.replace("%", "%%"))
            known = self._texts[text] = form, mine
        return known

    # ---- rounds

    @property
    def cost(self) -> int:
        """The steps of a round; coordinates are there already."""
        return 1 + sum(1 for step in self.steps if step[1] != "coord")

    def make(self, result: int, given: Sequence[int], remark: str = "") -> int | None:
        """The formula of one round, None where it has to be expanded by itself. `remark` is added to the texts of
        atoms."""
        below, values = self.below, dict(zip(self.given, given, strict=True))
        for step in self.steps:
            made = _do(below, values, step, remark)
            if made is None:
                return None
            values[step[0]] = made
        return values.get(result, result)


def placeholders() -> Iterator[int]:
    return count(FIRST)


def _do(below: CoreBuilder, values: dict[int, int], step: tuple[Any, ...], remark: str) -> int | None:
    """One step of a round: the node that it makes below. None where that is not what the template stands for."""
    get = values.get
    kind = step[1]
    if kind == "apply" or kind == "plain":
        args = tuple([get(arg, arg) for arg in step[3]])
        shapes = step[4]
        if len(shapes) == 2 and args[:3] == args[3:6]:
            return None  # a thing beside itself
        if kind == "plain":
            return below.plain(step[2], args, shapes)
        if step[2] == "div" and below.divisor(args[1]) == 0.0:
            return None
        made = below.apply(step[2], args, shapes)
        node = below.nodes[made]
        return made if isinstance(node, Apply) and node.args == args and node.primitive == step[2] else None
    if kind == "constant":
        try:
            made = below.apply(step[2], [get(arg, arg) for arg in step[3]], step[4])
        except (OverflowError, ZeroDivisionError):
            return None
        return made if isinstance(below.nodes[made], Const) else None
    if kind == "coord":
        return below.coord(values[step[2]], step[3])
    if kind == "atom":
        _, _, margin, lower, upper, text, unit, spans = step
        words = _filled(below, values, text) + remark
        return below.atom_of(get(margin, margin), get(lower, lower), get(upper, upper), words, unit, spans)
    if kind == "junction":
        return below.junction(step[2], [get(part, part) for part in step[3]], _filled(below, values, step[4]))
    formula: int = step[2]
    return below.negate(values[formula])


def _filled(below: CoreBuilder, values: dict[int, int], text: Text) -> str:
    form, places = text
    if not places:
        return form % ()
    return form % tuple(
        [
            below.objects[values[slot]] if kind == "o" else number_text(below.nodes[values[slot]].value)  # type: ignore[union-attr]
            for kind, slot in places
        ]
    )
