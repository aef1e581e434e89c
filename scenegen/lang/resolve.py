"""What can be said of names before any formula is expanded: does each exist, is each call well-formed, is nothing
defined by itself. All mistakes are found in one go."""

from __future__ import annotations

from collections.abc import Iterator

from scenegen.errors import Diagnostic, Source, Span, quoted, suggest
from scenegen.lang import ast
from scenegen.lang.print import print_expr
from scenegen.lang.scope import BUILT_IN, Declared, Scope, Signature, signatures
from scenegen.scene.workspace import AXES

LATER = "the grammar knows it, this version cannot give it a meaning yet"


def resolve(module: ast.Module, scope: Scope) -> list[Diagnostic]:
    """The problems of a module's names, in the order of the text."""
    problems: list[Diagnostic] = []
    for statement in module.statements:
        unsupported = list(_unsupported_statement(statement, module.source))
        if unsupported:
            problems.extend(unsupported)
            continue
        bound: set[str] = set()
        if isinstance(statement, ast.Definition):
            problems.extend(_parameters(statement, module.source))
            bound = {parameter.name.id for parameter in statement.parameters}
        for expr in ast.expressions(statement):
            constant = isinstance(statement, ast.Constant | ast.Workspace)
            # a default is written where the parameters are not yet known
            visible = bound if isinstance(statement, ast.Definition) and expr is statement.body else set()
            problems.extend(_expression(expr, visible, scope, module.source, constant))
    if module.bare is not None:
        problems.extend(_expression(module.bare, set(), scope, module.source, False))
    return problems or list(_cycles(scope))


def _later(what: str, span: Span) -> Diagnostic:
    return Diagnostic(f"{what} cannot be used yet", span, LATER)


def _unsupported_statement(statement: ast.Statement, source: Source) -> Iterator[Diagnostic]:
    match statement:
        case ast.Region():
            yield _later("`region`", Span(source, statement.start, statement.start + len("region")))
        case ast.Require():
            yield _later("`require`", Span(source, statement.start, statement.start + len("require")))
        case ast.Import():
            yield _later("`import`", Span(source, statement.start, statement.start + len("import")))
        case ast.Objects(declarations):
            for one in declarations:
                for what, part in (("an object array", one.count), ("a shape", one.shape), ("`at`", one.pose)):
                    if part is not None:
                        yield _later(what, part.span(source))


def _unsupported(node: ast.Expr | ast.Argument) -> str:
    match node:
        case ast.Quantifier(kind, _, _, _):
            return f"`{kind}`"
        case ast.List():
            return "a list"
        case ast.Index():
            return "an index"
        case ast.Member(_, member):
            return f"`.{member.id}`"
        case ast.Name(id) if id in BUILT_IN:
            return f"`{id}`"
        case _:
            return ""


def _parameters(definition: ast.Definition, source: Source) -> Iterator[Diagnostic]:
    seen: set[str] = set()
    defaults = False
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
    stack: list[ast.Expr | ast.Argument] = [root]
    while stack:
        node = stack.pop()
        what = _unsupported(node)
        if isinstance(node, ast.Member) and node.member.id in AXES:
            inner = print_expr(node.base)
            help_ = f"write {node.member.id}({inner})"
            yield Diagnostic("a coordinate is not written with a dot", node.span(source), "", help_)
            continue
        if what:
            yield _later(what, node.span(source))
            continue
        if isinstance(node, ast.Name) and node.id not in bound:
            yield from _name(node, bound, scope, source, constant)
        if isinstance(node, ast.Text):
            yield Diagnostic("a text cannot stand in a formula", node.span(source), "", "write names without quotes")
        if isinstance(node, ast.Call):
            yield from _call(node, scope, source)
        stack.extend(reversed(ast.children(node)))


def _name(node: ast.Name, bound: set[str], scope: Scope, source: Source, constant: bool) -> Iterator[Diagnostic]:
    here = node.span(source)
    if node.id in scope.constants:
        return
    if constant:
        if scope.knows(node.id):
            yield Diagnostic(f"`{node.id}` is not a constant", here, "only numbers and constants can stand here")
        else:
            yield Diagnostic(
                f"unknown constant `{node.id}`",
                here,
                "",
                suggest(node.id, scope.constants, f"define it: const {node.id} = 1"),
            )
    elif not scope.knows(node.id):
        if node.id in scope.functions():
            signature = scope.signature(node.id)
            usage = signature.usage if signature else ""
            yield Diagnostic(f"`{node.id}` needs its arguments", here, "", f"write {usage}")
            return
        known = {*scope.values(), *bound}
        declared = f"the objects are {quoted(scope.objects)}" if scope.objects else ""
        yield Diagnostic(
            f"unknown name `{node.id}`",
            here,
            "no object, constant or label is called so",
            suggest(node.id, known, declared or f"declare it: object {node.id}"),
        )


def _call(node: ast.Call, scope: Scope, source: Source) -> Iterator[Diagnostic]:
    name = node.function.id
    signature = scope.signature(name)
    here = node.function.span(source)
    if signature is None:
        if scope.knows(name):
            yield Diagnostic(f"`{name}` is not a relation", here, "it cannot be called")
            return
        close = suggest(name, scope.functions())
        relations = f"the relations are {quoted(scope.definitions)};\nthe functions are {quoted(signatures())}"
        yield Diagnostic(f"unknown relation `{name}`", here, "no relation or function is called so", close or relations)
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
        if count < 2:
            return Diagnostic(
                f"`{signature.name}` takes two or more arguments", node.span(source), f"{count} given", usage
            )
        return {str(number): argument.value for number, argument in enumerate(node.arguments)}
    if count > len(signature.parameters):
        extra = node.arguments[len(signature.parameters)]
        span = Span(source, extra.start, node.arguments[-1].end)
        return Diagnostic(_arity(signature, count), span, "too many", usage)
    for position, argument in enumerate(node.arguments):
        if argument.name is None:
            name = signature.parameters[position]
            if len(given) < position or any(one.name is not None for one in node.arguments[:position]):
                return Diagnostic(
                    "an argument without a name after one with a name", argument.span(source), "", f"write {name} = ..."
                )
        else:
            name = argument.name.id
            if name not in signature.parameters:
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
    everything = [*scope.constants.values(), *scope.definitions.values(), *scope.labels.values()]
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
    bound: set[str] = set()
    if isinstance(declared.statement, ast.Definition):
        bound = {parameter.name.id for parameter in declared.statement.parameters}
    stack: list[ast.Expr | ast.Argument] = list(ast.expressions(declared.statement))
    while stack:
        node = stack.pop()
        target: Declared | None = None
        if isinstance(node, ast.Call):
            target = scope.definitions.get(node.function.id)
        elif isinstance(node, ast.Name) and node.id not in bound:
            target = scope.constants.get(node.id) or scope.labels.get(node.id)
        if target is not None:
            place = node.function if isinstance(node, ast.Call) else node
            yield target, place.span(declared.source)
        stack.extend(ast.children(node))
