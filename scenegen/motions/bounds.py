"""What a spec over time says about single steps: how far each object may go and turn, and what phi can be at most.

A bound on a step is a conjunct of the requirement of the form `speed(a) <= c`, `displacement(a) <= c` or `spin(a) <= c`
(`still(a)` is two of them). It is the disc, or the interval, from which a step is drawn; as a requirement it holds
anyway.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from scenegen.bounds import label_bounds
from scenegen.bounds.effort import Effort
from scenegen.lang.core import Apply, Atom, Const, Coord, Core, Junction, Moment
from scenegen.lang.timed import Numpy, Signal, Timed, over_time
from scenegen.pose import THETA, X, Y

Array = npt.NDArray[np.float64]


def step_bounds(timed: Timed) -> tuple[Array, Array]:
    """The largest displacement, metres, and turn, radians, of each object in a step, (N,) each; infinity where nothing
    bounds it."""
    count = len(timed.objects)
    far, turn = np.full(count, np.inf), np.full(count, np.inf)
    for margin in _required_margins(timed):
        found = _bound(timed.state, margin, count)
        if found is not None:
            thing, angle, limit = found
            bounds = turn if angle else far
            bounds[thing] = min(bounds[thing], max(limit, 0.0))
    return far, turn


def without_step_bounds(timed: Timed) -> Timed:
    """The same, with a requirement that leaves out what holds by construction: bounds of steps, where steps are drawn
    within `step_bounds`."""
    if timed.requirement is None:
        return timed
    states, nodes = list(timed.state.nodes), list(timed.nodes)
    labels, roots = dict(timed.state.labels), list(timed.state.labels.values())
    waiting, found = [timed.requirement], set[int]()
    while waiting:
        index = waiting.pop()
        if index not in found:
            found.add(index)
            match nodes[index]:
                case Junction("min", args):
                    waiting += args
                case Moment("steps", arg):
                    waiting.append(arg)
                case _:
                    pass
    place = {index: index for index in range(len(nodes))}
    for index in sorted(found):  # children before parents
        node = nodes[index]
        match node:
            case Junction("min", args):
                nodes.append(replace(node, args=tuple(place[arg] for arg in args)))
            case Moment("steps", arg):
                nodes.append(replace(node, arg=place[arg]))
            case Signal(signal):
                kept = _rest(timed, roots[signal])
                states.append(Junction("min", kept, "") if kept else Const(math.inf))
                labels[str(len(labels))] = len(states) - 1
                nodes.append(Signal(len(labels) - 1))
            case _:
                continue
        place[index] = len(nodes) - 1
    state = Core(tuple(states), labels, timed.state.objects)
    return replace(timed, state=state, nodes=tuple(nodes), requirement=place[timed.requirement])


def _rest(timed: Timed, root: int) -> tuple[int, ...]:
    """The formulas of whose conjunction a state formula consists, without bounds of steps."""
    waiting, kept = [root], list[int]()
    while waiting:
        index = waiting.pop()
        match timed.state.nodes[index]:
            case Junction("min", args):
                waiting += reversed(args)
            case Atom(margin):
                found = _bound(timed.state, margin, len(timed.objects))
                if found is None or found[2] < 0.0:
                    kept.append(index)
            case _:
                kept.append(index)
    return tuple(dict.fromkeys(kept))


def _required_margins(timed: Timed) -> Iterator[int]:
    """The margins, nodes of the state core, of the atoms whose conjunction is required at every moment."""
    waiting = [] if timed.requirement is None else [timed.requirement]
    roots = list(timed.state.labels.values())
    states: list[int] = []
    while waiting:
        match timed.nodes[waiting.pop()]:
            case Junction("min", args):
                waiting += args
            case Moment("steps", arg):
                waiting.append(arg)
            case Signal(place):
                states.append(roots[place])
            case _:
                pass
    while states:
        match timed.state.nodes[states.pop()]:
            case Junction("min", args):
                states += args
            case Atom(margin):
                yield margin
            case _:
                pass


def _bound(core: Core, margin: int, count: int) -> tuple[int, bool, float] | None:
    """The object, whether it is its turn, and the limit, where a margin is `c - displacement` or `c - turn`."""
    nodes = core.nodes
    match nodes[margin]:
        case Apply("sub", (left, right)) if isinstance(nodes[left], Const):
            limit = _constant(core, left)
        case _:
            return None
    node = nodes[right]
    match node:
        case Apply("div", (value, by)) if isinstance(nodes[by], Const):
            limit, node = limit * _constant(core, by), nodes[value]
        case _:
            pass
    match node:
        case Apply("dist", args) if len(args) == 4:
            thing = _same_object(core, args[:2], args[2:], (X, Y), count)
            return None if thing is None else (thing, False, limit)
        case Apply("abs", (arg,)):
            match nodes[arg]:
                case Apply("wrap", (difference,)):
                    match nodes[difference]:
                        case Apply("sub", (now, before)):
                            thing = _same_object(core, (now,), (before,), (THETA,), count)
                            return None if thing is None else (thing, True, min(limit, math.pi))
                        case _:
                            pass
                case _:
                    pass
        case _:
            pass
    return None


def _constant(core: Core, index: int) -> float:
    node = core.nodes[index]
    assert isinstance(node, Const)
    return node.value


def _same_object(
    core: Core, now: tuple[int, ...], before: tuple[int, ...], axes: tuple[int, ...], count: int
) -> int | None:
    """The object whose coordinates these are, now and at the moment before."""
    found = set()
    for one, other, axis in zip(now, before, axes, strict=True):
        first, second = core.nodes[one], core.nodes[other]
        if not (isinstance(first, Coord) and isinstance(second, Coord) and first.axis == second.axis == axis):
            return None
        low, high = sorted((first.object, second.object))
        if high != low + count:
            return None
        found.add(low)
    return found.pop() if len(found) == 1 else None


def phi_bounds(timed: Timed, lowest: Array, highest: Array, effort: Effort) -> dict[str, tuple[float, float]]:
    """What phi of each label can be at most, from interval bounds of the state formulas in the box (3N,): minima and
    maxima over time are monotone in them."""
    if timed.steps:  # every object as it stands now, and as it stood before
        lowest, highest = np.tile(lowest, 2), np.tile(highest, 2)
    ends = label_bounds(timed.state, lowest, highest, effort)

    def everywhere(value: float) -> Array:
        return np.full(timed.horizon.moments, value)

    low, high = (over_time(Numpy(), timed, [everywhere(float(x)) for x in end], everywhere) for end in ends)
    return {name: (float(low[node][0]), float(high[node][0])) for name, node in timed.labels.items()}
