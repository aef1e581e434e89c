"""Where the workspace and the regions lie."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from scenegen.errors import Diagnostic, Source, SpecError
from scenegen.errors.counts import COUNT_OF_LEVELS
from scenegen.errors.declarations import (
    CORNERS_NOT_A_LIST,
    EMPTY_INTERVAL,
    FLAT_RECTANGLE,
    LEVEL_COUNT,
    LEVEL_OUT_OF_RANGE,
    LEVELS_INTERSECT,
    NARROW_INTERVAL,
    NOT_A_REGION,
    TOO_FAR_OUT,
)
from scenegen.lang import ast
from scenegen.lang.measure import Arguments, arguments, corners, number, point, size
from scenegen.lang.places import Area, board_gap, disc, polygon, rectangle
from scenegen.lang.provenance import Frame
from scenegen.lang.resolve import AREAS
from scenegen.lang.scope import Declared
from scenegen.lang.select import whole_number
from scenegen.lang.trampoline import Call, run
from scenegen.lang.values import Value
from scenegen.scene.limits import BOARD, FARTHEST, LARGEST
from scenegen.scene.workspace import Workspace

if TYPE_CHECKING:
    from scenegen.lang.context import Context

ROUNDING = 1e-9  # metres: heights in a text are rounded
NARROWEST = 1e-9  # least width of the workspace, relative to its distance from the origin


def workspace(lowering: Context, source: Source, statement: ast.Workspace) -> Workspace:
    """The rectangle of a `workspace` statement. Raises SpecError."""
    return Workspace(_interval(lowering, source, statement.x, "x"), _interval(lowering, source, statement.y, "y"))


def _interval(lowering: Context, source: Source, interval: ast.Interval, axis: str) -> tuple[float, float]:
    ends = []
    for expr in (interval.lowest, interval.highest):
        value = run(lowering.lower(expr, {}, Frame(source)))
        ends.append(number(lowering, value, expr, source, "the workspace"))
    lowest, highest = ends
    here = interval.span(source)
    if max(abs(lowest), abs(highest)) > FARTHEST:
        raise SpecError(TOO_FAR_OUT(here, what=f"this interval of {axis}", limit=FARTHEST))
    if 0.0 < highest - lowest < NARROWEST * max(1.0, abs(lowest), abs(highest)):
        raise SpecError(NARROW_INTERVAL(here, axis=axis))
    if not lowest < highest:
        swapped = f"[{highest:g}, {lowest:g}]" if lowest > highest else None
        raise SpecError(EMPTY_INTERVAL(here, axis=axis, swapped=swapped))
    return lowest, highest


def areas(lowering: Context, declared: Declared) -> Call[None]:
    """Puts the place of a `region` statement into `lowering.areas`, or those of `shelf[1]`, `shelf[2]` and so on.
    Raises SpecError."""
    statement, source = declared.statement, declared.source
    assert isinstance(statement, ast.Region)
    name = statement.name.id
    flat: Area = yield _area(lowering, declared)
    levels = []
    for expr in statement.levels:
        value: Value = yield lowering.lower(expr, {}, Frame(source))
        level = number(lowering, value, expr, source, "the height of a region")
        if not 0.0 <= level <= LARGEST:
            raise SpecError(LEVEL_OUT_OF_RANGE(expr.span(source), level=level, most=LARGEST))
        levels.append(level)
    if statement.count is None:
        if len(levels) > 1:
            raise SpecError(LEVEL_COUNT(statement.span(source), name=name, count=1, levels=len(levels)))
        lowering.areas[name] = replace(flat, z=levels[0]) if levels else flat
        return
    if isinstance(statement.count, ast.Range):
        raise SpecError(COUNT_OF_LEVELS(statement.count.span(source), name=name, levels=len(levels) or None))
    given: Value = yield lowering.lower(statement.count, {}, Frame(source))
    frame = Frame(source)
    what = "the number of levels"
    count = whole_number(lowering, lowering.coerce.number(given, what), statement.count, frame, what)
    if count != len(levels):
        raise SpecError(LEVEL_COUNT(statement.span(source), name=name, count=count, levels=len(levels)))
    for which, level in enumerate(levels, 1):
        lowering.areas[f"{name}[{which}]"] = replace(flat, z=level)
    lowering.levels[name] = count


def level_clash(lowering: Context, declared: Sequence[Declared]) -> list[Diagnostic]:
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


def _area(lowering: Context, declared: Declared) -> Call[Area]:
    statement, source = declared.statement, declared.source
    assert isinstance(statement, ast.Region)
    call = statement.shape
    if not isinstance(call, ast.Call) or call.function.id not in AREAS:
        written = call.function.id if isinstance(call, ast.Call) else ""
        raise SpecError(NOT_A_REGION(call.span(source), name=written, known=AREAS))
    kind = call.function.id
    if kind == "polygon" and (len(call.arguments) != 1 or isinstance(call.arguments[0].value, ast.Point)):
        raise SpecError(CORNERS_NOT_A_LIST(call.span(source)))
    given: Arguments = yield arguments(lowering, call, source)
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
    if max(abs(left), abs(bottom), abs(right), abs(top)) > FARTHEST:
        raise SpecError(TOO_FAR_OUT(call.span(source), what="this region", limit=FARTHEST))
    return rectangle(left, bottom, right, top)
