"""Calls of what the language brings along: axes, primitives, and functions over lists."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

from scenegen.errors import Span
from scenegen.errors.declarations import STANDS_ELSEWHERE
from scenegen.errors.language import ADDED_TO_A_LIST, EMPTY_LIST, ONE_ARGUMENT, SAME_ARGUMENT_TWICE, UNIT_OF_ARGUMENT
from scenegen.geometry import PRIMITIVES, Footprint
from scenegen.geometry.units import ANGLE, BARE, LENGTH, SPEED, TURN_RATE, Unit
from scenegen.lang.check.choices import of_options, options_of
from scenegen.lang.check.context import CallFrame
from scenegen.lang.check.template import FIRST
from scenegen.lang.check.values import (
    LONGEST,
    AnyValue,
    ChosenValue,
    FormulaValue,
    ListValue,
    NeighboursValue,
    NumberValue,
    ObjectValue,
    PointValue,
    RegionValue,
    SurfaceValue,
    Value,
)
from scenegen.lang.spec import Support
from scenegen.lang.syntax import ast
from scenegen.pose import NAMES, THETA

if TYPE_CHECKING:
    from scenegen.lang.check.context import Context


def key_of(value: Value) -> object:
    """What tells an argument from another, in time that does not grow with it: lists by identity. It stays true while
    somebody holds the list."""
    if isinstance(value, ListValue | NeighboursValue) and isinstance(value.items, tuple):
        return id(value.items)
    return value


def list_function(lowering: Context, name: str, value: Value, node: ast.Call, frame: CallFrame) -> Value:
    """A call of `consecutive` or `gaps` over a list. Raises SpecError."""
    origin = lowering.origin(node, frame)
    if isinstance(value, AnyValue):
        return AnyValue(origin=origin)
    items = lowering.coerce.items(value, f"the argument of `{name}`")
    if name == "consecutive":
        return NeighboursValue(items, origin=origin)
    key = (name, key_of(value))
    if key not in lowering.expansions:  # a quantifier over the gaps may ask for them in each of its rounds
        pairs = [function(lowering, "gap", [first, second], node, frame) for first, second in pairwise(items)]
        lowering.expansions[key] = (ListValue(tuple(pairs), origin=origin), [value])
    return lowering.expansions[key][0].moved(origin)


def joined(lowering: Context, values: list[Value], node: ast.Binary, frame: CallFrame) -> Value | None:
    """The two lists on the sides of a `+` as one; None where neither is a list. Raises SpecError."""
    if not any(isinstance(value, ListValue) for value in values):
        return None
    origin = lowering.origin(node, frame)
    for value, part in zip(values, (node.left, node.right), strict=True):
        if not isinstance(value, ListValue | AnyValue):
            written = value.origin.text
            single = isinstance(value, ObjectValue | PointValue) and len(written) <= LONGEST
            raise lowering.error(ADDED_TO_A_LIST, part, frame, found=value.kind, single=written if single else None)
    if any(isinstance(value, AnyValue) for value in values):
        return AnyValue(origin=origin)
    key = ("+", *map(key_of, values))
    if key not in lowering.expansions:
        items = tuple(item for value in values for item in lowering.coerce.items(value, ""))
        lowering.spend(len(items), frame)
        lowering.expansions[key] = (ListValue(items, origin=origin), values)
    return lowering.expansions[key][0].moved(origin)


def function(lowering: Context, name: str, values: list[Value], node: ast.Call, frame: CallFrame) -> NumberValue:
    """A call of an axis or a primitive: the number it is, of arguments whose kinds and units fit. Raises SpecError."""
    origin = lowering.origin(node, frame)
    what = f"an argument of `{name}`"
    if name in NAMES:
        (value,) = values
        axis = NAMES.index(name)
        if isinstance(value, ChosenValue) and axis != THETA:
            return of_options(lowering, value, lambda one: function(lowering, name, [one], node, frame))
        if axis == THETA:
            return NumberValue(lowering.coerce.heading(value, what), ANGLE, origin=origin)
        return NumberValue(lowering.coerce.place(value, what)[axis], LENGTH, origin=origin)
    primitive = PRIMITIVES[name]
    if primitive.variadic:
        values = _spread(lowering, name, values, node, frame)
    params = primitive.params * len(values) if primitive.variadic else primitive.params
    units: list[Unit] = []
    args: list[int] = []
    shapes: list[Footprint] = []
    for at, (kind, value) in enumerate(zip(params, values, strict=True)):
        if isinstance(value, ChosenValue) and kind != "number":
            return _of_options(lowering, name, values, at, node, frame)
        if kind == "number":
            number = lowering.coerce.number(value, what)
            if primitive.of_angle:  # a bare number is in radians
                lowering.refuse_degrees([number, NumberValue(number.node, ANGLE, origin=number.origin)])
            units.append(number.unit)
            args.append(number.node)
            continue
        units.append(LENGTH)
        if kind == "place":
            args.extend(lowering.coerce.place(value, what))
        else:
            footprint, pose = lowering.coerce.footprint(value, what)
            shapes.append(footprint)
            args.extend(pose)
    if len(shapes) == 2 and values[0] == values[1] and not isinstance(values[0], AnyValue):
        raise lowering.error(SAME_ARGUMENT_TWICE, node, frame, name=name)
    return lowering.apply(name, units, args, tuple(shapes), node, frame)


def _of_options(
    lowering: Context, name: str, values: list[Value], at: int, node: ast.Call, frame: CallFrame
) -> NumberValue:
    """A call of a primitive, one of whose arguments is what a choice picks."""
    chosen = values[at]
    assert isinstance(chosen, ChosenValue)
    rest = values[:at], values[at + 1 :]
    return of_options(lowering, chosen, lambda one: function(lowering, name, [*rest[0], one, *rest[1]], node, frame))


def _spread(lowering: Context, name: str, values: list[Value], node: ast.Call, frame: CallFrame) -> list[Value]:
    """The arguments of min, max, sum and mean: two or more numbers, or a list of them."""
    if len(values) == 1 and isinstance(values[0], NumberValue):
        raise lowering.error(ONE_ARGUMENT, node, frame, name=name)
    spread = [item for value in values for item in (value.items if isinstance(value, ListValue) else (value,))]
    if not spread:
        raise lowering.error(EMPTY_LIST, node, frame, needs=f"`{name}` needs numbers")
    return spread


# --------------------------------------------------------------------------------------------------------------------
# Functions of a step: what an object did since the moment before.
#
# The state that a formula is evaluated on has every object twice: as it stands now, and as it stood at the moment
# before. At moment 0 both are the same, so nothing has moved yet.


EPS_STILL = 0.001  # metres, and radians: what still counts as not having moved

Pose = Sequence[int]  # the nodes of x, y and theta


def step_function(
    lowering: Context, name: str, values: Mapping[str, Value], node: ast.Call, frame: CallFrame
) -> NumberValue | FormulaValue:
    """A call of a function of a step. Raises SpecError."""
    origin = lowering.origin(node, frame)
    builder, horizon = lowering.builder, lowering.horizon
    assert horizon is not None
    now, before = _poses(lowering, values["a"], f"what `{name}` is about")
    if name == "carried":
        other_now, other_before = _poses(lowering, values["b"], "what carries")
        now, before = _seen_from(lowering, other_now, now), _seen_from(lowering, other_before, before)
    way = builder.apply("dist", (*now[:THETA], *before[:THETA]))
    turned = builder.apply("abs", (builder.apply("wrap", (builder.apply("sub", (now[THETA], before[THETA])),)),))
    shown = f"({', '.join(lowering.text(value) for value in values.values())})"
    if name in ("displacement", "speed", "spin"):
        unit = {"displacement": LENGTH, "speed": SPEED, "spin": TURN_RATE}[name]
        number = turned if name == "spin" else way
        if name != "displacement" and horizon.dt != 1.0:
            number = builder.apply("div", (number, builder.const(horizon.dt)))
        if builder.value(number) is None:
            builder.called.setdefault(number, name + shown)
        return NumberValue(number, unit, origin=origin)
    limit = builder.const(EPS_STILL)
    given = values.get("within") or values.get("by")
    if given is not None:
        number_ = lowering.coerce.number(given, f"the limit of `{name}`")
        if number_.unit not in (BARE, LENGTH):
            raise lowering.error(UNIT_OF_ARGUMENT, node, frame, name=name, wanted="a length", found=number_.unit.words)
        limit = number_.node
    words = f"{name}{shown}"
    if name == "moved":
        words = f"!{words}"
    places = lowering.spans(node, frame)
    stayed = builder.junction(
        "min",
        [
            builder.atom(way, limit, words, LENGTH, places),
            builder.atom(turned, limit, f"{words} (heading)", ANGLE, places),
        ],
        words,
    )
    return FormulaValue(builder.negate(stayed) if name == "moved" else stayed, origin=origin)


def _poses(lowering: Context, value: Value, what: str) -> tuple[Pose, Pose]:
    """The pose of an object now, and at the moment before. Raises SpecError."""
    coerce, builder = lowering.coerce, lowering.builder
    if isinstance(value, AnyValue):
        some = [coerce.number(value, what).node] * 3
        return some, some
    if not isinstance(value, ObjectValue):
        raise coerce.wrong(value, "an object", what)
    axes = range(THETA + 1)
    now = [coerce.coordinate(value.index, axis) for axis in axes]
    held = value.index in coerce.fixed
    return now, now if held else [builder.before(value.index, axis) for axis in axes]


def _seen_from(lowering: Context, frame: Pose, pose: Pose) -> Pose:
    """A pose in the frame of another."""
    apply = lowering.builder.apply
    right, up = (apply("sub", (pose[axis], frame[axis])) for axis in range(THETA))
    cosine, sine = apply("cos", (frame[THETA],)), apply("sin", (frame[THETA],))
    x = apply("add", (apply("mul", (right, cosine)), apply("mul", (up, sine))))
    y = apply("sub", (apply("mul", (up, cosine)), apply("mul", (right, sine))))
    return x, y, apply("sub", (pose[THETA], frame[THETA]))


# --------------------------------------------------------------------------------------------------------------------
# What is said to rest on, or to be inside, a thing that no declaration lets it stand on.


OF_SUPPORT = ("restsOn", "insideOf")  # relations of the prelude: a on or in b


def note_elsewhere(lowering: Context, name: str, values: Mapping[str, Value], node: ast.Call, frame: CallFrame) -> None:
    """Notices a call of one of OF_SUPPORT that holds in no scene, since its first argument stands elsewhere. In
    rounds of quantifiers that is no mistake."""
    upper, lower = values["a"], values["b"]
    if frame.where or lowering.heights is None or not isinstance(upper, ObjectValue) or upper.index >= FIRST:
        return
    options = [*options_of(upper.index, lowering.supports, lowering.choices)]
    stands = [one.name for one in options] or ["workspace"]
    if name == "insideOf":  # what is in a bowl in a drawer is in the drawer
        for one in options:
            more = () if one.carrier is None else options_of(one.carrier, lowering.supports, lowering.choices)
            options.extend(other for other in more if other not in options)
    match lower:
        case ObjectValue(carrier) if carrier < FIRST:
            written, meant = lowering.builder.objects[carrier], any(one.carrier == carrier for one in options)
        case SurfaceValue():
            written = lowering.text(lower)
            meant = any(one.name == written for one in options)
        case RegionValue(written, area):
            levels = [_height_of(lowering, one) for one in options] or [0.0]
            meant = any(level is None or level == area.z for level in levels)
        case _:
            return
    if meant or (isinstance(lower, ObjectValue) and lower.index == upper.index):
        return
    called = lowering.builder.objects[upper.index]
    spans = lowering.spans(node, frame)
    plain = "[" not in called and called in lowering.scope.objects
    example = f"object {called} on any of [{', '.join((*stands, written))}]" if plain else None
    problem = STANDS_ELSEWHERE(
        spans[0],
        name=called,
        relation=name,
        lower=written,
        stands=["the table" if one == "workspace" else one for one in stands],
        example=example,
    )
    if problem not in lowering.noticed:
        lowering.noticed.append(problem)


def _height_of(lowering: Context, under: Support) -> float | None:
    assert lowering.heights is not None
    below = 0.0 if under.carrier is None else lowering.heights[under.carrier]
    return None if below is None else below + under.height


def meant(lowering: Context, here: Span) -> str | None:
    """What to do about a requirement at some part of the text that asks for such a thing; None where it does not."""
    for one in lowering.noticed:
        if one.kind is not STANDS_ELSEWHERE or one.span is None or one.facts["example"] is None:
            continue
        if one.span.source is here.source and here.start <= one.span.start and one.span.end <= here.end:
            return f"let it stand there: {one.facts['example']}"
    return None
