"""What can be said of names before any formula is expanded: does each exist, is each call well-formed, is nothing
defined by itself. All mistakes are found in one go. In the end: which names nobody uses, and which hide another."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import islice
from types import ModuleType
from typing import Any

from scenegen.errors import Diagnostic, Source, Span, quote_names
from scenegen.errors.language import (
    BUILT_IN_NAME,
    CIRCULAR_DEFINITION,
    HIDDEN_NAME,
    MISPLACED_VALUE,
    NAMED_TWICE,
    NO_SUCH_PART,
    NOT_FINITE,
    SHADOWED_VARIABLE,
    TIME_MISSING,
    TOO_MANY_PARAMETERS,
    UNKNOWN_NAME,
    UNKNOWN_PARAMETER,
    UNKNOWN_RELATION,
    UNUSED_NAME,
    WRONG_NAME,
    WRONG_NUMBER_OF_ARGUMENTS,
    WRONG_ORDER,
)
from scenegen.lang.check.imports import SourcedStatement
from scenegen.lang.check.scope import BUILT_IN, NO_NUMBERS, STEPS, Declared, Scope, Signature
from scenegen.lang.syntax import ast
from scenegen.lang.syntax.parse import MOST_ERRORS
from scenegen.lang.syntax.printer import print_expr
from scenegen.lang.syntax.tokens import TEMPORAL
from scenegen.pose import NAMES
from scenegen.things.library import PLAIN

BUILT = ("cabinet",)  # objects of the library that are made to order
SHAPE_WORDS = (*PLAIN, *BUILT, "category")  # what an object can be
FILE_SHAPES = ("urdf", "mesh", "asset")  # those of them that a file says
MAX_PARAMETERS = 100  # of a definition
MAX_SHOWN_NAMES = 8  # relations that a help line names, and arguments that it repeats
LIST = ("items",)  # the parameters of a relation that takes one list
AREAS = ("rect", "circle", "polygon")  # what a region can be


def resolve(placed: Sequence[SourcedStatement], bare: ast.Expr | None, scope: Scope) -> list[Diagnostic]:
    """The problems of a spec's names, in the order of the text, and the first MOST_ERRORS of a file: nobody
    reads more, and finding names like the unknown ones takes time."""
    problems: list[Diagnostic] = []
    counts = Counter[str]()
    for one in placed:
        room = MOST_ERRORS - counts[one.source.name]
        found = list(islice(_statement(one, scope), max(0, room)))
        counts[one.source.name] += len(found)
        problems.extend(found)
    if bare is not None:
        problems.extend(islice(_expression(bare, set(), scope, scope.source, False), MOST_ERRORS))
    return problems or list(_cycles(scope))


def _statement(one: SourcedStatement, scope: Scope) -> Iterator[Diagnostic]:
    statement, source = one.statement, one.source
    if isinstance(statement, ast.Objects):
        yield from _declarations(statement, scope, source)
        return
    if isinstance(statement, ast.Region):
        yield from _area(statement.shape, scope, source)
        for expr in (*statement.levels, *(() if statement.count is None else (statement.count,))):
            yield from _expression(expr, set(), scope, source, True)
        return
    if isinstance(statement, ast.CameraDeclaration):
        for place in (statement.eye, statement.target):
            for part in place.coordinates if isinstance(place, ast.Point) else (place,):
                yield from _expression(part, set(), scope, source, True)
        for expr in (statement.field, statement.width, statement.height):
            yield from _expression(expr, set(), scope, source, True)
        return
    if isinstance(statement, ast.Usually):
        yield from _prior(statement, scope, source)
        return
    bound: set[str] = set()
    if isinstance(statement, ast.Definition):
        yield from _parameters(statement, source)
        bound = {parameter.name.id for parameter in statement.parameters}
    for expr in ast.expressions(statement):
        constant = isinstance(statement, ast.Constant | ast.Workspace | ast.Time)
        # a default is written where the parameters are not yet known
        visible = bound if isinstance(statement, ast.Definition) and expr is statement.body else set()
        yield from _expression(expr, visible, scope, source, constant)


def _declarations(statement: ast.Objects, scope: Scope, source: Source) -> Iterator[Diagnostic]:
    """Counts and poses are constants; of a shape only what stands in its parentheses is looked at here."""
    for one in statement.declarations:
        if one.count is not None:
            yield from _expression(one.count, set(), scope, source, True)
        if isinstance(one.shape, ast.Call) and one.shape.function.id != "category":  # which is read as it stands
            file = one.robot or one.shape.function.id in FILE_SHAPES
            for argument in one.shape.arguments:
                if not (file and isinstance(argument.value, ast.Name)):
                    yield from _shape_argument(argument, scope, source)
        if one.support is not None:
            yield from _expression(one.support, set(), scope, source, False)
        if one.pose is not None:
            yield from _expression(one.pose, set(), scope, source, True)


def _shape_argument(argument: ast.Argument, scope: Scope, source: Source) -> Iterator[Diagnostic]:
    """Texts, colours, and shapes inside a shape, are the declaration's own business."""
    if argument.name is not None and argument.name.id == "color":
        return
    if isinstance(argument.value, ast.Call) and argument.value.function.id in SHAPE_WORDS:
        for inner in argument.value.arguments:
            yield from _shape_argument(inner, scope, source)
    elif not isinstance(argument.value, ast.Text):
        yield from _expression(argument.value, set(), scope, source, True)


def _prior(statement: ast.Usually, scope: Scope, source: Source) -> Iterator[Diagnostic]:
    """The words of distributions, and the names of files, are the checker's business."""
    of = statement.distribution
    parts: list[ast.Expr] = []
    for one in of.items if isinstance(of, ast.Weighted) else (of,):
        if isinstance(one, ast.Call):
            parts.extend(each.value for each in one.arguments if not isinstance(each.value, ast.Text))
        elif not isinstance(one, ast.List | ast.Weighted):
            parts.append(one)
    for part in (*statement.things, *parts):
        yield from _expression(part, set(), scope, source, False)
    for weight in of.weights if isinstance(of, ast.Weighted) else ():
        yield from _expression(weight, set(), scope, source, True)


def _area(shape: ast.Expr, scope: Scope, source: Source) -> Iterator[Diagnostic]:
    if isinstance(shape, ast.Call):
        for argument in shape.arguments:
            yield from _expression(argument.value, set(), scope, source, True)


def _parameters(definition: ast.Definition, source: Source) -> Iterator[Diagnostic]:
    seen: set[str] = set()
    defaults = False
    if len(definition.parameters) > MAX_PARAMETERS:
        here = definition.parameters[MAX_PARAMETERS].name.span(source)
        yield TOO_MANY_PARAMETERS(here, name=definition.name.id, limit=MAX_PARAMETERS)
    for parameter in definition.parameters:
        here = parameter.name.span(source)
        if parameter.name.id in seen:
            yield NAMED_TWICE(here, name=parameter.name.id, parameter=True)
        if defaults and parameter.default is None:
            yield WRONG_ORDER(here, name=parameter.name.id)
        seen.add(parameter.name.id)
        defaults = defaults or parameter.default is not None


def _expression(root: ast.Expr, bound: set[str], scope: Scope, source: Source, constant: bool) -> Iterator[Diagnostic]:
    for node, visible in ast.walk(root, frozenset(bound), _is_no_coordinate):
        match node:
            case ast.Member(base, member) if member.id in NAMES:
                yield NO_SUCH_PART(node.span(source), axis=member.id, base=print_expr(base))
            case ast.Name() if node.id not in visible:
                yield from _name(node, set(visible), scope, source, constant)
            case ast.Text():
                yield MISPLACED_VALUE(node.span(source), text=True)
            case ast.Call():
                yield from _call(node, scope, source)
            case ast.Quantifier():
                yield from _variables(node, visible, source)


def _is_no_coordinate(node: ast.Expr | ast.Argument) -> bool:
    return not isinstance(node, ast.Member) or node.member.id not in NAMES


def _variables(node: ast.Quantifier, visible: frozenset[str], source: Source) -> Iterator[Diagnostic]:
    seen: set[str] = set()
    for variable in node.variables:
        here = variable.span(source)
        if variable.id in seen:
            yield NAMED_TWICE(here, name=variable.id)
        elif variable.id in BUILT_IN:
            yield BUILT_IN_NAME(here, name=variable.id, what="built in", use="be a variable")
        elif variable.id in visible:
            yield SHADOWED_VARIABLE(here, name=variable.id)
        seen.add(variable.id)


def _name(node: ast.Name, bound: set[str], scope: Scope, source: Source, constant: bool) -> Iterator[Diagnostic]:
    here = node.span(source)
    if node.id in scope.constants or node.id in scope.regions or node.id in BUILT_IN:
        return
    if node.id.lower() in NO_NUMBERS and not scope.knows(node.id):
        yield NOT_FINITE(here, name=node.id)
    elif constant:
        if node.id in scope.labels:
            yield WRONG_NAME(here, name=node.id)
        elif node.id not in scope.things:
            near, instead = [*scope.constants, *scope.regions, *scope.things], _elsewhere().of_number(node.id)
            yield UNKNOWN_NAME(here, name=node.id, known=near, instead=instead, constant=True)
    elif not scope.knows(node.id):
        if node.id in scope.functions():
            signature = scope.signature(node.id)
            yield WRONG_NUMBER_OF_ARGUMENTS(here, name=node.id, usage=signature.usage if signature else None)
            return
        known, instead = {*scope.values(), *bound}, _elsewhere().of_thing(node.id)
        yield UNKNOWN_NAME(here, name=node.id, known=known, objects=tuple(scope.things), instead=instead)


def _elsewhere() -> ModuleType:
    """What names mean in other languages, which correct specs have no need of."""
    from scenegen.lang.syntax import foreign

    return foreign


def _call(node: ast.Call, scope: Scope, source: Source) -> Iterator[Diagnostic]:
    name = node.function.id
    signature = scope.signature(name)
    here = node.function.span(source)
    if signature is None:
        if scope.knows(name):
            yield WRONG_NAME(here, name=name, relation=True)
            return
        if name in STEPS or name in TEMPORAL:
            yield TIME_MISSING(here, word=name)
            return
        if name in SHAPE_WORDS or name in AREAS:
            kind, opening = ("an object", "object") if name in SHAPE_WORDS else ("a region", "region")
            yield MISPLACED_VALUE(here, name=name, kind=kind, opening=opening, shape=print_expr(node))
            return
        relations = tuple(one for one in scope.definitions if not one.startswith("_"))
        known = scope.functions()
        instead = _elsewhere().of_relation(name, [print_expr(one.value) for one in node.arguments], known)
        yield UNKNOWN_RELATION(here, name=name, known=known, relations=relations, instead=instead)
        return
    problem = bind(node, signature, source)
    if isinstance(problem, Diagnostic):
        yield problem


def bind(node: ast.Call, signature: Signature, source: Source) -> dict[str, ast.Expr] | Diagnostic:
    """The arguments of a call by parameter name, without those left to their default; or what is wrong with them."""
    given: dict[str, ast.Expr] = {}
    count = len(node.arguments)
    if signature.variadic:
        if count < 1:
            return WRONG_NUMBER_OF_ARGUMENTS(node.span(source), name=signature.name, usage=signature.usage, none=True)
        return {str(number): argument.value for number, argument in enumerate(node.arguments)}
    if count > len(signature.parameters):
        extra = node.arguments[len(signature.parameters)]
        span = Span(source, extra.start, node.arguments[-1].end)
        facts = _arity(signature, count)
        if signature.parameters == LIST and all(one.name is None for one in node.arguments):
            items = [print_expr(one.value) for one in node.arguments[:MAX_SHOWN_NAMES]]
            items += ["..."] * (count > MAX_SHOWN_NAMES)
            facts["usage"] = f"{signature.name}([{', '.join(items)}])"
        return WRONG_NUMBER_OF_ARGUMENTS(span, **facts, label="too many")
    known: frozenset[str] | None = None  # the parameters, once an argument has a name
    for position, argument in enumerate(node.arguments):
        if argument.name is None:
            name = signature.parameters[position]
            if known is not None:
                return WRONG_ORDER(argument.span(source), name=name, argument=True)
        else:
            name = argument.name.id
            known = frozenset(signature.parameters) if known is None else known
            if name not in known:
                here = argument.name.span(source)
                parameters = signature.parameters
                return UNKNOWN_PARAMETER(
                    here, function=signature.name, name=name, known=parameters, usage=signature.usage
                )
            if name in given:
                return NAMED_TWICE(argument.span(source), name=name, usage=signature.usage)
        given[name] = argument.value
    missing = [name for name in signature.parameters[: signature.needed] if name not in given]
    if missing:
        label = f"{quote_names(missing)} missing"
        return WRONG_NUMBER_OF_ARGUMENTS(node.span(source), **_arity(signature, count), label=label)
    return given


def _arity(signature: Signature, given: int) -> dict[str, Any]:
    most = len(signature.parameters)
    takes = str(most) if signature.needed == most else f"{signature.needed} to {most}"
    plural = "argument" if takes == "1" else "arguments"
    return {"name": signature.name, "takes": f"{takes} {plural}", "given": given, "usage": signature.usage}


def _cycles(scope: Scope) -> Iterator[Diagnostic]:
    """Constants, definitions and labels that are defined by themselves, one diagnostic per circle. The prelude has no
    circles of its own, so of its definitions only those that the spec uses are looked at."""
    groups = (scope.constants, scope.regions, scope.cameras, scope.definitions, scope.replaced, scope.labels)
    state: dict[Declared, int] = {}  # 1 under way, 2 done
    for start in (declared for group in groups for declared in group.values()):
        if start in state or start.source is scope.prelude:
            continue
        state[start] = 1
        path = [start]
        stack = [_references(start, scope)]
        while stack:
            step = next(stack[-1], None)
            if step is None:
                stack.pop()
                state[path.pop()] = 2
                continue
            target, span = step
            if state.get(target) == 1:
                circle = [one.name.id for one in path[path.index(target) :]] + [target.name.id]
                way = " -> ".join(circle) if len(circle) > 2 else None
                yield CIRCULAR_DEFINITION(span, name=target.name.id, way=way)
                state[target] = 2
            elif target not in state:
                state[target] = 1
                path.append(target)
                stack.append(_references(target, scope))


def _references(declared: Declared, scope: Scope) -> Iterator[tuple[Declared, Span]]:
    bound = frozenset[str]()
    if isinstance(declared.statement, ast.Definition):
        bound = frozenset(parameter.name.id for parameter in declared.statement.parameters)
    for node, visible in (pair for expr in ast.expressions(declared.statement) for pair in ast.walk(expr, bound)):
        target: Declared | None = None
        if isinstance(node, ast.Call):
            target = scope.definition(node.function.id, declared.source)
        elif isinstance(node, ast.Name) and node.id not in visible:
            target = scope.declaration(node.id)
        if target is not None:
            place = node.function if isinstance(node, ast.Call) else node
            yield target, place.span(declared.source)


def find_unused(
    scope: Scope,
    placed: Sequence[SourcedStatement],
    bare: ast.Expr | None,
    by_formulas: set[str],
    by_anything: set[str],
) -> list[Diagnostic]:
    """The warnings of the spec's own statements, in the order of the text. `by_formulas` are the names that
    formulas use, `by_anything` also those that only definitions use."""
    out: list[Diagnostic] = []
    for one in placed:
        if not scope.is_own(one.source):
            continue
        match one.statement:
            case ast.Definition(name, parameters, body):
                if name.id not in by_formulas:
                    out.append(
                        UNUSED_NAME(
                            name.span(one.source), kind="definition", name=name.id, reason="no formula calls it"
                        )
                    )
                inside = _names_in(body)
                for parameter in parameters:
                    out.extend(_hidden_names(parameter.name, "parameter", scope, one.source))
                    if parameter.name.id not in inside:
                        here, reason = parameter.name.span(one.source), f"the body of `{name.id}` has none"
                        out.append(UNUSED_NAME(here, kind="parameter", name=parameter.name.id, reason=reason))
            case ast.Constant(name) | ast.Region(name) | ast.CameraDeclaration(name):
                if name.id not in by_anything:
                    kind = type(one.statement).__name__.lower()
                    out.append(
                        UNUSED_NAME(name.span(one.source), kind=kind, name=name.id, reason="nothing mentions it")
                    )
            case _:
                pass
        for expr in ast.expressions(one.statement):
            out.extend(_shadowing(expr, scope, one.source))
    if bare is not None:
        out.extend(_shadowing(bare, scope, scope.source))
    return out


def _hidden_names(name: ast.Name, kind: str, scope: Scope, source: Source) -> Iterator[Diagnostic]:
    if name.id in scope.things and not scope.inferred:
        what = "an array" if scope.things[name.id].is_array else "an object"
    elif name.id in scope.constants:
        what = "a constant"
    elif name.id in scope.regions:
        what = "a region"
    elif name.id in scope.cameras:
        what = "a camera"
    elif name.id in scope.labels:
        what = "a label"
    else:
        return
    yield HIDDEN_NAME(name.span(source), kind=kind, name=name.id, what=what)


def _shadowing(root: ast.Expr, scope: Scope, source: Source) -> Iterator[Diagnostic]:
    for node, _ in ast.walk(root):
        if isinstance(node, ast.Quantifier):
            inside = _names_in(node.body)
            for variable in node.variables:
                yield from _hidden_names(variable, "variable", scope, source)
                if variable.id not in inside:
                    here, reason = variable.span(source), "every round says the same"
                    yield UNUSED_NAME(here, kind="variable", name=variable.id, reason=reason)


def _names_in(root: ast.Expr) -> set[str]:
    return {node.id for node, _ in ast.walk(root) if isinstance(node, ast.Name)}
