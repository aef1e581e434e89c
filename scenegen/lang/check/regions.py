"""Where the workspace and the regions lie."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from scenegen.errors import Diagnostic, Source, SpecError
from scenegen.errors.declarations import (
    EMPTY_INTERVAL,
    FILE_WITHOUT_QUOTES,
    FLAT_RECTANGLE,
    LEVEL_COUNT,
    LEVELS_INTERSECT,
    NOT_A_SHAPE,
    SIZE_OUT_OF_RANGE,
    WRONG_CORNERS,
)
from scenegen.errors.language import MISPLACED_VALUE, NOT_CONSTANT
from scenegen.errors.requests import UNKNOWN_CHOICE
from scenegen.geometry.footprint import convex_hull, is_convex
from scenegen.geometry.primitives import BARE, LENGTH
from scenegen.geometry.workspace import BOARD, LARGEST, MAX_COORDINATE, SMALLEST, Workspace
from scenegen.lang.check.names import AREAS, SHAPE_WORDS, bind
from scenegen.lang.check.scope import Declared, Signature
from scenegen.lang.check.values import (
    AnyValue,
    Area,
    CallFrame,
    ListValue,
    Point,
    PointValue,
    Value,
    board_gap,
    disc,
    polygon,
    rectangle,
)
from scenegen.lang.syntax import ast
from scenegen.things.arms import RING_FIELDS
from scenegen.things.library import COLOR_WORDS, hex_of

if TYPE_CHECKING:
    from scenegen.lang.check.lowering import Lowering


SIGNATURES = {
    "box": Signature("box", ("length", "width", "height", "color"), 3, usage="box(length, width, height)"),
    "cylinder": Signature("cylinder", ("radius", "height", "color"), 2, usage="cylinder(radius, height)"),
    "prism": Signature("prism", ("corners", "height", "color"), 2, usage="prism([(x, y), ...], height)"),
    "urdf": Signature("urdf", ("path", "shape"), 1, usage='urdf("file.urdf")'),
    "mesh": Signature("mesh", ("path", "shape"), 1, usage='mesh("file.obj")'),
    "asset": Signature("asset", ("name", "shape"), 1, usage='asset("025_mug")'),
    "arm": Signature(
        "arm",
        ("path", *RING_FIELDS, "offset", *(f"behind_{name}" for name in RING_FIELDS), "base", "hand"),
        1,
        usage='arm("my_arm.toml")',
    ),
    "cabinet": Signature("cabinet", ("drawers", "open"), 0, usage="cabinet(drawers = 3, open = 0.6)"),
    "category": Signature(
        "category", ("name", "assets", "pick", "most", "seed"), 1, usage='category("mug", most = 8, seed = 1)'
    ),
    "rect": Signature("rect", ("left", "bottom", "right", "top"), 4, usage="rect(left, bottom, right, top)"),
    "circle": Signature("circle", ("center", "radius"), 2, usage="circle((x, y), radius)"),
    "polygon": Signature("polygon", ("corners",), 1, usage="polygon([(x, y), ...])"),
}


def number(lowering: Lowering, value: Value, expr: ast.Expr, source: Source, what: str) -> float:
    """A constant length. Raises SpecError."""
    return lowering.constant(value, expr, CallFrame(source), what, BARE, LENGTH)


def point(lowering: Lowering, value: Value, what: str) -> Point:
    """A constant point. Raises SpecError."""
    if not isinstance(value, PointValue):
        raise lowering.coerce.wrong(value, "a point", what)
    x, y = (lowering.builder.value(node) for node in (value.x, value.y))
    if x is None or y is None:
        raise SpecError(NOT_CONSTANT(value.origin, what=what))
    if max(abs(x), abs(y)) > MAX_COORDINATE:
        raise SpecError(SIZE_OUT_OF_RANGE(value.origin, what=what, limit=MAX_COORDINATE))
    return x, y


def size(lowering: Lowering, value: Value, expr: ast.Expr, source: Source, what: str) -> float:
    """A constant length that something can measure. Raises SpecError."""
    amount = number(lowering, value, expr, source, what)
    if not SMALLEST <= amount <= LARGEST:
        raise SpecError(SIZE_OUT_OF_RANGE(expr.span(source), what=what, size=amount, least=SMALLEST, most=LARGEST))
    return amount


Arguments = dict[str, tuple[Value, ast.Expr]]


def arguments(lowering: Lowering, call: ast.Call, source: Source) -> Arguments:
    """The arguments of a shape by parameter, each with the expression it was written as. Raises SpecError."""
    given = bind(call, SIGNATURES[call.function.id], source)
    if isinstance(given, Diagnostic):
        raise SpecError(given)
    values: Arguments = {}
    for name, expr in given.items():
        if name == "color":
            values[name] = (AnyValue(origin=expr.span(source)), expr)
            continue
        if isinstance(expr, ast.Text) or (isinstance(expr, ast.Call) and expr.function.id in SHAPE_WORDS):
            what = "a text" if isinstance(expr, ast.Text) else "a shape"
            usage = SIGNATURES[call.function.id].usage
            raise SpecError(MISPLACED_VALUE(expr.span(source), what=what, parameter=name, usage=usage))
        value = lowering.evaluate(expr, CallFrame(source))
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
        raise SpecError(UNKNOWN_CHOICE(here, what="colour", name=expr.value, known=(*COLOR_WORDS, "#rrggbb")))
    return found


def corners(lowering: Lowering, value: Value, expr: ast.Expr, source: Source) -> tuple[Point, ...]:
    """The corners of a convex polygon, counter-clockwise. Raises SpecError."""
    if not isinstance(value, ListValue):
        raise lowering.coerce.wrong(value, "a list of corners", "a polygon")
    corners = [point(lowering, item, "a corner") for item in value.items]
    here = expr.span(source)
    if len(corners) < 3:
        raise SpecError(WRONG_CORNERS(here, given=len(corners)))
    if not is_convex(corners):
        raise SpecError(WRONG_CORNERS(here))
    return convex_hull(corners).vertices


ROUNDING = 1e-9  # metres: heights in a text are rounded
MIN_REGION_WIDTH = 1e-9  # least width of the workspace, relative to its distance from the origin


def workspace(lowering: Lowering, source: Source, statement: ast.Workspace) -> Workspace:
    """The rectangle of a `workspace` statement. Raises SpecError."""
    return Workspace(_interval(lowering, source, statement.x, "x"), _interval(lowering, source, statement.y, "y"))


def _interval(lowering: Lowering, source: Source, interval: ast.Interval, axis: str) -> tuple[float, float]:
    ends = []
    for expr in (interval.lowest, interval.highest):
        value = lowering.evaluate(expr, CallFrame(source))
        ends.append(number(lowering, value, expr, source, "the workspace"))
    lowest, highest = ends
    here = interval.span(source)
    if max(abs(lowest), abs(highest)) > MAX_COORDINATE:
        raise SpecError(SIZE_OUT_OF_RANGE(here, what=f"this interval of {axis}", limit=MAX_COORDINATE))
    if 0.0 < highest - lowest < MIN_REGION_WIDTH * max(1.0, abs(lowest), abs(highest)):
        raise SpecError(EMPTY_INTERVAL(here, axis=axis, narrow=True))
    if not lowest < highest:
        swapped = f"[{highest:g}, {lowest:g}]" if lowest > highest else None
        raise SpecError(EMPTY_INTERVAL(here, axis=axis, swapped=swapped))
    return lowest, highest


def areas(lowering: Lowering, declared: Declared) -> None:
    """Puts the place of a `region` statement into `lowering.areas`, or those of `shelf[1]`, `shelf[2]` and so on.
    Raises SpecError."""
    statement, source = declared.statement, declared.source
    assert isinstance(statement, ast.Region)
    name = statement.name.id
    flat: Area = _area(lowering, declared)
    levels = []
    for expr in statement.levels:
        value: Value = lowering.evaluate(expr, CallFrame(source))
        level = number(lowering, value, expr, source, "the height of a region")
        if not 0.0 <= level <= LARGEST:
            raise SpecError(SIZE_OUT_OF_RANGE(expr.span(source), level=level, most=LARGEST))
        levels.append(level)
    if statement.count is None:
        if len(levels) > 1:
            raise SpecError(LEVEL_COUNT(statement.span(source), name=name, count=1, levels=len(levels)))
        lowering.areas[name] = replace(flat, z=levels[0]) if levels else flat
        return
    if isinstance(statement.count, ast.Range | ast.Weighted):
        raise SpecError(LEVEL_COUNT(statement.count.span(source), name=name, levels=len(levels) or None))
    given: Value = lowering.evaluate(statement.count, CallFrame(source))
    frame = CallFrame(source)
    what = "the number of levels"
    count = lowering.count(given, statement.count, frame, what)
    if count != len(levels):
        raise SpecError(LEVEL_COUNT(statement.span(source), name=name, count=count, levels=len(levels)))
    for which, level in enumerate(levels, 1):
        lowering.areas[f"{name}[{which}]"] = replace(flat, z=level)
    lowering.levels[name] = count


def level_clash(lowering: Lowering, declared: Sequence[Declared]) -> list[Diagnostic]:
    """A diagnostic for each board that shares space with an earlier one."""
    problems = []
    earlier: list[tuple[str, Area]] = []
    for one in declared:
        assert isinstance(one.statement, ast.Region)
        for name, place in lowering.areas.items():
            if place.z > 0.0 and name.partition("[")[0] == one.statement.name.id:
                for other, below in earlier:
                    if board_gap(place, below) < -ROUNDING:
                        apart = abs(place.z - below.z)
                        here = one.statement.span(one.source)
                        names = {"name": name, "other": other}
                        problems.append(LEVELS_INTERSECT(here, **names, apart=100.0 * apart, board=100.0 * BOARD))
                earlier.append((name, place))
    return problems


def _area(lowering: Lowering, declared: Declared) -> Area:
    statement, source = declared.statement, declared.source
    assert isinstance(statement, ast.Region)
    call = statement.shape
    if not isinstance(call, ast.Call) or call.function.id not in AREAS:
        written = call.function.id if isinstance(call, ast.Call) else ""
        raise SpecError(NOT_A_SHAPE(call.span(source), name=written, known=AREAS))
    kind = call.function.id
    if kind == "polygon" and (len(call.arguments) != 1 or isinstance(call.arguments[0].value, ast.Point)):
        raise SpecError(WRONG_CORNERS(call.span(source), list=True))
    given: Arguments = arguments(lowering, call, source)
    if kind == "circle":
        center = point(lowering, given["center"][0], "the centre of a circle")
        return disc(center, size(lowering, *given["radius"], source, "the radius of a circle"))
    if kind == "polygon":
        outline = corners(lowering, *given["corners"], source)
        x, y = zip(*outline, strict=True)
        return polygon(outline, (sum(x) / len(x), sum(y) / len(y)))
    left, bottom, right, top = (
        number(lowering, *given[name], source, f"the {name} side of a rectangle")
        for name in ("left", "bottom", "right", "top")
    )
    if left >= right or bottom >= top:
        side = None
        if left > right or bottom > top:
            side = "left side is right of its right side" if left > right else "top is below its bottom"
        low_x, high_x, low_y, high_y = min(left, right), max(left, right), min(bottom, top), max(bottom, top)
        mended = f"rect({low_x:g}, {low_y:g}, {high_x:g}, {high_y:g})" if low_x < high_x and low_y < high_y else None
        raise SpecError(FLAT_RECTANGLE(call.span(source), side=side, mended=mended))
    if max(abs(left), abs(bottom), abs(right), abs(top)) > MAX_COORDINATE:
        raise SpecError(SIZE_OUT_OF_RANGE(call.span(source), what="this region", limit=MAX_COORDINATE))
    return rectangle(left, bottom, right, top)
