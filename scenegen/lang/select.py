"""Taking one thing out of another: `placemat.left`, `block[3]`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenegen.assets.surfaces import sizes_of
from scenegen.errors import Span
from scenegen.errors.counts import MAY_BE_MISSING
from scenegen.errors.language import (
    EMPTY_LIST,
    INDEX_OUT_OF_RANGE,
    NO_SUCH_PART,
    NOT_A_PLAIN_NUMBER,
    NOT_A_WHOLE_NUMBER,
    NOT_AN_ARRAY,
    NOT_CONSTANT,
    PART_OF_AN_OBJECT,
)
from scenegen.errors.names import nearest
from scenegen.lang import ast
from scenegen.lang.heights import surface_values
from scenegen.lang.places import CORNERS, MEMBERS, SIDES, SIZES, Point
from scenegen.lang.provenance import Frame
from scenegen.lang.template import FIRST, Depends
from scenegen.lang.values import (
    AnyValue,
    ListValue,
    NumberValue,
    ObjectValue,
    PointValue,
    RegionValue,
    SurfaceValue,
    Value,
)
from scenegen.primitives.units import BARE, LENGTH

if TYPE_CHECKING:
    from scenegen.lang.context import Context

LIST_MEMBERS = ("first", "last", "count")
SURFACE_SIZES = ("length", "depth")  # of a surface, beside `width` and `height`, which regions have, too


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
                raise lowering.error(EMPTY_LIST, node.base, frame, needs=f"it has no `.{name}`")
            return items[0 if name == "first" else -1]
        case ListValue():
            raise lowering.error(NO_SUCH_PART, node, frame, what="a list", name=name, known=LIST_MEMBERS)
        case SurfaceValue(carrier, surface):
            sizes = sizes_of(lowering.shapes[carrier], surface)
            sizes |= {"height": sizes["depth"]} if "depth" in sizes else {}  # as the third of box(...)
            if name in sizes:
                return NumberValue(lowering.builder.const(sizes[name]), LENGTH, origin=origin)
            raise lowering.error(NO_SUCH_PART, node, frame, what="this surface", name=name, parts=tuple(sizes))
        case ObjectValue(index):
            written = lowering.builder.objects[index]
            if lowering.shapes:
                found = _surface(lowering, base, index, name, origin)
                if found is not None:
                    return found
            if lowering.scope.inferred:
                raise lowering.error(PART_OF_AN_OBJECT, node, frame, name=written, part=name, inferred=written)
            known = [one.surface.name for one in surface_values(lowering, index, base)] if lowering.shapes else []
            edge = name if name in SIDES[:4] else None
            facts = {"meant": nearest(name, {one.partition("[")[0] for one in known}), "surfaces": known}
            raise lowering.error(PART_OF_AN_OBJECT, node, frame, name=written, part=name, edge=edge, **facts)
        case _:
            raise lowering.error(NO_SUCH_PART, node, frame, what=base.kind, name=name)


def _surface(lowering: Context, base: ObjectValue, index: int, name: str, origin: Span) -> Value | None:
    """The surface of that name of an object, or the list of those that are numbered; None where it has none."""
    if index >= FIRST:
        raise Depends
    named = [one for one in surface_values(lowering, index, base) if one.surface.name.partition("[")[0] == name]
    if len(named) == 1 and named[0].surface.name == name:
        return named[0].moved(origin)
    return ListValue(tuple(named), origin=origin) if named else None


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
        kind = "circle" if area.kind == "circle" else "polygon"
        parts = (*SIDES, *SIZES)
        raise lowering.error(NO_SUCH_PART, node, frame, what=f"a {kind}", name=name, parts=parts, region=region.name)
    raise lowering.error(NO_SUCH_PART, node, frame, what=f"`{region.name}`", name=name, known=MEMBERS)


def index(lowering: Context, base: Value, place: NumberValue, node: ast.Index, frame: Frame) -> Value:
    """`base[place]`, counted from 1. Raises SpecError."""
    origin = lowering.origin(node, frame)
    if isinstance(base, AnyValue):
        return AnyValue(origin=origin)
    if isinstance(base, ObjectValue):
        name = lowering.builder.objects[base.index]
        raise lowering.error(NOT_AN_ARRAY, node, frame, name=name)
    items = lowering.coerce.items(base, "what `[` counts in")
    which = whole_number(lowering, place, node.index, frame, "an index")
    drawn = lowering.scope.counts.get(node.base.id) if isinstance(node.base, ast.Name) else None
    if drawn is not None and drawn.least < which <= drawn.most:
        facts = {"name": drawn.name, "index": which, "least": drawn.least, "most": drawn.most}
        raise lowering.error(MAY_BE_MISSING, node, frame, **facts)
    if not 1 <= which <= len(items):
        raise lowering.error(
            INDEX_OUT_OF_RANGE, node.index, frame, index=which, count=len(items), last=len(items) or None
        )
    return items[which - 1]


def whole_number(lowering: Context, number: NumberValue, node: ast.Expr, frame: Frame, what: str) -> int:
    """A number that counts. Raises SpecError for one that depends on the scene, has a unit or is not whole."""
    value = lowering.builder.value(number.node)
    if value is None:
        raise lowering.error(NOT_CONSTANT, node, frame, what=what)
    if number.unit != BARE:
        raise lowering.error(NOT_A_PLAIN_NUMBER, node, frame, what=what, found=number.unit.words)
    if value != int(value):
        raise lowering.error(NOT_A_WHOLE_NUMBER, node, frame, what=what, value=value)
    return int(value)
