"""Warnings about names: what is defined and never used, what hides something else, and misspelt objects."""

from __future__ import annotations

from collections.abc import Iterator, Sequence, Set

from scenegen.assets import meant_by
from scenegen.errors import Diagnostic, Source
from scenegen.errors.declarations import STANDS_IN
from scenegen.errors.language import HIDDEN_NAME, UNUSED_NAME
from scenegen.lang import ast, traversal
from scenegen.lang.imports import Placed
from scenegen.lang.scope import Scope


def unused(
    placed: Sequence[Placed], bare: ast.Expr | None, scope: Scope, by_formulas: Set[str], by_anything: Set[str]
) -> list[Diagnostic]:
    """The warnings of the spec's own statements, in the order of the text.

    `by_formulas` are the names that labels and requirements use, `by_anything` those that definitions use as well.
    """
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
                inside = _free_names(body)
                for parameter in parameters:
                    out.extend(_hidden(parameter.name, "parameter", scope, one.source))
                    if parameter.name.id not in inside:
                        here, reason = parameter.name.span(one.source), f"the body of `{name.id}` has none"
                        out.append(UNUSED_NAME(here, kind="parameter", name=parameter.name.id, reason=reason))
            case ast.Constant(name) | ast.Region(name):
                if name.id not in by_anything:
                    kind = "constant" if isinstance(one.statement, ast.Constant) else "region"
                    out.append(
                        UNUSED_NAME(name.span(one.source), kind=kind, name=name.id, reason="nothing mentions it")
                    )
            case _:
                pass
        for expr in traversal.expressions(one.statement):
            out.extend(_variables(expr, scope, one.source))
    if bare is not None:
        out.extend(_variables(bare, scope, scope.source))
    return [*out, *_misspelt(scope)]


def _misspelt(scope: Scope) -> Iterator[Diagnostic]:
    """Objects without a shape whose names are nearly those of the library."""
    for name, thing in scope.things.items():
        shapeless = thing.declaration is None or thing.declaration.shape is None
        meant = meant_by(name) if shapeless and scope.is_own(thing.source) else None
        if meant is not None:
            inferred = thing.declaration is None or None
            yield STANDS_IN(thing.name.span(thing.source), name=name, meant=meant, inferred=inferred)


def _hidden(name: ast.Name, kind: str, scope: Scope, source: Source) -> Iterator[Diagnostic]:
    if name.id in scope.things and not scope.inferred:
        what = "an array" if scope.things[name.id].is_array else "an object"
    elif name.id in scope.constants:
        what = "a constant"
    elif name.id in scope.regions:
        what = "a region"
    elif name.id in scope.labels:
        what = "a label"
    else:
        return
    yield HIDDEN_NAME(name.span(source), kind=kind, name=name.id, what=what)


def _variables(root: ast.Expr, scope: Scope, source: Source) -> Iterator[Diagnostic]:
    stack: list[ast.Expr | ast.Argument] = [root]
    while stack:
        node = stack.pop()
        if isinstance(node, ast.Quantifier):
            inside = _free_names(node.body)
            for variable in node.variables:
                yield from _hidden(variable, "variable", scope, source)
                if variable.id not in inside:
                    here, reason = variable.span(source), "every round says the same"
                    yield UNUSED_NAME(here, kind="variable", name=variable.id, reason=reason)
        stack.extend(reversed(traversal.children(node)))


def _free_names(root: ast.Expr) -> set[str]:
    names: set[str] = set()
    stack: list[ast.Expr | ast.Argument] = [root]
    while stack:
        node = stack.pop()
        if isinstance(node, ast.Name):
            names.add(node.id)
        stack.extend(traversal.children(node))
    return names
