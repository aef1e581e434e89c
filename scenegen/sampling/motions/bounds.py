"""What a spec over time says about single steps: how far each object may go and turn, and what phi can be at most.

A bound on a step is a conjunct of the requirement that says `speed(a) <= c`, `displacement(a) <= c` or `spin(a) <= c`,
however it is written (`still(a)` is two of them, and `always` changes nothing). It is the disc, or the interval, from
which a step is drawn; as a requirement it holds anyway.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from scenegen.arrays import Array
from scenegen.lang.formula.core import Apply, Atom, Const, Coord, Core, Junction, Moment, Window
from scenegen.lang.formula.timed import Numpy, Signal, Timed, over_time
from scenegen.pose import THETA, X, Y
from scenegen.search import label_bounds
from scenegen.search.effort import Effort


def step_bounds(timed: Timed) -> tuple[Array, Array]:
    """The largest displacement, metres, and turn, radians, of each object in a step, (N,) each; infinity where nothing
    bounds it."""
    count = len(timed.objects)
    far, turn = np.full(count, np.inf), np.full(count, np.inf)
    for margin in _required_margins(timed):
        for thing, angle, limit in _bounds(timed.state, margin, count) or ():
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
    place = {index: index for index in range(len(nodes))}
    for index in sorted(_required_nodes(timed)):  # children before parents
        node = nodes[index]
        match node:
            case Junction("min", args):
                nodes.append(replace(node, args=tuple(place[arg] for arg in args)))
            case Moment("steps", arg) | Window("min", arg, 0 | 1, _):
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
                found = _bounds(timed.state, margin, len(timed.objects))
                if found is None or any(limit < 0.0 for _, _, limit in found):
                    kept.append(index)
            case _:
                kept.append(index)
    return tuple(dict.fromkeys(kept))


def _required_nodes(timed: Timed) -> set[int]:
    """The nodes over time of whose conjunction the requirement consists, at every moment; it is one of them."""
    waiting, found = [] if timed.requirement is None else [timed.requirement], set[int]()
    while waiting:
        index = waiting.pop()
        if index not in found:
            found.add(index)
            match timed.nodes[index]:
                case Junction("min", args):
                    waiting += args
                case Moment("steps", arg) | Window("min", arg, 0 | 1, _):  # the first step leads to moment 1
                    waiting.append(arg)
    return found


def _required_margins(timed: Timed) -> Iterator[int]:
    """The margins, nodes of the state core, of the atoms whose conjunction is required at every moment."""
    roots = list(timed.state.labels.values())
    required = (timed.nodes[index] for index in _required_nodes(timed))
    states = [roots[node.place] for node in required if isinstance(node, Signal)]
    while states:
        match timed.state.nodes[states.pop()]:
            case Junction("min", args):
                states += args
            case Atom(margin):
                yield margin


def _bounds(core: Core, margin: int, count: int) -> list[tuple[int, bool, float]] | None:
    """Objects, whether it is their turn, and the limit, where a margin that is at least 0 says nothing but that their
    displacements or turns are at most that: c - displacement, or (c - displacement) / c. None of other margins."""
    nodes = core.nodes
    found = []
    waiting = [(margin, 1.0, 0.0)]  # of a sum of a constant and a node times a factor, which is at least 0
    while waiting:
        index, factor, constant = waiting.pop()
        node = nodes[index]
        values = [nodes[arg] for arg in node.args] if isinstance(node, Apply) else []
        match node, values:
            case Apply("neg", (arg,)), _:
                waiting.append((arg, -factor, constant))
            case Apply("add", (arg, _)), [_, Const(value)]:
                waiting.append((arg, factor, constant + factor * value))
            case Apply("add", (_, arg)), [Const(value), _]:
                waiting.append((arg, factor, constant + factor * value))
            case Apply("sub", (arg, _)), [_, Const(value)]:
                waiting.append((arg, factor, constant - factor * value))
            case Apply("sub", (_, arg)), [Const(value), _]:
                waiting.append((arg, -factor, constant + factor * value))
            case (Apply("mul", (arg, _)), [_, Const(value)]) | (Apply("mul", (_, arg)), [Const(value), _]):
                waiting.append((arg, factor * value, constant))
            case Apply("div", (arg, _)), [_, Const(value)] if value != 0.0:
                waiting.append((arg, factor / value, constant))
            case (Apply("max", args), _) if factor < 0.0:
                waiting += [(arg, factor, constant) for arg in args]
            case (Apply("min", args), _) if factor > 0.0:
                waiting += [(arg, factor, constant) for arg in args]
            case _:
                step = _step(core, index, count) if factor < 0.0 else None
                if step is None:
                    return None
                thing, angle = step
                limit = -constant / factor
                found.append((thing, angle, min(limit, math.pi) if angle else limit))
    return found


def _step(core: Core, index: int, count: int) -> tuple[int, bool] | None:
    """The object of which a number is the displacement in a step, or else (True) the turn."""
    node = core.nodes[index]
    if isinstance(node, Apply) and node.primitive == "dist" and len(node.args) == 4:
        thing = _same_object(core, node.args[:2], node.args[2:], (X, Y), count)
        return None if thing is None else (thing, False)
    for primitive in ("abs", "wrap", "sub"):  # abs(wrap(now - before))
        if not isinstance(node, Apply) or node.primitive != primitive:
            return None
        now, *before = node.args
        node = core.nodes[now]
    thing = _same_object(core, (now,), tuple(before), (THETA,), count)
    return None if thing is None else (thing, True)


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
