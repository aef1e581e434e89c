"""What is wanted of a formula, pushed down to its parts, and split into alternatives that exclude one another.

A conjunction lies at or above l if all its parts do; it lies at or below u if *some* part does, and the first one that
does names an alternative. The alternatives of a node are disjoint and leave nothing out, so scenes drawn for each, in
proportion to their volumes, are scenes drawn for the whole. Disjunctions are the mirror image.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np

from scenegen.lang.core import Core, Junction

Ends = tuple[float, float]
EVERYTHING: Ends = (-math.inf, math.inf)


def both(a: Ends, b: Ends) -> Ends:
    return max(a[0], b[0]), min(a[1], b[1])


def push_down(core: Core, wanted: Mapping[int, Ends]) -> dict[int, Ends]:
    """The same demand with every end that all parts of a junction must meet handed to the parts.

    What stays on a junction is what one of its parts must meet: an upper end of a conjunction, a lower end of a
    disjunction. Nodes without a demand are left out.
    """
    out = dict(wanted)
    for index in sorted(out, reverse=True):
        _push(core, out, index)
    return {index: out[index] for index in sorted(out) if out[index] != EVERYTHING}


def _push(core: Core, out: dict[int, Ends], top: int) -> None:
    """Hand the ends at `top` down as far as they go."""
    stack = [top]
    while stack:
        index = stack.pop()
        node = core.nodes[index]
        if not isinstance(node, Junction):
            continue
        low, high = out[index]
        if node.kind == "min":
            passed, kept = (low, math.inf), (-math.inf, high)
        else:
            passed, kept = (-math.inf, high), (low, math.inf)
        out[index] = kept
        if passed == EVERYTHING:
            continue
        for arg in node.args:
            before = out.get(arg, EVERYTHING)
            after = both(before, passed)
            if after != before:
                out[arg] = after
                stack.append(arg)


def alternatives(
    core: Core, wanted: Mapping[int, Ends], index: int
) -> Iterator[tuple[dict[int, Ends], dict[int, Ends]]]:
    """The demand split at junction `index`, which must hold one: one entry per part that can be the first to meet it.

    Each entry is the whole demand of that alternative, pushed down, and what sets it apart: ends of formula nodes that
    hold for its scenes and for no other alternative's. Strict ends are the next number of float64, so that they say
    exactly what they mean about computed values.
    """
    node = core.nodes[index]
    assert isinstance(node, Junction)
    low, high = wanted[index]
    below = node.kind == "min"
    meets: Ends = (-math.inf, high) if below else (low, math.inf)
    fails: Ends = (
        (float(np.nextafter(high, math.inf)), math.inf) if below else (-math.inf, float(np.nextafter(low, -math.inf)))
    )
    rest = {key: ends for key, ends in wanted.items() if key != index}
    for position, arg in enumerate(node.args):
        apart = dict.fromkeys(node.args[:position], fails)
        # A part that occurs twice cannot be the first to meet the demand at its second place.
        if arg in apart:
            continue
        apart[arg] = meets
        demand = dict(rest)
        for key, ends in apart.items():
            demand[key] = both(demand.get(key, EVERYTHING), ends)
        if all(low <= high for low, high in demand.values()):
            yield push_down(core, demand), apart
