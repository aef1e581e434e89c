"""Constant numbers, points and sizes: what declarations are made of."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenegen.assets.palette import NAMED, hex_of
from scenegen.errors import Diagnostic, Source, SpecError
from scenegen.errors.declarations import (
    FILE_WITHOUT_QUOTES,
    NOT_CONVEX,
    SIZE_OUT_OF_RANGE,
    TOO_FAR_OUT,
    TOO_FEW_CORNERS,
)
from scenegen.errors.language import MISPLACED_VALUE, NOT_A_LENGTH, NOT_CONSTANT
from scenegen.errors.requests import UNKNOWN_CHOICE
from scenegen.lang import ast
from scenegen.lang.places import Point
from scenegen.lang.provenance import Frame
from scenegen.lang.resolve import SHAPES, bind
from scenegen.lang.scope import Signature
from scenegen.lang.trampoline import Call
from scenegen.lang.values import AnyValue, ListValue, PointValue, Value
from scenegen.primitives.hull import convex_hull, is_convex
from scenegen.primitives.units import BARE, LENGTH
from scenegen.scene.limits import FARTHEST, LARGEST, SMALLEST

if TYPE_CHECKING:
    from scenegen.lang.context import Context

SIGNATURES = {
    "box": Signature("box", ("length", "width", "height", "color"), 3, usage="box(length, width, height)"),
    "cylinder": Signature("cylinder", ("radius", "height", "color"), 2, usage="cylinder(radius, height)"),
    "prism": Signature("prism", ("corners", "height", "color"), 2, usage="prism([(x, y), ...], height)"),
    "urdf": Signature("urdf", ("path", "shape"), 1, usage='urdf("file.urdf")'),
    "mesh": Signature("mesh", ("path", "shape"), 1, usage='mesh("file.obj")'),
    "asset": Signature("asset", ("name", "shape"), 1, usage='asset("025_mug")'),
    "cabinet": Signature("cabinet", ("drawers", "open"), 0, usage="cabinet(drawers = 3, open = 0.6)"),
    "category": Signature(
        "category", ("name", "assets", "pick", "most", "seed"), 1, usage='category("mug", most = 8, seed = 1)'
    ),
    "rect": Signature("rect", ("left", "bottom", "right", "top"), 4, usage="rect(left, bottom, right, top)"),
    "circle": Signature("circle", ("center", "radius"), 2, usage="circle((x, y), radius)"),
    "polygon": Signature("polygon", ("corners",), 1, usage="polygon([(x, y), ...])"),
}


def number(lowering: Context, value: Value, expr: ast.Expr, source: Source, what: str) -> float:
    """A constant length. Raises SpecError."""
    number = lowering.coerce.number(value, what)
    amount = lowering.builder.value(number.node)
    if amount is None:
        raise SpecError(NOT_CONSTANT(expr.span(source), what=what))
    if number.unit not in (BARE, LENGTH):
        raise SpecError(NOT_A_LENGTH(expr.span(source), what=what, found=number.unit.words))
    return amount


def point(lowering: Context, value: Value, what: str) -> Point:
    """A constant point. Raises SpecError."""
    if not isinstance(value, PointValue):
        raise lowering.coerce.wrong(value, "a point", what)
    x, y = (lowering.builder.value(node) for node in (value.x, value.y))
    if x is None or y is None:
        raise SpecError(NOT_CONSTANT(value.origin, what=what))
    if max(abs(x), abs(y)) > FARTHEST:
        raise SpecError(TOO_FAR_OUT(value.origin, what=what, limit=FARTHEST))
    return x, y


def size(lowering: Context, value: Value, expr: ast.Expr, source: Source, what: str) -> float:
    """A constant length that something can measure. Raises SpecError."""
    amount = number(lowering, value, expr, source, what)
    if not SMALLEST <= amount <= LARGEST:
        raise SpecError(SIZE_OUT_OF_RANGE(expr.span(source), what=what, size=amount, least=SMALLEST, most=LARGEST))
    return amount


Arguments = dict[str, tuple[Value, ast.Expr]]


def arguments(lowering: Context, call: ast.Call, source: Source) -> Call[Arguments]:
    """The arguments of a shape by parameter, each with the expression it was written as. Raises SpecError."""
    given = bind(call, SIGNATURES[call.function.id], source)
    if isinstance(given, Diagnostic):
        raise SpecError(given)
    values: Arguments = {}
    for name, expr in given.items():
        if name == "color":
            values[name] = (AnyValue(origin=expr.span(source)), expr)
            continue
        if isinstance(expr, ast.Text) or (isinstance(expr, ast.Call) and expr.function.id in SHAPES):
            what = "a text" if isinstance(expr, ast.Text) else "a shape"
            usage = SIGNATURES[call.function.id].usage
            raise SpecError(MISPLACED_VALUE(expr.span(source), what=what, parameter=name, usage=usage))
        value = yield lowering.lower(expr, {}, Frame(source))
        values[name] = (value, expr)
    return values


def color(given: Arguments, source: Source) -> str:
    """The colour of a shape as "#rrggbb"; "" where it has none. Raises SpecError."""
    if "color" not in given:
        return ""
    expr = given["color"][1]
    here = expr.span(source)
    if not isinstance(expr, ast.Text):
        raise SpecError(FILE_WITHOUT_QUOTES(here, what="a colour", usage='color = "red" or color = "#ffdd33"'))
    found = hex_of(expr.value)
    if found is None:
        raise SpecError(UNKNOWN_CHOICE(here, what="colour", name=expr.value, known=(*NAMED, "#rrggbb")))
    return found


def corners(lowering: Context, value: Value, expr: ast.Expr, source: Source) -> tuple[Point, ...]:
    """The corners of a convex polygon, counter-clockwise. Raises SpecError."""
    if not isinstance(value, ListValue):
        raise lowering.coerce.wrong(value, "a list of corners", "a polygon")
    corners = [point(lowering, item, "a corner") for item in value.items]
    here = expr.span(source)
    if len(corners) < 3:
        raise SpecError(TOO_FEW_CORNERS(here, given=len(corners)))
    if not is_convex(corners):
        raise SpecError(NOT_CONVEX(here))
    return convex_hull(corners).vertices
