"""Warnings about names: what is defined and never used, and what hides something else."""

from __future__ import annotations

from collections.abc import Iterator, Sequence, Set

from scenegen.errors import Diagnostic, Source
from scenegen.lang import ast
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
                    out.append(_never(f"definition `{name.id}`", name, one.source, "no formula calls it"))
                inside = _free_names(body)
                for parameter in parameters:
                    out.extend(_hidden(parameter.name, "parameter", scope, one.source))
                    if parameter.name.id not in inside:
                        what = f"parameter `{parameter.name.id}`"
                        out.append(_never(what, parameter.name, one.source, f"the body of `{name.id}` has none"))
            case ast.Constant(name) | ast.Region(name):
                if name.id not in by_anything:
                    kind = "constant" if isinstance(one.statement, ast.Constant) else "region"
                    out.append(_never(f"{kind} `{name.id}`", name, one.source, "nothing mentions it"))
            case _:
                pass
        for expr in ast.expressions(one.statement):
            out.extend(_variables(expr, scope, one.source))
    if bare is not None:
        out.extend(_variables(bare, scope, scope.source))
    return out


def _never(what: str, name: ast.Name, source: Source, label: str) -> Diagnostic:
    help_ = "remove it, or use it"
    return Diagnostic(f"the {what} is never used", name.span(source), label, help_, severity="warning")


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
    title = f"the {kind} `{name.id}` hides {what} of that name"
    label = f"here `{name.id}` means the {kind}"
    yield Diagnostic(title, name.span(source), label, "choose another name", severity="warning")


def _variables(root: ast.Expr, scope: Scope, source: Source) -> Iterator[Diagnostic]:
    stack: list[ast.Expr | ast.Argument] = [root]
    while stack:
        node = stack.pop()
        if isinstance(node, ast.Quantifier):
            inside = _free_names(node.body)
            for variable in node.variables:
                yield from _hidden(variable, "variable", scope, source)
                if variable.id not in inside:
                    label = "every round says the same"
                    yield _never(f"variable `{variable.id}`", variable, source, label)
        stack.extend(reversed(ast.children(node)))


def _free_names(root: ast.Expr) -> set[str]:
    names: set[str] = set()
    stack: list[ast.Expr | ast.Argument] = [root]
    while stack:
        node = stack.pop()
        if isinstance(node, ast.Name):
            names.add(node.id)
        stack.extend(ast.children(node))
    return names
