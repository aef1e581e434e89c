"""What can be said of names before any formula is expanded: does each exist, is each call well-formed, is nothing
defined by itself. All mistakes are found in one go."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import islice

from scenegen.assets.library import PLAIN
from scenegen.errors import Diagnostic, Source, Span, quoted, suggest
from scenegen.lang import ast
from scenegen.lang.imports import Placed
from scenegen.lang.parse import MOST_ERRORS
from scenegen.lang.print import print_expr
from scenegen.lang.scope import BUILT_IN, NO_NUMBERS, Declared, Scope, Signature
from scenegen.scene.workspace import AXES

SHAPES = PLAIN  # what an object can be
FILES = ("urdf", "mesh")  # those of them that a file says
MAX_PARAMETERS = 100  # of a definition
SHOWN = 8  # relations that a help line names
AREAS = ("rect", "circle", "polygon")  # what a region can be


def resolve(placed: Sequence[Placed], bare: ast.Expr | None, scope: Scope) -> list[Diagnostic]:
    """The problems of a spec's names, in the order of the text, and the first MOST_ERRORS of a file: whoever has more
    does not read them, and to look for names like the unknown ones takes time."""
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


def _statement(one: Placed, scope: Scope) -> Iterator[Diagnostic]:
    statement, source = one.statement, one.source
    if isinstance(statement, ast.Objects):
        yield from _declarations(statement, scope, source)
        return
    if isinstance(statement, ast.Region):
        yield from _area(statement.shape, scope, source)
        return
    bound: set[str] = set()
    if isinstance(statement, ast.Definition):
        yield from _parameters(statement, source)
        bound = {parameter.name.id for parameter in statement.parameters}
    for expr in ast.expressions(statement):
        constant = isinstance(statement, ast.Constant | ast.Workspace)
        # a default is written where the parameters are not yet known
        visible = bound if isinstance(statement, ast.Definition) and expr is statement.body else set()
        yield from _expression(expr, visible, scope, source, constant)


def _declarations(statement: ast.Objects, scope: Scope, source: Source) -> Iterator[Diagnostic]:
    """Counts and poses are constants; of a shape only what stands in its parentheses is looked at here."""
    for one in statement.declarations:
        if one.count is not None:
            yield from _expression(one.count, set(), scope, source, True)
        if isinstance(one.shape, ast.Call):
            file = one.shape.function.id in FILES
            for argument in one.shape.arguments:
                if not (file and isinstance(argument.value, ast.Name)):
                    yield from _shape_argument(argument, scope, source)
        if one.pose is not None:
            yield from _expression(one.pose, set(), scope, source, True)


def _shape_argument(argument: ast.Argument, scope: Scope, source: Source) -> Iterator[Diagnostic]:
    """Texts, and shapes inside a shape, are the declaration's own business."""
    if isinstance(argument.value, ast.Call) and argument.value.function.id in SHAPES:
        for inner in argument.value.arguments:
            yield from _shape_argument(inner, scope, source)
    elif not isinstance(argument.value, ast.Text):
        yield from _expression(argument.value, set(), scope, source, True)


def _area(shape: ast.Expr, scope: Scope, source: Source) -> Iterator[Diagnostic]:
    if isinstance(shape, ast.Call):
        for argument in shape.arguments:
            yield from _expression(argument.value, set(), scope, source, True)


def _parameters(definition: ast.Definition, source: Source) -> Iterator[Diagnostic]:
    seen: set[str] = set()
    defaults = False
    if len(definition.parameters) > MAX_PARAMETERS:
        here = definition.parameters[MAX_PARAMETERS].name.span(source)
        title = f"`{definition.name.id}` has more than {MAX_PARAMETERS} parameters"
        yield Diagnostic(title, here, "", "give it a list of things instead")
    for parameter in definition.parameters:
        here = parameter.name.span(source)
        if parameter.name.id in seen:
            yield Diagnostic(f"two parameters are called `{parameter.name.id}`", here, "", "rename one of them")
        if defaults and parameter.default is None:
            help_ = "move it before those that have one, or give it a default as well"
            yield Diagnostic(f"`{parameter.name.id}` has no default, but stands after one that has", here, "", help_)
        seen.add(parameter.name.id)
        defaults = defaults or parameter.default is not None


def _expression(root: ast.Expr, bound: set[str], scope: Scope, source: Source, constant: bool) -> Iterator[Diagnostic]:
    stack: list[tuple[ast.Expr | ast.Argument, frozenset[str]]] = [(root, frozenset(bound))]
    while stack:
        node, visible = stack.pop()
        match node:
            case ast.Member(base, member) if member.id in AXES:
                help_ = f"write {member.id}({print_expr(base)})"
                yield Diagnostic("a coordinate is not written with a dot", node.span(source), "", help_)
                continue
            case ast.Name() if node.id not in visible:
                yield from _name(node, set(visible), scope, source, constant)
            case ast.Text():
                help_ = "write names without quotes"
                yield Diagnostic("a text cannot stand in a formula", node.span(source), "", help_)
            case ast.Call():
                yield from _call(node, scope, source)
            case ast.Quantifier():
                yield from _variables(node, visible, source)
                names = frozenset(variable.id for variable in node.variables)
                stack.append((node.body, visible | names))
                stack.append((node.domain, visible))
                continue
            case _:
                pass
        stack.extend((child, visible) for child in reversed(ast.children(node)))


def _variables(node: ast.Quantifier, visible: frozenset[str], source: Source) -> Iterator[Diagnostic]:
    seen: set[str] = set()
    for variable in node.variables:
        here = variable.span(source)
        if variable.id in seen:
            yield Diagnostic(f"`{variable.id}` is named twice", here, "", "two variables need two names")
        elif variable.id in BUILT_IN:
            yield Diagnostic(f"`{variable.id}` is built in", here, "it cannot be a variable", "choose another name")
        elif variable.id in visible:
            label = "a variable or parameter of that name is in use here"
            yield Diagnostic(f"`{variable.id}` would hide another `{variable.id}`", here, label, "choose another name")
        seen.add(variable.id)


def _name(node: ast.Name, bound: set[str], scope: Scope, source: Source, constant: bool) -> Iterator[Diagnostic]:
    here = node.span(source)
    if node.id in scope.constants or node.id in scope.regions or node.id in BUILT_IN:
        return
    if node.id.lower() in NO_NUMBERS and not scope.knows(node.id):
        yield no_number(node.id, here)
    elif constant:
        if node.id in scope.labels:
            yield Diagnostic(f"`{node.id}` is not a constant", here, "only numbers and constants can stand here")
        elif node.id not in scope.things:
            yield Diagnostic(
                f"unknown constant `{node.id}`",
                here,
                "",
                suggest(node.id, [*scope.constants, *scope.regions, *scope.things], f"define it: const {node.id} = 1"),
            )
    elif not scope.knows(node.id):
        if node.id in scope.functions():
            signature = scope.signature(node.id)
            usage = signature.usage if signature else ""
            yield Diagnostic(f"`{node.id}` needs its arguments", here, "", f"write {usage}")
            return
        known = {*scope.values(), *bound}
        declared = f"the objects are {quoted(scope.things)}" if scope.things else ""
        yield Diagnostic(
            f"unknown name `{node.id}`",
            here,
            "no object, constant or label is called so",
            suggest(node.id, known, declared or f"declare it: object {node.id}"),
        )


def no_number(name: str, here: Span) -> Diagnostic:
    help_ = "write a number; where there shall be no limit, leave the comparison out"
    return Diagnostic(f"there is no `{name}` here", here, "all numbers are finite", help_)


def _call(node: ast.Call, scope: Scope, source: Source) -> Iterator[Diagnostic]:
    name = node.function.id
    signature = scope.signature(name)
    here = node.function.span(source)
    if signature is None:
        if scope.knows(name):
            yield Diagnostic(f"`{name}` is not a relation", here, "it cannot be called")
            return
        if name in SHAPES or name in AREAS:
            kind, opening = ("an object", "object") if name in SHAPES else ("a region", "region")
            help_ = f"give {kind} that shape: {opening} name = {print_expr(node)}"
            yield Diagnostic(f"`{name}` is the shape of {kind}", here, "a formula cannot hold it", help_)
            return
        close = suggest(name, scope.functions())
        known = [one for one in scope.definitions if not one.startswith("_")]
        shown = quoted(known) if len(known) <= SHOWN else f"{', '.join(f'`{one}`' for one in known[:SHOWN])}, ..."
        help_ = close or f"the relations are {shown}; docs/language.md has all of them"
        yield Diagnostic(f"unknown relation `{name}`", here, "no relation or function is called so", help_)
        return
    problem = bind(node, signature, source)
    if isinstance(problem, Diagnostic):
        yield problem


def bind(node: ast.Call, signature: Signature, source: Source) -> dict[str, ast.Expr] | Diagnostic:
    """The arguments of a call by parameter name, without those left to their default; or what is wrong with them."""
    given: dict[str, ast.Expr] = {}
    count = len(node.arguments)
    usage = f"write {signature.usage}"
    if signature.variadic:
        if count < 1:
            return Diagnostic(f"`{signature.name}` takes numbers, or a list of them", node.span(source), "", usage)
        return {str(number): argument.value for number, argument in enumerate(node.arguments)}
    if count > len(signature.parameters):
        extra = node.arguments[len(signature.parameters)]
        span = Span(source, extra.start, node.arguments[-1].end)
        return Diagnostic(_arity(signature, count), span, "too many", usage)
    known: frozenset[str] | None = None  # the parameters, once an argument has a name
    for position, argument in enumerate(node.arguments):
        if argument.name is None:
            name = signature.parameters[position]
            if known is not None:
                return Diagnostic(
                    "an argument without a name after one with a name", argument.span(source), "", f"write {name} = ..."
                )
        else:
            name = argument.name.id
            known = frozenset(signature.parameters) if known is None else known
            if name not in known:
                help_ = suggest(name, signature.parameters, usage)
                return Diagnostic(
                    f"`{signature.name}` has no parameter `{name}`", argument.name.span(source), "", help_
                )
            if name in given:
                return Diagnostic(f"`{name}` is given twice", argument.span(source), "", usage)
        given[name] = argument.value
    missing = [name for name in signature.parameters[: signature.needed] if name not in given]
    if missing:
        return Diagnostic(_arity(signature, count), node.span(source), f"{quoted(missing)} missing", usage)
    return given


def _arity(signature: Signature, given: int) -> str:
    most = len(signature.parameters)
    takes = str(most) if signature.needed == most else f"{signature.needed} to {most}"
    plural = "" if takes == "1" else "s"
    return f"`{signature.name}` takes {takes} argument{plural}, not {given}"


def _cycles(scope: Scope) -> Iterator[Diagnostic]:
    """Constants, definitions and labels that are defined by themselves, one diagnostic per circle."""
    uses: dict[Declared, list[tuple[Declared, Span]]] = {}
    groups = (scope.constants, scope.regions, scope.definitions, scope.labels)
    everything = [declared for group in groups for declared in group.values()]
    for declared in everything:
        uses[declared] = list(_references(declared, scope))
    state: dict[Declared, int] = {}  # 1 under way, 2 done
    for start in everything:
        if start in state:
            continue
        state[start] = 1
        path = [start]
        stack = [iter(uses[start])]
        while stack:
            step = next(stack[-1], None)
            if step is None:
                stack.pop()
                state[path.pop()] = 2
                continue
            target, span = step
            if state.get(target) == 1:
                circle = [one.name.id for one in path[path.index(target) :]] + [target.name.id]
                note = " -> ".join(circle) if len(circle) > 2 else ""
                yield Diagnostic(f"`{target.name.id}` is defined by itself", span, "it is used here again", note=note)
                state[target] = 2
            elif target not in state:
                state[target] = 1
                path.append(target)
                stack.append(iter(uses[target]))


def _references(declared: Declared, scope: Scope) -> Iterator[tuple[Declared, Span]]:
    bound = frozenset[str]()
    if isinstance(declared.statement, ast.Definition):
        bound = frozenset(parameter.name.id for parameter in declared.statement.parameters)
    stack: list[tuple[ast.Expr | ast.Argument, frozenset[str]]] = [
        (expr, bound) for expr in ast.expressions(declared.statement)
    ]
    while stack:
        node, visible = stack.pop()
        target: Declared | None = None
        if isinstance(node, ast.Call):
            target = scope.definitions.get(node.function.id)
        elif isinstance(node, ast.Name) and node.id not in visible:
            target = scope.declared(node.id)
        if target is not None:
            place = node.function if isinstance(node, ast.Call) else node
            yield target, place.span(declared.source)
        if isinstance(node, ast.Quantifier):
            stack.append((node.domain, visible))
            stack.append((node.body, visible | {variable.id for variable in node.variables}))
            continue
        stack.extend((child, visible) for child in ast.children(node))
