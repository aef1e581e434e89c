"""Source text -> CheckedSpec: the front door of the language."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from scenegen.assets import Shape
from scenegen.errors import Source, Span, SpecError
from scenegen.errors.declarations import (
    CONSTANT_LABEL,
    CONSTANT_REQUIREMENT,
    NO_FREE_OBJECT,
    SPEC_TOO_LARGE,
)
from scenegen.errors.temporal import CHOICE_OVER_TIME, LOOKS_BEYOND, MOVES_WITHOUT_TIME
from scenegen.lang import ast
from scenegen.lang.builder import TRUE, CoreBuilder, TooLarge
from scenegen.lang.canonical import canonical
from scenegen.lang.category import Category, Variants, is_category, refuse_surfaces
from scenegen.lang.constants import check_constants
from scenegen.lang.core import Coord, Core, children
from scenegen.lang.counts import always_the_same, family
from scenegen.lang.declare import categories, name_objects, pose, shape
from scenegen.lang.formulas import lower_labels, lower_requirement
from scenegen.lang.headings import headings_compared
from scenegen.lang.horizon import Horizon, Movers
from scenegen.lang.imports import Placed, Project, inline
from scenegen.lang.lower import Lowering
from scenegen.lang.parse import parse, plain_breaks, read_source
from scenegen.lang.places import whole
from scenegen.lang.provenance import Frame
from scenegen.lang.regions import areas, level_clash, workspace
from scenegen.lang.resolve import resolve
from scenegen.lang.scope import Scope, collect
from scenegen.lang.spec import CheckedSpec, Pose, Region, Support
from scenegen.lang.stage import Stage, refusal
from scenegen.lang.supports import choices, empty, heights, spread, standing_on, supports
from scenegen.lang.temporal import horizon, movers
from scenegen.lang.timed import MOST_VALUES, Timed, endless, split
from scenegen.lang.trampoline import run
from scenegen.lang.unused import unused
from scenegen.lang.values import AnyValue
from scenegen.scene.workspace import Workspace

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
    except TooLarge as error:
        raise SpecError(SPEC_TOO_LARGE(file=source.name, reason=str(error))) from None


def _expand(
    source: Source,
    placed: Sequence[Placed],
    bare: ast.Expr | None,
    scope: Scope,
    project: Project,
    look: Look | None,
    counts: Mapping[str, int],
) -> CheckedSpec:
    builder = CoreBuilder(())
    texts = {one.source.name: len(one.source.text) for one in placed}
    lowering = Lowering(scope, builder, len(source.text) + sum(texts.values()))
    stage = Stage(source)
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
            raise TooLarge(f"has too many formulas over time for {lasts.steps:,} steps")
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


def _time(placed: Sequence[Placed], lowering: Lowering, stage: Stage) -> tuple[Horizon | None, Movers]:
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


def _refuse_endless(timed: Timed, placed: Sequence[Placed], bare: ast.Expr | None, stage: Stage) -> None:
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
    stage: Stage,
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


def _refuse_constants(core: Core, placed: Sequence[Placed], bare: ast.Expr | None, scope: Scope, stage: Stage) -> None:
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


def _refuse_nothing_free(scope: Scope, fixed: dict[int, Pose], stage: Stage) -> None:
    if fixed and sum(place < len(scope.objects) for place in fixed) == len(scope.objects):
        last = list(scope.things.values())[-1]
        stage.problems.append(NO_FREE_OBJECT(last.name.span(last.source)))


def _uncalled_definitions(scope: Scope, lowering: Lowering, stage: Stage) -> None:
    """Bodies of definitions that nobody calls are checked with parameters that may be anything."""
    for name, declared in scope.definitions.items():
        definition = declared.statement
        if name in lowering.used or declared.source is scope.prelude or not isinstance(definition, ast.Definition):
            continue
        if stage.full:
            break
        env = {one.name.id: AnyValue(origin=one.name.span(declared.source)) for one in definition.parameters}
        with stage:
            run(lowering.lower(definition.body, env, Frame(declared.source)))


def _title(source: Source) -> str:
    """The opening comment's first line: shipped specs say there what they describe."""
    first = source.text.lstrip().splitlines()[0].strip()
    return first.lstrip("# ").strip() if first.startswith("#") else ""
