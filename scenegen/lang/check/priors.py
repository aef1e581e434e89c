"""`usually mug ~ normal((0.4, 0.3), 5 cm)`: what the statements about where things usually are mean."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from scenegen.errors import DataError, Diagnostic, Source, Span, SpecError
from scenegen.errors.files import DOUBTFUL_POSE
from scenegen.errors.priors import (
    CIRCULAR_PRIOR,
    NOT_A_DISTRIBUTION,
    PRIOR_OUTSIDE,
    WRONG_POSES,
    WRONG_PRIOR,
    WRONG_SPREAD,
)
from scenegen.geometry import MATH, PRIMITIVES
from scenegen.geometry.footprint import Box
from scenegen.geometry.interval import Interval, point
from scenegen.geometry.primitives import ANGLE, BARE, LENGTH, Unit
from scenegen.lang.check.draft import PriorStatement
from scenegen.lang.check.names import bind
from scenegen.lang.check.objects import written_call, written_number, written_pose
from scenegen.lang.check.scope import Signature
from scenegen.lang.check.values import CallFrame, ListValue, NumberValue, ObjectValue, RegionValue
from scenegen.lang.check.weights import weights_of
from scenegen.lang.formula.builder import describe
from scenegen.lang.formula.core import Apply, Const, Coord, Core
from scenegen.lang.prior import Distribution, Normal, Prior, Recorded, UniformHeading, UniformPlace
from scenegen.lang.spec import Pose
from scenegen.lang.syntax import ast
from scenegen.lang.tables import Table, csv_cells
from scenegen.pose import NAMES, TWO_PI, wrap_heading

if TYPE_CHECKING:
    from scenegen.lang.check.imports import Project
    from scenegen.lang.check.lowering import Lowering

LEAST_SPREAD, MOST_SPREAD = 1e-6, 1e6  # metres, or radians: what is narrower is held, what is wider is uniform
MOST_DEVIATIONS = 8.0  # beyond these a normal distribution has less than 1e-15 of its mass
MAX_ROWS = 10_000  # of recorded poses
TABLE_ENDING = ".csv"

POSES = "poses"
Part = Literal["place", "heading"]
PRIOR_SIGNATURES: Mapping[tuple[str, Part], Signature] = {
    ("normal", "place"): Signature("normal", ("middle", "deviation"), 2, usage="normal((0.4, 0.3), 5 cm)"),
    ("normal", "heading"): Signature("normal", ("middle", "deviation"), 2, usage="normal(NORTH, 10 deg)"),
    ("uniform", "place"): Signature("uniform", ("region",), 1, usage="uniform(region)"),
    ("uniform", "heading"): Signature("uniform", ("low", "high"), 2, usage="uniform(80 deg, 100 deg)"),
    (POSES, "place"): Signature(POSES, ("file", "reach", "turn"), 3, usage='poses("logs.csv", 1 cm, 5 deg)'),
}
DISTRIBUTIONS = tuple(dict.fromkeys(word for word, _ in PRIOR_SIGNATURES))


@dataclass(frozen=True, slots=True)
class _Reader:
    """What the parts of a statement are read with. `things` are the objects that it names, by their places; None for an
    element that this member of the spec lacks."""

    lowering: Lowering
    project: Project
    source: Source
    part: Part
    things: tuple[int | None, ...]

    @property
    def present(self) -> tuple[int, ...]:
        return tuple(one for one in self.things if one is not None)

    def width(self, expr: ast.Expr, what: str, unit: Unit) -> float:
        """A standard deviation, or how far recorded poses are moved. Raises SpecError."""
        frame = CallFrame(self.source)
        value = self.lowering.coerce.number(self.lowering.evaluate(expr, frame), what)
        amount = self.lowering.constant(value, expr, frame, what, BARE, unit)
        if unit == ANGLE:
            self.lowering.refuse_degrees([value, NumberValue(value.node, ANGLE, origin=value.origin)])
        if not LEAST_SPREAD <= amount <= MOST_SPREAD:
            unit_name = "m" if unit == LENGTH else "rad"
            facts = {"what": what, "width": amount, "unit": unit_name, "least": LEAST_SPREAD, "most": MOST_SPREAD}
            raise SpecError(WRONG_SPREAD(expr.span(self.source), **facts))
        return amount

    def arguments(self, call: ast.Call) -> Mapping[str, ast.Expr]:
        """What a distribution is given, by parameter. Raises SpecError."""
        given = bind(call, PRIOR_SIGNATURES[call.function.id, self.part], self.source)
        if isinstance(given, Diagnostic):
            raise SpecError(given)
        return given


def prior_statement(
    lowering: Lowering, project: Project, source: Source, statement: ast.Usually, also: Mapping[int, int]
) -> PriorStatement:
    """What a `usually` statement says. `also` are objects that take the place of another one, and are drawn as that is.
    Raises SpecError."""
    part = _part(source, statement)
    named = [_things(lowering, source, _thing(expr)) for expr in statement.things]
    reader = _Reader(lowering, project, source, part, tuple(one for some in named for one in some))
    for expr, some in zip(statement.things, named, strict=True):
        held = [one for one in some if one in lowering.coerce.fixed]
        if held:
            raise SpecError(WRONG_PRIOR(expr.span(source), held=_name(lowering, held[0] or 0)))
    of = written = statement.distribution
    span = statement.span(source)
    if isinstance(of, ast.Call) and of.function.id == POSES:
        recorded, written = _read_rows(reader, of)
        found = _with_variants(Prior(reader.present, "pose", (recorded,), (1.0,)), also)
        relative = frozenset[int]()
    else:
        options, weights, middles = _options(reader, of)
        core = lowering.builder.finish({str(number): node for number, node in enumerate(middles)})
        place = [core.labels[str(number)] for number in range(len(middles))]
        numbered = tuple(
            replace(one, middle=tuple(place[number] for number in one.middle)) if isinstance(one, Normal) else one
            for one in options
        )
        found = _with_variants(Prior(reader.present, part, numbered, weights, core.nodes if middles else ()), also)
        relative = frozenset(node.object for node in core.nodes if isinstance(node, Coord))
    kept = tuple(
        expr for expr, some in zip(statement.things, named, strict=True) if any(one is not None for one in some)
    )
    if not kept:
        return PriorStatement(span, None, ())
    return PriorStatement(span, found, (ast.Usually(kept, written),), relative)


def _thing(expr: ast.Expr) -> ast.Expr:
    """What is named: `mug` of `theta(mug)`."""
    return expr.arguments[0].value if isinstance(expr, ast.Call) else expr


def _part(source: Source, statement: ast.Usually) -> Part:
    """Whether a statement is about places or about headings. Raises SpecError."""
    parts: list[Part] = []
    for expr in statement.things:
        if isinstance(expr, ast.Call) and expr.function.id != "theta":
            raise SpecError(WRONG_PRIOR(expr.span(source)))
        parts.append("heading" if isinstance(expr, ast.Call) else "place")
        if parts[-1] != parts[0]:
            raise SpecError(WRONG_PRIOR(expr.span(source), mixed=True))
    return parts[0]


def _things(lowering: Lowering, source: Source, expr: ast.Expr) -> list[int | None]:
    """The objects that an expression names. Of arrays whose number of elements is drawn it is as many as there can be:
    None for those that are not there. Raises SpecError."""
    frame, scope = CallFrame(source), lowering.scope
    name = expr.base if isinstance(expr, ast.Index) else expr
    drawn = scope.counts.get(name.id) if isinstance(name, ast.Name) and name.id in scope.arrays else None
    if drawn is not None and isinstance(name, ast.Name):
        places = scope.arrays[name.id]
        each = [*places, *[None] * (drawn.most - len(places))]
        if not isinstance(expr, ast.Index):
            return each
        which = lowering.count(lowering.evaluate(expr.index, frame), expr.index, frame, "an index")
        if 1 <= which <= drawn.most:
            return [each[which - 1]]
    value = lowering.evaluate(expr, frame)
    found: list[int | None] = []
    for one in value.items if isinstance(value, ListValue) else (value,):
        if not isinstance(one, ObjectValue):
            raise SpecError(WRONG_PRIOR(expr.span(source)))
        found.append(one.index)
    return found


def _name(lowering: Lowering, which: int) -> str:
    """An object as the spec names it: one of a category without the asset that it is."""
    return next(name for name, place in lowering.scope.objects.items() if place == which)


def _with_variants(prior: Prior, also: Mapping[int, int]) -> Prior:
    """The prior, also for those that take the place of its things."""
    extra = [(place, prior.things.index(like)) for place, like in also.items() if like in prior.things]
    if not extra:
        return prior
    columns = [*range(len(prior.things)), *(column for _, column in extra)]
    options = tuple(
        replace(one, rows=tuple(tuple(row[column] for column in columns) for row in one.rows))
        if isinstance(one, Recorded)
        else one
        for one in prior.options
    )
    return replace(prior, things=(*prior.things, *(place for place, _ in extra)), options=options)


_Option = Normal | UniformPlace | UniformHeading


def _options(reader: _Reader, of: ast.Expr) -> tuple[list[_Option], tuple[float, ...], list[int]]:
    """Distributions with their weights, and the middles of the normal ones, which number them. Raises SpecError."""
    lowering, source = reader.lowering, reader.source
    mixed = isinstance(of, ast.Weighted)
    weights = tuple(map(float, weights_of(lowering, of, source))) if isinstance(of, ast.Weighted) else (1.0,)
    options: list[_Option] = []
    middles: list[int] = []
    for one in of.items if isinstance(of, ast.Weighted) else (of,):
        here = one.span(source)
        if isinstance(one, ast.Weighted):
            raise SpecError(NOT_A_DISTRIBUTION(here, nested=True))
        if not isinstance(one, ast.Call) or one.function.id not in DISTRIBUTIONS:
            raise SpecError(_no_distribution(reader, one))
        if one.function.id == POSES:
            facts = {"mixture": True} if mixed else {"headings": True, "thing": _name(lowering, reader.present[0])}
            raise SpecError(NOT_A_DISTRIBUTION(here, **facts))
        if one.function.id == "normal":
            options.append(_normal(reader, one, middles))
        elif reader.part == "place":
            options.append(_uniform_place(reader, one))
        else:
            options.append(_uniform_heading(reader, one))
    return options, weights, middles


def _no_distribution(reader: _Reader, expr: ast.Expr) -> Diagnostic:
    here = expr.span(reader.source)
    if isinstance(expr, ast.Call):
        return NOT_A_DISTRIBUTION(expr.function.span(reader.source), name=expr.function.id, known=DISTRIBUTIONS)
    region = None
    if isinstance(expr, ast.Name | ast.Index):
        value = reader.lowering.evaluate(expr, CallFrame(reader.source))
        region = here.text if isinstance(value, RegionValue) else None
    return NOT_A_DISTRIBUTION(here, region=region)


def _normal(reader: _Reader, call: ast.Call, middles: list[int]) -> Normal:
    """A normal distribution; `middles` gets the numbers that it is around. Raises SpecError."""
    lowering, given = reader.lowering, reader.arguments(call)
    expr = given["middle"]
    value = lowering.evaluate(expr, CallFrame(reader.source))
    here = expr.span(reader.source)
    if reader.part == "place":
        nodes: tuple[int, ...] = lowering.coerce.place(value, "the middle of a normal distribution")
        deviation = reader.width(given["deviation"], "the deviation of a place", LENGTH)
    else:
        what = "the middle of a normal distribution of headings"
        number = lowering.coerce.number(value, what)
        lowering.agree(expr, CallFrame(reader.source), "used as", number.unit, ANGLE)
        lowering.refuse_degrees([number, NumberValue(number.node, ANGLE, origin=number.origin)])
        nodes = (number.node,)
        deviation = reader.width(given["deviation"], "the deviation of a heading", ANGLE)
    core = lowering.builder.finish({str(number): node for number, node in enumerate(nodes)})
    _refuse_circle(reader, core, here)
    reach = _reach(lowering, core)
    for which in reader.present if reader.part == "place" else ():
        left, bottom, right, top = _box(lowering, which)
        x, y = reach
        away = float(max(left - x.hi, x.lo - right, bottom - y.hi, y.lo - top)) / deviation
        if away > MOST_DEVIATIONS:
            relative = any(isinstance(node, Coord) for node in core.nodes) or None
            raise SpecError(_outside(lowering, here, which, deviations=away, relative=relative))
    if not (np.abs(reach) <= MOST_SPREAD).all():  # nor infinite
        far = "1,000 km away" if reader.part == "place" else "a million radians"
        raise SpecError(PRIOR_OUTSIDE(here, far=far))
    numbers = tuple(range(len(middles), len(middles) + len(nodes)))
    middles.extend(nodes)
    return Normal(numbers, deviation)


def _reach(lowering: Lowering, core: Core) -> list[Interval]:
    """Bounds of the numbers that are the labels of a core, each () and in metres or radians, wherever the things may
    be that they depend on."""
    found: list[Interval] = []
    with np.errstate(over="ignore", invalid="ignore"):  # infinite bounds are an answer, not an accident
        for node in core.nodes:
            match node:
                case Coord(which, axis):
                    left, bottom, right, top = _box(lowering, which)
                    low, high = ((left, right), (bottom, top), (0.0, TWO_PI))[axis]
                    found.append(Interval(np.array(low), np.array(high)))
                case Apply(primitive, args, shapes):
                    found.append(PRIMITIVES[primitive].interval(*shapes, *map(found.__getitem__, args)))
                case Const(value):
                    found.append(point(value))
    return [found[index] for index in core.labels.values()]


def _refuse_circle(reader: _Reader, core: Core, here: Span) -> None:
    """Raises SpecError where numbers depend on the things themselves, on which of several surfaces they stand, or on
    how they move."""
    lowering = reader.lowering
    for node in core.nodes:
        if isinstance(node, Coord) and node.object >= len(lowering.shapes):
            which = "switch" if lowering.horizon is None else "step"
            raise SpecError(CIRCULAR_PRIOR(here, **{which: True}))
        if isinstance(node, Coord) and node.object in reader.present:
            raise SpecError(CIRCULAR_PRIOR(here, name=_name(lowering, node.object)))


def _uniform_place(reader: _Reader, call: ast.Call) -> UniformPlace:
    lowering, expr = reader.lowering, reader.arguments(call)["region"]
    value = lowering.evaluate(expr, CallFrame(reader.source))
    if not isinstance(value, RegionValue):
        raise lowering.coerce.wrong(value, "a region", "what `uniform` is over")
    over = UniformPlace(value.name, value.area.footprint, (*value.area.center, 0.0))
    for which in reader.present:
        left, bottom, right, top = _box(lowering, which)
        middle = ((left + right) / 2.0, (bottom + top) / 2.0, 0.0)
        box = Box(right - left, top - bottom)
        if PRIMITIVES["gap"].evaluate(MATH, over.footprint, box, *over.pose, *middle) >= 0.0:
            raise SpecError(_outside(lowering, expr.span(reader.source), which, region=over.region))
    return over


def _uniform_heading(reader: _Reader, call: ast.Call) -> UniformHeading:
    lowering, given, frame = reader.lowering, reader.arguments(call), CallFrame(reader.source)
    ends = []
    for name in ("low", "high"):
        value = lowering.coerce.number(lowering.evaluate(given[name], frame), "a heading")
        ends.append(lowering.constant(value, given[name], frame, "a heading", BARE, ANGLE))
        lowering.refuse_degrees([value, NumberValue(value.node, ANGLE, origin=value.origin)])
    low, high = ends
    if not LEAST_SPREAD <= high - low <= TWO_PI + LEAST_SPREAD:
        degrees = [math.degrees(one) for one in ends]
        mended = None
        if high < low < high + TWO_PI - LEAST_SPREAD:
            mended = f"{degrees[0]:g} deg, {degrees[1] + 360.0:g} deg"
        here, wide = call.span(reader.source), high > low + TWO_PI or None
        raise SpecError(WRONG_SPREAD(here, low=degrees[0], high=degrees[1], wide=wide, mended=mended))
    return UniformHeading(low, min(high, low + TWO_PI))


def _box(lowering: Lowering, which: int) -> tuple[float, float, float, float]:
    """Where the centre of an object can be: left, bottom, right, top."""
    (left, right), (bottom, top) = lowering.space.x, lowering.space.y
    for one, x, y in lowering.space.own:
        if one == which:
            (left, right), (bottom, top) = x, y
    return left, bottom, right, top


def _outside(lowering: Lowering, here: Span, which: int, **facts: object) -> Diagnostic:
    left, bottom, right, top = _box(lowering, which)
    box = {"left": left, "bottom": bottom, "right": right, "top": top}
    return PRIOR_OUTSIDE(here, thing=_name(lowering, which), **box, **facts)


Rows = tuple[tuple[Pose, ...], ...]


def _read_rows(reader: _Reader, call: ast.Call) -> tuple[Recorded, ast.Call]:
    """Recorded poses, and the call with its rows written out. Raises SpecError."""
    if reader.part == "heading":
        thing = _name(reader.lowering, reader.present[0]) if reader.present else ""
        raise SpecError(NOT_A_DISTRIBUTION(call.span(reader.source), headings=True, thing=thing))
    given = reader.arguments(call)
    reach = reader.width(given["reach"], "how far recorded places are moved", LENGTH)
    turn = reader.width(given["turn"], "how far recorded headings are turned", ANGLE)
    if turn > math.pi + LEAST_SPREAD:
        raise SpecError(WRONG_SPREAD(given["turn"].span(reader.source), turn=True))
    said = given["file"]
    here = said.span(reader.source)
    rows = _from_file(reader, said, here) if isinstance(said, ast.Text) else _from_list(reader, said)
    if len(rows) > MAX_ROWS:
        raise SpecError(WRONG_POSES(here, rows=len(rows), most=MAX_ROWS))
    _refuse_outside(reader, rows, reach, said)
    if isinstance(said, ast.Text) or None in reader.things:
        each = [[ast.Point(tuple(map(written_number, pose))) for pose in row] for row in rows]
        written = ast.List(tuple(ast.List(tuple(row)) if len(row) > 1 else row[0] for row in each))
        return Recorded(rows, reach, min(turn, math.pi)), written_call(POSES, written, given["reach"], given["turn"])
    return Recorded(rows, reach, min(turn, math.pi)), call


def _from_file(reader: _Reader, said: ast.Text, here: Span) -> Rows:
    """The rows of a .csv file with the poses of all things. Raises SpecError."""
    path = said.value
    if not path.lower().endswith(TABLE_ENDING):
        raise SpecError(WRONG_POSES(here, file=path, reason=f"its ending is not {TABLE_ENDING}"))
    data = reader.project.read(path, here, "a table of poses")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise SpecError(WRONG_POSES(here, file=path, reason="it is not a text in UTF-8")) from None
    try:
        names, cells, count = csv_cells(path, text, WRONG_POSES)
        table = Table(path, WRONG_POSES, names, cells, 0, count)
        if not count:
            raise DataError(WRONG_POSES(file=path, reason="it has no rows"))
        things = [_name(reader.lowering, which) for which in reader.present]
        columns = [[table.column(f"{name}.{axis}") for axis in NAMES] for name in things]
    except DataError as error:
        raise SpecError(*(replace(one, span=here) for one in error.diagnostics)) from None
    for name, (*_, turned) in zip(things, columns, strict=True):
        beyond = np.flatnonzero(np.abs(turned) > TWO_PI)
        if len(beyond):
            row, remedy = int(beyond[0]) + 1, "headings are in radians: numpy.radians(90) is 1.5708"
            facts = {"row": row, "value": float(turned[row - 1]), "doubt": "more than a turn", "remedy": remedy}
            reader.lowering.noticed.append(DOUBTFUL_POSE(here, file=path, name=f"{name}.theta", **facts))
            break
    numbers = np.array(columns).transpose(2, 0, 1)
    numbers[..., -1] = wrap_heading(np, numbers[..., -1])
    return tuple(tuple((x, y, theta) for x, y, theta in row) for row in numbers.tolist())


def _from_list(reader: _Reader, said: ast.Expr) -> Rows:
    """The rows that stand in the text itself. Raises SpecError."""
    lowering, source, wanted = reader.lowering, reader.source, len(reader.things)
    if not isinstance(said, ast.List):
        raise SpecError(WRONG_POSES(said.span(source)))
    if len(said.items) > MAX_ROWS:
        raise SpecError(WRONG_POSES(said.span(source), rows=len(said.items), most=MAX_ROWS))
    rows: list[tuple[Pose, ...]] = []
    for one in said.items:
        row = one.items if isinstance(one, ast.List) else (one,)
        if len(row) != wanted:
            names = [_name(lowering, which) for which in reader.present]
            raise SpecError(WRONG_POSES(one.span(source), given=len(row), wanted=wanted, things=names))
        for pose in row:
            if not isinstance(pose, ast.Point) or len(pose.coordinates) != len(NAMES):
                raise SpecError(WRONG_POSES(pose.span(source), listed=True, expected="three coordinates"))
        kept = (pose for pose, which in zip(row, reader.things, strict=True) if which is not None)
        rows.append(tuple(written_pose(lowering, pose, source) for pose in kept))
    if not rows:
        raise SpecError(WRONG_POSES(said.span(source), listed=True, expected="a row or more"))
    return tuple(rows)


def _refuse_outside(reader: _Reader, rows: Rows, reach: float, said: ast.Expr) -> None:
    """Raises SpecError where no row has all things where they can be; notes the first one that has not."""
    here = said.span(reader.source)
    if not reader.present:
        return
    places = np.array(rows)[..., :2]
    boxes = np.array([_box(reader.lowering, which) for which in reader.present])
    away = np.maximum(boxes[:, :2] - places, places - boxes[:, 2:]) - reach
    outside = np.argwhere(away >= 0.0)
    if len(np.unique(outside[:, 0])) == len(rows):
        raise SpecError(_outside(reader.lowering, here, reader.present[0], rows=len(rows)))
    if len(outside):
        row, thing, axis = outside[0].tolist()
        low, high = boxes[thing, axis], boxes[thing, axis + 2]
        name = f"{_name(reader.lowering, reader.present[thing])}.{NAMES[axis]}"
        doubt = f"outside of where it can be, which ends at {low:g} and {high:g}: this row is never drawn"
        remedy = "places are in metres, in the frame of the spec's workspace"
        facts = {"row": row + 1, "value": float(places[row, thing, axis]), "doubt": doubt, "remedy": remedy}
        reader.lowering.noticed.append(
            DOUBTFUL_POSE(here, file=said.value if isinstance(said, ast.Text) else "poses", name=name, **facts)
        )


def said_twice(lowering: Lowering, one: PriorStatement, known: dict[tuple[int, str], Span]) -> Iterator[Diagnostic]:
    """A diagnostic where a statement is about a place or heading that `known` has already; else it gets there."""
    if one.prior is None:
        return
    parts = ("place", "heading") if one.prior.part == "pose" else (one.prior.part,)
    for which, part in [(which, part) for which in one.prior.things for part in parts]:
        if (which, part) in known:
            what = {"twice" if part == "place" else "turned": _name(lowering, which)}
            yield WRONG_PRIOR(one.span, first=known[which, part].place, **what)
            return
        known[which, part] = one.span


def circles(lowering: Lowering, statements: Sequence[PriorStatement]) -> Iterator[Diagnostic]:
    """A diagnostic where things are relative to each other in a circle, which it names: the first such."""
    relative: dict[int, set[int]] = {}
    spans: dict[int, Span] = {}
    for one in statements:
        for which in one.prior.things if one.prior is not None and one.relative else ():
            relative.setdefault(which, set()).update(one.relative)
            spans.setdefault(which, one.span)
    done = set[int]()
    for start in relative:
        path, stack = [start], [iter(sorted(relative[start]))]
        while stack:
            following = next(stack[-1], None)
            if following is None:
                done.add(path.pop())
                stack.pop()
            elif following in path:
                names = [_name(lowering, which) for which in (*path[path.index(following) :], following)]
                yield CIRCULAR_PRIOR(spans[path[-1]], way=" -> ".join(names), name=names[0])
                return
            elif following in relative and following not in done:
                path.append(following)
                stack.append(iter(sorted(relative[following])))


def prior_text(prior: Prior, names: Sequence[str], objects: Sequence[str]) -> str:
    """A prior as a spec says it, with recorded poses counted; `names` are what its things are called, `objects` those
    of the spec."""
    each = [f"theta({name})" for name in names] if prior.part == "heading" else names
    options = [_option_text(prior, one, objects) for one in prior.options]
    mixture = ", ".join(f"{one}: {weight:g}" for one, weight in zip(options, prior.weights, strict=True))
    return f"{', '.join(each)} ~ {options[0] if len(options) == 1 else f'[{mixture}]'}"


def _option_text(prior: Prior, one: Distribution, objects: Sequence[str]) -> str:
    match one:
        case UniformPlace(region=region):
            return f"uniform({region})"
        case UniformHeading(low, high):
            return f"uniform({math.degrees(low):g} deg, {math.degrees(high):g} deg)"
        case Recorded(rows, reach, turn):
            return f"poses({len(rows):,} row{'s' * (len(rows) > 1)}, {100.0 * reach:g} cm, {math.degrees(turn):g} deg)"
        case Normal(middle, deviation):
            numbers = [describe(prior.nodes, objects, node) for node in middle]
            if prior.part == "place":
                return f"normal(({', '.join(numbers)}), {100.0 * deviation:g} cm)"
            (known,) = (prior.nodes[node] for node in middle)
            written = f"{math.degrees(known.value):g} deg" if isinstance(known, Const) else numbers[0]
            return f"normal({written}, {math.degrees(deviation):g} deg)"
