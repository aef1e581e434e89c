"""The canonical text of a spec, which scene and model files carry: all it needs, in one piece.

Imports are replaced by what they import, and the outline of a URDF or mesh file stands beside its path: the text
means the same wherever it is read again.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from scenegen.assets import Shape
from scenegen.errors import Source
from scenegen.lang import ast
from scenegen.lang.category import WORD, Category, picked
from scenegen.lang.imports import Placed
from scenegen.lang.print import print_module
from scenegen.lang.resolve import FILES
from scenegen.lang.scope import Scope
from scenegen.primitives.footprint import Box, Circle, Footprint


def canonical(
    placed: Sequence[Placed],
    bare: ast.Expr | None,
    scope: Scope,
    shapes: Sequence[Shape],
    counts: Mapping[str, int],
    kinds: Mapping[str, Category],
) -> str:
    """The canonical text; `shapes` has one entry per object, `counts` the numbers of things that are drawn no more,
    `kinds` the categories of objects."""
    statements = tuple(
        _resolved(one.statement, scope, shapes, counts, kinds)
        if isinstance(one.statement, ast.Objects)
        else one.statement
        for one in placed
    )
    return print_module(ast.Module(Source("", ""), statements, bare))


def _resolved(
    statement: ast.Objects,
    scope: Scope,
    shapes: Sequence[Shape],
    counts: Mapping[str, int],
    kinds: Mapping[str, Category],
) -> ast.Objects:
    """The statement with every file's outline written out, and every number that is drawn no more."""
    declarations = []
    for one in statement.declarations:
        if isinstance(one.count, ast.Range) and one.name.id in counts:
            count = ast.Quantity(str(counts[one.name.id]), "")
            one = ast.Declaration(one.name, count, one.shape, one.pose, one.support, one.choice)
        call = one.shape
        if isinstance(call, ast.Call) and call.function.id in FILES:
            place = scope.arrays.get(one.name.id, (scope.objects.get(one.name.id, 0),))[0]
            looks = shapes[place]
            arguments = (ast.Argument(None, ast.Text(looks.path)), ast.Argument(None, _outline(looks)))
            one = ast.Declaration(
                one.name, one.count, ast.Call(call.function, arguments), one.pose, one.support, one.choice
            )
        if one.name.id in kinds:
            shape = _category(
                kinds[one.name.id], picked(one.name.id, kinds[one.name.id], one.count is not None, counts)
            )
            one = ast.Declaration(one.name, one.count, shape, one.pose, one.support, one.choice)
        declarations.append(one)
    return ast.Objects(tuple(declarations))


def _category(kind: Category, picks: Sequence[int]) -> ast.Call:
    """The category with its assets and their outlines; with what is drawn no more."""
    function, asset = ast.Name(WORD), ast.Name("asset")
    each = [
        ast.Call(asset, (ast.Argument(None, ast.Text(one.path)), ast.Argument(None, _outline(one))))
        for one in kind.assets
    ]
    arguments = [ast.Argument(None, ast.Text(kind.path)), ast.Argument(None, ast.List(tuple(each)))]
    if any(picks):
        arguments.append(ast.Argument(None, ast.List(tuple(ast.Quantity(str(pick), "") for pick in picks))))
    return ast.Call(function, tuple(arguments))


def _outline(looks: Shape) -> ast.Call:
    kind, numbers = _measures(looks.footprint)
    parts = [*numbers, _number(looks.height)]
    return ast.Call(ast.Name(kind), tuple(ast.Argument(None, part) for part in parts))


def _measures(footprint: Footprint) -> tuple[str, list[ast.Expr]]:
    match footprint:
        case Circle(radius):
            return "cylinder", [_number(radius)]
        case Box(length, width):
            return "box", [_number(length), _number(width)]
        case _:
            corners = tuple(ast.Point((_number(x), _number(y))) for x, y in footprint.vertices)
            return "prism", [ast.List(corners)]


def _number(value: float) -> ast.Expr:
    written = ast.Quantity(repr(abs(value)), "")
    return ast.Negative(written) if value < 0.0 else written
