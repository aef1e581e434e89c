"""Where the workspace and the regions lie."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenegen.errors import Diagnostic, Source, SpecError, suggest
from scenegen.lang import ast
from scenegen.lang.blame import Frame
from scenegen.lang.measure import SIGNATURES, Arguments, arguments, corners, number, point, size
from scenegen.lang.places import Area, disc, polygon, rectangle
from scenegen.lang.resolve import AREAS
from scenegen.lang.scope import Declared
from scenegen.lang.trampoline import Call, run
from scenegen.scene.limits import FARTHEST
from scenegen.scene.workspace import Workspace

if TYPE_CHECKING:
    from scenegen.lang.context import Context

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
        raise SpecError(Diagnostic(f"this interval of {axis} is too far out", here, f"the limit is {FARTHEST:,.0f} m"))
    if 0.0 < highest - lowest < NARROWEST * max(1.0, abs(lowest), abs(highest)):
        label = "numbers of a computer are too coarse for it"
        raise SpecError(Diagnostic(f"this interval of {axis} is too narrow", here, label, "give it some width"))
    if not lowest < highest:
        help_ = f"write [{highest:g}, {lowest:g}]" if lowest > highest else "give it some width"
        raise SpecError(Diagnostic(f"this interval of {axis} is empty", here, "the first end must be smaller", help_))
    return lowest, highest


def area(lowering: Context, declared: Declared) -> Call[Area]:
    """The place of a `region` statement. Raises SpecError."""
    statement, source = declared.statement, declared.source
    assert isinstance(statement, ast.Region)
    call = statement.shape
    if not isinstance(call, ast.Call) or call.function.id not in AREAS:
        written = call.function.id if isinstance(call, ast.Call) else ""
        help_ = suggest(written, AREAS) or f"write {SIGNATURES['rect'].usage}, {SIGNATURES['circle'].usage}"
        help_ = help_ if "did you" in help_ else f"{help_} or {SIGNATURES['polygon'].usage}"
        raise SpecError(Diagnostic("this is no region", call.span(source), "expected a shape with its place", help_))
    kind = call.function.id
    if kind == "polygon" and (len(call.arguments) != 1 or isinstance(call.arguments[0].value, ast.Point)):
        help_ = "put the corners in a list: polygon([(0, 0), (1, 0), (0, 1)])"
        raise SpecError(Diagnostic("a polygon takes one list of corners", call.span(source), "", help_))
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
        title = "this rectangle is flat"
        if left > right or bottom > top:
            where = "left side is right of its right side" if left > right else "top is below its bottom"
            title = f"this rectangle's {where}"
        low_x, high_x, low_y, high_y = min(left, right), max(left, right), min(bottom, top), max(bottom, top)
        help_ = f"write rect({low_x:g}, {low_y:g}, {high_x:g}, {high_y:g})" if low_x < high_x and low_y < high_y else ""
        help_ = help_ or "give it some width and height"
        raise SpecError(Diagnostic(title, call.span(source), SIGNATURES["rect"].usage, help_))
    if max(abs(left), abs(bottom), abs(right), abs(top)) > FARTHEST:
        raise SpecError(Diagnostic("this region is too far out", call.span(source), f"the limit is {FARTHEST:,.0f} m"))
    return rectangle(left, bottom, right, top)
