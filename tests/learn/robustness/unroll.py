"""A spec over time as one formula of a single scene with (T + 1) N objects: each object once at every moment.

The tests compare it with the layer over time, where T is small: the formula grows with T times the widths of windows.
"""

from __future__ import annotations

from typing import Literal

from scenegen.errors import SpecError
from scenegen.errors.declarations import SPEC_TOO_LARGE
from scenegen.lang.formula.builder import FALSE, TRUE, CoreBuilder, FormulaTooLarge
from scenegen.lang.formula.core import (
    Apply,
    Atom,
    BoundedUntil,
    Const,
    Coord,
    Core,
    Everywhere,
    Junction,
    Moment,
    Window,
)
from scenegen.lang.formula.timed import Signal, Timed


def unroll(timed: Timed) -> Core:
    """The core over the objects `mug at 0`, `plate at 0`, ..., `mug at 1`, ...: motions (B, T + 1, N, 3) reshaped to
    (B, (T + 1) N, 3) are its scenes. Its requirement is that of all moments. Raises SpecError for a million parts."""
    names = [f"{name} at {t}" for t in range(timed.horizon.moments) for name in timed.objects]
    builder = CoreBuilder(names)
    try:
        values = _Unrolled(timed, builder).formulas()
        labels = {name: values[node][0] for name, node in timed.labels.items()}
        required = None
        if timed.requirement is not None:
            required = builder.junction("min", values[timed.requirement], "require")
    except FormulaTooLarge as error:
        raise SpecError(SPEC_TOO_LARGE(file="the spec, unrolled,", reason=str(error))) from None
    return builder.finish(labels, None if required == TRUE else required)


class _Unrolled:
    def __init__(self, timed: Timed, builder: CoreBuilder) -> None:
        self.timed, self.builder = timed, builder
        self.last = timed.horizon.steps

    def formulas(self) -> list[list[int]]:
        """For every node over time its formula at every moment."""
        states = [self._state(t) for t in range(self.last + 1)]
        made: list[list[int]] = []
        for node in self.timed.nodes:
            match node:
                case Signal(place):
                    root = self.timed.state.labels[str(place)]
                    made.append([state[root] for state in states])
                case Everywhere(holds):
                    made.append([TRUE if holds else FALSE] * (self.last + 1))
                case Moment("steps", arg):
                    made.append([TRUE, *made[arg][1:]])
                case Moment(which, arg):
                    made.append([made[arg][0 if which == "first" else -1]] * (self.last + 1))
                case _:
                    made.append([self._later(node, made, t) for t in range(self.last + 1)])
        return made

    def _later(self, node: Junction | Window | BoundedUntil, made: list[list[int]], t: int) -> int:
        junction = self.builder.junction
        if isinstance(node, Junction):
            return junction(node.kind, [made[arg][t] for arg in node.args], _at(node.text, t))
        window = range(t + node.lowest, min(t + node.highest, self.last) + 1)
        if isinstance(node, Window):
            return junction(node.kind, [made[node.arg][s] for s in window], _at(node.text, t))
        inner: Literal["min", "max"] = "min" if node.kind == "max" else "max"
        held = TRUE if inner == "min" else FALSE
        cases = []
        for s in range(t, window.stop):
            until = junction(inner, [held, made[node.left][s]])
            if s >= window.start:
                cases.append(junction(inner, [until if node.closed else held, made[node.right][s]]))
            held = until
        return junction(node.kind, cases, _at(node.text, t))

    def _state(self, t: int) -> list[int]:
        """The nodes of the state core at a moment."""
        builder, count = self.builder, len(self.timed.objects)
        places: list[int] = []
        for node in self.timed.state.nodes:
            match node:
                case Const(value):
                    place = builder.const(value)
                case Coord(which, axis):
                    moment, index = (max(t - 1, 0), which - count) if which >= count else (t, which)
                    place = builder.coord(moment * count + index, axis)
                case Apply(primitive, args, shapes):
                    place = builder.apply(primitive, [places[arg] for arg in args], shapes)
                case Atom(margin, text, unit, spans):
                    zero = builder.const(0.0)
                    place = builder.atom_of(places[margin], zero, places[margin], _at(text, t), unit, spans)
                case Junction(kind, args, text):
                    place = builder.junction(kind, [places[arg] for arg in args], _at(text, t))
                case _:
                    raise AssertionError("a formula over time in a state")
            places.append(place)
        return places


def _at(text: str, t: int) -> str:
    return f"{text} at {t}" if text else ""
