"""Every construct of the language as tokens and the places where a line may break.

What the canonical print (scenegen.lang.syntax.pieces, on one line) and the formatter (scenegen.lang.syntax.format, over
several) have in common: order, spelling, and the parentheses that are needed. A `str` among the items is one token.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields
from typing import ClassVar, NamedTuple

from scenegen.lang.syntax import ast

WIDTH = 100  # columns; a longer formula is broken before its outermost operators
INDENT = 4

# binding strength, loosest first; a part is put in parentheses where it binds more loosely than its place demands
IMPLIES, OR, AND, UNTIL, NOT, COMPARE, SUM, TERM, UNARY, POSTFIX = range(1, 11)


@dataclass(frozen=True, slots=True)
class Filler:
    """Text that is no token: a space, a grouping parenthesis."""

    flat: str


@dataclass(frozen=True, slots=True)
class Break:
    """A place where a line may end; `flat` where it does not. Comments may stand there if `free`."""

    flat: str
    free: bool = True


@dataclass(frozen=True, slots=True)
class OpenGroup:
    """Opens a group: all its breaks are taken or none; in a `fill` group only those that the width asks for."""

    fill: bool = False
    flat: ClassVar[str] = ""


@dataclass(frozen=True, slots=True)
class Close:
    flat: ClassVar[str] = ""


@dataclass(frozen=True, slots=True)
class Indent:
    """Lines that begin after this one stand `by` columns further to the right."""

    by: int
    flat: ClassVar[str] = ""


class ExpressionPart(NamedTuple):
    """An expression that is still to be taken apart, with the strength its place demands. Lines after its first are
    `indent` columns to the right of it; with `joins`, its breaks belong to the group around it."""

    node: ast.Expr | ast.Argument
    demands: int
    indent: int = INDENT
    joins: bool = False


Mark = Filler | Break | OpenGroup | Close | Indent
Item = str | Mark
Pieces = Iterator[str | Mark | ExpressionPart]

SPACE, LINE, EDGE, OPEN, FILL, CLOSE = Filler(" "), Break(" "), Break(""), OpenGroup(), OpenGroup(fill=True), Close()
INWARD, OUTWARD = Indent(INDENT), Indent(-INDENT)
_PARENTHESIS = (OPEN, Filler("("), INWARD, Break("", free=False))
_CLOSING = (OUTWARD, Break("", free=False), Filler(")"), CLOSE)


def strength(node: ast.Expr | ast.Argument) -> int:
    """How tightly a node holds its parts together; 0 for a quantifier, which reaches as far right as it can and so
    stands in parentheses inside any other formula."""
    match node:
        case ast.Quantifier():
            return 0
        case ast.Implies():
            return IMPLIES
        case ast.Or():
            return OR
        case ast.And():
            return AND
        case ast.Until():
            return UNTIL
        case ast.Not() | ast.Temporal():
            return NOT
        case ast.Compare():
            return COMPARE
        case ast.Binary(operator="+" | "-"):
            return SUM
        case ast.Binary():
            return TERM
        case ast.Negative():
            return UNARY
        case _:
            return POSTFIX


def expand(pieces: Iterable[str | Mark | ExpressionPart]) -> Iterator[Item]:
    """Pieces with every part taken apart, down to tokens and marks; the depth of a formula is no concern."""
    stack = [*pieces]
    stack.reverse()
    while stack:
        piece = stack.pop()
        if type(piece) is not ExpressionPart:
            yield piece  # type: ignore[misc]
        elif strength(piece.node) < piece.demands:
            stack.extend(reversed((*_PARENTHESIS, ExpressionPart(piece.node, 0, indent=0), *_CLOSING)))
        else:
            stack.extend(reversed([*_pieces(piece)]))


def flat(items: Iterable[Item]) -> str:
    """Tokens and marks on one line."""
    return "".join(item if isinstance(item, str) else item.flat for item in items)


def _operation(
    part: ExpressionPart, operands: Iterable[ExpressionPart], operators: Iterable[str], *, fill: bool = False
) -> Pieces:
    """Operands separated by operators; a line breaks before an operator."""
    if not part.joins:
        yield FILL if fill else OPEN
    signs = iter(operators)
    for number, operand in enumerate(operands):
        if number:
            yield from (Indent(part.indent), LINE, next(signs), SPACE, operand, Indent(-part.indent))
        else:
            yield operand
    if not part.joins:
        yield CLOSE


def _enclosed(
    opening: str, items: Iterable[Iterable[str | Mark | ExpressionPart]], closing: str, *, fill: bool = False
) -> Pieces:
    """Items separated by commas, between brackets."""
    yield opening
    filled = list(items)
    if filled:
        yield from (FILL if fill else OPEN, INWARD, EDGE)
        yield from _listed(filled)
        yield from (OUTWARD, EDGE)
    yield closing
    if filled:
        yield CLOSE


def _listed(items: Iterable[Iterable[str | Mark | ExpressionPart]]) -> Pieces:
    for number, item in enumerate(items):
        if number:
            yield from (",", LINE)
        yield from item


def _argument(argument: ast.Argument) -> Pieces:
    if argument.name is not None:
        yield from (argument.name.id, SPACE, "=", SPACE)
    yield ExpressionPart(argument.value, 0)


def _pieces(part: ExpressionPart) -> Pieces:
    """A node as tokens, marks and smaller parts."""
    node = part.node
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
            yield from _enclosed("(", ([ExpressionPart(one, 0)] for one in coordinates), ")")
        case ast.List(items):
            yield from _enclosed("[", ([ExpressionPart(one, 0)] for one in items), "]", fill=True)
        case ast.Call(function, arguments):
            yield function.id
            yield from _enclosed("(", map(_argument, arguments), ")")
        case ast.Argument():
            yield from _argument(node)
        case ast.Member(base, member):
            yield from (ExpressionPart(base, POSTFIX), ".", member.id)
        case ast.Index(base, index):
            # `workspace [` opens a statement
            yield ExpressionPart(base, POSTFIX + (base == ast.Name("workspace")))
            yield from ("[", ExpressionPart(index, SUM), "]")
        case ast.Negative(value):
            yield from ("-", ExpressionPart(value, UNARY, part.indent))
        case ast.Binary(operator, left, right):
            own = strength(node)  # left-associative
            joined = ExpressionPart(left, own, part.indent, joins=strength(left) == own)
            yield from _operation(part, [joined, ExpressionPart(right, own + 1)], [operator], fill=True)
        case ast.Compare(operands, operators):
            yield from _operation(part, [ExpressionPart(one, SUM) for one in operands], operators)
        case ast.Not(value):
            # `!a <= b` means !(a <= b), but nobody reads it so
            yield from ("!", ExpressionPart(value, POSTFIX if isinstance(value, ast.Compare) else NOT, part.indent))
        case ast.Temporal(word, window, value):
            yield from (word, *_window(window), SPACE)
            yield ExpressionPart(value, POSTFIX if isinstance(value, ast.Compare) else NOT, part.indent)
        case ast.Until(word, window, left, right):
            last = ExpressionPart(right, UNTIL, part.indent, joins=isinstance(right, ast.Until))
            if not part.joins:
                yield OPEN
            yield from (ExpressionPart(left, UNTIL + 1), Indent(part.indent), LINE, word, *_window(window), SPACE, last)
            yield from (Indent(-part.indent), *(() if part.joins else (CLOSE,)))
        case ast.And(parts):
            yield from _operation(part, [ExpressionPart(one, AND + 1) for one in parts], ["&"] * len(parts))
        case ast.Or(parts):
            yield from _operation(part, [ExpressionPart(one, OR + 1) for one in parts], ["|"] * len(parts))
        case ast.Implies(condition, consequence):
            after = ExpressionPart(consequence, IMPLIES, part.indent, joins=isinstance(consequence, ast.Implies))
            yield from _operation(part, [ExpressionPart(condition, IMPLIES + 1), after], ["->"])
        case ast.Range(lowest, highest):
            yield from (ExpressionPart(lowest, SUM), "..", ExpressionPart(highest, SUM))
        case ast.Quantifier(kind, variables, domain, body):
            yield from (OPEN, kind, SPACE)
            yield from _listed_flat(variable.id for variable in variables)
            yield from (SPACE, "in", SPACE, ExpressionPart(domain, 0 if isinstance(domain, ast.Range) else SUM), ":")
            yield from (INWARD, LINE, ExpressionPart(body, 0, indent=0), OUTWARD, CLOSE)


def _listed_flat(names: Iterable[str]) -> Pieces:
    for number, name in enumerate(names):
        if number:
            yield from (",", SPACE)
        yield name


# ---- statements ----------------------------------------------------------------------------------------------------


def head(statement: ast.Statement) -> Pieces:
    """What opens a statement: all but the formula or value it ends in."""
    match statement:
        case ast.Workspace(x, y):
            yield from (
                "workspace",
                SPACE,
                *_interval(x),
                OPEN,
                INWARD,
                LINE,
                "x",
                SPACE,
                *_interval(y),
                OUTWARD,
                CLOSE,
            )
        case ast.Objects(declarations):
            yield from ("object", SPACE, FILL, INWARD, *_listed(map(_declaration, declarations)), OUTWARD, CLOSE)
        case ast.Region(name, _, count):
            yield from (
                "region",
                SPACE,
                name.id,
                *(() if count is None else ("[", ExpressionPart(count, SUM), "]")),
                SPACE,
                "=",
            )
        case ast.Constant(name):
            yield from ("const", SPACE, name.id, SPACE, "=")
        case ast.Definition(name, parameters):
            yield from ("def", SPACE, name.id, *_enclosed("(", map(_parameter, parameters), ")"), SPACE, "=")
        case ast.Require():
            yield "require"
        case ast.Import(path):
            yield from ("import", SPACE, f'"{path.value}"')
        case ast.Label(name):
            yield from (name.id, ":")
        case ast.Time(amount, word, span) if span is None:
            yield from ("time", SPACE, ExpressionPart(amount, SUM), SPACE, "steps" if word is None else word.id)
        case ast.Time(amount, _, span):
            yield from ("time", SPACE, *_window(span), SPACE, "every", SPACE, ExpressionPart(amount, SUM))
        case ast.Moves(which):
            yield from ("moves", SPACE, which.id)


def tail(statement: ast.Statement) -> ExpressionPart | None:
    """The formula or value that a statement ends in."""
    match statement:
        case ast.Definition(_, _, formula) | ast.Require(formula) | ast.Label(_, formula):
            return ExpressionPart(formula, 0, indent=0, joins=isinstance(formula, ast.And | ast.Or))
        case ast.Constant(_, value):
            return ExpressionPart(value, SUM, indent=0)
        case ast.Region(_, shape):
            return ExpressionPart(shape, POSTFIX, indent=0)
        case _:
            return None


def statement_pieces(statement: ast.Statement) -> Pieces:
    """A statement; where it is long, its formula stands below its head."""
    yield from head(statement)
    end = tail(statement)
    if end is not None:
        yield from (OPEN, INWARD, LINE, end, OUTWARD, CLOSE)
    if isinstance(statement, ast.Region) and statement.levels:
        heights = ([ExpressionPart(one, SUM)] for one in statement.levels)
        yield from (SPACE, "at", SPACE, FILL, INWARD, *_listed(heights), OUTWARD, CLOSE)


def _interval(interval: ast.Interval) -> Pieces:
    yield from ("[", ExpressionPart(interval.lowest, SUM), ",", SPACE, ExpressionPart(interval.highest, SUM), "]")


def _window(window: ast.Interval | None) -> Pieces:
    if window is not None:
        yield from _interval(window)


def _declaration(one: ast.Declaration) -> Pieces:
    yield one.name.id
    if one.count is not None:
        yield from ("[", ExpressionPart(one.count, 0 if isinstance(one.count, ast.Range) else SUM), "]")
    if one.shape is not None:
        of = isinstance(one.shape, ast.Call) and one.shape.function.id == "category"
        yield from (SPACE, "of" if of else "=", SPACE, ExpressionPart(one.shape, POSTFIX))
    if one.support is not None:
        yield from (
            SPACE,
            "on",
            SPACE,
            *(("any", SPACE, "of", SPACE) if one.choice else ()),
            ExpressionPart(one.support, POSTFIX),
        )
        if one.choice == "area":
            yield from (SPACE, "by", SPACE, "area")
    if one.pose is not None:
        yield from (SPACE, "at", SPACE, ExpressionPart(one.pose, POSTFIX))


def _parameter(one: ast.Parameter) -> Pieces:
    yield one.name.id
    if one.default is not None:
        yield from (SPACE, "=", SPACE, ExpressionPart(one.default, SUM))


# --------------------------------------------------------------------------------------------------------------------
# The syntax tree as text: the canonical print, and the indented dump of golden files.
#
# Canonical text has one statement a line, one spelling per operator, no comments and only the parentheses it needs.
# Parsing it gives the same tree, so printing that again gives the same text. Both writers keep an explicit stack: the
# depth of a formula is no concern of theirs.


def print_expr(expr: ast.Expr, demanded: int = 0) -> str:
    """The canonical text of an expression, on one line; in parentheses where it binds more loosely than demanded."""
    return flat(expand([ExpressionPart(expr, demanded)]))


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
