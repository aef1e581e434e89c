"""Source text -> CheckedSpec: the front door of the language."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from scenegen.errors import Diagnostic, Source, SpecError
from scenegen.lang import ast
from scenegen.lang.blame import Frame
from scenegen.lang.builder import FALSE, TRUE, CoreBuilder, TooLarge
from scenegen.lang.canonical import canonical
from scenegen.lang.core import Coord, Core, children
from scenegen.lang.declare import name_objects, pose, shape
from scenegen.lang.headings import headings_compared
from scenegen.lang.imports import Placed, Project, inline
from scenegen.lang.interpret import phi
from scenegen.lang.lower import Lowering
from scenegen.lang.parse import MOST_ERRORS, parse, plain_breaks, read_source
from scenegen.lang.places import whole
from scenegen.lang.print import print_expr
from scenegen.lang.regions import area, workspace
from scenegen.lang.resolve import resolve
from scenegen.lang.scope import LABEL, Declared, Scope, collect, prelude
from scenegen.lang.spec import CheckedSpec, Pose, Region
from scenegen.lang.trampoline import run
from scenegen.lang.unused import unused
from scenegen.lang.values import AnyValue, NumberValue, Value
from scenegen.primitives.units import ANGLE, BARE, LENGTH
from scenegen.scene.workspace import Workspace


def check_text(text: str, name: str = "<spec>") -> CheckedSpec:
    """Parse and check a spec's text. Raises SpecError with every mistake found; `name` is what they call the file."""
    return check(Source(name, plain_breaks(text)))


def check_file(path: Path, data: bytes, root: Path | None = None) -> CheckedSpec:
    """Check the bytes of a spec file. What it imports is read from its own folder, or from `root`. Raises SpecError."""
    return check(read_source(str(path), data), Project(path, root))


def check(source: Source, project: Project | None = None) -> CheckedSpec:
    """Parse and check a source. Raises SpecError with every mistake found; without a project nothing is imported."""
    return check_module(parse(source), project)


def check_module(module: ast.Module, project: Project | None = None) -> CheckedSpec:
    """Check what was parsed already. Raises SpecError as `check` does."""
    source = module.source
    project = project or Project()
    placed, problems = inline(module, project)
    if problems:
        raise _refusal(problems, source)
    scope, problems = collect(source, placed, module.bare)
    problems += resolve(placed, module.bare, scope)
    if problems:
        raise _refusal(problems, source)
    try:
        return _expand(source, placed, module.bare, scope, project)
    except TooLarge as error:
        help_ = "use fewer objects, or smaller definitions and quantifiers"
        raise SpecError(Diagnostic(f"{source.name} {error}", help=help_)) from None


def _refusal(problems: Sequence[Diagnostic], main: Source) -> SpecError:
    """All problems once, those of the spec itself first, each file's in the order of its text."""

    def place(problem: Diagnostic) -> tuple[bool, str, int]:
        span = problem.span
        return (False, "", 0) if span is None else (span.source is not main, span.source.name, span.start)

    return SpecError(*sorted(dict.fromkeys(problems), key=place)[:MOST_ERRORS])


class _Stage:
    """Runs the steps of a stage and keeps what each found wrong, so that one mistake does not hide another."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self.problems: list[Diagnostic] = []

    def __enter__(self) -> _Stage:
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> bool:
        if isinstance(error, SpecError):
            self.problems.extend(error.diagnostics)
            return True
        return False

    @property
    def full(self) -> bool:
        """Whether nobody would read any more."""
        return len(self.problems) >= MOST_ERRORS

    def close(self) -> None:
        """Raises SpecError where anything was wrong."""
        if self.problems:
            raise _refusal(self.problems, self.source)


def _expand(
    source: Source, placed: Sequence[Placed], bare: ast.Expr | None, scope: Scope, project: Project
) -> CheckedSpec:
    builder = CoreBuilder(())
    texts = {one.source.name: len(one.source.text) for one in placed}
    lowering = Lowering(scope, builder, len(source.text) + sum(texts.values()))
    stage = _Stage(source)
    space = Workspace()
    for one in placed:
        if isinstance(one.statement, ast.Workspace):
            with stage:
                space = workspace(lowering, one.source, one.statement)
    lowering.areas["workspace"] = whole(space)
    with stage:
        scope.objects, scope.arrays = name_objects(lowering, list(scope.things.values()))
    if not stage.problems:
        builder.objects = tuple(scope.objects)
    shapes, fixed = [], dict[int, Pose]()
    for thing in scope.things.values():
        if stage.full:
            break
        places = scope.arrays.get(thing.name.id) or (scope.objects.get(thing.name.id, 0),)
        with stage:
            looks = shape(lowering, thing, thing.name.id, project)
            shapes.extend([looks] * len(places))
        with stage:
            fixed.update(zip(places, pose(lowering, thing, space), strict=False))
    stage.close()
    lowering.kinds.footprints = tuple(looks.footprint for looks in shapes)
    lowering.kinds.fixed = fixed
    for declared in scope.regions.values():
        if stage.full:
            break
        with stage:
            if declared.name.id not in lowering.areas:
                lowering.areas[declared.name.id] = run(area(lowering, declared))
    _constants(scope, lowering, stage)
    if not stage.problems:
        _refuse_nothing_free(scope, fixed, stage)
        labels = _labels(placed, bare, lowering, stage)
        requirement = _requirement(placed, lowering, stage)
    used = set(lowering.used)
    _uncalled_definitions(scope, lowering, stage)
    stage.close()
    core = builder.finish(labels, None if requirement == TRUE else requirement)
    _refuse_constants(core, placed, bare, scope, stage)
    stage.close()
    regions = tuple(
        Region(name, place.footprint, (*place.center, 0.0))
        for name, place in lowering.areas.items()
        if name != "workspace"
    )
    text = canonical(placed, bare, scope, shapes)
    warnings = [*unused(placed, bare, scope, used, lowering.used), *headings_compared(core)]
    return CheckedSpec(source.name, text, space, core, _title(source), tuple(shapes), fixed, regions, tuple(warnings))


def _labels(placed: Sequence[Placed], bare: ast.Expr | None, lowering: Lowering, stage: _Stage) -> dict[str, int]:
    """The formula of each label; mistakes in one do not hide those in another."""
    formulas = [
        (one.source, one.statement.name.id, one.statement.formula)
        for one in placed
        if isinstance(one.statement, ast.Label)
    ]
    if bare is not None:
        formulas = [(stage.source, LABEL, bare)]
    if not formulas and not stage.problems:
        end = len(stage.source.text.rstrip())
        stage.problems.append(
            Diagnostic(
                f"{stage.source.name} has no formula",
                ast.Truth(True, start=end, end=end).span(stage.source),
                "nothing says what the scenes must satisfy",
                "add one: task: leftOf(mug, plate)",
            )
        )
    labels: dict[str, int] = {}
    for source, name, formula in formulas:
        if stage.full:
            break
        with stage:
            value = run(lowering.lower(formula, {}, Frame(source)))
            labels[name] = lowering.kinds.formula(value, f"`{name}`")
    for source, name, formula in formulas:
        if labels.get(name, 0) < 0 and not stage.problems:
            stage.problems.append(_constant(name, formula, source))
    return labels


def _requirement(placed: Sequence[Placed], lowering: Lowering, stage: _Stage) -> int:
    """The conjunction of all `require` statements."""
    parts = []
    for one in placed:
        if isinstance(one.statement, ast.Require) and not stage.full:
            with stage:
                value = run(lowering.lower(one.statement.formula, {}, Frame(one.source)))
                part = lowering.kinds.formula(value, "what `require` demands")
                if part == FALSE or _never(part, lowering.builder):
                    here = one.statement.formula.span(one.source)
                    raise SpecError(Diagnostic("this can never hold", here, "no scene meets it", "remove it"))
                parts.append(part)
    return lowering.builder.junction("min", parts, "require" if len(parts) > 1 else "")


def _never(formula: int, builder: CoreBuilder) -> bool:
    """Whether a formula that no coordinate takes part in does not hold."""
    stack, seen = [formula], set[int]()
    while stack:
        index = stack.pop()
        if index < 0 or isinstance(builder.nodes[index], Coord):
            return False  # found soon in almost every formula
        if index not in seen:
            seen.add(index)
            stack.extend(children(builder.nodes[index]))
    core = builder.finish({LABEL: formula})
    return bool(phi(core, [])[LABEL] < 0.0)


def _constant(name: str, formula: ast.Expr, source: Source, note: str = "") -> Diagnostic:
    return Diagnostic(
        f"`{name}` is constant",
        formula.span(source),
        "its value is the same in every scene",
        "say something about the objects, for instance: leftOf(mug, plate)",
        note=note,
    )


def _refuse_constants(core: Core, placed: Sequence[Placed], bare: ast.Expr | None, scope: Scope, stage: _Stage) -> None:
    """A label that no coordinate takes part in cannot be asked for, nor learned; nor is it any use to require it."""
    depends: list[bool] = []
    for node in core.nodes:
        depends.append(isinstance(node, Coord) or any(map(depends.__getitem__, children(node))))
    held = [name for name, thing in scope.things.items() if thing.declaration and thing.declaration.pose is not None]
    note = f"held in place by `at`: {', '.join(held)}" if held else ""
    formulas = {one.statement.name.id: one for one in placed if isinstance(one.statement, ast.Label)}
    for name, index in core.labels.items():
        if depends[index]:
            continue
        if bare is not None:
            stage.problems.append(_constant(name, bare, stage.source, note))
        else:
            statement = formulas[name].statement
            assert isinstance(statement, ast.Label)
            stage.problems.append(_constant(name, statement.formula, formulas[name].source, note))
    if core.requirement is not None and not depends[core.requirement]:
        first = next(one for one in placed if isinstance(one.statement, ast.Require))
        title = "what `require` demands is the same in every scene"
        stage.problems.append(
            Diagnostic(
                title, first.statement.span(first.source), "no free object takes part", "leave it out", note=note
            )
        )


def _refuse_nothing_free(scope: Scope, fixed: dict[int, Pose], stage: _Stage) -> None:
    if fixed and len(fixed) == len(scope.objects):
        last = list(scope.things.values())[-1]
        title, label = "no object is free", "all objects are held in place by `at`"
        stage.problems.append(
            Diagnostic(title, last.name.span(last.source), label, "leave out `at` for what shall move")
        )


def _constants(scope: Scope, lowering: Lowering, stage: _Stage) -> None:
    """Constants that no formula uses are checked all the same."""
    for declared in scope.constants.values():
        if declared.source is not scope.prelude and not stage.full:
            (expr,) = ast.expressions(declared.statement)
            with stage:
                value = run(lowering.lower(expr, {}, Frame(declared.source)))
                if isinstance(value, NumberValue) and lowering.builder.value(value.node) is None:
                    help_ = f"write a definition: def {declared.name.id}() = {print_expr(expr)}"
                    raise SpecError(
                        Diagnostic("a constant cannot depend on the scene", expr.span(declared.source), "", help_)
                    )
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
    (expr,) = ast.expressions(declared.statement)
    here, help_ = expr.span(declared.source), f"the prelude's is {print_expr(standard.value)}"
    if not isinstance(value, NumberValue) or value.unit not in (BARE, wanted):
        what = value.unit.words if isinstance(value, NumberValue) else value.kind
        return [Diagnostic(f"`{name}` must be {wanted.words}, not {what}", here, "", help_)]
    amount = lowering.builder.value(value.node)
    if amount is not None and (amount < 0.0 or (amount == 0.0 and name == "ANGLE_SCALE")):
        return [Diagnostic(f"`{name}` must be positive", here, "", help_)]
    return []


def _uncalled_definitions(scope: Scope, lowering: Lowering, stage: _Stage) -> None:
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
