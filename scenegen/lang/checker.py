"""Source text -> CheckedSpec: the front door of the language, and the passes behind it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

from scenegen.errors import Diagnostic, Source, Span, SpecError
from scenegen.errors.declarations import CONSTANT_LABEL, IMPOSSIBLE_REQUIREMENT, NO_FREE_OBJECT, SPEC_TOO_LARGE
from scenegen.errors.language import (
    LOOKS_BEYOND,
    NO_FORMULA,
    NO_PLACE_OVER_TIME,
    NOT_CONSTANT,
    TIME_MISSING,
    WRONG_OVERRIDE,
)
from scenegen.geometry.primitives import ANGLE, BARE, LENGTH
from scenegen.lang.check.draft import Draft, LoweringHook
from scenegen.lang.check.expressions import FormulaLowering
from scenegen.lang.check.families import always_the_same, family, is_category, refuse_surfaces
from scenegen.lang.check.functions import find_remedy, horizon, movers
from scenegen.lang.check.imports import Project, SourcedStatement, inline
from scenegen.lang.check.lowering import Lowering
from scenegen.lang.check.names import find_unused, resolve
from scenegen.lang.check.objects import canonical, categories, name_objects, pose, shape, unlikely
from scenegen.lang.check.priors import circles, prior_statement, said_twice
from scenegen.lang.check.regions import areas, level_clash, workspace
from scenegen.lang.check.scope import LABEL, Declared, collect, prelude
from scenegen.lang.check.sight import blind_cameras, camera, camera_clash
from scenegen.lang.check.supports import (
    choices,
    clashing,
    empty_supports,
    heights,
    standing_on,
    support_boxes,
    supports,
    without_supports,
)
from scenegen.lang.check.values import AnyValue, CallFrame, NumberValue, Value, whole
from scenegen.lang.formula.builder import FALSE, TRUE, CoreBuilder, FormulaTooLarge
from scenegen.lang.formula.core import Coord, Junction, Node, Temporal, children
from scenegen.lang.formula.interpret import headings_compared, phi
from scenegen.lang.formula.timed import MAX_TIMED_VALUES, endless, split
from scenegen.lang.spec import CheckedSpec, Region, Support, numbers_text
from scenegen.lang.syntax import ast
from scenegen.lang.syntax.parse import parse, plain_breaks, read_source
from scenegen.lang.syntax.printer import print_expr


def check_text(text: str, name: str = "<spec>", counts: Mapping[str, int] | None = None) -> CheckedSpec:
    """Parse and check a spec's text. Raises SpecError with every mistake found; `name` is what they call the file;
    `counts` says how many there are of things whose number the spec draws."""
    return check_module(parse(Source(name, plain_breaks(text))), counts=counts)


def check_file(path: Path, data: bytes, root: Path | None = None) -> CheckedSpec:
    """Check the bytes of a spec file. What it imports is read from its own folder, or from `root`. Raises SpecError."""
    return check_module(parse(read_source(str(path), data)), Project(path, root))


def check(source: Source, project: Project | None = None) -> CheckedSpec:
    """Parse and check a source. Raises SpecError with every mistake found; without a project nothing is imported."""
    return check_module(parse(source), project)


def check_module(
    module: ast.Module,
    project: Project | None = None,
    hook: LoweringHook | None = None,
    counts: Mapping[str, int] | None = None,
) -> CheckedSpec:
    """Check what was parsed already. Raises SpecError as `check` does. `hook` gets the lowering at work once all that
    the spec declares is known; it may expand formulas of its own. `counts` are numbers of things that the spec draws;
    with those that it does not say the spec is a family, see `lang.check.families`."""
    given, project = counts or {}, project or Project()
    draft = Draft(module, project, hook, given)
    spec, constant = _run_passes(draft), draft.constant
    if not spec.counts:
        never = [one for one in constant.values() if one.kind is IMPOSSIBLE_REQUIREMENT]
        if never:
            raise SpecError(*(one.but(counted=numbers_text(given)) for one in never))
        return spec

    def member(numbers: dict[str, int]) -> CheckedSpec:
        draft = Draft(module, project, None, {**given, **numbers})
        made = _run_passes(draft)
        for key in constant.keys() - draft.constant.keys():
            del constant[key]
        return made

    spec = family(module, spec, member)
    if constant:
        raise SpecError(*constant.values())
    return spec


def _run_passes(draft: Draft) -> CheckedSpec:
    try:
        for one in PASSES:
            one(draft)
    except FormulaTooLarge as error:
        raise SpecError(SPEC_TOO_LARGE(file=draft.source.name, reason=str(error))) from None
    return _spec(draft)


def refuse(draft: Draft) -> None:
    """Raises SpecError where anything was wrong so far: what follows would not know what to make of it."""
    if draft.problems:
        raise draft.problems.refusal(draft.source)


def take_imports(draft: Draft) -> None:
    """The statements of all files, in order."""
    module = draft.module
    if any(isinstance(one, ast.Import) for one in module.statements):
        draft.placed, problems = inline(module, draft.project)
        draft.problems.extend(problems)
    else:
        draft.placed = [SourcedStatement(module.source, one) for one in module.statements]


def declare_names(draft: Draft) -> None:
    """What each name stands for, and whether all are used as they can be."""
    draft.scope, problems = collect(draft.source, draft.placed, draft.module.bare)
    draft.problems.extend([*problems, *resolve(draft.placed, draft.module.bare, draft.scope)])
    sources = {one.source.name: len(one.source.text) for one in draft.placed}
    characters = len(draft.source.text) + sum(sources.values())
    draft.lowering = FormulaLowering(draft.scope, CoreBuilder(()), characters)


def place_workspace(draft: Draft) -> None:
    for one in draft.placed:
        if isinstance(one.statement, ast.Workspace):
            with draft.problems:
                draft.space = workspace(draft.lowering, one.source, one.statement)
    draft.lowering.areas["workspace"] = whole(draft.space)


def count_objects(draft: Draft) -> None:
    """Places of objects in storage order, how many elements arrays have, and which assets objects of categories are."""
    scope, lowering = draft.scope, draft.lowering
    with draft.problems:
        scope.objects, scope.arrays = name_objects(lowering, list(scope.things.values()), draft.counts)
    if not draft.problems:
        with draft.problems:
            draft.kinds, draft.variants = categories(lowering, draft.project, draft.counts)
        lowering.builder.objects = draft.variants.all_names(scope.objects) if draft.kinds else tuple(scope.objects)


def read_time(draft: Draft) -> None:
    """How long a motion lasts and what moves in a step; every object is then there twice: now, and before the step."""
    lowering = draft.lowering
    for one in draft.placed:
        with draft.problems:
            if isinstance(one.statement, ast.Time):
                lowering.horizon = horizon(lowering, one.source, one.statement)
            elif isinstance(one.statement, ast.Moves):
                draft.moves = movers(one.source, one.statement)
                if not draft.scope.timed:
                    raise SpecError(TIME_MISSING(one.statement.span(one.source)))
    if lowering.horizon is not None:
        builder = lowering.builder
        builder.moving = len(builder.objects)
        builder.objects += tuple(f"{name} before" for name in builder.objects)


def shape_objects(draft: Draft) -> None:
    """What each object looks like, and where it is held."""
    scope, lowering, variants = draft.scope, draft.lowering, draft.variants
    for thing in scope.things.values():
        if draft.problems.full:
            break
        places = draft.places(thing)
        with draft.problems:
            if thing.name.id in draft.kinds:
                draft.shapes.extend(variants.shapes[place] for place in places)
            elif thing.declaration is None or not is_category(thing.declaration.shape):
                looks = shape(lowering, thing, thing.name.id, draft.project)
                draft.shapes.extend([looks] * len(places))
        with draft.problems:
            draft.fixed.update(zip(places, pose(lowering, thing, draft.space), strict=False))
    draft.shapes.extend(looks for _, _, looks in variants.more)
    also = variants.behind(len(scope.objects)) if variants.more else {}
    draft.fixed.update({place: draft.fixed[like] for place, like in also.items() if like in draft.fixed})
    (left, right), (bottom, top) = draft.space.x, draft.space.y
    for which, (x, y, _) in draft.fixed.items() if not draft.problems else ():
        # a robot may stand beside the workspace: its own box reaches there
        if draft.shapes[which].arm is not None and not (left <= x <= right and bottom <= y <= top):
            box = (which, (min(x, left), max(x, right)), (min(y, bottom), max(y, top)))
            draft.space = replace(draft.space, own=(*draft.space.own, box))
    lowering.coerce.footprints = tuple(looks.footprint for looks in draft.shapes)
    lowering.coerce.fixed = draft.fixed


def place_regions(draft: Draft) -> None:
    """Where regions and cameras are."""
    lowering, regions = draft.lowering, list(draft.scope.regions.values())
    for declared in regions:
        if draft.problems.full:
            break
        with draft.problems:
            if declared.name.id not in lowering.areas and declared.name.id not in lowering.levels:
                areas(lowering, declared)
    if regions:
        draft.problems.extend(level_clash(lowering, regions))
    for declared in draft.scope.cameras.values():
        with draft.problems:
            lowering.cameras[declared.name.id] = camera(lowering, declared)


def stand_objects(draft: Draft) -> None:
    """What objects stand on, how high that is, the boxes of their centres, and what it requires."""
    if draft.problems:
        return
    scope, lowering = draft.scope, draft.lowering
    lowering.shapes, lowering.space = tuple(draft.shapes), draft.space
    found: dict[int, tuple[Support, ...]] = {}
    spans: dict[int, Span] = {}
    for thing in scope.things.values():
        places, one = draft.places(thing), thing.declaration
        if one is not None and one.support is not None:
            spans.update((place, one.support.span(thing.source)) for place in places)
            with draft.problems:
                found.update(supports(lowering, thing, places))
                refuse_surfaces(thing, [found[place] for place in places], spans[places[0]])
    also = draft.variants.behind(len(scope.objects)) if draft.variants.more else {}
    found.update({place: found[like] for place, like in also.items() if like in found})
    spans.update({place: spans[like] for place, like in also.items() if like in spans})
    if draft.problems or not found:
        lowering.heights = (0.0,) * len(draft.shapes)  # what formulas have to say is still looked at
        return
    names = lowering.builder.objects
    with draft.problems:
        lowering.heights = heights(len(draft.shapes), found, names, spans)
    if draft.problems:
        return
    if lowering.horizon is not None:
        for thing in scope.things.values():
            one = thing.declaration
            if one is not None and one.choice:
                draft.problems.append(NO_PLACE_OVER_TIME(one.name.span(thing.source)))
                return
    chosen = lowering.choices = choices(lowering, found, list(scope.things.values()))
    lowering.supports = {which: options[0] for which, options in found.items() if which not in chosen}
    lowering.builder.objects = (*names, *(f"{names[which]}.on" for which in chosen))
    space = support_boxes(draft.space, found, draft.fixed, [one.switch for one in chosen.values()])
    outside = empty_supports(space, spans, names)
    draft.problems.extend(outside)
    if not outside:
        with draft.problems:
            draft.standing = standing_on(lowering, lowering.supports, spans)
        draft.space = space


def check_constants(draft: Draft) -> None:
    """Constants that no formula uses are checked all the same."""
    scope, lowering = draft.scope, draft.lowering
    for declared in scope.constants.values():
        if declared.source is not scope.prelude and not draft.problems.full:
            (expr,) = ast.expressions(declared.statement)
            with draft.problems:
                value = lowering.evaluate(expr, CallFrame(declared.source))
                if isinstance(value, NumberValue) and lowering.builder.value(value.node) is None:
                    here, formula = expr.span(declared.source), print_expr(expr)
                    raise SpecError(NOT_CONSTANT(here, name=declared.name.id, formula=formula))
                draft.problems.extend(_bad_override(declared, value, lowering))


def _bad_override(declared: Declared, value: Value, lowering: Lowering) -> list[Diagnostic]:
    """A constant of the prelude may be given another value, but not one that turns its relations upside down."""
    name = declared.name.id
    standard = next(
        (one for one in prelude().statements if isinstance(one, ast.Constant) and one.name.id == name), None
    )
    if standard is None or name in ("NORTH", "EAST", "SOUTH", "WEST"):
        return []
    wanted = BARE if name == "ANGLE_SCALE" else ANGLE if "ANGLE" in name else LENGTH
    (expr,) = ast.expressions(declared.statement)
    here, usual = expr.span(declared.source), print_expr(standard.value)
    if not isinstance(value, NumberValue) or value.unit not in (BARE, wanted):
        what = value.unit.words if isinstance(value, NumberValue) else value.kind
        return [WRONG_OVERRIDE(here, name=name, wanted=wanted.words, found=what, usual=usual)]
    amount = lowering.builder.value(value.node)
    if amount is not None and (amount < 0.0 or (amount == 0.0 and name == "ANGLE_SCALE")):
        return [WRONG_OVERRIDE(here, name=name, wanted="positive", usual=usual)]
    return []


def lower_formulas(draft: Draft) -> None:
    """The core formulas of all labels, and of what is required; then of whatever `hook` wants to know."""
    if draft.problems:
        return
    scope = draft.scope
    if scope.cameras:
        draft.problems.extend(camera_clash(draft.lowering, draft.fixed))
        draft.lowering.noticed.extend(blind_cameras(draft.lowering, draft.fixed))
    if draft.fixed and sum(place < len(scope.objects) for place in draft.fixed) == len(scope.objects):
        last = list(scope.things.values())[-1]
        draft.problems.append(NO_FREE_OBJECT(last.name.span(last.source)))
    draft.labels = _labels(draft)
    draft.requirement = _requirement(draft)
    if draft.hook is not None and not draft.problems:
        draft.hook(draft.lowering)


def _labels(draft: Draft) -> dict[str, int]:
    """The formula of each label; mistakes in one do not hide those in another."""
    problems, formulas = draft.problems, draft.formulas()
    if not formulas and not problems:
        end = len(draft.source.text.rstrip())
        problems.append(NO_FORMULA(Span(draft.source, end, end), file=draft.source.name))
    labels: dict[str, int] = {}
    alone: dict[str, list[str]] = {}
    for name, source, formula in formulas:
        if problems.full:
            break
        draft.lowering.alone.clear()
        with problems:
            value = draft.lowering.evaluate(formula, CallFrame(source))
            labels[name] = draft.lowering.coerce.formula(value, f"`{name}`")
        alone[name] = list(draft.lowering.alone)
    for name, source, formula in formulas:
        if labels.get(name, 0) < 0 and not problems:
            problems.append(CONSTANT_LABEL(formula.span(source), name=name, alone=alone[name]))
    return labels


def _requirement(draft: Draft) -> int:
    """The conjunction of all `require` statements, after what supports require."""
    lowering, builder = draft.lowering, draft.lowering.builder
    parts = [*draft.standing]
    declared = lowering.supports or lowering.choices
    options = {which: choice.options for which, choice in lowering.choices.items()}
    for one in draft.placed:
        if isinstance(one.statement, ast.Require) and not draft.problems.full:
            with draft.problems:
                value = lowering.evaluate(one.statement.formula, CallFrame(one.source))
                part = lowering.coerce.formula(value, "what `require` demands")
                here = one.statement.formula.span(one.source)
                never = _constant(part, builder) < 0.0
                if not never:
                    part, *later = _by_time(part, builder)
                    parts.extend(later)
                    problem = clashing(lowering, part, lowering.supports, options)
                    if problem is not None:
                        raise SpecError(problem)
                    part = without_supports(lowering, part, frozenset(draft.standing)) if declared else part
                    never = part == FALSE  # where heights and places are constants
                if never:
                    draft.refuse_constant(IMPOSSIBLE_REQUIREMENT(here, meant=find_remedy(lowering, here)), -1.0)
                if part == FALSE:  # which no core has
                    part = builder.atom(builder.const(1.0), builder.const(0.0), here.text, BARE, (here,))
                parts.append(part)
    return builder.junction("min", parts, "require" if len(parts) > 1 else "")


def _by_time(formula: int, builder: CoreBuilder) -> list[int]:
    """What a requirement demands of single moments; in a spec over time also what it demands of several of them, and of
    steps, at all moments but the first: before that there is no step."""
    if not builder.moving or formula < 0:
        return [formula]
    still: list[int] = []
    steps: list[int] = []
    later: list[int] = []
    stack = [formula]
    while stack:
        node = builder.nodes[index := stack.pop()]
        if isinstance(node, Junction) and node.kind == "min":
            stack.extend(reversed(node.args))
        elif _takes(index, builder, lambda one: isinstance(one, Coord) and one.object >= builder.moving):
            steps.append(index)
        else:
            (later if _takes(index, builder, lambda one: isinstance(one, Temporal)) else still).append(index)
    if not steps and not later:
        return [formula]
    made = builder.junction("min", still)
    return [made, *later, builder.moment("steps", builder.junction("min", steps))]


def _takes(formula: int, builder: CoreBuilder, what: Callable[[Node], bool]) -> bool:
    """Whether a node of some kind takes part in a formula."""
    stack, seen = [formula], set[int]()
    while stack:
        index = stack.pop()
        if index >= 0 and index not in seen:
            seen.add(index)
            if what(builder.nodes[index]):
                return True
            stack.extend(children(builder.nodes[index]))
    return False


def _constant(formula: int, builder: CoreBuilder) -> float:
    """phi of a formula that no coordinate takes part in; NaN of others, and of those over time."""
    if formula < 0:
        return math.inf if formula == TRUE else -math.inf
    if _takes(formula, builder, lambda one: isinstance(one, Coord | Temporal)):
        return math.nan
    return float(phi(builder.finish({LABEL: formula}), [])[LABEL])


def read_priors(draft: Draft) -> None:
    """Where things usually are."""
    said = [(one.source, one.statement) for one in draft.placed if isinstance(one.statement, ast.Usually)]
    if not said or draft.lowering.heights is None:
        return
    also = draft.variants.behind(len(draft.scope.objects)) if draft.variants.more else {}
    lowering = draft.lowering
    lowering.space = draft.space
    known: dict[tuple[int, str], Span] = {}
    for source, statement in said:
        with draft.problems:
            draft.priors.append(prior_statement(lowering, draft.project, source, statement, also))
            draft.problems.extend(said_twice(lowering, draft.priors[-1], known))
    draft.problems.extend(circles(lowering, draft.priors))


def check_uncalled(draft: Draft) -> None:
    """Bodies of definitions that nobody calls are checked with parameters that may be anything."""
    scope, lowering = draft.scope, draft.lowering
    draft.used = set(lowering.used)
    for name, declared in scope.definitions.items():
        definition = declared.statement
        if name in lowering.used or declared.source is scope.prelude or not isinstance(definition, ast.Definition):
            continue
        if draft.problems.full:
            break
        env: dict[str, Value] = {
            one.name.id: AnyValue(origin=one.name.span(declared.source)) for one in definition.parameters
        }
        with draft.problems:
            lowering.evaluate(definition.body, CallFrame(declared.source), env)


def make_core(draft: Draft) -> None:
    """The core. A label that no coordinate takes part in cannot be asked for, nor learned; nor is it any use to require
    it."""
    required = None if draft.requirement == TRUE else draft.requirement
    core = draft.core = draft.lowering.builder.finish(draft.labels, required)
    depends: list[bool] = []
    for node in core.nodes:
        depends.append(isinstance(node, Coord) or any(map(depends.__getitem__, children(node))))
    things = draft.scope.things.items()
    held = [name for name, thing in things if thing.declaration and thing.declaration.pose is not None]
    for name, index in core.labels.items():
        if not depends[index]:
            value = _constant(draft.labels[name], draft.lowering.builder)
            draft.refuse_constant(CONSTANT_LABEL(draft.formula(name), name=name, held=held), value)
    still = core.requirement is not None and not depends[core.requirement]
    if still and not _constant(draft.requirement, draft.lowering.builder) < 0.0:  # which was refused
        draft.refuse_constant(CONSTANT_LABEL(draft.first_requirement(), held=held), 0.0)


def split_time(draft: Draft) -> None:
    """The two layers of a spec over time. A formula that looks beyond the last moment in every motion has no finite
    phi."""
    lasts = draft.lowering.horizon
    if lasts is None:
        return
    timed = draft.timed = split(draft.core, lasts, draft.moves, draft.lowering.builder.moving)
    if len(timed.nodes) * lasts.moments > MAX_TIMED_VALUES:
        raise FormulaTooLarge(f"has too many formulas over time for {lasts.steps:,} steps")
    found, most = endless(timed), lasts.steps - 1
    for name, index in timed.labels.items() if draft.module.bare is None else ():
        value = found[index][0]
        if math.isinf(value):
            sign = "minus " if value < 0.0 else ""
            draft.problems.append(LOOKS_BEYOND(draft.formula(name), name=f"`{name}`", sign=sign, most=most))
    if timed.requirement is not None and (found[timed.requirement] == -math.inf).any():
        here = draft.first_requirement()
        draft.problems.append(LOOKS_BEYOND(here, name="what is required", sign="minus ", most=most))


Pass = Callable[[Draft], None]

PASSES: tuple[Pass, ...] = (
    take_imports,
    refuse,
    declare_names,
    refuse,
    place_workspace,
    count_objects,
    read_time,
    shape_objects,
    refuse,
    place_regions,
    stand_objects,
    check_constants,
    lower_formulas,
    read_priors,
    check_uncalled,
    refuse,
    make_core,
    refuse,
    split_time,
    refuse,
)


def _spec(draft: Draft) -> CheckedSpec:
    """The spec that a draft has become, with warnings."""
    scope, lowering = draft.scope, draft.lowering
    regions = tuple(
        Region(name, place.footprint, (*place.center, 0.0), place.z)
        for name, place in lowering.areas.items()
        if name != "workspace"
    )
    alone = {one.name: one.least for one in scope.counts.values() if one.least == one.most}
    drawn = tuple(one for one in scope.counts.values() if one.name not in draft.counts and one.name not in alone)
    noted = (
        *find_unused(draft.scope, draft.placed, draft.module.bare, draft.used, draft.lowering.used),
        *unlikely(draft),
    )
    raised = bool(lowering.supports or lowering.choices)
    return CheckedSpec(
        draft.source.name,
        canonical(draft, {**alone, **draft.counts}),
        draft.space,
        draft.core,
        _title(draft.source),
        tuple(draft.shapes),
        draft.fixed,
        regions,
        dict(lowering.supports),
        tuple(lowering.heights or ()) if raised else (),
        dict(lowering.choices),
        (
            *noted,
            *headings_compared(draft.core),
            *lowering.noticed,
            *(always_the_same(scope, alone) if alone else ()),
        ),
        draft.timed,
        drawn,
        cameras=tuple(lowering.cameras.values()),
        priors=tuple(one.prior for one in draft.priors if one.prior is not None),
    )


def _title(source: Source) -> str:
    """The opening comment's first line: shipped specs say there what they describe."""
    first = source.text.lstrip().splitlines()[0].strip()
    return first.lstrip("# ").strip() if first.startswith("#") else ""
