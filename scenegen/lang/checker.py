"""Source text -> CheckedSpec: the front door of the language."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from scenegen.errors import Diagnostic, Source, Span, SpecError
from scenegen.errors.declarations import CONSTANT_LABEL, CONSTANT_REQUIREMENT, NO_FREE_OBJECT, SPEC_TOO_LARGE
from scenegen.errors.language import CONSTANT_FROM_SCENE, WRONG_OVERRIDE
from scenegen.errors.time import CHOICE_OVER_TIME, LOOKS_BEYOND, MOVES_WITHOUT_TIME
from scenegen.geometry.footprint import Box, Circle, Footprint
from scenegen.geometry.units import ANGLE, BARE, LENGTH
from scenegen.geometry.workspace import Workspace
from scenegen.lang.check.context import CallFrame, ErrorCollector, refusal, run
from scenegen.lang.check.declare import categories, name_objects, pose, shape
from scenegen.lang.check.families import (
    WORD,
    Category,
    Variants,
    always_the_same,
    family,
    is_category,
    picked,
    refuse_surfaces,
)
from scenegen.lang.check.formulas import lower_labels, lower_requirement
from scenegen.lang.check.imports import Project, SourcedStatement, inline
from scenegen.lang.check.lower import Lowering
from scenegen.lang.check.names import FILES, resolve
from scenegen.lang.check.regions import areas, level_clash, workspace
from scenegen.lang.check.scope import Declared, Scope, collect, prelude, whole
from scenegen.lang.check.supports import choices, empty, heights, spread, standing_on, supports
from scenegen.lang.check.temporal import horizon, movers
from scenegen.lang.check.values import AnyValue, NumberValue, Value
from scenegen.lang.check.warnings import unused
from scenegen.lang.formula.builder import TRUE, CoreBuilder, FormulaTooLarge
from scenegen.lang.formula.core import Coord, Core, children
from scenegen.lang.formula.headings import headings_compared
from scenegen.lang.formula.timed import MOST_VALUES, Horizon, Movers, Timed, endless, split
from scenegen.lang.spec import CheckedSpec, Pose, Region, Support
from scenegen.lang.syntax import ast
from scenegen.lang.syntax import ast as traversal
from scenegen.lang.syntax.parse import parse, plain_breaks, read_source
from scenegen.lang.syntax.pieces import print_expr, print_module
from scenegen.things import Shape

# --------------------------------------------------------------------------------------------------------------------
# Constants: each has a value that no scene decides; those of the prelude only values that its relations can use.


def check_constants(scope: Scope, lowering: Lowering, stage: ErrorCollector) -> None:
    """Constants that no formula uses are checked all the same."""
    for declared in scope.constants.values():
        if declared.source is not scope.prelude and not stage.full:
            (expr,) = traversal.expressions(declared.statement)
            with stage:
                value = run(lowering.lower(expr, {}, CallFrame(declared.source)))
                if isinstance(value, NumberValue) and lowering.builder.value(value.node) is None:
                    here, formula = expr.span(declared.source), print_expr(expr)
                    raise SpecError(CONSTANT_FROM_SCENE(here, name=declared.name.id, formula=formula))
                stage.problems.extend(_bad_override(declared, value, lowering))


def _bad_override(declared: Declared, value: Value, lowering: Lowering) -> list[Diagnostic]:
    """A constant of the prelude may be given another value, but not one that turns its relations upside down."""
    name = declared.name.id
    standard = next(
        (one for one in prelude().statements if isinstance(one, ast.Constant) and one.name.id == name), None
    )
    if standard is None or name in ("NORTH", "EAST", "SOUTH", "WEST"):
        return []
    wanted = BARE if name == "ANGLE_SCALE" else ANGLE if "ANGLE" in name else LENGTH
    (expr,) = traversal.expressions(declared.statement)
    here, usual = expr.span(declared.source), print_expr(standard.value)
    if not isinstance(value, NumberValue) or value.unit not in (BARE, wanted):
        what = value.unit.words if isinstance(value, NumberValue) else value.kind
        return [WRONG_OVERRIDE(here, name=name, wanted=wanted.words, found=what, usual=usual)]
    amount = lowering.builder.value(value.node)
    if amount is not None and (amount < 0.0 or (amount == 0.0 and name == "ANGLE_SCALE")):
        return [WRONG_OVERRIDE(here, name=name, wanted="positive", usual=usual)]
    return []


# --------------------------------------------------------------------------------------------------------------------
# The canonical text of a spec, which scene and model files carry: all it needs, in one piece.
#
# Imports are replaced by what they import, and the outline of a URDF or mesh file stands beside its path: the text
# means the same wherever it is read again.


def canonical(
    placed: Sequence[SourcedStatement],
    bare: ast.Expr | None,
    scope: Scope,
    shapes: Sequence[Shape],
    counts: Mapping[str, int],
    kinds: Mapping[str, Category],
) -> str:
    """The canonical text; `shapes` has one entry per object, `counts` the numbers of things that are drawn no more,
    `kinds` the categories of objects."""
    statements = tuple(
        _resolved(one.statement, scope, shapes, counts, kinds)
        if isinstance(one.statement, ast.Objects)
        else one.statement
        for one in placed
    )
    return print_module(ast.Module(Source("", ""), statements, bare))


def _resolved(
    statement: ast.Objects,
    scope: Scope,
    shapes: Sequence[Shape],
    counts: Mapping[str, int],
    kinds: Mapping[str, Category],
) -> ast.Objects:
    """The statement with every file's outline written out, and every number that is drawn no more."""
    declarations = []
    for one in statement.declarations:
        if isinstance(one.count, ast.Range) and one.name.id in counts:
            count = ast.Quantity(str(counts[one.name.id]), "")
            one = ast.Declaration(one.name, count, one.shape, one.pose, one.support, one.choice)
        call = one.shape
        if isinstance(call, ast.Call) and call.function.id in FILES:
            place = scope.arrays.get(one.name.id, (scope.objects.get(one.name.id, 0),))[0]
            looks = shapes[place]
            arguments = (ast.Argument(None, ast.Text(looks.path)), ast.Argument(None, _outline(looks)))
            one = ast.Declaration(
                one.name, one.count, ast.Call(call.function, arguments), one.pose, one.support, one.choice
            )
        if one.name.id in kinds:
            shape = _category(
                kinds[one.name.id], picked(one.name.id, kinds[one.name.id], one.count is not None, counts)
            )
            one = ast.Declaration(one.name, one.count, shape, one.pose, one.support, one.choice)
        declarations.append(one)
    return ast.Objects(tuple(declarations))


def _category(kind: Category, picks: Sequence[int]) -> ast.Call:
    """The category with its assets and their outlines; with what is drawn no more."""
    function, asset = ast.Name(WORD), ast.Name("asset")
    each = [
        ast.Call(asset, (ast.Argument(None, ast.Text(one.path)), ast.Argument(None, _outline(one))))
        for one in kind.assets
    ]
    arguments = [ast.Argument(None, ast.Text(kind.path)), ast.Argument(None, ast.List(tuple(each)))]
    if any(picks):
        arguments.append(ast.Argument(None, ast.List(tuple(ast.Quantity(str(pick), "") for pick in picks))))
    return ast.Call(function, tuple(arguments))


def _outline(looks: Shape) -> ast.Call:
    kind, numbers = _measures(looks.footprint)
    parts = [*numbers, _number(looks.height)]
    return ast.Call(ast.Name(kind), tuple(ast.Argument(None, part) for part in parts))


def _measures(footprint: Footprint) -> tuple[str, list[ast.Expr]]:
    match footprint:
        case Circle(radius):
            return "cylinder", [_number(radius)]
        case Box(length, width):
            return "box", [_number(length), _number(width)]
        case _:
            corners = tuple(ast.Point((_number(x), _number(y))) for x, y in footprint.vertices)
            return "prism", [ast.List(corners)]


def _number(value: float) -> ast.Expr:
    written = ast.Quantity(repr(abs(value)), "")
    return ast.Negative(written) if value < 0.0 else written


Look = Callable[[Lowering], None]


def check_text(text: str, name: str = "<spec>", counts: Mapping[str, int] | None = None) -> CheckedSpec:
    """Parse and check a spec's text. Raises SpecError with every mistake found; `name` is what they call the file;
    `counts` says how many there are of things whose number the spec draws."""
    return check_module(parse(Source(name, plain_breaks(text))), counts=counts)


def check_file(path: Path, data: bytes, root: Path | None = None) -> CheckedSpec:
    """Check the bytes of a spec file. What it imports is read from its own folder, or from `root`. Raises SpecError."""
    return check(read_source(str(path), data), Project(path, root))


def check(source: Source, project: Project | None = None) -> CheckedSpec:
    """Parse and check a source. Raises SpecError with every mistake found; without a project nothing is imported."""
    return check_module(parse(source), project)


def check_module(
    module: ast.Module,
    project: Project | None = None,
    look: Look | None = None,
    counts: Mapping[str, int] | None = None,
) -> CheckedSpec:
    """Check what was parsed already. Raises SpecError as `check` does. `look` gets the machine at work
    once all that the spec declares is known; it may expand formulas of its own. `counts` are numbers of things that the
    spec draws; with those that it does not say the spec is a family, see `lang.counts`."""
    given = counts or {}
    spec = _check_one(module, project, look, given)
    if not spec.counts:
        return spec
    return family(module, spec, lambda numbers: _check_one(module, project, None, {**given, **numbers}))


def _check_one(
    module: ast.Module, project: Project | None, look: Look | None, counts: Mapping[str, int]
) -> CheckedSpec:
    source = module.source
    project = project or Project()
    placed, problems = inline(module, project)
    if problems:
        raise refusal(problems, source)
    scope, problems = collect(source, placed, module.bare)
    problems += resolve(placed, module.bare, scope)
    if problems:
        raise refusal(problems, source)
    try:
        return _expand(source, placed, module.bare, scope, project, look, counts)
    except FormulaTooLarge as error:
        raise SpecError(SPEC_TOO_LARGE(file=source.name, reason=str(error))) from None


def _expand(
    source: Source,
    placed: Sequence[SourcedStatement],
    bare: ast.Expr | None,
    scope: Scope,
    project: Project,
    look: Look | None,
    counts: Mapping[str, int],
) -> CheckedSpec:
    builder = CoreBuilder(())
    texts = {one.source.name: len(one.source.text) for one in placed}
    lowering = Lowering(scope, builder, len(source.text) + sum(texts.values()))
    stage = ErrorCollector(source)
    space = Workspace()
    for one in placed:
        if isinstance(one.statement, ast.Workspace):
            with stage:
                space = workspace(lowering, one.source, one.statement)
    lowering.areas["workspace"] = whole(space)
    with stage:
        scope.objects, scope.arrays = name_objects(lowering, list(scope.things.values()), counts)
    kinds, other = dict[str, Category](), Variants()
    if not stage.problems:
        with stage:
            kinds, other = categories(lowering, project, counts)
        builder.objects = other.called(scope.objects)
    shapes, fixed = list[Shape](), dict[int, Pose]()
    for thing in scope.things.values():
        if stage.full:
            break
        places = scope.arrays.get(thing.name.id) or (scope.objects.get(thing.name.id, 0),)
        with stage:
            if thing.name.id in kinds:
                shapes.extend(other.shapes[place] for place in places)
            elif thing.declaration is None or not is_category(thing.declaration.shape):
                looks = shape(lowering, thing, thing.name.id, project)
                shapes.extend([looks] * len(places))
        with stage:
            fixed.update(zip(places, pose(lowering, thing, space), strict=False))
    shapes.extend(looks for _, _, looks in other.more)
    also = other.behind(len(scope.objects))
    fixed.update({place: fixed[like] for place, like in also.items() if like in fixed})
    lasts, moves = _time(placed, lowering, stage)
    stage.close()
    if lasts is not None:
        builder.moving = len(builder.objects)
        builder.objects += tuple(f"{name} before" for name in builder.objects)
    lowering.coerce.footprints = tuple(looks.footprint for looks in shapes)
    lowering.coerce.fixed = fixed
    for declared in scope.regions.values():
        if stage.full:
            break
        with stage:
            if declared.name.id not in lowering.areas and declared.name.id not in lowering.levels:
                run(areas(lowering, declared))
    stage.problems.extend(level_clash(lowering, list(scope.regions.values())))
    standing: list[int] = []
    if not stage.problems:
        with stage:
            space, standing = _supports(scope, lowering, shapes, fixed, space, stage, also)
    check_constants(scope, lowering, stage)
    if not stage.problems:
        _refuse_nothing_free(scope, fixed, stage)
        labels = lower_labels(placed, bare, lowering, stage)
        requirement = lower_requirement(placed, lowering, stage, standing)
        if look is not None and not stage.problems:
            look(lowering)
    used = set(lowering.used)
    _uncalled_definitions(scope, lowering, stage)
    stage.close()
    core = builder.finish(labels, None if requirement == TRUE else requirement)
    _refuse_constants(core, placed, bare, scope, stage)
    stage.close()
    timed = None
    if lasts is not None:
        timed = split(core, lasts, moves, builder.moving)
        if len(timed.nodes) * lasts.moments > MOST_VALUES:
            raise FormulaTooLarge(f"has too many formulas over time for {lasts.steps:,} steps")
        _refuse_endless(timed, placed, bare, stage)
        stage.close()
    regions = tuple(
        Region(name, place.footprint, (*place.center, 0.0), place.z)
        for name, place in lowering.areas.items()
        if name != "workspace"
    )
    alone = {one.name: one.least for one in scope.counts.values() if one.least == one.most}
    drawn = tuple(one for one in scope.counts.values() if one.name not in counts and one.name not in alone)
    text = canonical(placed, bare, scope, shapes, {**alone, **counts}, kinds)
    warnings = [*unused(placed, bare, scope, space, used, lowering.used), *headings_compared(core), *lowering.noticed]
    raised = bool(lowering.supports or lowering.choices)
    return CheckedSpec(
        source.name,
        text,
        space,
        core,
        _title(source),
        tuple(shapes),
        fixed,
        regions,
        dict(lowering.supports),
        tuple(lowering.heights or ()) if raised else (),
        dict(lowering.choices),
        (*warnings, *always_the_same(scope, alone)),
        timed,
        drawn,
    )


def _time(
    placed: Sequence[SourcedStatement], lowering: Lowering, stage: ErrorCollector
) -> tuple[Horizon | None, Movers]:
    """How long a motion lasts and what moves in a step; None for a spec of single scenes."""
    moves: Movers = "one"
    for one in placed:
        with stage:
            if isinstance(one.statement, ast.Time):
                lowering.horizon = run(horizon(lowering, one.source, one.statement))
            elif isinstance(one.statement, ast.Moves):
                moves = movers(one.source, one.statement)
                if not lowering.scope.timed:
                    raise SpecError(MOVES_WITHOUT_TIME(one.statement.span(one.source)))
    return lowering.horizon, moves


def _refuse_endless(
    timed: Timed, placed: Sequence[SourcedStatement], bare: ast.Expr | None, stage: ErrorCollector
) -> None:
    """A formula that looks beyond the last moment in every motion has no finite phi."""
    found = endless(timed)
    most = timed.horizon.steps - 1
    for one in placed:
        if isinstance(one.statement, ast.Label):
            name = one.statement.name.id
            value = found[timed.labels[name]][0]
            if math.isinf(value):
                here = one.statement.formula.span(one.source)
                sign = "minus " if value < 0.0 else ""
                stage.problems.append(LOOKS_BEYOND(here, name=f"`{name}`", sign=sign, most=most))
    if timed.requirement is not None and (found[timed.requirement] == -math.inf).any():
        first = next(one for one in placed if isinstance(one.statement, ast.Require))
        here = first.statement.span(first.source)
        stage.problems.append(LOOKS_BEYOND(here, name="what is required", sign="minus ", most=most))


def _supports(
    scope: Scope,
    lowering: Lowering,
    shapes: Sequence[Shape],
    fixed: dict[int, Pose],
    space: Workspace,
    stage: ErrorCollector,
    also: Mapping[int, int],
) -> tuple[Workspace, list[int]]:
    """Evaluates what objects stand on: the workspace with their boxes, and what it requires. Raises SpecError for what
    the declarations say together."""
    lowering.shapes, lowering.space = tuple(shapes), space
    found: dict[int, tuple[Support, ...]] = {}
    spans: dict[int, Span] = {}
    for thing in scope.things.values():
        places = scope.arrays.get(thing.name.id) or (scope.objects[thing.name.id],)
        one = thing.declaration
        if one is not None and one.support is not None:
            spans.update((place, one.support.span(thing.source)) for place in places)
            with stage:
                found.update(supports(lowering, thing, places))
                refuse_surfaces(thing, [found[place] for place in places], spans[places[0]])
    found.update({place: found[like] for place, like in also.items() if like in found})
    spans.update({place: spans[like] for place, like in also.items() if like in spans})
    if stage.problems:
        lowering.heights = (0.0,) * len(shapes)  # what formulas have to say is still looked at
        return space, []
    names = lowering.builder.objects
    lowering.heights = heights(len(shapes), found, names, spans)
    if not found:
        return space, []
    if lowering.horizon is not None:
        for thing in scope.things.values():
            one = thing.declaration
            if one is not None and one.choice:
                raise SpecError(CHOICE_OVER_TIME(one.name.span(thing.source)))
    chosen = lowering.choices = choices(lowering, found, list(scope.things.values()))
    lowering.supports = {which: options[0] for which, options in found.items() if which not in chosen}
    lowering.builder.objects = (*names, *(f"{names[which]}.on" for which in chosen))
    space = spread(space, found, fixed, [one.switch for one in chosen.values()])
    problems = empty(space, spans, names)
    if problems:
        raise SpecError(*problems)
    return space, standing_on(lowering, lowering.supports, spans)


def _refuse_constants(
    core: Core, placed: Sequence[SourcedStatement], bare: ast.Expr | None, scope: Scope, stage: ErrorCollector
) -> None:
    """A label that no coordinate takes part in cannot be asked for, nor learned; nor is it any use to require it."""
    depends: list[bool] = []
    for node in core.nodes:
        depends.append(isinstance(node, Coord) or any(map(depends.__getitem__, children(node))))
    held = [name for name, thing in scope.things.items() if thing.declaration and thing.declaration.pose is not None]
    formulas = {one.statement.name.id: one for one in placed if isinstance(one.statement, ast.Label)}
    for name, index in core.labels.items():
        if depends[index]:
            continue
        if bare is not None:
            stage.problems.append(CONSTANT_LABEL(bare.span(stage.source), name=name, held=held))
        else:
            statement = formulas[name].statement
            assert isinstance(statement, ast.Label)
            here = statement.formula.span(formulas[name].source)
            stage.problems.append(CONSTANT_LABEL(here, name=name, held=held))
    if core.requirement is not None and not depends[core.requirement]:
        first = next(one for one in placed if isinstance(one.statement, ast.Require))
        stage.problems.append(CONSTANT_REQUIREMENT(first.statement.span(first.source), held=held))


def _refuse_nothing_free(scope: Scope, fixed: dict[int, Pose], stage: ErrorCollector) -> None:
    if fixed and sum(place < len(scope.objects) for place in fixed) == len(scope.objects):
        last = list(scope.things.values())[-1]
        stage.problems.append(NO_FREE_OBJECT(last.name.span(last.source)))


def _uncalled_definitions(scope: Scope, lowering: Lowering, stage: ErrorCollector) -> None:
    """Bodies of definitions that nobody calls are checked with parameters that may be anything."""
    for name, declared in scope.definitions.items():
        definition = declared.statement
        if name in lowering.used or declared.source is scope.prelude or not isinstance(definition, ast.Definition):
            continue
        if stage.full:
            break
        env = {one.name.id: AnyValue(origin=one.name.span(declared.source)) for one in definition.parameters}
        with stage:
            run(lowering.lower(definition.body, env, CallFrame(declared.source)))


def _title(source: Source) -> str:
    """The opening comment's first line: shipped specs say there what they describe."""
    first = source.text.lstrip().splitlines()[0].strip()
    return first.lstrip("# ").strip() if first.startswith("#") else ""
