"""The core of a spec over time, in two layers: formulas of a state, and what time makes of them.

The state formulas are an ordinary core, whose labels are signals: every reader of core formulas computes them, moment
by moment. The second layer is a short tape of its own over these signals.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from scenegen.arrays import Array
from scenegen.geometry import NUMPY
from scenegen.lang.formula.core import (
    Atom,
    BoundedUntil,
    Coord,
    Core,
    Everywhere,
    Junction,
    Moment,
    Node,
    Temporal,
    Window,
    children,
    part_of,
    renumber,
)
from scenegen.lang.formula.interpret import deciding_atom, evaluate
from scenegen.pose import SIZE

# Minima, maxima and untils over windows of moments, for numpy and torch alike: time is the last axis.
#
# A window of w moments is put together from windows of 1, 2, 4, ... of them, so a formula takes time proportional to
# T log w, without a loop over moments. For minima: Bentley's decomposition by doubling; `Arrays` can have another
# way. For `until`: a step from a moment to the one before is x -> max(p, min(q, x)), and two such steps make one of
# the same form.


class Arrays(Protocol):
    """What is done to values; a `kind` is "min" or "max". `shift(x, k, fill)` is x at the moments k later, with `fill`
    beyond the last; `first(x, everywhere)` is x at the first moment and minus infinity at all others."""

    def minimum(self, a: Any, b: Any) -> Any: ...
    def maximum(self, a: Any, b: Any) -> Any: ...
    def shift(self, a: Any, by: int, fill: float) -> Any: ...
    def first(self, value: float, everywhere: Any) -> Any: ...

    def onto(self, kind: str, a: Any, b: Any) -> Any:
        """The extreme of a and b, which ends some moments earlier: there it is a."""

    def slide(self, kind: str, a: Any, width: int) -> Any:
        """The extreme over the `width` moments from t on, for every t; fewer where the motion ends. See `doubled`."""


def extreme(of: Arrays, kind: str, values: Any, lowest: int, highest: int) -> Any:
    """The least ("min") or largest value at the moments t + lowest to t + highest, for every t: (..., T + 1)."""
    if lowest:
        values = of.shift(values, lowest, math.inf if kind == "min" else -math.inf)
    width = min(highest - lowest + 1, values.shape[-1])
    return of.slide(kind, values, width) if width > 1 else values


def slide_by_doubling(of: Arrays, kind: str, values: Any, width: int) -> Any:
    """`slide` in log `width` passes."""
    done = 1
    while 2 * done <= width:
        values = of.onto(kind, values, values[..., done:])
        done *= 2
    return values if done == width else of.onto(kind, values, values[..., width - done :])


def until(of: Arrays, left: Any, right: Any, lowest: int, highest: int, closed: bool) -> Any:
    """The largest value, over the moments t' from t + lowest to t + highest, of the minimum of `right` at t' and of
    `left` from t to before t' (where it is `closed`: to t'); for every t: (..., T + 1)."""
    ends = of.minimum(left, right) if closed else right
    found = _steps(of, ends, left, highest - lowest + 1)
    if not lowest:
        return found
    return of.minimum(of.shift(found, lowest, -math.inf), extreme(of, "min", left, 0, lowest - 1))


def _steps(of: Arrays, p: Any, q: Any, count: int) -> Any:
    """`count` steps x -> max(p, min(q, x)) from t on, the last of them from minus infinity."""
    done_p: Any = None
    done_q: Any = None
    passed = 0  # steps that are in `done`: the first ones
    width = 1
    count = min(count, p.shape[-1])  # further steps find nothing
    while True:
        if count & 1:
            done_p, done_q = (p, q) if done_p is None else _compose_steps(of, done_p, done_q, p, q, passed)
            passed += width
        count >>= 1
        if not count:
            return done_p
        p, q = _compose_steps(of, p, q, p, q, width)
        width *= 2


def _compose_steps(of: Arrays, p: Any, q: Any, then_p: Any, then_q: Any, by: int) -> tuple[Any, Any]:
    """max(p, min(q, max(then_p, min(then_q, x)))) as one such step, where `then` is `by` moments later. Beyond the last
    moment a step changes nothing, and finds nothing."""
    then_p, then_q = then_p[..., by:], then_q[..., by:]
    before = of.minimum(q[..., : then_p.shape[-1]], then_p)
    return of.onto("max", p, before), of.onto("min", q, then_q)


MAX_TIME_STEPS = 100_000

Movers = Literal["one", "all"]  # what moves in a step


@dataclass(frozen=True, slots=True)
class Horizon:
    """The moments 0, 1, ... `steps` of a motion, `dt` seconds apart: steps + 1 of them."""

    steps: int
    dt: float

    @property
    def moments(self) -> int:
        return self.steps + 1

    @property
    def seconds(self) -> float:
        return self.steps * self.dt


MAX_TIMED_VALUES = 20_000_000  # operators times moments; larger specs are refused


@dataclass(frozen=True, slots=True)
class Signal:
    """The state formula `place` of the state core's labels, at every moment."""

    place: int


TimeNode = Signal | Junction | Window | BoundedUntil | Moment | Everywhere


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
        timed = renumber(node, place)
        assert isinstance(timed, Junction | Window | BoundedUntil | Moment | Everywhere)
        made.append(timed)
    roots = [*core.labels.values(), *(() if core.requirement is None else (core.requirement,))]
    for root in roots:
        if not over[root]:
            signal(root)
    whole = Core(tuple(nodes), {str(number): index for index, number in signals.items()}, core.objects)
    state = part_of(whole, tuple(whole.labels))
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
            case BoundedUntil(kind, left, right, lowest, highest, closed):
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
        return slide_by_doubling(self, kind, a, width)


def endless(timed: Timed) -> list[npt.NDArray[np.float64]]:
    """Of every node, where its value is infinite whatever the motion, because it looks beyond the last moment; finite
    numbers are 0. Minima and maxima make infinities of infinities alone, so zeros stand for all motions."""
    moments = timed.horizon.moments

    def everywhere(value: float) -> npt.NDArray[np.float64]:
        return np.full(moments, value)

    return over_time(Numpy(), timed, [everywhere(0.0)] * len(timed.state.labels), everywhere)


class ActiveAtom(NamedTuple):
    """The atom whose margin is phi, and the moment at which it is: it alone would have to change for phi to change."""

    atom: Atom
    moment: int


@dataclass(frozen=True, slots=True)
class TimedValues:
    """The values of a motion: of every node of the state core and of every formula over time, each (T + 1,)."""

    timed: Timed
    states: list[Array]
    values: list[Array]

    @property
    def phi(self) -> dict[str, float]:
        """phi of every label: its formula's value at moment 0."""
        return {name: float(self.values[node][0]) for name, node in self.timed.labels.items()}

    @property
    def signals(self) -> dict[str, Array]:
        """The value of every label's formula at every moment, (T + 1,); infinite where it looks beyond the last."""
        return {name: self.values[node] for name, node in self.timed.labels.items()}

    @property
    def requirement(self) -> Array | None:
        """What is required, at every moment, (T + 1,): met where it is >= 0. None where nothing is."""
        return None if self.timed.requirement is None else self.values[self.timed.requirement]

    def decides(self, label: str | None) -> ActiveAtom:
        """What decides phi of a label; None: the requirement, where it is least."""
        if label is not None:
            return self._walk(self.timed.labels[label], 0)
        assert self.timed.requirement is not None
        return self._walk(self.timed.requirement, int(self.values[self.timed.requirement].argmin()))

    def _walk(self, index: int, t: int) -> ActiveAtom:
        while True:
            node, values = self.timed.nodes[index], self.values
            value = values[index][t]
            match node:
                case Signal(place):
                    label = str(place)
                    core = self.timed.state
                    now = [float(one[t]) for one in self.states]
                    atom = core.nodes[deciding_atom(core, label, now)]
                    assert isinstance(atom, Atom)
                    return ActiveAtom(atom, t)
                case Junction(_, args):
                    index = next(arg for arg in args if values[arg][t] == value)
                case Window(_, arg, lowest, highest):
                    index, t = arg, t + lowest + _first(values[arg][t + lowest : t + highest + 1], value)
                case Moment(which, arg):
                    index, t = arg, {"first": 0, "last": len(values[arg]) - 1, "steps": t}[which]
                case BoundedUntil():
                    index, t = self._until(node, t, value)
                case Everywhere():
                    raise ValueError("a value that is infinite in every motion has no atom")

    def _until(self, node: BoundedUntil, t: int, value: float) -> tuple[int, int]:
        sign = 1.0 if node.kind == "max" else -1.0
        left, right = (sign * self.values[part][t : t + node.highest + 1] for part in (node.left, node.right))
        held = np.minimum.accumulate(left)
        if not node.closed:
            held = np.concatenate([[math.inf], held[:-1]])
        both = np.minimum(held, right)
        end = node.lowest + _first(both[node.lowest :], sign * value)
        if right[end] == sign * value:
            return node.right, t + end
        return node.left, t + _first(left, sign * value)


def _first(values: Array, value: float) -> int:
    return int((values == value).argmax())


def score(timed: Timed, poses: Array) -> TimedValues:
    """The values of a motion, (T + 1, N, 3)."""
    moments = len(poses)
    before = np.concatenate([poses[:1], poses[:-1]])
    states = np.concatenate([poses, before], axis=1) if timed.steps else poses
    rows: Sequence[Array] = list(states.reshape(moments, states.shape[1] * SIZE).T.copy())
    found = [np.broadcast_to(value, moments) for value in evaluate(timed.state, rows, NUMPY)]

    def everywhere(value: float) -> Array:
        return np.full(moments, value)

    signals = [found[node] for node in timed.state.labels.values()]
    return TimedValues(timed, found, over_time(Numpy(), timed, signals, everywhere))
