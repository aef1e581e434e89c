"""The table of scalar primitives, and the units of their numbers: all that any reader knows of one stands in its row.

`x`, `y` and `theta` read a coordinate of an object and have no entry: they are the leaves of the core formula. The
operators, `min`, `max` and `pick` are what formulas are made of: readers of formulas know them by name, too.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal

from scenegen.geometry import clearance, shadow, share
from scenegen.geometry import footprint_rules as rules
from scenegen.geometry import interval as iv
from scenegen.geometry.interval import Interval, Rule
from scenegen.geometry.namespace import Namespace
from scenegen.geometry.quantile import QUANTILE, back_quantile, quantile, quantile_bounds
from scenegen.pose import FLAT, PLACE, TWO_PI

# Units of scalar expressions, as powers of metre and radian. A bare number takes its unit from its place
# (docs/language.md), so `BARE` agrees with every unit.


@dataclass(frozen=True, slots=True)
class Unit:
    """metre^length * radian^angle * second^time; a share (`30 %`, share = 1) is a plain number of a whole, which is no
    length: a share of a length is one."""

    length: int = 0
    angle: int = 0
    time: int = 0
    share: int = 0

    def __str__(self) -> str:
        if self.time == -1 and self.length + self.angle == 1:
            return "m/s" if self.length else "rad/s"
        parts = [
            name if power == 1 else f"{name}^{power}"
            for name, power in (("m", self.length), ("rad", self.angle), ("s", self.time))
            if power
        ]
        return " ".join(parts)

    @property
    def words(self) -> str:
        """The unit as text."""
        known = {LENGTH: "a length", ANGLE: "an angle", BARE: "a plain number", Unit(2, 0): "an area"}
        known |= {TIME: "a time", SHARE: "a share", SPEED: "a speed", TURN_RATE: "a turn rate"}
        return known.get(self, f"a quantity in {self}")


BARE = Unit()
LENGTH = Unit(length=1)
ANGLE = Unit(angle=1)
TIME = Unit(time=1)
SHARE = Unit(share=1)
SPEED = Unit(length=1, time=-1)
TURN_RATE = Unit(angle=1, time=-1)

# unit suffix of a quantity -> (multiplier, divisor) to metres, radians or seconds, and what it measures. Dividing by
# 100, not multiplying by 0.01, makes `7 cm` the same number as `0.07`.
_UNITS: dict[str, tuple[float, float, Unit]] = {
    "m": (1.0, 1.0, LENGTH),
    "cm": (1.0, 100.0, LENGTH),
    "mm": (1.0, 1000.0, LENGTH),
    "rad": (1.0, 1.0, ANGLE),
    "deg": (math.pi, 180.0, ANGLE),
    "turn": (2.0 * math.pi, 1.0, ANGLE),
    "%": (1.0, 100.0, SHARE),
    "s": (1.0, 1.0, TIME),
    "ms": (1.0, 1000.0, TIME),
    "min": (60.0, 1.0, TIME),
}


class UnitMismatch(Exception):  # noqa: N818 - a signal between primitives and the checker, which words the diagnostic
    """Two units that cannot be added or compared."""

    def __init__(self, left: Unit, right: Unit) -> None:
        super().__init__(left, right)
        self.left, self.right = left, right


def agree(*units: Unit) -> Unit:
    """The common unit of numbers that are added or compared. Raises UnitMismatch if there is none."""
    result = BARE
    for unit in units:
        if unit == BARE:
            continue
        if result not in (BARE, unit):
            raise UnitMismatch(result, unit)
        result = unit
    return result


def times(left: Unit, right: Unit) -> Unit:
    unit = Unit(left.length + right.length, left.angle + right.angle, left.time + right.time)
    return SHARE if unit == BARE and (left.share or right.share) else unit


def divide_units(left: Unit, right: Unit) -> Unit:
    unit = Unit(left.length - right.length, left.angle - right.angle, left.time - right.time)
    return SHARE if unit == BARE and left.share > right.share else unit


def quantity(number: str, suffix: str) -> tuple[float, Unit]:
    """The value in metres, radians and seconds and the unit of a number as written, e.g. ("25", "cm") -> (0.25,
    LENGTH)."""
    if not suffix:
        return float(number), BARE
    name, per_second, _ = suffix.partition("/")
    multiplier, divisor, unit = _UNITS[name]
    return float(number) * multiplier / divisor, divide_units(unit, TIME) if per_second else unit


Shape = Literal["number", "place", "footprint"]
"""What an argument is in the language. A place (an object or a point) reaches the primitive as two numbers, x and y; a
footprint (an object, a region or a point) as three, x, y and theta, and as a constant Footprint: all constants stand
before all numbers."""


Slopes = Callable[[Sequence[float | None]], Sequence[float] | None]
"""Of arguments, of which constants have a value: what the result grows by with each of the others, 0 for constants;
None where it is not linear in them."""


@dataclass(frozen=True, slots=True)
class Primitive:
    """One scalar function of the language.

    evaluate(ns, *shapes, *numbers) computes it over the namespace `ns`; interval(*shapes, *intervals) bounds it;
    unit(*units) gives the result's unit from one unit per argument (that of a place or footprint is LENGTH) or raises
    UnitMismatch; `doc` is a sentence for editors. `operator` is set for those written infix; specs cannot call those
    that are `hidden`. `names` are what its parameters are called: a, b, c where none are given.
    backward(*shapes, wanted, *intervals) narrows the intervals of the arguments to what the wanted interval of the
    result leaves, see scenegen.geometry.interval; None: the arguments stay as they are.

    What else readers ask, and what is lost where a trait is left out:
    `of_angle`: its number is an angle: a bare one is in radians, and a turn more makes no difference (a wrong
    warning);
    `relative`: of two places it needs only how they lie to each other (weaker pruning);
    `smooth` (of places): no set of scenes with a volume has one value of it (more work to prove that a value cannot
    be);
    `vanishes`: it is 0 where both halves of its arguments are the same (a formula keeps what is 0);
    `exact`: all namespaces round it alike;
    `monotone`: it grows with each argument;
    `slopes`: it is linear (quantifiers over many numbers take longer);
    `crowd`: it takes any number of things more; each of them has as many parameters as this, the last ones (an error);
    `drawn` (of places): how a picture shows its value: a line between centres, across the gap, out to the rim of what
    contains; a turn; or, as an edge, with the place that it is added to (no picture).
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
    names: tuple[str, ...] = ()
    of_angle: bool = False
    relative: bool = False
    smooth: bool = False
    vanishes: bool = False
    exact: bool = False
    monotone: bool = False
    slopes: Slopes | None = None
    crowd: int = 0
    drawn: Literal["", "centres", "gap", "room", "turn", "edge"] = ""

    @property
    def spatial(self) -> bool:
        """Whether it takes places or footprints."""
        return any(kind != "number" for kind in self.params)

    @property
    def places(self) -> tuple[tuple[int, int], ...]:
        """Which numbers are x and y of each place or footprint."""
        found, at = [], 0
        for kind in self.params:
            if kind != "number":
                found.append((at, at + 1))
            at += NUMBERS_OF_KIND[kind]
        return tuple(found)


NUMBERS_OF_KIND: dict[Shape, int] = {"number": 1, "place": len(PLACE), "footprint": len(FLAT)}
"""How many numbers an argument is."""


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


def _product(values: Sequence[float | None]) -> Sequence[float] | None:
    a, b = values
    if b is not None:
        return b, 0.0
    return None if a is None else (0.0, a)


def _quotient(values: Sequence[float | None]) -> Sequence[float] | None:
    divisor = values[1]
    return None if divisor is None else (1.0 / divisor, 0.0)


def _same_slopes(values: Sequence[float | None]) -> Sequence[float]:
    return [1.0] * len(values)


_BODY: tuple[Shape, ...] = ("footprint", "number", "number")
_ONE: tuple[Shape, ...] = ("number",)
_SEER: tuple[Shape, ...] = _ONE * share.CAMERA
_TWO: tuple[Shape, ...] = ("number", "number")
_PLACES: tuple[Shape, ...] = ("place", "place")
_FOOTPRINTS: tuple[Shape, ...] = ("footprint", "footprint")

PRIMITIVES: dict[str, Primitive] = {
    primitive.name: primitive
    for primitive in (
        Primitive(
            "add", _TWO, lambda ns, a, b: a + b, iv.add, agree, "a + b",
            operator="+", backward=iv.back_add, exact=True, slopes=_same_slopes,
        ),
        Primitive(
            "sub", _TWO, lambda ns, a, b: a - b, iv.sub, agree, "a - b",
            operator="-", backward=iv.back_sub, exact=True, vanishes=True, slopes=lambda values: (1.0, -1.0),
        ),
        Primitive(
            "mul", _TWO, lambda ns, a, b: a * b, iv.mul, times, "a * b",
            operator="*", backward=iv.back_mul, exact=True, slopes=_product,
        ),
        Primitive(
            "div", _TWO, lambda ns, a, b: a / b, iv.div, divide_units, "a / constant",
            operator="/", backward=iv.back_div, exact=True, slopes=_quotient,
        ),
        Primitive(
            "neg", _ONE, lambda ns, a: -a, iv.neg, _same, "-a",
            operator="-", backward=iv.back_neg, exact=True, slopes=lambda values: (-1.0,),
        ),
        Primitive(
            "dist", _PLACES, _dist, lambda ax, ay, bx, by: iv.hypot(iv.sub(ax, bx), iv.sub(ay, by)),
            lambda a, b: LENGTH, "Euclidean distance between two centres or points, in metres",
            backward=iv.back_dist, relative=True, smooth=True, vanishes=True, drawn="centres",
        ),
        Primitive(
            "wrap", _ONE, _wrap, iv.wrap, _angle_in(ANGLE), "an angle brought to (-pi, pi]",
            backward=iv.back_wrap, of_angle=True, drawn="turn",
        ),
        Primitive(
            "abs", _ONE, lambda ns, a: ns.absolute(a), iv.absolute, _same, "absolute value",
            backward=iv.back_absolute, exact=True,
        ),
        Primitive(
            "min", _ONE, _fold("minimum"), iv.minimum, agree, "the smallest argument",
            variadic=True, backward=iv.back_minimum, exact=True, monotone=True,
        ),
        Primitive(
            "max", _ONE, _fold("maximum"), iv.maximum, agree, "the largest argument",
            variadic=True, backward=iv.back_maximum, exact=True, monotone=True,
        ),
        Primitive(
            "sum", _ONE, _total, iv.total, agree, "the sum of all arguments",
            variadic=True, backward=iv.back_total, slopes=_same_slopes,
        ),
        Primitive(
            "mean", _ONE, lambda ns, *numbers: _total(ns, *numbers) / len(numbers), iv.mean, agree,
            "the mean of all arguments",
            variadic=True, backward=iv.back_mean, slopes=lambda values: [1.0 / len(values)] * len(values),
        ),
        Primitive(
            "pick", (*_TWO, *_TWO), lambda ns, switch, end, before, after: ns.where(switch < end, before, after),
            iv.pick, lambda switch, end, before, after: agree(before, after),
            "one number where the switch of a choice is below an end, another elsewhere",
            hidden=True, backward=iv.back_pick,
        ),
        Primitive(
            QUANTILE, _ONE, quantile, quantile_bounds, agree,
            "a coordinate as a function of numbers that are uniform",
            hidden=True, variadic=True, backward=back_quantile,
        ),
        Primitive("sin", _ONE, lambda ns, a: ns.sin(a), iv.sin, _angle_in(BARE), "sine of an angle", of_angle=True),
        Primitive("cos", _ONE, lambda ns, a: ns.cos(a), iv.cos, _angle_in(BARE), "cosine of an angle", of_angle=True),
        Primitive(
            "gap", _FOOTPRINTS, clearance.gap, rules.gap, lambda a, b: LENGTH,
            "clearance of two footprints, in metres; where they overlap, minus the smallest shift that parts them",
            backward=rules.back_gap, relative=True, smooth=True, drawn="gap",
        ),
        Primitive(
            "room", _FOOTPRINTS, clearance.room, rules.room, lambda a, b: LENGTH,
            "how far a's footprint stays inside b's, in metres; negative by how far it sticks out",
            backward=rules.back_room, names=("a", "area"), relative=True, drawn="room",
        ),
        Primitive(
            "reach", ("footprint", "number"), clearance.reach, rules.reach,
            lambda a, heading: _angle_in(LENGTH)(heading),
            "how far a's footprint reaches from its centre towards a heading, in metres",
            names=("a", "heading"), of_angle=True, drawn="edge",
        ),
        Primitive(
            "pathGap", ("footprint", "place", "place"), clearance.path_gap, rules.path_gap, lambda a, p, q: LENGTH,
            "clearance of a's footprint from the straight way between two places, in metres; negative on it",
            names=("a", "start", "end"), smooth=True,
        ),
        Primitive(
            "bearing", _PLACES, clearance.bearing, rules.bearing, lambda a, b: ANGLE,
            "direction of b seen from a, an angle in (-pi, pi]; 0 where they coincide", relative=True,
        ),
        Primitive(
            "shadowGap", (*_FOOTPRINTS, "place", *_TWO), shadow.shadow_gap, rules.shadow_gap,
            lambda a, b, eye, first, last: LENGTH,
            "clearance of a footprint and the shadow of another one from a place: the hull of its enlarged copies",
            hidden=True, backward=rules.back_shadow, smooth=True,
        ),
        Primitive(
            "visibleShare", (*_BODY, *_SEER, *_BODY, "number"), share.visible_share,
            rules.visible_share, lambda *units: SHARE, "share of a body's silhouette that no nearer body covers",
            hidden=True, backward=rules.back_share, crowd=len(_BODY) + 1,
        ),
    )
}  # fmt: skip


@cache
def argument_kinds(name: str, shapes: int) -> tuple[Shape, ...]:
    """What the arguments of a primitive are where so many of them are footprints."""
    primitive = PRIMITIVES[name]
    if not primitive.crowd:
        return primitive.params
    return primitive.params + primitive.params[-primitive.crowd :] * (shapes - primitive.params.count("footprint"))
