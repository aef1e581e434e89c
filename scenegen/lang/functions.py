"""Calls of what the language brings along: axes, primitives, and functions over lists."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

from scenegen.errors.language import ADDED_TO_A_LIST, EMPTY_LIST, ONE_ARGUMENT, SAME_ARGUMENT_TWICE
from scenegen.lang import ast
from scenegen.lang.choices import of_options
from scenegen.lang.provenance import Frame
from scenegen.lang.values import (
    LONGEST,
    AnyValue,
    ChosenValue,
    ListValue,
    NeighboursValue,
    NumberValue,
    ObjectValue,
    PointValue,
    Value,
)
from scenegen.pose import NAMES, THETA
from scenegen.primitives import PRIMITIVES, Footprint
from scenegen.primitives.units import ANGLE, LENGTH, Unit

if TYPE_CHECKING:
    from scenegen.lang.context import Context

_OF_ANGLES = ("sin", "cos", "wrap", "reach")  # a bare number given to these is in radians


def key_of(value: Value) -> object:
    """What tells an argument from another, in time that does not grow with it: lists by identity. It stays true while
    somebody holds the list."""
    if isinstance(value, ListValue | NeighboursValue) and isinstance(value.items, tuple):
        return id(value.items)
    return value


def list_function(lowering: Context, name: str, value: Value, node: ast.Call, frame: Frame) -> Value:
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


def joined(lowering: Context, values: list[Value], node: ast.Binary, frame: Frame) -> Value | None:
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


def function(lowering: Context, name: str, values: list[Value], node: ast.Call, frame: Frame) -> NumberValue:
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
            if name in _OF_ANGLES:
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
    lowering: Context, name: str, values: list[Value], at: int, node: ast.Call, frame: Frame
) -> NumberValue:
    """A call of a primitive, one of whose arguments is what a choice picks."""
    chosen = values[at]
    assert isinstance(chosen, ChosenValue)
    rest = values[:at], values[at + 1 :]
    return of_options(lowering, chosen, lambda one: function(lowering, name, [*rest[0], one, *rest[1]], node, frame))


def _spread(lowering: Context, name: str, values: list[Value], node: ast.Call, frame: Frame) -> list[Value]:
    """The arguments of min, max, sum and mean: two or more numbers, or a list of them."""
    if len(values) == 1 and isinstance(values[0], NumberValue):
        raise lowering.error(ONE_ARGUMENT, node, frame, name=name)
    spread = [item for value in values for item in (value.items if isinstance(value, ListValue) else (value,))]
    if not spread:
        raise lowering.error(EMPTY_LIST, node, frame, needs=f"`{name}` needs numbers")
    return spread
