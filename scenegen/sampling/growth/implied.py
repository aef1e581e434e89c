"""What follows from a formula and touches fewer objects than it does.

`evenlySpaced` holds every gap of a row against the mean of all gaps: none of it can be scored before the last object of
the row is placed, and by then it is too late. But two gaps that are each within e of the mean are within 2 e of each
other, and that touches three or four objects. The margin e - |a - b| / 2 is at least the mean of the two, so never
below the smaller one: to add it to their conjunction changes no value of phi.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from scenegen.bounds.effort import Effort
from scenegen.bounds.tape import make_tape
from scenegen.lang.core import Apply, Atom, Const, Core, Junction, Node, moved
from scenegen.sampling.problem import Problem

Even = tuple[int, int, float]
"""One number, the mean of several of which it is one (nodes), and how near they must be."""


def strengthened(problem: Problem, effort: Effort) -> Problem:
    """The problem with what its formulas imply, for growth; phi of every scene is the same but for rounding. Raises
    what `effort` raises."""
    core = with_implied(problem.core)
    if core is problem.core:
        return problem
    return replace(problem, core=core, tape=make_tape(core, problem.lowest, problem.highest, effort))


def with_implied(core: Core) -> Core:
    """The core with an atom more for every two numbers that a conjunction holds against their mean; the core itself
    where there are none."""
    nodes: list[Node] = []
    place: dict[int, int] = {}
    for old, node in enumerate(core.nodes):
        new = moved(node, place)
        if isinstance(node, Junction) and isinstance(new, Junction) and node.kind == "min":
            more = _pairs(core.nodes, node, place, nodes)
            new = replace(new, args=(*new.args, *more)) if more else new
        place[old] = len(nodes)
        nodes.append(new)
    if len(nodes) == len(core.nodes):
        return core
    labels = {name: place[node] for name, node in core.labels.items()}
    required = None if core.requirement is None else place[core.requirement]
    return Core(tuple(nodes), labels, core.objects, required)


def _pairs(old: Sequence[Node], junction: Junction, place: dict[int, int], nodes: list[Node]) -> list[int]:
    """Atoms for the pairs of one conjunction, appended to the nodes."""
    found: dict[int, list[tuple[Even, Atom]]] = {}
    for arg in junction.args:
        atom = old[arg]
        if isinstance(atom, Atom) and (even := _even(old, atom)) is not None:
            found.setdefault(even[1], []).append((even, atom))
    added = []
    for group in found.values():
        for number, (one, atom) in enumerate(group):
            for other, _ in group[:number]:
                begin = len(nodes)
                nodes += [
                    Const(0.5 * (one[2] + other[2])),
                    Const(0.5),
                    Apply("sub", (place[one[0]], place[other[0]])),
                    Apply("abs", (begin + 2,)),
                    Apply("mul", (begin + 3, begin + 1)),
                    Apply("sub", (begin, begin + 4)),
                    Atom(begin + 5, atom.text, atom.unit, atom.spans),
                ]
                added.append(begin + 6)
    return added


def _even(nodes: Sequence[Node], atom: Atom) -> Even | None:
    """The atom as e - |number - mean|, where it is one, and the number one of several of which the mean is."""
    match nodes[atom.margin]:
        case Apply("sub", (limit, size)):
            pass
        case _:
            return None
    match nodes[limit], nodes[size]:
        case Const(value), Apply("abs", (difference,)):
            pass
        case _:
            return None
    match nodes[difference]:
        case Apply("sub", (number, mean)):
            pass
        case _:
            return None
    match nodes[mean]:
        case Apply("mean", args) if number in args and len(args) > 2:
            return number, mean, value
    return None
