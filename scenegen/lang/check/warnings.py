"""Warnings about what is written: names that are never used, that hide something else or are misspelt, and sizes
without a unit that are hardly metres."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from scenegen.errors import Diagnostic, Source
from scenegen.errors.declarations import STANDS_IN, UNLIKELY_SHAPE
from scenegen.errors.language import HIDDEN_NAME, UNUSED_NAME
from scenegen.lang.check.declare import LARGE, OUTLINES
from scenegen.lang.check.draft import Draft
from scenegen.lang.check.scope import Scope
from scenegen.lang.syntax import ast
from scenegen.lang.syntax import ast as traversal
from scenegen.things import meant_by

WIDE = 10.0  # metres: a table is shorter
SMALL = 0.5  # numbers below this are metres, whatever the others are


def unused(draft: Draft) -> list[Diagnostic]:
    """The warnings of the spec's own statements, in the order of the text."""
    scope, placed, bare = draft.scope, draft.placed, draft.module.bare
    by_formulas, by_anything = draft.used, draft.lowering.used  # what definitions use is no use of formulas
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
            out.extend(_shadowing(expr, scope, one.source))
    if bare is not None:
        out.extend(_shadowing(bare, scope, scope.source))
    return [*out, *_misspelt(scope), *_centimetres(draft)]


def _misspelt(scope: Scope) -> Iterator[Diagnostic]:
    """Objects without a shape whose names are nearly those of the library."""
    for name, thing in scope.things.items():
        shapeless = thing.declaration is None or thing.declaration.shape is None
        meant = meant_by(name) if shapeless and scope.is_own(thing.source) else None
        if meant is not None:
            inferred = thing.declaration is None or None
            yield STANDS_IN(thing.name.span(thing.source), name=name, meant=meant, inferred=inferred)


def _centimetres(draft: Draft) -> Iterator[Diagnostic]:
    """Shapes, regions and a workspace with bare numbers that are too large for metres."""
    scope, space = draft.scope, draft.space
    far = max(LARGE, *map(abs, (*space.x, *space.y)))
    for one in draft.placed:
        measured: list[tuple[ast.Expr | ast.Workspace, float]] = []
        match one.statement:
            case ast.Objects(declarations):
                measured = [(each.shape, far) for each in declarations if isinstance(each.shape, ast.Call)]
                measured = [(node, most) for node, most in measured if _named(node) in OUTLINES]
            case ast.Region(shape=ast.Call() as shape):
                measured = [(shape, far)]
            case ast.Workspace() if max(space.x[1] - space.x[0], space.y[1] - space.y[0]) > WIDE:
                measured = [(one.statement, WIDE)]
        for node, most in measured if scope.is_own(one.source) else ():
            here = node.span(one.source)
            numbers = [
                (part.start - here.start, part.end - here.start, abs(float(part.number)), part.number)
                for root in (traversal.expressions(node) if isinstance(node, ast.Workspace) else (node,))
                for part in _quantities(root)
                if not part.unit and abs(float(part.number)) >= SMALL
            ]
            *_, largest, written = max(numbers, key=lambda number: number[2], default=(0, 0, 0.0, ""))
            if largest > most:
                mended, unit = here.text, "cm" if largest <= 100.0 * most else "mm"
                for _, end, _, _ in sorted(numbers, reverse=True):
                    mended = f"{mended[:end]} {unit}{mended[end:]}"
                facts = {"largest": largest, "mended": mended, "written": written}
                yield replace(UNLIKELY_SHAPE(here, **facts), severity="warning")


def _named(node: object) -> str:
    return node.function.id if isinstance(node, ast.Call) else ""


def _quantities(root: ast.Expr) -> Iterator[ast.Quantity]:
    """Its numbers, but factors and divisors: these are no lengths."""
    stack: list[ast.Expr | ast.Argument] = [root]
    while stack:
        node = stack.pop()
        if isinstance(node, ast.Binary) and node.operator in "*/":
            continue
        if isinstance(node, ast.Quantity):
            yield node
        stack.extend(traversal.children(node))


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


def _shadowing(root: ast.Expr, scope: Scope, source: Source) -> Iterator[Diagnostic]:
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
