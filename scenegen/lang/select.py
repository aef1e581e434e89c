"""Taking one thing out of another: `placemat.left`, `block[3]`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenegen.errors import suggest
from scenegen.lang import ast
from scenegen.lang.blame import Frame
from scenegen.lang.places import CORNERS, MEMBERS, SIDES, SIZES, Point
from scenegen.lang.values import (
    AnyValue,
    ListValue,
    NumberValue,
    ObjectValue,
    PointValue,
    RegionValue,
    Value,
)
from scenegen.primitives.units import BARE, LENGTH

if TYPE_CHECKING:
    from scenegen.lang.context import Context

LIST_MEMBERS = ("first", "last", "count")


def member(lowering: Context, base: Value, node: ast.Member, name: str, frame: Frame) -> Value:
    """`base.name`. Raises SpecError."""
    origin = lowering.origin(node, frame)
    match base:
        case AnyValue():
            return AnyValue(origin=origin)
        case RegionValue():
            return _of_region(lowering, base, node, name, frame)
        case ListValue(items) if name in LIST_MEMBERS:
            if name == "count":
                return NumberValue(lowering.builder.const(float(len(items))), BARE, origin=origin)
            if not items:
                raise lowering.error("this list is empty", node.base, frame, f"it has no `.{name}`")
            return items[0 if name == "first" else -1]
        case ListValue():
            help_ = suggest(name, LIST_MEMBERS, f"a list has {', '.join('.' + one for one in LIST_MEMBERS)}")
            raise lowering.error(f"a list has no `.{name}`", node, frame, "", help_)
        case ObjectValue(index):
            written = lowering.builder.objects[index]
            if lowering.scope.inferred:
                help_ = f"declare it: region {written} = rect(0.3, 0, 0.7, 0.2)"
                label = "taken for an object: nothing else is called so"
                raise lowering.error(f"`{written}` has no `.{name}`", node, frame, label, help_)
            help_ = "only regions and the workspace have named points"
            if name in SIDES[:4]:
                help_ += f"; for where the object ends write {name}Edge({written})"
            raise lowering.error(f"`{written}` has no `.{name}`", node, frame, "this is an object", help_)
        case _:
            help_ = "only regions, the workspace and lists have parts"
            raise lowering.error(f"{base.kind} has no `.{name}`", node, frame, "", help_)


def _of_region(lowering: Context, region: RegionValue, node: ast.Member, name: str, frame: Frame) -> Value:
    area, origin = region.area, lowering.origin(node, frame)

    def point(place: Point) -> PointValue:
        return PointValue(*map(lowering.builder.const, place), origin=origin)

    if name in SIDES:
        return point(area.side(name))
    if name in SIZES:
        left, bottom, right, top = area.box
        size = right - left if name == "width" else top - bottom
        return NumberValue(lowering.builder.const(size), LENGTH, origin=origin)
    if name == "corners" and area.corners:
        return ListValue(tuple(map(point, area.corners)), origin=origin)
    if name in CORNERS and area.kind in ("rect", "workspace"):
        return point(area.corner(name))
    if name in MEMBERS:
        remedy = f"it has {', '.join('.' + one for one in (*SIDES, *SIZES))}"
        kind = "circle" if area.kind == "circle" else "polygon"
        raise lowering.error(f"a {kind} has no `.{name}`", node, frame, f"`{region.name}` is a {kind}", remedy)
    otherwise = f"a region has {', '.join('.' + one for one in MEMBERS)}"
    raise lowering.error(f"`{region.name}` has no `.{name}`", node, frame, "", suggest(name, MEMBERS, otherwise))


def index(lowering: Context, base: Value, place: NumberValue, node: ast.Index, frame: Frame) -> Value:
    """`base[place]`, counted from 1. Raises SpecError."""
    origin = lowering.origin(node, frame)
    if isinstance(base, AnyValue):
        return AnyValue(origin=origin)
    if isinstance(base, ObjectValue):
        name = lowering.builder.objects[base.index]
        help_ = f"declare an array: object {name}[7]"
        raise lowering.error(f"`{name}` is one object, not an array", node, frame, "", help_)
    items = lowering.kinds.items(base, "what `[` counts in")
    which = whole_number(lowering, place, node.index, frame, "an index")
    if not 1 <= which <= len(items):
        title = f"there is no element {which} of {len(items)}"
        last = f"it has the elements 1 to {len(items)}" if items else "the list is empty"
        raise lowering.error(title, node.index, frame, last)
    return items[which - 1]


def whole_number(lowering: Context, number: NumberValue, node: ast.Expr, frame: Frame, what: str) -> int:
    """A number that counts. Raises SpecError for one that depends on the scene, has a unit or is not whole."""
    value = lowering.builder.value(number.node)
    if value is None:
        raise lowering.error(f"{what} must be a constant", node, frame, "this depends on the scene")
    if number.unit != BARE:
        raise lowering.error(f"{what} is a plain number, not {number.unit.words}", node, frame)
    if value != int(value):
        raise lowering.error(f"{what} is a whole number", node, frame, f"this is {value:g}")
    return int(value)
