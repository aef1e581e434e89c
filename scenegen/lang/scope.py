"""Which names a spec knows: what each statement declares, and the objects that a spec without `object` uses.

Relations and functions live apart from everything else, since a call is told by its parenthesis: an object may be
called `box` or `x`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache

from scenegen.errors import Diagnostic, Source, Span
from scenegen.lang import ast
from scenegen.lang.parse import parse
from scenegen.primitives import PRIMITIVES
from scenegen.resources import grammar_file
from scenegen.scene.workspace import AXES

BUILT_IN = ("objects", "workspace")  # names with a meaning of their own

LABEL = "task"  # the name of an unnamed formula


@dataclass(frozen=True, slots=True)
class Signature:
    """What a call may look like: the parameters in order, how many of them are needed; `variadic` repeats the last."""

    name: str
    parameters: tuple[str, ...]
    needed: int
    variadic: bool = False
    usage: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Declared:
    """A statement that gives a name a meaning, and the source it stands in. Compared by identity: trees may be deep."""

    source: Source
    name: ast.Name
    statement: ast.Constant | ast.Definition | ast.Label

    @property
    def span(self) -> Span:
        return self.name.span(self.source)


@dataclass(slots=True)
class Scope:
    """Everything a formula can name. `objects` maps a name to its place in storage order."""

    source: Source
    prelude: Source
    constants: dict[str, Declared] = field(default_factory=dict)
    definitions: dict[str, Declared] = field(default_factory=dict)
    labels: dict[str, Declared] = field(default_factory=dict)
    objects: dict[str, int] = field(default_factory=dict)
    inferred: bool = False

    def values(self) -> set[str]:
        """Names that stand for something by themselves."""
        return {*self.objects, *self.constants, *self.labels}

    def knows(self, name: str) -> bool:
        """Whether a name stands for something by itself."""
        return name in self.objects or name in self.constants or name in self.labels

    def functions(self) -> set[str]:
        return {*self.definitions, *signatures()}

    def signature(self, name: str) -> Signature | None:
        """How `name` may be called; None where nothing of that name can be."""
        declared = self.definitions.get(name)
        if declared is None:
            return signatures().get(name)
        assert isinstance(declared.statement, ast.Definition)
        return signature_of(declared.statement)


def signature_of(definition: ast.Definition) -> Signature:
    from scenegen.lang.print import print_expr

    names = tuple(parameter.name.id for parameter in definition.parameters)
    shown = [
        one.name.id if one.default is None else f"{one.name.id} = {print_expr(one.default)}"
        for one in definition.parameters
    ]
    needed = sum(one.default is None for one in definition.parameters)
    return Signature(definition.name.id, names, needed, usage=f"{definition.name.id}({', '.join(shown)})")


@cache
def signatures() -> Mapping[str, Signature]:
    """The functions that no definition makes: coordinates and primitives."""
    table = {axis: Signature(axis, ("a",), 1, usage=f"{axis}(a)") for axis in AXES}
    for primitive in PRIMITIVES.values():
        if not primitive.operator:
            names = tuple("abcdefgh"[: len(primitive.params)])
            dots = ", ..." if primitive.variadic else ""
            usage = f"{primitive.name}({', '.join(names)}{dots})"
            table[primitive.name] = Signature(primitive.name, names, len(names), primitive.variadic, usage)
    return table


@cache
def prelude() -> ast.Module:
    """The prelude's tree."""
    return parse(Source("prelude.spec", grammar_file("prelude.spec").read_text(encoding="utf-8")))


def collect(module: ast.Module) -> tuple[Scope, list[Diagnostic]]:
    """The scope of a module over the prelude, and a diagnostic for each name with two meanings."""
    base = prelude()
    scope = Scope(module.source, base.source)
    for statement in base.statements:
        if isinstance(statement, ast.Constant):
            scope.constants[statement.name.id] = Declared(base.source, statement.name, statement)
        elif isinstance(statement, ast.Definition):
            scope.definitions[statement.name.id] = Declared(base.source, statement.name, statement)
    problems: list[Diagnostic] = []
    places: dict[str, Span] = {}
    workspace: Span | None = None
    for statement in module.statements:
        if isinstance(statement, ast.Workspace):
            here = statement.span(module.source)
            if workspace is not None:
                problems.append(_twice("the workspace", here, workspace))
            workspace = here
        for kind, name in _names(statement):
            here = name.span(module.source)
            problem = _clash(scope, kind, name.id, here, places)
            if problem is not None:
                problems.append(problem)
                continue
            places[name.id] = here
            _declare(scope, statement, name)
    if not any(isinstance(statement, ast.Objects) for statement in module.statements):
        scope.inferred = True
        _infer_objects(module, scope)
    return scope, problems


def _names(statement: ast.Statement) -> Iterator[tuple[str, ast.Name]]:
    """The names that a statement declares, each with its kind."""
    match statement:
        case ast.Objects(declarations):
            for one in declarations:
                yield "object", one.name
        case ast.Region(name, _):
            yield "region", name
        case ast.Constant(name, _):
            yield "constant", name
        case ast.Definition(name, _, _):
            yield "definition", name
        case ast.Label(name, _):
            yield "label", name
        case _:
            return


def _declare(scope: Scope, statement: ast.Statement, name: ast.Name) -> None:
    match statement:
        case ast.Objects():
            scope.objects[name.id] = len(scope.objects)
        case ast.Constant():
            scope.constants[name.id] = Declared(scope.source, name, statement)
        case ast.Definition():
            scope.definitions[name.id] = Declared(scope.source, name, statement)
        case ast.Label():
            scope.labels[name.id] = Declared(scope.source, name, statement)
        case _:
            return


def _twice(what: str, here: Span, first: Span) -> Diagnostic:
    return Diagnostic(
        f"{what} is defined twice",
        here,
        "defined again here",
        "remove one of them",
        note=f"first defined at {first.place}",
    )


def _clash(scope: Scope, kind: str, name: str, here: Span, places: Mapping[str, Span]) -> Diagnostic | None:
    if name in places:
        return _twice(f"`{name}`", here, places[name])
    if name in BUILT_IN:
        return Diagnostic(f"`{name}` is built in", here, "it cannot be defined", "choose another name")
    if kind == "definition" and name in scope.functions():
        what = "a relation of the prelude" if name in scope.definitions else "a built-in function"
        return Diagnostic(f"`{name}` is {what}", here, "it cannot be defined again", "choose another name")
    if kind not in ("definition", "constant") and name in scope.constants:
        return Diagnostic(
            f"`{name}` is a constant of the prelude", here, f"it cannot name {_a(kind)}", "choose another name"
        )
    return None


def _a(kind: str) -> str:
    return f"an {kind}" if kind[0] in "aeiou" else f"a {kind}"


def _infer_objects(module: ast.Module, scope: Scope) -> None:
    """Names that nothing else explains are objects, in the order in which the text mentions them."""
    roots: list[tuple[ast.Expr, frozenset[str]]] = []
    for statement in module.statements:
        bound = frozenset[str]()
        if isinstance(statement, ast.Definition):
            bound = frozenset(parameter.name.id for parameter in statement.parameters)
        if isinstance(statement, ast.Definition | ast.Label | ast.Require):
            roots.extend((expr, bound) for expr in ast.expressions(statement))
    if module.bare is not None:
        roots.append((module.bare, frozenset()))
    known = {*scope.constants, *scope.labels, *BUILT_IN}
    stack: list[tuple[ast.Expr | ast.Argument, frozenset[str]]] = list(reversed(roots))
    while stack:
        node, bound = stack.pop()
        if isinstance(node, ast.Name) and node.id not in known and node.id not in bound:
            scope.objects.setdefault(node.id, len(scope.objects))
        if isinstance(node, ast.Quantifier):
            bound |= {variable.id for variable in node.variables}
        stack.extend((child, bound) for child in reversed(ast.children(node)))
