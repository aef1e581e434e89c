"""Requirements beside declared supports: what contradicts them, and what they make superfluous."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from collections.abc import Set as AbstractSet
from typing import TYPE_CHECKING, Literal

from scenegen.errors import Diagnostic
from scenegen.errors.declarations import STACKED_AND_APART
from scenegen.lang.builder import FALSE, TRUE
from scenegen.lang.core import Apply, Atom, Const, Junction
from scenegen.lang.spec import Support
from scenegen.pose import PLACE
from scenegen.primitives.units import BARE

if TYPE_CHECKING:
    from scenegen.lang.lower import Lowering

DEPTH = 4  # of min and max in a margin that is taken apart: apart() has two


def clashing(
    lowering: Lowering, requirement: int, found: Mapping[int, Support], choices: Mapping[int, Sequence[Support]]
) -> Diagnostic | None:
    """What to say where a requirement keeps an object's footprint clear of what it stands on: of all that it can stand
    on, where that is a choice."""
    nodes, coordinate = lowering.builder.nodes, lowering.coerce.coordinate
    pairs = {}
    options = {upper: [under] for upper, under in found.items()} | dict(choices)
    carriers = {upper: [under.carrier for under in unders] for upper, unders in options.items()}
    for upper, all_ in carriers.items():
        for carrier in all_:
            if carrier is not None and None not in all_:
                first, second = (tuple(coordinate(one, axis) for axis in PLACE) for one in (upper, carrier))
                pairs[first, second] = pairs[second, first] = upper, carrier
    apart: dict[int, set[int]] = {}
    stack = [requirement]
    while stack:
        node = nodes[index] if (index := stack.pop()) >= 0 else None
        if isinstance(node, Junction) and node.kind == "min":
            stack.extend(node.args)
        if not isinstance(node, Atom):
            continue
        margin = nodes[node.margin]
        if isinstance(margin, Apply) and margin.primitive == "gap" and len(margin.args) == 6:
            pair = pairs.get((margin.args[:2], margin.args[3:5]))
            if pair is not None:
                apart.setdefault(pair[0], set()).add(pair[1])
                if apart[pair[0]] < set(carriers[pair[0]]):
                    continue
                one, other = (lowering.builder.objects[which] for which in pair)
                return STACKED_AND_APART(node.spans[-1], upper=one, lower=other)
    return None


def relaxed(lowering: Lowering, formula: int, known: AbstractSet[int]) -> int:
    """A requirement that is satisfied by the same scenes, without the constants in it and without the atoms `known` to
    be required already: of what is required only the sign counts, most pairs of `noCollision` are apart by their
    heights, and what stands in a tray is clear of its walls."""
    builder = lowering.builder
    margins = {atom.margin for which in known if isinstance(atom := builder.nodes[which], Atom)}
    needed, stack = set[int](), [formula]
    while stack:
        if (index := stack.pop()) >= 0 and index not in needed:
            needed.add(index)
            node = builder.nodes[index]
            stack.extend(node.args if isinstance(node, Junction) else ())
    made = {TRUE: TRUE, FALSE: FALSE}
    for index in sorted(needed):  # children first
        node = builder.nodes[index]
        if isinstance(node, Junction):
            made[index] = builder.junction(node.kind, [made[part] for part in node.args], node.text)
        elif isinstance(node, Atom):
            made[index] = _split(lowering, node.margin, node, margins, DEPTH)
    return made[formula]


def _split(lowering: Lowering, margin: int, atom: Atom, known: AbstractSet[int], depth: int) -> int:
    builder = lowering.builder
    node = builder.nodes[margin]
    if isinstance(node, Const):
        return TRUE if node.value >= 0.0 else FALSE
    if margin in known:
        return TRUE
    if depth and isinstance(node, Apply) and node.primitive == "pick":
        switch, end, *sides = node.args
        before, after = (_split(lowering, part, atom, known, depth) for part in sides)
        early, late = (
            builder.atom(*ends, f"{builder.text(ends[0])} <= {builder.text(ends[1])}", BARE, atom.spans)
            for ends in ((switch, end), (end, switch))
        )
        either = [builder.junction("max", [late, before]), builder.junction("max", [early, after])]
        return builder.junction("min", either)
    if depth and isinstance(node, Apply) and node.primitive in ("min", "max"):
        kind: Literal["min", "max"] = "min" if node.primitive == "min" else "max"
        return builder.junction(kind, [_split(lowering, part, atom, known, depth - 1) for part in node.args])
    text = atom.text if margin == atom.margin else f"{builder.text(margin)} >= 0"
    return builder.atom_of(margin, builder.const(0.0), margin, text, atom.unit, atom.spans)
