"""Source text -> CheckedSpec: the front door of the language."""

from __future__ import annotations

from pathlib import Path

from scenegen.errors import Diagnostic, Source, SpecError
from scenegen.lang import ast
from scenegen.lang.builder import MAX_NODES, CoreBuilder, TooLarge
from scenegen.lang.core import Coord, Core, children
from scenegen.lang.lower import Frame, Lowering
from scenegen.lang.parse import parse, plain_breaks
from scenegen.lang.print import print_expr, print_module
from scenegen.lang.resolve import resolve
from scenegen.lang.scope import LABEL, Declared, Scope, collect, prelude
from scenegen.lang.spec import CheckedSpec
from scenegen.lang.trampoline import run
from scenegen.lang.values import AnyValue, NumberValue, Value
from scenegen.primitives.units import ANGLE, BARE, LENGTH
from scenegen.scene.workspace import Workspace

FARTHEST = 1e6  # metres from the origin; rounding is then still far below a micrometre
NARROWEST = 1e-9  # least width of the workspace, relative to its distance from the origin

MOST_ERRORS = 20  # diagnostics of one run; whoever has more has one mistake that causes the others


def check_text(text: str, name: str = "<spec>") -> CheckedSpec:
    """Parse and check a spec's text. Raises SpecError with every mistake found; `name` is what they call the file."""
    return check(Source(name, plain_breaks(text)))


def check(source: Source) -> CheckedSpec:
    """Parse and check a source. Raises SpecError with every mistake found."""
    module = parse(source)
    scope, problems = collect(module)
    problems += resolve(module, scope)
    if problems:
        raise SpecError(*sorted(problems, key=_place)[:MOST_ERRORS])
    builder = CoreBuilder(tuple(scope.objects))
    lowering = Lowering(scope, builder)
    try:
        workspace = _workspace(module, lowering, problems)
        _constants(scope, lowering, problems)
        labels = {} if problems else _labels(module, lowering, problems)
        _unused_definitions(scope, lowering, problems)
    except TooLarge:
        raise SpecError(_too_large(source)) from None
    if problems:
        unique = list(dict.fromkeys(problems))
        raise SpecError(*sorted(unique, key=_place)[:MOST_ERRORS])
    core = builder.finish(labels)
    _refuse_constant_labels(core, module)
    return CheckedSpec(source.name, print_module(module), workspace, core, _title(source))


def check_file(path: Path, data: bytes) -> CheckedSpec:
    """Check the bytes of a spec file. Raises SpecError."""
    from scenegen.lang.parse import read_source

    return check(read_source(str(path), data))


def _place(problem: Diagnostic) -> int:
    return problem.span.start if problem.span is not None else 0


def _too_large(source: Source) -> Diagnostic:
    return Diagnostic(
        f"{source.name} expands to more than {MAX_NODES:,} parts", help="use fewer or smaller definitions"
    )


def _workspace(module: ast.Module, lowering: Lowering, problems: list[Diagnostic]) -> Workspace:
    for statement in module.statements:
        if isinstance(statement, ast.Workspace):
            try:
                sides = [
                    _interval(side, axis, lowering, module) for side, axis in ((statement.x, "x"), (statement.y, "y"))
                ]
            except SpecError as error:
                problems.extend(error.diagnostics)
            else:
                return Workspace(*sides)
    return Workspace()


def _interval(interval: ast.Interval, axis: str, lowering: Lowering, module: ast.Module) -> tuple[float, float]:
    frame = Frame(module.source)
    ends = []
    for expr in (interval.lowest, interval.highest):
        number = lowering.number(run(lowering.lower(expr, {}, frame)), "an end of the workspace")
        value = lowering.builder.value(number.node)
        assert value is not None  # the resolver lets only constants stand here
        if number.unit not in (BARE, LENGTH):
            title = f"the workspace is measured in metres, not as {number.unit.words}"
            raise SpecError(Diagnostic(title, expr.span(module.source)))
        ends.append(value)
    lowest, highest = ends
    if max(abs(lowest), abs(highest)) > FARTHEST:
        here = interval.span(module.source)
        raise SpecError(Diagnostic(f"this interval of {axis} is too far out", here, f"the limit is {FARTHEST:,.0f} m"))
    if 0.0 < highest - lowest < NARROWEST * max(1.0, abs(lowest), abs(highest)):
        here = interval.span(module.source)
        label = "numbers of a computer are too coarse for it"
        raise SpecError(Diagnostic(f"this interval of {axis} is too narrow", here, label, "give it some width"))
    if not lowest < highest:
        here = interval.span(module.source)
        help_ = f"write [{highest:g}, {lowest:g}]" if lowest > highest else "give it some width"
        raise SpecError(Diagnostic(f"this interval of {axis} is empty", here, "the first end must be smaller", help_))
    return lowest, highest


def _labels(module: ast.Module, lowering: Lowering, problems: list[Diagnostic]) -> dict[str, int]:
    """The formula of each label; mistakes in one do not hide those in another."""
    formulas = [(one.name.id, one.formula) for one in module.statements if isinstance(one, ast.Label)]
    if module.bare is not None:
        formulas = [(LABEL, module.bare)]
    if not formulas and not problems:
        end = len(module.source.text.rstrip())
        problems.append(
            Diagnostic(
                f"{module.source.name} has no formula",
                ast.Truth(True, start=end, end=end).span(module.source),
                "nothing says what the scenes must satisfy",
                "add one: task: leftOf(mug, plate)",
            )
        )
    labels: dict[str, int] = {}
    for name, formula in formulas:
        try:
            value = run(lowering.lower(formula, {}, Frame(module.source)))
            labels[name] = lowering.formula(value, f"`{name}`")
        except SpecError as error:
            problems.extend(error.diagnostics)
    for name, index in labels.items():
        if index < 0 and not problems:
            problems.append(_constant(module, name))
    return labels


def _constant(module: ast.Module, name: str) -> Diagnostic:
    formula = module.bare
    for statement in module.statements:
        if isinstance(statement, ast.Label) and statement.name.id == name:
            formula = statement.formula
    assert formula is not None
    return Diagnostic(
        f"`{name}` is constant",
        formula.span(module.source),
        "its value is the same in every scene",
        "say something about the objects, for instance: leftOf(mug, plate)",
    )


def _refuse_constant_labels(core: Core, module: ast.Module) -> None:
    """A label that no coordinate takes part in cannot be asked for, nor learned."""
    depends: list[bool] = []
    for node in core.nodes:
        depends.append(isinstance(node, Coord) or any(depends[child] for child in children(node)))
    constant = [name for name, index in core.labels.items() if not depends[index]]
    if constant:
        raise SpecError(*(_constant(module, name) for name in constant))


def _constants(scope: Scope, lowering: Lowering, problems: list[Diagnostic]) -> None:
    """Constants that no formula uses are checked all the same."""
    for declared in scope.constants.values():
        if declared.source is scope.source:
            (expr,) = ast.expressions(declared.statement)
            try:
                value = run(lowering.lower(expr, {}, Frame(declared.source)))
                problems.extend(_bad_override(declared, value, lowering))
            except SpecError as error:
                problems.extend(error.diagnostics)


def _bad_override(declared: Declared, value: Value, lowering: Lowering) -> list[Diagnostic]:
    """A constant of the prelude may be given another value, but not one that turns its relations upside down."""
    name = declared.name.id
    if name not in ("ANGLE_SCALE", "EPS_CLOSE", "EPS_FAR", "EPS_ANGLE"):
        return []
    wanted = {"ANGLE_SCALE": BARE, "EPS_ANGLE": ANGLE}.get(name, LENGTH)
    (expr,) = ast.expressions(declared.statement)
    here = expr.span(declared.source)
    if not isinstance(value, NumberValue) or value.unit not in (BARE, wanted):
        what = value.unit.words if isinstance(value, NumberValue) else value.kind
        return [
            Diagnostic(f"`{name}` must be {wanted.words}, not {what}", here, "", f"the prelude's is {_default(name)}")
        ]
    amount = lowering.builder.value(value.node)
    if amount is not None and (amount < 0.0 or (amount == 0.0 and name == "ANGLE_SCALE")):
        return [Diagnostic(f"`{name}` must be positive", here, "", f"the prelude's is {_default(name)}")]
    return []


def _default(name: str) -> str:
    found = next(one for one in prelude().statements if isinstance(one, ast.Constant) and one.name.id == name)
    return print_expr(found.value)


def _unused_definitions(scope: Scope, lowering: Lowering, problems: list[Diagnostic]) -> None:
    """Bodies of definitions that nobody calls are checked with parameters that may be anything."""
    for name, declared in scope.definitions.items():
        definition = declared.statement
        if name in lowering.used or declared.source is not scope.source or not isinstance(definition, ast.Definition):
            continue
        env = {one.name.id: AnyValue(origin=one.name.span(declared.source)) for one in definition.parameters}
        try:
            run(lowering.lower(definition.body, env, Frame(declared.source)))
        except SpecError as error:
            problems.extend(error.diagnostics)


def _title(source: Source) -> str:
    """The opening comment's first line: shipped specs say there what they describe."""
    first = source.text.lstrip().splitlines()[0].strip()
    return first.lstrip("# ").strip() if first.startswith("#") else ""
