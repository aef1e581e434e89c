"""What nodes of the core formula read: coordinates, parts of junctions, a clearance and a constant."""

from __future__ import annotations

from collections.abc import Sequence

from scenegen.lang.core import Apply, Atom, Const, Core, Junction, Node, children
from scenegen.pose import FLAT, PLACE
from scenegen.primitives import PRIMITIVES, Footprint
from scenegen.primitives.footprint import Circle


def read_by(node: Node) -> list[int]:
    """The nodes that a value depends on: a circle's heading is not one of them."""
    if not isinstance(node, Apply) or not node.shapes:
        return list(children(node))
    read: list[int] = []
    at = 0
    shapes = iter(node.shapes)
    for kind in PRIMITIVES[node.primitive].params:
        size = {"number": 1, "place": len(PLACE), "footprint": len(FLAT)}[kind]
        args = node.args[at : at + size]
        at += size
        read += args[: len(PLACE)] if kind == "footprint" and isinstance(next(shapes), Circle) else args
    return read


def needed(args: Sequence[int], shape: Footprint) -> Sequence[int]:
    """Arguments x, y and heading, of a round footprint the first two."""
    return args[: len(PLACE)] if isinstance(shape, Circle) else args


def members(bits: int) -> list[int]:
    found = []
    while bits:
        lowest = bits & -bits
        found.append(lowest.bit_length() - 1)
        bits ^= lowest
    return found


def flat(core: Core, index: int) -> list[int]:
    """The arguments of a junction, those of junctions of the same kind within it instead of these; each only once."""
    top = core.nodes[index]
    assert isinstance(top, Junction)
    found: dict[int, None] = {}
    waiting = list(reversed(top.args))
    while waiting:
        arg = waiting.pop()
        node = core.nodes[arg]
        if isinstance(node, Junction) and node.kind == top.kind:
            waiting += reversed(node.args)
        else:
            found[arg] = None
    return list(found)


def ways_of(core: Core, index: int) -> list[int]:
    """The numbers of which a formula's value is the largest: those of a disjunction's atoms, and of a `max` in them."""
    found: dict[int, None] = {}
    waiting = [index]
    while waiting:
        index = waiting.pop()
        match core.nodes[index]:
            case Junction("max", args) | Apply("max", args):
                waiting += reversed(args)
            case Atom(margin=margin):
                waiting.append(margin)
            case _:
                found[index] = None
    return list(found)


def offset_of(nodes: Sequence[Node], index: int) -> tuple[int, float, float] | None:
    """An atom's margin, or a number, as sign times a clearance or distance, plus a constant: its node, the sign, the
    constant."""
    node = nodes[index]
    index, sign, constant = node.margin if isinstance(node, Atom) else index, 1.0, 0.0
    while True:
        node = nodes[index]
        if not isinstance(node, Apply):
            return None
        if node.primitive in ("gap", "dist"):
            return index, sign, constant
        values = [nodes[arg] for arg in node.args]
        match node.primitive, values:
            case "neg", _:
                index, sign = node.args[0], -sign
            case "add", [_, Const(value)]:
                index, constant = node.args[0], constant + sign * value
            case "add", [Const(value), _]:
                index, constant = node.args[1], constant + sign * value
            case "sub", [_, Const(value)]:
                index, constant = node.args[0], constant - sign * value
            case "sub", [Const(value), _]:
                index, constant, sign = node.args[1], constant + sign * value, -sign
            case _:
                return None
