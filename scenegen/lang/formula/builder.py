"""Making a core formula: nodes are shared, constants folded, negation pushed to the atoms as it is asked for."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Literal

from scenegen.errors import Span
from scenegen.geometry import MATH, POINT, PRIMITIVES, Footprint, Primitive
from scenegen.geometry.primitives import Unit, argument_kinds
from scenegen.lang.formula.core import (
    Apply,
    Atom,
    BoundedUntil,
    Const,
    Coord,
    Core,
    Everywhere,
    Junction,
    Moment,
    Node,
    Variable,
    Window,
    children,
    renumber,
)
from scenegen.pose import NAMES

MAX_TEXT_LENGTH = 120  # characters; what is cut off is marked with three dots

# regions, whose names the core does not keep, and parts of hands
_SHAPES = {"Circle": "circle", "Box": "rect", "Polygon": "polygon", "PlacedBox": "rect", "Stack": "polygon"}
_INFIX = {"add": (1, "+"), "sub": (1, "-"), "mul": (2, "*"), "div": (2, "/")}


def number_text(value: float) -> str:
    """A constant, to as many digits as people read: up to 6 significant ones."""
    return f"{value:.6g}"


def describe(nodes: Sequence[Node], objects: Sequence[str], index: int, called: Mapping[int, str] | None = None) -> str:
    """The number at `index` as a formula over x, y and theta of the objects, cut to MAX_TEXT_LENGTH characters; numbers
    that have words of their own stand as these."""
    words = called or {}
    out: list[str] = []
    length = 0
    stack: list[str | tuple[int, int]] = [(index, 0)]
    while stack and length <= MAX_TEXT_LENGTH:
        item = stack.pop()
        if isinstance(item, str):
            out.append(item)
            length += len(item)
            continue
        stack.extend(reversed([words[item[0]]] if item[0] in words else _pieces(nodes, objects, *item)))
    text = "".join(out)
    return text if not stack and length <= MAX_TEXT_LENGTH else text[:MAX_TEXT_LENGTH] + "..."


def _pieces(nodes: Sequence[Node], objects: Sequence[str], index: int, demanded: int) -> list[str | tuple[int, int]]:
    match nodes[index]:
        case Const(value):
            return [number_text(value)]
        case Variable(name):
            return [name]
        case Coord(which, axis):
            return [f"{NAMES[axis]}({objects[which]})"]
        case Apply("neg", (value,)):
            return ["-", (value, 3)]
        case Apply(primitive, args, _) if PRIMITIVES[primitive].crowd:
            return [f"{PRIMITIVES[primitive].name}(", *_place(nodes, objects, args[:2]), ", ...)"]
        case Apply(primitive, args, shapes) if PRIMITIVES[primitive].spatial:
            return _spatial(nodes, objects, PRIMITIVES[primitive], args, shapes)
        case Apply(primitive, args) if primitive in _INFIX:
            strength, symbol = _INFIX[primitive]
            inner: list[str | tuple[int, int]] = [(args[0], strength), f" {symbol} ", (args[1], strength + 1)]
            return ["(", *inner, ")"] if strength < demanded else inner
        case Apply("pick", (switch, _, before, after)):  # a height that a choice decides: (0.3 or 0.6)
            sides: list[str | tuple[int, int]] = ["(", (before, 0)]
            node = nodes[after]
            while isinstance(node, Apply) and node.primitive == "pick" and node.args[0] == switch:
                sides += [" or ", (node.args[2], 0)]
                after = node.args[3]
                node = nodes[after]
            return [*sides, " or ", (after, 0), ")"]
        case Apply(primitive, args):
            pieces: list[str | tuple[int, int]] = [f"{PRIMITIVES[primitive].name}("]
            for position, arg in enumerate(args):
                pieces += [", "] if position else []
                pieces.append((arg, 0))
            return [*pieces, ")"]
        case formula:
            raise TypeError(f"not a number: {formula}")


def _spatial(
    nodes: Sequence[Node],
    objects: Sequence[str],
    primitive: Primitive,
    args: tuple[int, ...],
    shapes: tuple[Footprint, ...],
) -> list[str | tuple[int, int]]:
    """A primitive over places and footprints: two or three coordinates make one argument."""
    pieces: list[str | tuple[int, int]] = [f"{primitive.name}("]
    waiting = list(shapes)
    kinds: tuple[str, ...] = argument_kinds(primitive.name, len(shapes))
    at = 0
    for position, kind in enumerate(kinds):
        pieces += [", "] if position else []
        if kind == "number":
            pieces.append((args[at], 0))
            at += 1
            continue
        place = _place(nodes, objects, args[at : at + 2])
        if kind == "footprint":
            shape = waiting.pop(0)
            if len(place) > 1 and shape != POINT:
                place = [f"{_SHAPES[type(shape).__name__]} at ", *place]
        pieces += place
        at += 2 if kind == "place" else 3
    return [*pieces, ")"]


def _place(nodes: Sequence[Node], objects: Sequence[str], args: tuple[int, ...]) -> list[str | tuple[int, int]]:
    x, y = (nodes[arg] for arg in args)
    if isinstance(x, Coord) and isinstance(y, Coord) and x.object == y.object and (x.axis, y.axis) == (0, 1):
        return [objects[x.object]]
    return ["(", (args[0], 0), ", ", (args[1], 0), ")"]


# formulas that hold everywhere or nowhere; junctions swallow them, so none is left in a finished core
TRUE = -1
FALSE = -2

MAX_NODES = 1_000_000

RIGHT_ANGLE = 1e-15  # sines and cosines of constants that are smaller count as 0


class DependsOnRound(Exception):  # noqa: N818 - a signal to the quantifier
    """What a body means depends on the number that a variable stands for in a round."""


class FormulaTooLarge(Exception):  # noqa: N818 - a signal to the checker, which words the diagnostic
    """The spec that there is too much of: what it does, in words."""


class CoreBuilder:
    """Nodes under construction. Every method returns the index of the node that stands for its result."""

    def __init__(self, objects: Sequence[str]) -> None:
        self.objects = tuple(objects)
        self.nodes: list[Node] = []
        self._index: dict[object, int] = {}
        self._negation: dict[int, int] = {TRUE: FALSE, FALSE: TRUE}
        self._sides: dict[int, tuple[int, int]] = {}  # of an atom, the numbers that it compares
        self.moving = 0  # objects that have coordinates of the moment before, too: all, in a spec over time
        self.called: dict[int, str] = {}  # numbers that have words of their own: speed(mug)
        self.varying: set[int] = set()  # numbers that `variable`s alone decide, while there are any

    def _add(self, node: Node, key: object) -> int:
        known = self._index.get(key)
        if known is None:
            if len(self.nodes) >= MAX_NODES:
                raise FormulaTooLarge(f"expands to more than {MAX_NODES:,} parts")
            known = self._index[key] = len(self.nodes)
            self.nodes.append(node)
        return known

    def const(self, value: float) -> int:
        return self._add(Const(value), ("const", value, math.copysign(1.0, value)))

    def coord(self, index: int, axis: int) -> int:
        known = self._index.get((index, axis))
        return self._add(Coord(index, axis), (index, axis)) if known is None else known

    def previous_coord(self, index: int, axis: int) -> int:
        """The coordinate of an object at the moment before; at the first moment, at that one."""
        return self.coord(self.moving + index, axis)

    def variable(self, name: str) -> int:
        """A number that stands for those of all rounds of a quantifier, until `varying` is emptied."""
        number = self._add(Variable(name), ("variable", len(self.nodes)))
        self.varying.add(number)
        return number

    def value(self, number: int) -> float | None:
        """The value of a constant number, None of one that depends on the scene."""
        node = self.nodes[number]
        return node.value if isinstance(node, Const) else None

    def apply(self, primitive: str, args: Sequence[int], shapes: tuple[Footprint, ...] = ()) -> int:
        """A primitive over numbers; over constants alone it is computed now. Raises OverflowError for infinity."""
        nodes = self.nodes
        values = [node.value if isinstance(node := nodes[arg], Const) else None for arg in args]
        short = self._simpler(primitive, args, values)
        if short is not None:
            return short
        known = [value for value in values if value is not None]
        if len(known) == len(values):
            result = float(PRIMITIVES[primitive].evaluate(MATH, *shapes, *known))
            if not math.isfinite(result):
                raise OverflowError
            if primitive in ("sin", "cos") and abs(result) < RIGHT_ANGLE:
                result = 0.0  # 90 deg is a rounded right angle; that its cosine is 0 is meant
            return self.const(result)
        if len(args) == 1 and PRIMITIVES[primitive].variadic:
            return args[0]
        key = (primitive, tuple(args), shapes)
        known_ = self._index.get(key)
        result_ = self._add(Apply(*key), key) if known_ is None else known_
        if self.varying and all(isinstance(nodes[arg], Const) or arg in self.varying for arg in args):
            self.varying.add(result_)
        return result_

    def _simpler(self, primitive: str, args: Sequence[int], values: Sequence[float | None]) -> int | None:
        """A number that needs no primitive: x + 0, x * 1. `values` are those of the arguments that are constants."""
        if primitive == "mul":
            if 1.0 in values:  # an ANGLE_SCALE of 1 costs nothing
                return args[1 - values.index(1.0)]
            return self.const(0.0) if 0.0 in values else None
        if primitive in ("add", "sub"):
            if values[1] == 0.0:
                return args[0]
            if primitive == "add":
                return args[1] if values[0] == 0.0 else None
        # a thing beside itself: the same in every scene, and the checker says so
        alike = PRIMITIVES[primitive].vanishes and args[: len(args) // 2] == args[len(args) // 2 :]
        return self.const(0.0) if alike else None

    def text(self, number: int) -> str:
        """A number as the text of an atom shows it."""
        return describe(self.nodes, self.objects, number, self.called)

    def atom(self, lower: int, upper: int, text: str, unit: Unit, spans: tuple[Span, ...]) -> int:
        """lower <= upper, with the margin upper - lower; its negation has lower - upper, which rounds to the same."""
        return self.atom_of(self.apply("sub", (upper, lower)), lower, upper, text, unit, spans)

    def atom_of(self, margin: int, lower: int, upper: int, text: str, unit: Unit, spans: tuple[Span, ...]) -> int:
        """The atom with the margin upper - lower, which is there already."""
        key = ("atom", margin, text)
        known = self._index.get(key)
        if known is None:
            known = self._add(Atom(margin, text, unit, spans), key)
            self._sides[known] = lower, upper
        return known

    def add_remark(self, index: int, remark: str) -> int:
        """An atom with a remark at the end of its text."""
        atom = self.nodes[index]
        assert isinstance(atom, Atom)
        return self.atom_of(atom.margin, *self._sides[index], atom.text + remark, atom.unit, atom.spans)

    def _opposite(self, index: int, atom: Atom) -> None:
        """Makes the negation of an atom: most are never asked for."""
        lower, upper = self._sides[index]
        text = _negation_text(atom.text)
        margin = self.apply("sub", (lower, upper))
        fails = self._add(Atom(margin, text, atom.unit, atom.spans), ("atom", margin, text))
        self._negation[index] = fails
        self._negation.setdefault(fails, index)
        self._sides.setdefault(fails, (upper, lower))

    def junction(self, kind: Literal["min", "max"], parts: Sequence[int], text: str = "") -> int:
        """Conjunction or disjunction of formulas; doubles are dropped, true and false decided."""
        absorbing, neutral = (FALSE, TRUE) if kind == "min" else (TRUE, FALSE)
        kept = tuple(dict.fromkeys(part for part in parts if part != neutral))
        if absorbing in kept:
            return absorbing
        if not kept:
            return neutral
        if len(kept) == 1:
            return kept[0]
        return self._add(Junction(kind, kept, text), (kind, kept))

    def negate(self, formula: int) -> int:
        """min and max change places, atoms their sign; each node is turned once, however often it is used."""
        stack = [formula]
        while stack:
            top = stack[-1]
            if top in self._negation:
                stack.pop()
                continue
            node = self.nodes[top]
            if isinstance(node, Atom):
                self._opposite(top, node)
                continue
            below = children(node)
            waiting = [part for part in below if part not in self._negation]
            if waiting:
                stack.extend(waiting)
                continue
            stack.pop()
            turned = self._negate_node(node, [self._negation[part] for part in below])
            self._negation[top] = turned
            self._negation.setdefault(turned, top)
        return self._negation[formula]

    def _negate_node(self, node: Node, parts: Sequence[int]) -> int:
        """The negation of a formula whose parts have the negations `parts`."""
        if isinstance(node, Everywhere):
            return self.everywhere(not node.holds)
        assert isinstance(node, Junction | Window | BoundedUntil | Moment)
        text = _negation_text(node.text) if node.text else ""
        if isinstance(node, Moment):
            return self.moment(node.which, parts[0], text)
        kind: Literal["min", "max"] = "max" if node.kind == "min" else "min"
        if isinstance(node, Window):
            return self.window(kind, parts[0], node.lowest, node.highest, text)
        if isinstance(node, BoundedUntil):
            return self.until(kind, parts[0], parts[1], node.lowest, node.highest, node.closed, text)
        return self.junction(kind, parts, text)

    def everywhere(self, holds: bool) -> int:
        """What holds at every moment, or at none, beside formulas that end with the horizon."""
        made = self._add(Everywhere(holds), ("everywhere", holds))
        self._negation.setdefault(made, self._add(Everywhere(not holds), ("everywhere", not holds)))
        return made

    def window(self, kind: Literal["min", "max"], part: int, lowest: int, highest: int, text: str = "") -> int:
        """The least or largest value over a window of moments."""
        if part in (TRUE, FALSE):
            if lowest == 0 or (part == TRUE) == (kind == "min"):
                return part  # no window from now on is empty; and of none the least is infinity
            part = self.everywhere(part == TRUE)
        if lowest == highest == 0:
            return part
        return self._add(Window(kind, part, lowest, highest, text), ("window", kind, part, lowest, highest))

    def until(
        self, kind: Literal["min", "max"], left: int, right: int, lowest: int, highest: int, closed: bool, text: str
    ) -> int:
        """`left` until `right`, or the dual of that."""
        left, right = (self.everywhere(part == TRUE) if part in (TRUE, FALSE) else part for part in (left, right))
        key = ("until", kind, left, right, lowest, highest, closed)
        return self._add(BoundedUntil(kind, left, right, lowest, highest, closed, text), key)

    def moment(self, which: Literal["first", "last", "steps"], part: int, text: str = "") -> int:
        """A formula at the first or the last moment, or at all but the first."""
        if part in (TRUE, FALSE):
            return part
        return self._add(Moment(which, part, text), ("moment", which, part))

    def finish(self, labels: dict[str, int], requirement: int | None = None) -> Core:
        """The core of these labels: every node after those that it is computed from, and the first label's first.

        What no label needs is left out. The order is that of the formulas alone: a number that a declaration was the
        first to mention stands where the formulas come to it, so equal formulas have equal tapes.
        """
        place: dict[int, int] = {}
        nodes: list[Node] = []
        stack = [*labels.values(), *(() if requirement is None else (requirement,))][::-1]
        while stack:
            index = stack.pop()
            if index < 0:  # all that it is computed from has its place
                if ~index not in place:
                    place[~index] = len(nodes)
                    nodes.append(renumber(self.nodes[~index], place))
            elif index not in place:
                needed = children(self.nodes[index])
                if needed:
                    stack.append(~index)
                    stack += [child for child in reversed(needed) if child not in place]
                else:
                    place[index] = len(nodes)
                    nodes.append(self.nodes[index])
        kept = None if requirement is None else place[requirement]
        return Core(tuple(nodes), {name: place[index] for name, index in labels.items()}, self.objects, kept)


def _negation_text(text: str) -> str:
    """`!text`, with the parentheses it needs; a double negation falls away."""
    if text.startswith("!"):
        inner = text[1:]
        return inner[1:-1] if inner.startswith("(") and inner.endswith(")") else inner
    return f"!({text})" if " <= " in text or " >= " in text else f"!{text}"
