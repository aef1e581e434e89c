"""The syntax tree as text: the canonical print, and the indented dump of golden files.

Canonical text has one statement a line, one spelling per operator, no comments and only the parentheses it needs.
Parsing it gives the same tree, so printing that again gives the same text. Both writers keep an explicit stack: the
depth of a formula is no concern of theirs.
"""

from __future__ import annotations

from dataclasses import fields

from scenegen.lang import ast
from scenegen.lang.pieces import AND, OR, WIDTH, Part, expand, flat, head, statement_pieces, tail


def print_expr(expr: ast.Expr, demanded: int = 0) -> str:
    """The canonical text of an expression, on one line; in parentheses where it binds more loosely than demanded."""
    return flat(expand([Part(expr, demanded)]))


def print_statement(statement: ast.Statement) -> str:
    """The canonical text of a statement; a long `&` or `|` at its top stands on lines of its own."""
    line = flat(expand(statement_pieces(statement)))
    end = tail(statement)
    if len(line) <= WIDTH or end is None or not end.joins or not isinstance(end.node, ast.And | ast.Or):
        return line
    symbol, looser = ("&", AND) if isinstance(end.node, ast.And) else ("|", OR)
    parts = [print_expr(part, looser + 1) for part in end.node.parts]
    return "\n".join(
        [flat(expand(head(statement))), f"    {parts[0]}", *(f"    {symbol} {part}" for part in parts[1:])]
    )


def print_module(module: ast.Module) -> str:
    """The canonical text of a spec, ending in a line break."""
    if module.bare is not None:
        return print_expr(module.bare) + "\n"
    return "".join(print_statement(statement) + "\n" for statement in module.statements)


def dump(module: ast.Module, *, places: bool = False) -> str:
    """The tree, one node a line, indented; with `places`, each node's character range. For golden files."""
    out: list[str] = []
    roots: list[ast.Node] = list(module.statements) if module.bare is None else [module.bare]
    stack: list[tuple[ast.Node, int, str]] = [(node, 0, "") for node in reversed(roots)]
    while stack:
        node, depth, role = stack.pop()
        below: list[tuple[ast.Node, int, str]] = []
        words = [type(node).__name__]
        for item in fields(node):
            value = getattr(node, item.name)
            if item.name in ("start", "end"):
                continue
            if isinstance(value, ast.Node):
                below.append((value, depth + 1, item.name))
            elif isinstance(value, tuple) and any(isinstance(part, ast.Node) for part in value):
                below.extend((part, depth + 1, item.name) for part in value)
            elif value is not None and value != ():
                words.append(
                    " ".join(value)
                    if isinstance(value, tuple)
                    else repr(value)
                    if isinstance(value, str)
                    else str(value)
                )
        where = f" @{node.start}-{node.end}" if places else ""
        out.append("  " * depth + (f"{role}: " if role else "") + " ".join(words) + where)
        stack.extend(reversed(below))
    return "\n".join(out) + "\n"
