"""The syntax tree as text: the canonical print, and the indented dump of golden files.

Canonical text has one statement a line, one spelling per operator, no comments and only the parentheses it needs.
Parsing it gives the same tree, so printing that again gives the same text. Both writers keep an explicit stack: the
depth of a formula is no concern of theirs.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import fields

from scenegen.lang import ast

LINE = 100  # a longer formula is broken before its outermost operators

# binding strength, loosest first; a part is put in parentheses where it binds more loosely than its place demands
_IMPLIES, _OR, _AND, _NOT, _COMPARE, _SUM, _TERM, _UNARY, _POSTFIX = range(1, 10)

_Item = str | tuple[ast.Expr | ast.Argument, int]


def _strength(node: ast.Expr | ast.Argument) -> int:
    match node:
        case ast.Quantifier():
            return 0  # reaches to the right as far as it can: always in parentheses inside another formula
        case ast.Implies():
            return _IMPLIES
        case ast.Or():
            return _OR
        case ast.And():
            return _AND
        case ast.Not():
            return _NOT
        case ast.Compare():
            return _COMPARE
        case ast.Binary(operator="+" | "-"):
            return _SUM
        case ast.Binary():
            return _TERM
        case ast.Negative():
            return _UNARY
        case _:
            return _POSTFIX


def _join(parts: Iterable[ast.Expr | ast.Argument], strength: int, by: str) -> Iterator[_Item]:
    for number, part in enumerate(parts):
        if number:
            yield by
        yield part, strength


def _pieces(node: ast.Expr | ast.Argument) -> Iterator[_Item]:
    """A node as text and smaller nodes, each with the strength that its place demands."""
    match node:
        case ast.Name(id):
            yield id
        case ast.Quantity(number, unit):
            yield f"{number} {unit}" if unit else number
        case ast.Text(value):
            yield f'"{value}"'
        case ast.Truth(value):
            yield "true" if value else "false"
        case ast.Point(coordinates):
            yield "("
            yield from _join(coordinates, 0, ", ")
            yield ")"
        case ast.List(items):
            yield "["
            yield from _join(items, 0, ", ")
            yield "]"
        case ast.Call(function, arguments):
            yield f"{function.id}("
            yield from _join(arguments, 0, ", ")
            yield ")"
        case ast.Argument(name, value):
            if name is not None:
                yield f"{name.id} = "
            yield value, 0
        case ast.Member(base, member):
            yield base, _POSTFIX
            yield f".{member.id}"
        case ast.Index(base, index):
            # `workspace [` opens a statement
            yield base, _POSTFIX + (base == ast.Name("workspace"))
            yield "["
            yield index, _SUM
            yield "]"
        case ast.Negative(value):
            yield "-"
            yield value, _UNARY
        case ast.Binary(operator, left, right):
            strength = _strength(node)
            yield left, strength
            yield f" {operator} "
            yield right, strength + 1  # left-associative
        case ast.Compare(operands, operators):
            for position, operand in enumerate(operands):
                if position:
                    yield f" {operators[position - 1]} "
                yield operand, _SUM
        case ast.Not(value):
            yield "!"
            # `!a <= b` means !(a <= b), but nobody reads it so
            yield value, _POSTFIX if isinstance(value, ast.Compare) else _NOT
        case ast.And(parts):
            yield from _join(parts, _AND + 1, " & ")
        case ast.Or(parts):
            yield from _join(parts, _OR + 1, " | ")
        case ast.Implies(condition, consequence):
            yield condition, _IMPLIES + 1
            yield " -> "
            yield consequence, _IMPLIES
        case ast.Range(lowest, highest):
            yield lowest, _SUM
            yield ".."
            yield highest, _SUM
        case ast.Quantifier(kind, variables, domain, body):
            yield f"{kind} {', '.join(variable.id for variable in variables)} in "
            yield domain, _SUM if not isinstance(domain, ast.Range) else 0
            yield ": "
            yield body, 0


def print_expr(expr: ast.Expr, strength: int = 0) -> str:
    """The canonical text of an expression, on one line; in parentheses where it binds more loosely than `strength`."""
    out: list[str] = []
    stack: list[_Item] = [(expr, strength)]
    while stack:
        item = stack.pop()
        if isinstance(item, str):
            out.append(item)
            continue
        node, demanded = item
        pieces = list(_pieces(node))
        if _strength(node) < demanded:
            pieces = ["(", *pieces, ")"]
        stack.extend(reversed(pieces))
    return "".join(out)


def _formula(head: str, expr: ast.Expr) -> str:
    """A statement that ends in a formula; a long `&` or `|` at its top stands on lines of its own."""
    line = f"{head} {print_expr(expr)}"
    if len(line) <= LINE or not isinstance(expr, ast.And | ast.Or):
        return line
    symbol, strength = ("&", _AND) if isinstance(expr, ast.And) else ("|", _OR)
    parts = [
        f"({text})" if _strength(part) <= strength else text
        for part, text in ((part, print_expr(part)) for part in expr.parts)
    ]
    return "\n".join([f"{head}", f"    {parts[0]}", *(f"    {symbol} {part}" for part in parts[1:])])


def _interval(interval: ast.Interval) -> str:
    return f"[{print_expr(interval.lowest, _SUM)}, {print_expr(interval.highest, _SUM)}]"


def _declaration(one: ast.Declaration) -> str:
    count = f"[{print_expr(one.count, _SUM)}]" if one.count is not None else ""
    shape = f" = {print_expr(one.shape, _POSTFIX)}" if one.shape is not None else ""
    pose = f" at {print_expr(one.pose, _POSTFIX)}" if one.pose is not None else ""
    return f"{one.name.id}{count}{shape}{pose}"


def _parameter(one: ast.Parameter) -> str:
    return one.name.id if one.default is None else f"{one.name.id} = {print_expr(one.default, _SUM)}"


def print_statement(statement: ast.Statement) -> str:
    """The canonical text of a statement."""
    match statement:
        case ast.Workspace(x, y):
            return f"workspace {_interval(x)} x {_interval(y)}"
        case ast.Objects(declarations):
            return f"object {', '.join(_declaration(one) for one in declarations)}"
        case ast.Region(name, shape):
            return f"region {name.id} = {print_expr(shape, _POSTFIX)}"
        case ast.Constant(name, value):
            return f"const {name.id} = {print_expr(value, _SUM)}"
        case ast.Definition(name, parameters, body):
            return _formula(f"def {name.id}({', '.join(map(_parameter, parameters))}) =", body)
        case ast.Require(formula):
            return _formula("require", formula)
        case ast.Import(path):
            return f"import {print_expr(path)}"
        case ast.Label(name, formula):
            return _formula(f"{name.id}:", formula)


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
