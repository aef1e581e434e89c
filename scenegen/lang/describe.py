"""Numbers of the core formula in the words of the language."""

from __future__ import annotations

from collections.abc import Sequence

from scenegen.lang.core import Apply, Const, Coord, Node
from scenegen.primitives import PRIMITIVES
from scenegen.scene.workspace import AXES

LONGEST = 120  # characters; what is cut off is marked with three dots

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
            return [f"{AXES[axis]}({objects[which]})"]
        case Apply("neg", (value,)):
            return ["-", (value, 3)]
        case Apply("dist", args):
            return ["dist(", *_place(nodes, objects, args[:2]), ", ", *_place(nodes, objects, args[2:]), ")"]
        case Apply(primitive, args) if primitive in _INFIX:
            strength, symbol = _INFIX[primitive]
            inner: list[str | tuple[int, int]] = [(args[0], strength), f" {symbol} ", (args[1], strength + 1)]
            return ["(", *inner, ")"] if strength < demanded else inner
        case Apply(primitive, args):
            pieces: list[str | tuple[int, int]] = [f"{PRIMITIVES[primitive].name}("]
            for position, arg in enumerate(args):
                pieces += [", "] if position else []
                pieces.append((arg, 0))
            return [*pieces, ")"]
        case formula:
            raise TypeError(f"not a number: {formula}")


def _place(nodes: Sequence[Node], objects: Sequence[str], args: tuple[int, ...]) -> list[str | tuple[int, int]]:
    x, y = (nodes[arg] for arg in args)
    if isinstance(x, Coord) and isinstance(y, Coord) and x.object == y.object and (x.axis, y.axis) == (0, 1):
        return [objects[x.object]]
    return ["(", (args[0], 0), ", ", (args[1], 0), ")"]
