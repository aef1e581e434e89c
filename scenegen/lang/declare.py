"""What the declarations of objects say: how many there are, what they look like, and which are held in place."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from scenegen.assets import ASSETS, Shape, shape_of
from scenegen.errors import Diagnostic, Source, Span, SpecError, suggest
from scenegen.lang import ast
from scenegen.lang.blame import Frame
from scenegen.lang.measure import SIGNATURES, Arguments, arguments, corners, number, point, size
from scenegen.lang.places import Point
from scenegen.lang.resolve import FILES, SHAPES, bind
from scenegen.lang.scope import Thing
from scenegen.lang.select import whole_number
from scenegen.lang.spec import Pose
from scenegen.lang.trampoline import Call, run
from scenegen.lang.values import ListValue, NumberValue
from scenegen.primitives.footprint import Box, Circle, Footprint
from scenegen.primitives.hull import convex_hull
from scenegen.primitives.units import ANGLE, BARE
from scenegen.scene.workspace import TWO_PI, Workspace

if TYPE_CHECKING:
    from scenegen.lang.imports import Project
    from scenegen.lang.lower import Lowering

MAX_OBJECTS = 20_000


@dataclass(frozen=True, slots=True)
class Sizes:
    """The arguments of a shape, as constants. Raises SpecError where they are not."""

    lowering: Lowering
    source: Source
    kind: str
    given: Arguments

    def length(self, name: str) -> float:
        """A length in metres."""
        return size(self.lowering, *self.given[name], self.source, f"the {name} of a {self.kind}")

    def points(self, name: str) -> tuple[Point, ...]:
        """The corners of a convex polygon, counter-clockwise."""
        return corners(self.lowering, *self.given[name], self.source)


OUTLINES: dict[str, Callable[[Sizes], Footprint]] = {
    "box": lambda sizes: Box(sizes.length("length"), sizes.length("width")),
    "cylinder": lambda sizes: Circle(sizes.length("radius")),
    "prism": lambda sizes: convex_hull(sizes.points("corners")),
}
"""Shape -> its footprint. Those of files are read from the file."""


def name_objects(lowering: Lowering, things: Sequence[Thing]) -> tuple[dict[str, int], dict[str, range]]:
    """The places of single objects and elements by name, and those of each array. Raises SpecError."""
    objects: dict[str, int] = {}
    arrays: dict[str, range] = {}
    for thing in things:
        one = thing.declaration
        if one is None or one.count is None:
            objects[thing.name.id] = len(objects)
        else:
            count = _count(lowering, one.count, thing.source, len(objects))
            arrays[thing.name.id] = range(len(objects), len(objects) + count)
            objects.update((f"{thing.name.id}[{k}]", len(objects) + k - 1) for k in range(1, count + 1))
        if len(objects) > MAX_OBJECTS:
            here = thing.name.span(thing.source)
            raise SpecError(Diagnostic(f"more than {MAX_OBJECTS:,} objects", here, "", "declare fewer"))
    return objects, arrays


def _count(lowering: Lowering, expr: ast.Expr, source: Source, before: int) -> int:
    frame = Frame(source)
    value = lowering.kinds.number(run(lowering.lower(expr, {}, frame)), "the number of elements")
    count = whole_number(lowering, value, expr, frame, "the number of elements")
    if count < 1:
        raise SpecError(Diagnostic(f"an array cannot have {count} elements", expr.span(source), "it has one or more"))
    if before + count > MAX_OBJECTS:
        raise SpecError(Diagnostic(f"more than {MAX_OBJECTS:,} objects", expr.span(source), "", "declare fewer"))
    return count


def shape(lowering: Lowering, thing: Thing, name: str, project: Project) -> Shape:
    """What an object looks like: its name says it, or the shape it was declared with. Raises SpecError."""
    one = thing.declaration
    if one is None or one.shape is None:
        return shape_of(name)
    return run(_shape(lowering, one.shape, thing.source, project))


def _shape(lowering: Lowering, expr: ast.Expr, source: Source, project: Project) -> Call[Shape]:
    here = expr.span(source)
    if isinstance(expr, ast.Name):
        if expr.id in ASSETS:
            return shape_of(expr.id)
        help_ = suggest(expr.id, ASSETS, f"the library has {', '.join(ASSETS)}")
        raise SpecError(Diagnostic(f"the library has no `{expr.id}`", here, "no asset is called so", help_))
    if not isinstance(expr, ast.Call) or expr.function.id not in SHAPES:
        written = expr.function.id if isinstance(expr, ast.Call) else ""
        usages = ", ".join(SIGNATURES[name].usage for name in SHAPES)
        help_ = suggest(written, SHAPES, f"write the name of an asset, or {usages}")
        raise SpecError(Diagnostic("this is no shape", here, "expected what the object looks like", help_))
    kind = expr.function.id
    if kind in FILES:
        file: Shape = yield _file(lowering, expr, source, project)
        return file
    given: Arguments = yield arguments(lowering, expr, source)
    sizes = Sizes(lowering, source, kind, given)
    return Shape(kind, OUTLINES[kind](sizes), sizes.length("height"))


def _file(lowering: Lowering, call: ast.Call, source: Source, project: Project) -> Call[Shape]:
    """A file's outline; where the outline stands beside the path, the file is not read."""
    from scenegen.assets.urdf import UrdfError, mesh_outline, outline

    kind = call.function.id
    given = bind(call, SIGNATURES[kind], source)
    if isinstance(given, Diagnostic):
        raise SpecError(given)
    path = given["path"]
    here = path.span(source)
    if not isinstance(path, ast.Text):
        raise SpecError(Diagnostic("a file is named in double quotes", here, "", f"write {SIGNATURES[kind].usage}"))
    if "shape" in given:
        stated: Shape = yield _shape(lowering, given["shape"], source, project)
        if stated.path or stated.asset not in SHAPES:
            help_ = f'write {kind}("{path.value}", box(length, width, height))'
            raise SpecError(Diagnostic("this is no outline", given["shape"].span(source), "", help_))
        return Shape(kind, stated.footprint, stated.height, path.value)
    data = project.read(path.value, here, "a URDF file" if kind == "urdf" else "a mesh file")
    try:
        if kind == "mesh":
            footprint, height = mesh_outline(path.value, data)
        else:
            footprint, height = outline(data, lambda mesh: project.read_beside(path.value, mesh, here))
    except UrdfError as error:
        raise SpecError(Diagnostic(f"{path.value} is of no use: {error}", here)) from None
    return Shape(kind, footprint, height, path.value)


def pose(lowering: Lowering, thing: Thing, within: Workspace) -> tuple[Pose, ...]:
    """Where an object is held, one pose per element of an array; empty where it is free. Raises SpecError."""
    one = thing.declaration
    if one is None or one.pose is None:
        return ()
    count = len(lowering.scope.arrays.get(thing.name.id, (0,)))
    here = one.pose.span(thing.source)
    if thing.is_array and not isinstance(one.pose, ast.List):
        value = run(lowering.lower(one.pose, {}, Frame(thing.source)))  # a constant may be a list of places
        items = value.items if isinstance(value, ListValue) else (value,)
        _count_places(len(items), count, here)
        places = [point(lowering, item, "the place of an object") for item in items]
        for x, y in places:
            _refuse_outside(x, y, here, within)
        return tuple((x, y, 0.0) for x, y in places)
    parts = one.pose.items if isinstance(one.pose, ast.List) else (one.pose,)
    if thing.is_array:
        _count_places(len(parts), count, here)
    elif isinstance(one.pose, ast.List):
        raise SpecError(Diagnostic("one object stands in one place", here, "", "write at (0.5, 0.5)"))
    return tuple(_pose(lowering, part, thing.source, within) for part in parts)


def _count_places(given: int, count: int, here: Span) -> None:
    if given != count:
        help_ = f"write a list of {count} points: at [(0.2, 0.5), ...]"
        raise SpecError(Diagnostic(f"{count} objects stand in {count} places", here, f"{given} given", help_))


def _pose(lowering: Lowering, expr: ast.Expr, source: Source, within: Workspace) -> Pose:
    frame = Frame(source)
    theta = 0.0
    if isinstance(expr, ast.Point):
        x, y = (
            number(lowering, run(lowering.lower(part, {}, frame)), part, source, "a coordinate")
            for part in expr.coordinates[:2]
        )
        if len(expr.coordinates) == 3:
            theta = _heading(lowering, expr.coordinates[2], source)
    else:
        x, y = point(lowering, run(lowering.lower(expr, {}, frame)), "the place of an object")
    _refuse_outside(x, y, expr.span(source), within)
    return x, y, theta


def _refuse_outside(x: float, y: float, here: Span, within: Workspace) -> None:
    if not (within.x[0] <= x <= within.x[1] and within.y[0] <= y <= within.y[1]):
        (left, right), (bottom, top) = within.x, within.y
        label = f"the workspace is [{left:g}, {right:g}] x [{bottom:g}, {top:g}]"
        raise SpecError(
            Diagnostic("this place is outside the workspace", here, label, "move it, or widen the workspace")
        )


def _heading(lowering: Lowering, expr: ast.Expr, source: Source) -> float:
    """A heading in [0, 2 pi). Raises SpecError."""
    given = lowering.kinds.number(run(lowering.lower(expr, {}, Frame(source))), "a heading")
    amount = lowering.builder.value(given.node)
    if amount is None:
        raise SpecError(Diagnostic("a heading must be a constant", expr.span(source), "this depends on the scene"))
    if given.unit not in (BARE, ANGLE):
        raise SpecError(
            Diagnostic(f"a heading is an angle, not {given.unit.words}", expr.span(source), "", "write 90 deg")
        )
    lowering.refuse_degrees([given, NumberValue(given.node, ANGLE, origin=Span(source, expr.start, expr.end))])
    wrapped = math.fmod(amount, TWO_PI)
    wrapped = wrapped + TWO_PI if wrapped < 0.0 else wrapped
    return 0.0 if wrapped >= TWO_PI else wrapped
