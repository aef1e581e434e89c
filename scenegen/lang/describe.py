"""Numbers of the core formula in the words of the language."""

from __future__ import annotations

from collections.abc import Sequence

from scenegen.lang.core import Apply, Const, Coord, Node
from scenegen.pose import NAMES
from scenegen.primitives import POINT, PRIMITIVES, Footprint, Primitive

LONGEST = 120  # characters; what is cut off is marked with three dots

_SHAPES = {"Circle": "circle", "Box": "rect", "Polygon": "polygon"}  # regions, whose names the core does not keep
_INFIX = {"add": (1, "+"), "sub": (1, "-"), "mul": (2, "*"), "div": (2, "/")}


def number_text(value: float) -> str:
    """A constant, to as many digits as people read: up to 6 significant ones."""
    return f"{value:.6g}"


def describe(nodes: Sequence[Node], objects: Sequence[str], index: int) -> str:
    """The number at `index` as a formula over x, y and theta of the objects, cut to LONGEST characters."""
    out: list[str] = []
    length = 0
    stack: list[str | tuple[int, int]] = [(index, 0)]
    while stack and length <= LONGEST:
        item = stack.pop()
        if isinstance(item, str):
            out.append(item)
            length += len(item)
            continue
        stack.extend(reversed(_pieces(nodes, objects, *item)))
    text = "".join(out)
    return text if not stack and length <= LONGEST else text[:LONGEST] + "..."


def _pieces(nodes: Sequence[Node], objects: Sequence[str], index: int, demanded: int) -> list[str | tuple[int, int]]:
    match nodes[index]:
        case Const(value):
            return [number_text(value)]
        case Coord(which, axis):
            return [f"{NAMES[axis]}({objects[which]})"]
        case Apply("neg", (value,)):
            return ["-", (value, 3)]
        case Apply(primitive, args, shapes) if {"place", "footprint"} & set(PRIMITIVES[primitive].params):
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
    kinds: tuple[str, ...] = primitive.params
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
