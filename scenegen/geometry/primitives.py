"""The table of scalar primitives. A new one is one entry here; every reader of the core formula picks it up.

`x`, `y` and `theta` read a coordinate of an object and have no entry: they are the leaves of the core formula.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

from scenegen.geometry import backward as back
from scenegen.geometry import clearance, clearance_bounds
from scenegen.geometry import clearance_bounds as clearance_backward
from scenegen.geometry import interval as iv
from scenegen.geometry.backward import Rule
from scenegen.geometry.interval import Interval
from scenegen.geometry.namespace import Namespace
from scenegen.geometry.units import ANGLE, BARE, LENGTH, Unit, agree, over, times
from scenegen.pose import TWO_PI

Shape = Literal["number", "place", "footprint"]
"""What an argument is in the language. A place (an object or a point) reaches the primitive as two numbers, x and y; a
footprint (an object, a region or a point) as three, x, y and theta, and as a constant Footprint: all constants stand
before all numbers."""


@dataclass(frozen=True, slots=True)
class Primitive:
    """One scalar function of the language.

    evaluate(ns, *shapes, *numbers) computes it over the namespace `ns`; interval(*shapes, *intervals) bounds it;
    unit(*units) gives the result's unit from one unit per argument (that of a place or footprint is LENGTH) or raises
    UnitMismatch. `operator` is set for those written infix; specs cannot
    call those that are `hidden`.
    backward(*shapes, wanted, *intervals) narrows the intervals of the arguments to what the wanted interval of the
    result leaves, see scenegen.geometry.backward; None: the arguments stay as they are.
    """

    name: str
    params: tuple[Shape, ...]
    evaluate: Callable[..., Any]
    interval: Callable[..., Interval]
    unit: Callable[..., Unit]
    doc: str
    variadic: bool = False
    operator: str = ""
    backward: Rule | None = None
    hidden: bool = False


def _wrap(ns: Namespace, a: Any) -> Any:
    return a - TWO_PI * ns.ceil((a - math.pi) / TWO_PI)


def _dist(ns: Namespace, ax: Any, ay: Any, bx: Any, by: Any) -> Any:
    return ns.hypot(ax - bx, ay - by)


def _fold(function: str) -> Callable[..., Any]:
    def evaluate(ns: Namespace, first: Any, *rest: Any) -> Any:
        step = getattr(ns, function)
        for value in rest:
            first = step(first, value)
        return first

    return evaluate


def _total(ns: Namespace, first: Any, *rest: Any) -> Any:
    for value in rest:
        first = first + value
    return first


def _same(unit: Unit) -> Unit:
    return unit


def _angle_in(result: Unit) -> Callable[[Unit], Unit]:
    def unit(argument: Unit) -> Unit:
        agree(argument, ANGLE)
        return result

    return unit


PRIMITIVES: dict[str, Primitive] = {
    primitive.name: primitive
    for primitive in (
        Primitive(
            "add",
            ("number", "number"),
            lambda ns, a, b: a + b,
            iv.add,
            agree,
            "a + b",
            operator="+",
            backward=back.add,
        ),
        Primitive(
            "sub",
            ("number", "number"),
            lambda ns, a, b: a - b,
            iv.sub,
            agree,
            "a - b",
            operator="-",
            backward=back.sub,
        ),
        Primitive(
            "mul",
            ("number", "number"),
            lambda ns, a, b: a * b,
            iv.mul,
            times,
            "a * b",
            operator="*",
            backward=back.mul,
        ),
        Primitive(
            "div",
            ("number", "number"),
            lambda ns, a, b: a / b,
            iv.div,
            over,
            "a / constant",
            operator="/",
            backward=back.div,
        ),
        Primitive("neg", ("number",), lambda ns, a: -a, iv.neg, _same, "-a", operator="-", backward=back.neg),
        Primitive(
            "dist",
            ("place", "place"),
            _dist,
            lambda ax, ay, bx, by: iv.hypot(iv.sub(ax, bx), iv.sub(ay, by)),
            lambda a, b: LENGTH,
            "Euclidean distance between two centres or points, in metres",
            backward=back.dist,
        ),
        Primitive(
            "wrap", ("number",), _wrap, iv.wrap, _angle_in(ANGLE), "an angle brought to (-pi, pi]", backward=back.wrap
        ),
        Primitive(
            "abs",
            ("number",),
            lambda ns, a: ns.absolute(a),
            iv.absolute,
            _same,
            "absolute value",
            backward=back.absolute,
        ),
        Primitive(
            "min",
            ("number",),
            _fold("minimum"),
            iv.minimum,
            agree,
            "the smallest argument",
            variadic=True,
            backward=back.minimum,
        ),
        Primitive(
            "max",
            ("number",),
            _fold("maximum"),
            iv.maximum,
            agree,
            "the largest argument",
            variadic=True,
            backward=back.maximum,
        ),
        Primitive(
            "sum",
            ("number",),
            _total,
            iv.total,
            agree,
            "the sum of all arguments",
            variadic=True,
            backward=back.total,
        ),
        Primitive(
            "mean",
            ("number",),
            lambda ns, *numbers: _total(ns, *numbers) / len(numbers),
            iv.mean,
            agree,
            "the mean of all arguments",
            variadic=True,
            backward=back.mean,
        ),
        Primitive(
            "pick",
            ("number", "number", "number", "number"),
            lambda ns, switch, end, before, after: ns.where(switch < end, before, after),
            iv.pick,
            lambda switch, end, before, after: agree(before, after),
            "one number where the switch of a choice is below an end, another elsewhere",
            hidden=True,
            backward=back.pick,
        ),
        Primitive("sin", ("number",), lambda ns, a: ns.sin(a), iv.sin, _angle_in(BARE), "sine of an angle"),
        Primitive("cos", ("number",), lambda ns, a: ns.cos(a), iv.cos, _angle_in(BARE), "cosine of an angle"),
        Primitive(
            "gap",
            ("footprint", "footprint"),
            clearance.gap,
            clearance_bounds.gap,
            lambda a, b: LENGTH,
            "clearance of two footprints, in metres; where they overlap, minus the smallest shift that parts them",
            backward=clearance_backward.back_gap,
        ),
        Primitive(
            "room",
            ("footprint", "footprint"),
            clearance.room,
            clearance_bounds.room,
            lambda a, b: LENGTH,
            "how far a's footprint stays inside b's, in metres; negative by how far it sticks out",
            backward=clearance_backward.back_room,
        ),
        Primitive(
            "reach",
            ("footprint", "number"),
            clearance.reach,
            clearance_bounds.reach,
            lambda a, heading: _angle_in(LENGTH)(heading),
            "how far a's footprint reaches from its centre towards a heading, in metres",
        ),
        Primitive(
            "bearing",
            ("place", "place"),
            clearance.bearing,
            clearance_bounds.bearing,
            lambda a, b: ANGLE,
            "direction of b seen from a, an angle in (-pi, pi]; 0 where they coincide",
        ),
    )
}
