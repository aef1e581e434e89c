"""The core of a spec over time, in two layers: formulas of a state, and what time makes of them.

The state formulas are an ordinary core, whose labels are signals: every reader of core formulas computes them, moment
by moment. The second layer is a short tape of its own over these signals.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from scenegen.lang.core import (
    Coord,
    Core,
    Everywhere,
    Junction,
    Moment,
    Node,
    Temporal,
    Until,
    Window,
    children,
    moved,
    part,
)
from scenegen.lang.horizon import Horizon, Movers
from scenegen.lang.windows import Arrays, doubled, extreme, until

MOST_VALUES = 20_000_000  # operators times moments; larger specs are refused


@dataclass(frozen=True, slots=True)
class Signal:
    """The state formula `place` of the state core's labels, at every moment."""

    place: int


TimeNode = Signal | Junction | Window | Until | Moment | Everywhere


@dataclass(frozen=True, slots=True)
class Timed:
    """What a spec over time means, for N objects.

    The labels of `state` are the signals "0", "1", ... Where `steps` is set, it has 2 N objects: as they stand, and as
    they stood at the moment before. A node of `nodes` refers only to earlier ones. A label is its formula's value at
    moment 0; `requirement` holds at every moment.
    """

    state: Core
    nodes: tuple[TimeNode, ...]
    labels: Mapping[str, int]
    requirement: int | None
    horizon: Horizon
    moves: Movers
    objects: tuple[str, ...]
    steps: bool


def split(core: Core, horizon: Horizon, moves: Movers, count: int) -> Timed:
    """The two layers of a core with formulas over time; `count` is N."""
    nodes: list[Node] = list(core.nodes)
    over: list[bool] = []  # whether time takes part in a formula
    for node in nodes:
        over.append(isinstance(node, Temporal) or any(over[child] for child in children(node)))
    signals: dict[int, int] = {}
    made: list[TimeNode] = []
    place: dict[int, int] = {}

    def signal(index: int) -> int:
        if index not in place:
            signals[index] = len(signals)
            place[index] = len(made)
            made.append(Signal(signals[index]))
        return place[index]

    for index, node in enumerate(core.nodes):
        if not over[index]:
            continue
        args = children(node)
        if isinstance(node, Junction):
            still = [arg for arg in args if not over[arg]]
            if len(still) > 1:  # one signal for all
                nodes.append(Junction(node.kind, tuple(still), ""))
                node = replace(node, args=(*(arg for arg in args if over[arg]), len(nodes) - 1))
                args = node.args
        for arg in args:
            if arg >= len(over) or not over[arg]:
                signal(arg)
        place[index] = len(made)
        timed = moved(node, place)
        assert isinstance(timed, Junction | Window | Until | Moment | Everywhere)
        made.append(timed)
    roots = [*core.labels.values(), *(() if core.requirement is None else (core.requirement,))]
    for root in roots:
        if not over[root]:
            signal(root)
    whole = Core(tuple(nodes), {str(number): index for index, number in signals.items()}, core.objects)
    state = part(whole, tuple(whole.labels))
    requirement = None if core.requirement is None else place[core.requirement]
    labels = {name: place[index] for name, index in core.labels.items()}
    steps = any(isinstance(node, Coord) and node.object >= count for node in state.nodes)
    state = state if steps else replace(state, objects=core.objects[:count])
    return Timed(state, tuple(made), labels, requirement, horizon, moves, core.objects[:count], steps)


def over_time(of: Arrays, timed: Timed, signals: Sequence[Any], everywhere: Any) -> list[Any]:
    """The value of every node at every moment, (..., T + 1). `everywhere(x)` is such an array full of x."""
    values: list[Any] = []
    for node in timed.nodes:
        match node:
            case Signal(place):
                value = signals[place]
            case Junction(kind, args):
                step = of.minimum if kind == "min" else of.maximum
                value = values[args[0]]
                for arg in args[1:]:
                    value = step(value, values[arg])
            case Window(kind, arg, lowest, highest):
                value = extreme(of, kind, values[arg], lowest, highest)
            case Until(kind, left, right, lowest, highest, closed):
                if kind == "max":
                    value = until(of, values[left], values[right], lowest, highest, closed)
                else:  # the dual: the negative of an until of negatives, which rounds nothing
                    value = -until(of, -values[left], -values[right], lowest, highest, closed)
            case Moment("first", arg):
                value = everywhere(0.0) + values[arg][..., :1]
            case Moment("last", arg):
                value = everywhere(0.0) + values[arg][..., -1:]
            case Moment(_, arg):
                value = of.maximum(values[arg], of.first(math.inf, everywhere))
            case Everywhere(holds):
                value = everywhere(math.inf if holds else -math.inf)
        values.append(value)
    return values


class Numpy:
    """Arrays of numpy."""

    minimum = staticmethod(np.minimum)
    maximum = staticmethod(np.maximum)

    @staticmethod
    def shift(a: Any, by: int, fill: float) -> Any:
        out = np.full_like(a, fill)
        if by < a.shape[-1]:
            out[..., : a.shape[-1] - by] = a[..., by:]
        return out

    @staticmethod
    def first(value: float, everywhere: Any) -> Any:
        out = everywhere(-math.inf)
        out[..., 0] = value
        return out

    @staticmethod
    def onto(kind: str, a: Any, b: Any) -> Any:
        moments = b.shape[-1]
        out = np.empty_like(a)
        (np.minimum if kind == "min" else np.maximum)(a[..., :moments], b, out=out[..., :moments])
        out[..., moments:] = a[..., moments:]
        return out

    def slide(self, kind: str, a: Any, width: int) -> Any:
        return doubled(self, kind, a, width)


def endless(timed: Timed) -> list[npt.NDArray[np.float64]]:
    """Of every node, where its value is infinite whatever the motion, because it looks beyond the last moment; finite
    numbers are 0. Minima and maxima make infinities of infinities alone, so zeros stand for all motions."""
    moments = timed.horizon.moments

    def everywhere(value: float) -> npt.NDArray[np.float64]:
        return np.full(moments, value)

    return over_time(Numpy(), timed, [everywhere(0.0)] * len(timed.state.labels), everywhere)
