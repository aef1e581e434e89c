"""What the declarations of objects say: how many there are, what they look like, and which are held in place."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from scenegen.errors import Diagnostic, Source, Span, SpecError
from scenegen.errors.declarations import (
    DRAWER_NOT_OPEN,
    EMPTY_ARRAY,
    FILE_WITHOUT_QUOTES,
    NOT_A_SHAPE,
    OUTSIDE_WORKSPACE,
    STANDS_IN,
    TOO_MANY_COUNTS,
    TOO_MANY_OBJECTS,
    UNKNOWN_ARM,
    UNKNOWN_ASSET,
    UNLIKELY_SHAPE,
    UNUSABLE_SHAPE_FILE,
    WRONG_DRAWERS,
    WRONG_NUMBER_OF_PLACES,
    WRONG_WEIGHT,
)
from scenegen.errors.language import EMPTY_RANGE
from scenegen.geometry.footprint import Box, Circle, Footprint, Polygon, convex_hull
from scenegen.geometry.primitives import ANGLE, BARE
from scenegen.geometry.workspace import Workspace
from scenegen.lang.check.arms import arm_call, arm_shape
from scenegen.lang.check.families import (
    MOST_COMBINATIONS,
    WORD,
    Category,
    Variants,
    category_of,
    category_picks,
    is_category,
    variants,
)
from scenegen.lang.check.names import BUILT, FILE_SHAPES, SHAPE_WORDS, bind
from scenegen.lang.check.regions import SIGNATURES, Arguments, arguments, color, corners, number, point, size
from scenegen.lang.check.scope import DeclaredObject, Scope
from scenegen.lang.check.values import CallFrame, ListValue, NumberValue, Point
from scenegen.lang.check.weights import refuse_fine_weights, weights_of, whole_weights
from scenegen.lang.spec import Count, Pose
from scenegen.lang.syntax import ast
from scenegen.lang.syntax.printer import print_expr, print_module
from scenegen.pose import TWO_PI
from scenegen.things import ASSETS, PLAIN, Shape, meant_by, shape_of
from scenegen.things.arms import shipped_arms
from scenegen.things.furniture import DRAWERS, MAX_DRAWERS, Cabinet, SupportSurface
from scenegen.things.library import cabinet_shape
from scenegen.things.surfaces import narrowest

if TYPE_CHECKING:
    from scenegen.lang.check.draft import Draft
    from scenegen.lang.check.imports import Project
    from scenegen.lang.check.lowering import Lowering


SPARE_PERCENT = 1e-3  # per cent: what just fits would be held by rounding alone


def cabinet(lowering: Lowering, given: Arguments, source: Source) -> Shape:
    """A cabinet's shape. `open` is a list of shares, the lowest drawer first, or the share of the topmost drawer alone.
    Raises SpecError."""
    drawers = None
    if "drawers" in given:
        value, expr = given["drawers"]
        what = "the number of drawers"
        drawers = lowering.count(value, expr, CallFrame(source), what)
        if not 1 <= drawers <= MAX_DRAWERS:
            raise SpecError(WRONG_DRAWERS(expr.span(source), given=drawers, most=MAX_DRAWERS))
    if "open" not in given:
        return cabinet_shape((0.0,) * (drawers or DRAWERS))
    value, expr = given["open"]
    here, what = expr.span(source), "the share by which a drawer is open"
    shares = []
    for item in value.items if isinstance(value, ListValue) else (value,):
        share = lowering.constant(item, expr, CallFrame(source), what, BARE)
        if not 0.0 <= share <= 1.0:
            raise SpecError(WRONG_DRAWERS(here, given=share, share=True))
        shares.append(share)
    if not isinstance(value, ListValue):
        return cabinet_shape((*(0.0,) * ((drawers or DRAWERS) - 1), *shares))
    if len(shares) != (drawers or len(shares)) or not 1 <= len(shares) <= MAX_DRAWERS:
        raise SpecError(WRONG_DRAWERS(here, given=len(shares), drawers=drawers or None, most=MAX_DRAWERS, shares=True))
    return cabinet_shape(tuple(shares))


def not_open(lowering: Lowering, upper: int, carrier: int, surface: SupportSurface, here: Span) -> Diagnostic | None:
    """What to say where an object would fit into a drawer that were open further, or that drawers above it did not
    hide; None of other surfaces, and where the object is too large for any drawer."""
    pull = surface.pull
    need = None if pull is None else narrowest(lowering.shapes[upper].footprint, pull.width)
    if pull is None or need is None:
        return None
    shares = list(lowering.shapes[carrier].open or Cabinet().open)
    number = int(surface.name.partition("[")[2].rstrip("]")) - 1
    least, above = _round_up(pull.least(need)), ""
    if least > 1.0:
        shares = [*shares[: number + 1], *(0.0 for _ in shares[number + 1 :])]
        alone = Cabinet(tuple(shares)).surfaces()[number + 1].pull
        assert alone is not None
        least, above = _round_up(alone.least(need)), "close the drawers above it and "
    if not shares[number] < least <= 1.0 and not (above and least <= 1.0):
        return None
    shares[number] = max(least, shares[number])
    return DRAWER_NOT_OPEN(
        here,
        name=lowering.builder.objects[upper],
        drawer=surface.name,
        carrier=lowering.builder.objects[carrier],
        share=100.0 * pull.share,
        reach=100.0 * max(pull.reach, 0.0),
        need=100.0 * need,
        least=least,
        above=above,
        mended=f"cabinet(open = [{', '.join(f'{share:g}' for share in shares)}])",
    )


def _round_up(share: float) -> float:
    """Up to the next hundredth, with some room."""
    return math.ceil(100.0 * share + SPARE_PERCENT) / 100.0


MAX_OBJECTS = 20_000
LARGE = 2.0  # metres: a thing on a table is smaller
AWAY = 0.05  # metres from the origin of a file to its outline, at least along x or y
CENTIMETRES = {  # what to do about a file in another unit
    "mesh": 'give it an entry in assets.toml with scale = 0.01, and write asset("NAME")',
    "asset": "multiply its scale in assets.toml by 0.01",
    "urdf": 'write scale="0.01 0.01 0.01" in its <mesh>',
}


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


def name_objects(
    lowering: Lowering, things: Sequence[DeclaredObject], counts: Mapping[str, int] | None = None
) -> tuple[dict[str, int], dict[str, range]]:
    """The places of single objects and elements by name, and those of each array. Where the number of elements is drawn
    it is that of `counts`, or else the most there can be. Raises SpecError."""
    objects: dict[str, int] = {}
    arrays: dict[str, range] = {}
    for thing in things:
        one = thing.declaration
        if one is None or one.count is None:
            objects[thing.name.id] = len(objects)
        else:
            if isinstance(one.count, ast.Range | ast.Weighted):
                drawn = _drawn_count(lowering, thing.name.id, one.count, thing.source, len(objects))
                lowering.scope.counts[thing.name.id] = drawn
                count = (counts or {}).get(thing.name.id, drawn.most)
            else:
                count = _count(lowering, one.count, thing.source, len(objects))
            places = arrays[thing.name.id] = range(len(objects), len(objects) + count)
            objects.update((f"{thing.name.id}[{k}]", place) for k, place in enumerate(places, start=1))
        if len(objects) > MAX_OBJECTS:
            raise SpecError(TOO_MANY_OBJECTS(thing.name.span(thing.source), limit=MAX_OBJECTS))
    return objects, arrays


def _count(lowering: Lowering, expr: ast.Expr, source: Source, before: int) -> int:
    frame = CallFrame(source)
    count = lowering.count(lowering.evaluate(expr, frame), expr, frame, "the number of elements")
    if count < 1:
        ends = (expr.left, expr.right) if isinstance(expr, ast.Binary) and expr.operator == "-" else ()
        written = [print_expr(end) for end in ends if isinstance(end, ast.Quantity)]
        instead = f"for a number that is drawn write {written[0]}..{written[1]}" if len(written) == 2 else None
        raise SpecError(EMPTY_ARRAY(expr.span(source), count=count, instead=instead))
    if before + count > MAX_OBJECTS:
        raise SpecError(TOO_MANY_OBJECTS(expr.span(source), limit=MAX_OBJECTS))
    return count


def _drawn_count(lowering: Lowering, name: str, drawn: ast.Range | ast.Weighted, source: Source, before: int) -> Count:
    if isinstance(drawn, ast.Weighted):
        made = _weighted_numbers(lowering, name, drawn, source, before)
    else:
        made = _range(lowering, name, drawn, source, before)
    known = [one for one in lowering.scope.counts.values() if one.name != name]
    combinations = math.prod(len(one.numbers) for one in (*known, made))
    if combinations > MOST_COMBINATIONS:
        raise SpecError(TOO_MANY_COUNTS(drawn.span(source), combinations=combinations, limit=MOST_COMBINATIONS))
    refuse_fine_weights((*known, made), drawn.span(source))
    return made


def _range(lowering: Lowering, name: str, drawn: ast.Range, source: Source, before: int) -> Count:
    least, most = (_count(lowering, end, source, before) for end in (drawn.lowest, drawn.highest))
    if least > most:
        written = isinstance(drawn.lowest, ast.Quantity) and isinstance(drawn.highest, ast.Quantity)
        instead = f"{most}..{least}" if written else None
        raise SpecError(EMPTY_RANGE(drawn.span(source), lowest=least, highest=most, instead=instead))
    return Count(name, least, most)


def _weighted_numbers(lowering: Lowering, name: str, drawn: ast.Weighted, source: Source, before: int) -> Count:
    numbers = [_count(lowering, item, source, before) for item in drawn.items]
    for place, item in enumerate(drawn.items):
        if numbers[place] in numbers[:place]:
            raise SpecError(WRONG_WEIGHT(item.span(source), twice=numbers[place]))
    weights = weights_of(lowering, drawn, source)
    if len(numbers) == 1:
        facts = {"name": name, "least": numbers[0], "most": max(numbers[0] + 1, math.ceil(weights[0]))}
        raise SpecError(WRONG_WEIGHT(drawn.span(source), alone=True, **facts))
    order = sorted(zip(numbers, whole_weights(weights), strict=True))
    return Count(
        name, order[0][0], order[-1][0], (), tuple(one for one, _ in order), tuple(weight for _, weight in order)
    )


def shape(lowering: Lowering, thing: DeclaredObject, name: str, project: Project) -> Shape:
    """What an object looks like: its name says it, or the shape it was declared with. Raises SpecError."""
    one = thing.declaration
    if one is None or one.shape is None:
        if one is not None and one.robot:
            raise SpecError(UNKNOWN_ARM(thing.name.span(thing.source), known=shipped_arms()))
        return shape_of(name)
    if one.robot:
        return arm_shape(lowering, one.shape, thing.source, project)
    return _shape(lowering, one.shape, thing.source, project)


def categories(lowering: Lowering, project: Project, counts: Mapping[str, int]) -> tuple[dict[str, Category], Variants]:
    """The categories of the objects that have one, by name, and what these objects are where `counts` says so. Raises
    SpecError."""
    scope = lowering.scope
    found: dict[str, Category] = {}
    for name, thing in scope.things.items():
        if thing.declaration is None or not is_category(thing.declaration.shape):
            continue

        def outline_of(expr: ast.Expr, source: Source = thing.source) -> Shape:
            return _shape(lowering, expr, source, project)

        made = category_of(thing, len(scope.arrays.get(name, (0,))), project, outline_of)
        if made is not None:
            found[name] = made
    return found, variants(scope, found, counts) if found else Variants()


def _shape(lowering: Lowering, expr: ast.Expr, source: Source, project: Project) -> Shape:
    here = expr.span(source)
    if isinstance(expr, ast.Name):
        if expr.id in ASSETS:
            return shape_of(expr.id)
        raise SpecError(UNKNOWN_ASSET(here, name=expr.id, known=ASSETS))
    if not isinstance(expr, ast.Call) or expr.function.id not in SHAPE_WORDS:
        written = expr.function.id if isinstance(expr, ast.Call) else ""
        usages = ", ".join(SIGNATURES[name].usage for name in SHAPE_WORDS)
        raise SpecError(NOT_A_SHAPE(here, name=written, known=SHAPE_WORDS, usages=usages))
    kind = expr.function.id
    if kind in FILE_SHAPES:
        return _file(lowering, expr, source, project)
    given: Arguments = arguments(lowering, expr, source)
    if kind in BUILT:
        return cabinet(lowering, given, source)
    sizes = Sizes(lowering, source, kind, given)
    return Shape(kind, OUTLINES[kind](sizes), sizes.length("height"), color=color(given, source))


def _file(lowering: Lowering, call: ast.Call, source: Source, project: Project) -> Shape:
    """A file's outline; where the outline stands beside the path, the file is not read."""
    from scenegen.lang.check.families import asset_shape
    from scenegen.things.outline import MeshError
    from scenegen.things.urdf import mesh_outline, outline

    kind = call.function.id
    given = bind(call, SIGNATURES[kind], source)
    if isinstance(given, Diagnostic):
        raise SpecError(given)
    path = given[SIGNATURES[kind].parameters[0]]
    here = path.span(source)
    if not isinstance(path, ast.Text):
        raise SpecError(
            FILE_WITHOUT_QUOTES(here, what="an asset" if kind == "asset" else "a file", usage=SIGNATURES[kind].usage)
        )
    if "shape" in given:
        stated: Shape = _shape(lowering, given["shape"], source, project)
        if stated.path or stated.color or stated.asset not in PLAIN:
            raise SpecError(NOT_A_SHAPE(given["shape"].span(source), kind=kind, path=path.value))
        return Shape(kind, stated.footprint, stated.height, path.value)
    if kind == "asset":
        found = asset_shape(path.value, here, project)
        _notice(lowering, found, here)
        return found
    name = path.value.replace("\\", "/")
    data = project.read(name, here, "a URDF file" if kind == "urdf" else "a mesh file")

    def read_other(other: str) -> bytes:
        return project.read_beside(name, other, here)

    try:
        if kind == "mesh":
            footprint, height = mesh_outline(name, data, read_other)
        else:
            footprint, height = outline(data, read_other)
    except MeshError as error:
        raise SpecError(UNUSABLE_SHAPE_FILE(here, path=path.value, reason=str(error))) from None
    found = Shape(kind, footprint, height, path.value)
    _notice(lowering, found, here)
    return found


def _notice(lowering: Lowering, shape: Shape, here: Span) -> None:
    """Note what a file would be read as and hardly is."""
    size = max(*shape.footprint.extent, shape.height)
    away = 0.0
    if isinstance(shape.footprint, Polygon):
        xs, ys = zip(*shape.footprint.vertices, strict=True)
        away = max(min(xs), -max(xs), min(ys), -max(ys))
    notes = []
    if size > LARGE:
        notes.append(UNLIKELY_SHAPE(here, path=shape.path, size=size, remedy=CENTIMETRES[shape.asset]))
    if away > AWAY:
        notes.append(UNLIKELY_SHAPE(here, path=shape.path, distance=away))
    lowering.noticed += [one for one in notes if one not in lowering.noticed]


def pose(lowering: Lowering, thing: DeclaredObject, within: Workspace) -> tuple[Pose, ...]:
    """Where an object is held, one pose per element of an array; empty where it is free. Raises SpecError."""
    one = thing.declaration
    if one is None or one.pose is None:
        return ()
    count = len(lowering.scope.arrays.get(thing.name.id, (0,)))
    here = one.pose.span(thing.source)
    if thing.is_array and not isinstance(one.pose, ast.List):
        value = lowering.evaluate(one.pose, CallFrame(thing.source))  # a constant may be a list of places
        items = value.items if isinstance(value, ListValue) else (value,)
        _count_places(len(items), count, here)
        places = [point(lowering, item, "the place of an object") for item in items]
        for x, y in places if not one.robot else ():
            _refuse_outside(x, y, here, within)
        return tuple((x, y, 0.0) for x, y in places)
    parts = one.pose.items if isinstance(one.pose, ast.List) else (one.pose,)
    if thing.is_array:
        _count_places(len(parts), count, here)
    elif isinstance(one.pose, ast.List):
        raise SpecError(WRONG_NUMBER_OF_PLACES(here))
    return tuple(written_pose(lowering, part, thing.source, None if one.robot else within) for part in parts)


def _count_places(given: int, count: int, here: Span) -> None:
    if given != count:
        raise SpecError(WRONG_NUMBER_OF_PLACES(here, count=count, given=given))


def written_pose(lowering: Lowering, expr: ast.Expr, source: Source, within: Workspace | None = None) -> Pose:
    """The pose that an expression stands for; inside of a workspace, where one is given. Raises SpecError."""
    frame = CallFrame(source)
    theta = 0.0
    if isinstance(expr, ast.Point):
        x, y = (
            number(lowering, lowering.evaluate(part, frame), part, source, "a coordinate")
            for part in expr.coordinates[:2]
        )
        if len(expr.coordinates) == 3:
            theta = _heading(lowering, expr.coordinates[2], source)
    else:
        x, y = point(lowering, lowering.evaluate(expr, frame), "the place of an object")
    if within is not None:
        _refuse_outside(x, y, expr.span(source), within)
    return x, y, theta


def _refuse_outside(x: float, y: float, here: Span, within: Workspace) -> None:
    if not (within.x[0] <= x <= within.x[1] and within.y[0] <= y <= within.y[1]):
        box = f"[{within.x[0]:g}, {within.x[1]:g}] x [{within.y[0]:g}, {within.y[1]:g}]"
        raise SpecError(OUTSIDE_WORKSPACE(here, workspace=box))


def _heading(lowering: Lowering, expr: ast.Expr, source: Source) -> float:
    """A heading in [0, 2 pi). Raises SpecError."""
    frame = CallFrame(source)
    given = lowering.coerce.number(lowering.evaluate(expr, frame), "a heading")
    amount = lowering.constant(given, expr, frame, "a heading", BARE, ANGLE)
    lowering.refuse_degrees([given, NumberValue(given.node, ANGLE, origin=Span(source, expr.start, expr.end))])
    wrapped = math.fmod(amount, TWO_PI)
    wrapped = wrapped + TWO_PI if wrapped < 0.0 else wrapped
    return 0.0 if wrapped >= TWO_PI else wrapped


# The canonical text of a spec, which scene and model files carry: all it needs, in one piece.
#
# Imports are replaced by what they import, and the outline of a URDF or mesh file stands beside its path: the text
# means the same wherever it is read again.


def canonical(draft: Draft, counts: Mapping[str, int]) -> str:
    """The canonical text; `counts` are the numbers of things that are drawn no more."""
    statements: list[ast.Statement] = []
    priors = iter(draft.priors)
    for one in draft.placed:
        match one.statement:
            case ast.Objects(declarations):
                each = tuple(_resolve_declaration(draft, declared, counts) for declared in declarations)
                statements.append(ast.Objects(each))
            case ast.Usually():
                statements.extend(next(priors).written)
            case statement:
                statements.append(statement)
    return print_module(ast.Module(Source("", ""), tuple(statements), draft.module.bare))


def _resolve_declaration(draft: Draft, one: ast.Declaration, counts: Mapping[str, int]) -> ast.Declaration:
    """The declaration with every file's outline written out, and every number that is drawn no more."""
    name, shape, count = one.name.id, one.shape, one.count
    if isinstance(count, ast.Range | ast.Weighted) and name in counts:
        count = ast.Quantity(str(counts[name]), "")
    if name in draft.kinds:
        shape = _category(draft.kinds[name], category_picks(name, draft.kinds[name], one.count is not None, counts))
    elif one.robot and (looks := draft.shapes[draft.places(draft.scope.things[name])[0]]).path:
        shape = arm_call(looks)
    elif isinstance(shape, ast.Call) and shape.function.id in FILE_SHAPES:
        looks = draft.shapes[draft.places(draft.scope.things[name])[0]]
        shape = written_call(shape.function.id, ast.Text(looks.path), _outline(looks))
    return replace(one, count=count, shape=shape)


def _category(kind: Category, picks: Sequence[int]) -> ast.Call:
    """The category with its assets and their outlines; with what is drawn no more."""
    each = tuple(written_call("asset", ast.Text(one.path), _outline(one)) for one in kind.assets)
    picked = [ast.List(tuple(ast.Quantity(str(pick), "") for pick in picks))] if any(picks) else []
    weights = tuple(ast.Quantity(str(one), "") for one in kind.weights)
    assets = ast.Weighted(each, weights) if weights else ast.List(each)
    return written_call(WORD, ast.Text(kind.path), assets, *picked)


def _outline(looks: Shape) -> ast.Call:
    height = written_number(looks.height)
    match looks.footprint:
        case Circle(radius):
            return written_call("cylinder", written_number(radius), height)
        case Box(length, width):
            return written_call("box", written_number(length), written_number(width), height)
        case footprint:
            corners = tuple(ast.Point((written_number(x), written_number(y))) for x, y in footprint.vertices)
            return written_call("prism", ast.List(corners), height)


def written_call(name: str, *arguments: ast.Expr) -> ast.Call:
    """A call as a text has it."""
    return ast.Call(ast.Name(name), tuple(ast.Argument(None, one) for one in arguments))


def written_number(value: float) -> ast.Expr:
    """A number as a text has it, to the last bit."""
    written = ast.Quantity(repr(abs(value)), "")
    return ast.Negative(written) if value < 0.0 else written


WIDE = 10.0  # metres: a table is shorter


SMALL = 0.5  # numbers below this are metres, whatever the others are


def unlikely(draft: Draft) -> list[Diagnostic]:
    """Warnings about declarations that can hardly be meant so."""
    return [*_misspelt(draft.scope), *_centimetres(draft)]


def _misspelt(scope: Scope) -> Iterator[Diagnostic]:
    """Objects without a shape whose names are nearly those of the library."""
    for name, thing in scope.things.items():
        shapeless = thing.declaration is None or thing.declaration.shape is None
        meant = meant_by(name) if shapeless and scope.is_own(thing.source) else None
        if meant is not None:
            inferred = thing.declaration is None or None
            yield STANDS_IN(thing.name.span(thing.source), name=name, meant=meant, inferred=inferred)


def _centimetres(draft: Draft) -> Iterator[Diagnostic]:
    """Shapes, regions and a workspace with bare numbers that are too large for metres."""
    scope, space = draft.scope, draft.space
    far = max(LARGE, *map(abs, (*space.x, *space.y)))
    for one in draft.placed:
        measured: list[tuple[ast.Expr | ast.Workspace, float]] = []
        match one.statement:
            case ast.Objects(declarations):
                measured = [(each.shape, far) for each in declarations if isinstance(each.shape, ast.Call)]
                measured = [(node, most) for node, most in measured if _function_name(node) in OUTLINES]
            case ast.Region(shape=ast.Call() as shape):
                measured = [(shape, far)]
            case ast.Workspace() if max(space.x[1] - space.x[0], space.y[1] - space.y[0]) > WIDE:
                measured = [(one.statement, WIDE)]
        for node, most in measured if scope.is_own(one.source) else ():
            here = node.span(one.source)
            numbers = [
                (part.start - here.start, part.end - here.start, abs(float(part.number)), part.number)
                for root in (ast.expressions(node) if isinstance(node, ast.Workspace) else (node,))
                for part in _quantities(root)
                if not part.unit and abs(float(part.number)) >= SMALL
            ]
            *_, largest, written = max(numbers, key=lambda number: number[2], default=(0, 0, 0.0, ""))
            if largest > most:
                mended, unit = here.text, "cm" if largest <= 100.0 * most else "mm"
                for _, end, _, _ in sorted(numbers, reverse=True):
                    mended = f"{mended[:end]} {unit}{mended[end:]}"
                facts = {"largest": largest, "mended": mended, "written": written}
                yield replace(UNLIKELY_SHAPE(here, **facts), severity="warning")


def _function_name(node: object) -> str:
    return node.function.id if isinstance(node, ast.Call) else ""


def _quantities(root: ast.Expr) -> Iterator[ast.Quantity]:
    """Its numbers, but factors and divisors: these are no lengths."""
    for node, _ in ast.walk(root, into=lambda node: not (isinstance(node, ast.Binary) and node.operator in "*/")):
        if isinstance(node, ast.Quantity):
            yield node
