"""The expressions below an expression or in a statement, in the order of the text."""

from __future__ import annotations

from scenegen.lang import ast


def children(node: ast.Expr | ast.Argument) -> tuple[ast.Expr | ast.Argument, ...]:
    """The expressions directly below an expression, in the order of the text. Names of members and calls are not."""
    match node:
        case ast.Call():
            return node.arguments
        case ast.Argument() | ast.Not() | ast.Negative():
            return (node.value,)
        case ast.And() | ast.Or():
            return node.parts
        case ast.Compare():
            return node.operands
        case ast.Binary():
            return (node.left, node.right)
        case ast.Implies():
            return (node.condition, node.consequence)
        case ast.Point():
            return node.coordinates
        case ast.List():
            return node.items
        case ast.Range():
            return (node.lowest, node.highest)
        case ast.Quantifier():
            return (node.domain, node.body)
        case ast.Member():
            return (node.base,)
        case ast.Index():
            return (node.base, node.index)
        case ast.Temporal():
            return (*_ends(node.window), node.value)
        case ast.Until():
            return (node.left, *_ends(node.window), node.right)
        case _:
            return ()


def _ends(window: ast.Interval | None) -> tuple[ast.Expr, ...]:
    return () if window is None else (window.lowest, window.highest)


def expressions(statement: ast.Statement) -> tuple[ast.Expr, ...]:
    """The expressions of a statement, in the order of the text."""
    match statement:
        case ast.Workspace(x, y):
            return (x.lowest, x.highest, y.lowest, y.highest)
        case ast.Objects(declarations):
            parts = (part for one in declarations for part in (one.count, one.shape, one.support, one.pose))
            return tuple(part for part in parts if part is not None)
        case ast.Definition(_, parameters, body):
            return (*(one.default for one in parameters if one.default is not None), body)
        case ast.Region(_, shape, count, levels):
            return (shape, *levels) if count is None else (count, shape, *levels)
        case ast.Constant():
            return (statement.value,)
        case ast.Import():
            return (statement.path,)
        case ast.Time():
            return (*_ends(statement.span_), statement.amount)
        case ast.Moves():
            return ()
        case _:
            return (statement.formula,)
