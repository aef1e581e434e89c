"""The syntax tree as text: the canonical print, on one line, and the formatter, over several and with comments.

Both take a tree apart into tokens and the places where a line may break: order, spelling, and the parentheses that are
needed. A `str` among the items is one token. Nothing here recurses: the depth of a formula is no concern.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable, Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

from scenegen.errors import Source, SpecError
from scenegen.lang.syntax import ast
from scenegen.lang.syntax.parse import parse
from scenegen.lang.syntax.tokens import KEYWORDS, TEMPORAL, Token, column, has_time, scan, spelling

PRINT_WIDTH = 100  # columns; a longer formula is broken before its outermost operators
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


def _enclose(
    opening: str, items: Iterable[Iterable[str | Mark | ExpressionPart]], closing: str, *, fill: bool = False
) -> Pieces:
    """Items separated by commas, between brackets."""
    yield opening
    filled = list(items)
    if filled:
        yield from (FILL if fill else OPEN, INWARD, EDGE)
        yield from _separate(filled)
        yield from (OUTWARD, EDGE)
    yield closing
    if filled:
        yield CLOSE


def _separate(items: Iterable[Iterable[str | Mark | ExpressionPart]]) -> Pieces:
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
            yield from _enclose("(", ([ExpressionPart(one, 0)] for one in coordinates), ")")
        case ast.List(items):
            yield from _enclose("[", ([ExpressionPart(one, 0)] for one in items), "]", fill=True)
        case ast.Weighted(items, weights):
            pairs = zip(items, weights, strict=True)
            weighed: Iterable[Iterable[str | Mark | ExpressionPart]] = (
                [ExpressionPart(one, IMPLIES), ":", SPACE, ExpressionPart(weight, SUM)] for one, weight in pairs
            )
            yield from _enclose("[", weighed, "]", fill=True)
        case ast.Call(function, arguments):
            yield function.id
            yield from _enclose("(", map(_argument, arguments), ")")
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
            word = "robot" if declarations[0].robot else "object"
            yield from (word, SPACE, FILL, INWARD, *_separate(map(_declaration, declarations)), OUTWARD, CLOSE)
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
        case ast.CameraDeclaration(name, eye, target, field, width, height):
            yield from ("camera", SPACE, name.id, SPACE, "=", SPACE, "at", SPACE, ExpressionPart(eye, POSTFIX), SPACE)
            yield from ("looks", SPACE, "at", SPACE, ExpressionPart(target, POSTFIX), SPACE, "fov", SPACE)
            yield from (ExpressionPart(field, SUM), ",", SPACE)
            yield from (ExpressionPart(width, SUM), ":", ExpressionPart(height, SUM))
        case ast.Usually(things):
            each = ([ExpressionPart(one, POSTFIX)] for one in things)
            yield from ("usually", SPACE, FILL, INWARD, *_separate(each), OUTWARD, CLOSE, SPACE, "~")
        case ast.Definition(name, parameters):
            yield from ("def", SPACE, name.id, *_enclose("(", map(_parameter, parameters), ")"), SPACE, "=")
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
        case ast.Region(_, shape) | ast.Usually(_, shape):
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
        yield from (SPACE, "at", SPACE, FILL, INWARD, *_separate(heights), OUTWARD, CLOSE)


def _interval(interval: ast.Interval) -> Pieces:
    yield from ("[", ExpressionPart(interval.lowest, SUM), ",", SPACE, ExpressionPart(interval.highest, SUM), "]")


def _window(window: ast.Interval | None) -> Pieces:
    if window is not None:
        yield from _interval(window)


def _declaration(one: ast.Declaration) -> Pieces:
    yield one.name.id
    if isinstance(one.count, ast.Weighted):
        yield ExpressionPart(one.count, POSTFIX)
    elif one.count is not None:
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


# Canonical text has one statement a line, one spelling per operator, no comments and only the parentheses it needs.
# Parsing it gives the same tree, so printing that again gives the same text.


def print_expr(expr: ast.Expr, demanded: int = 0) -> str:
    """The canonical text of an expression, on one line; in parentheses where it binds more loosely than demanded."""
    return flat(expand([ExpressionPart(expr, demanded)]))


def print_statement(statement: ast.Statement) -> str:
    """The canonical text of a statement; a long `&` or `|` at its top stands on lines of its own."""
    line = flat(expand(statement_pieces(statement)))
    end = tail(statement)
    if len(line) <= PRINT_WIDTH or end is None or not end.joins or not isinstance(end.node, ast.And | ast.Or):
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


# Tokens and marks as lines of limited width, comments (which do not count) where they were put.
#
# After Oppen, Prettyprinting (TOPLAS 2(4), 1980): the widths of all groups are summed up first, then one pass decides
# group by group, from the outermost inwards, whether its line breaks are taken. Linear in the number of items.


_NEVER = 1 << 40  # columns, more than any text has


MAX_INDENT = 60  # columns of indentation; what is nested deeper stands no further to the right


def break_lines(items: Sequence[Item], comments: Mapping[int, Sequence[tuple[str, bool]]]) -> list[str]:
    """The lines of a statement. `comments` maps the index of a break, which is then taken, to comments with whether
    each stands behind the line before it (only the first can) or on a line of its own."""
    widths = _widths(items, comments)
    lines: list[str] = []
    line: list[str] = []
    column = indent = 0
    groups: list[tuple[bool, bool]] = []  # whether it is broken, whether it is filled
    for index, item in enumerate(items):
        match item:
            case OpenGroup(fill):
                groups.append((column + widths[index] > PRINT_WIDTH, fill))
            case Close():
                groups.pop()
            case Indent(by):
                indent += by
            case Break(space):
                broken, fill = groups[-1] if groups else (False, False)
                if index in comments or (broken and not (fill and column + widths[index] <= PRINT_WIDTH)):
                    margin = " " * min(indent, MAX_INDENT)
                    for number, (comment, behind) in enumerate(comments.get(index, ())):
                        if number == 0 and behind:
                            line.append(f"  {comment}")
                        else:
                            lines.append("".join(line))
                            line = [margin, comment]
                    lines.append("".join(line))
                    line, column = [margin], len(margin)
                else:
                    line.append(space)
                    column += len(space)
            case _:
                text = item if isinstance(item, str) else item.flat
                line.append(text)
                column += len(text)
    return [*lines, "".join(line)]


def _widths(items: Sequence[Item], comments: Mapping[int, Sequence[tuple[str, bool]]]) -> list[int]:
    """For each opening of a group the width of the group on one line, for each break that of itself and what follows up
    to the next break of its group; both with what sticks to their end. Far too wide where a comment stands inside."""
    before = [0]  # the width of everything before an item
    for index, item in enumerate(items):
        width = len(item) if isinstance(item, str) else len(item.flat)
        before.append(before[-1] + (_NEVER if index in comments else width))
    reach = [before[-1]] * (len(items) + 1)  # the width of everything before the next break
    for index in range(len(items) - 1, -1, -1):
        reach[index] = before[index] if isinstance(items[index], Break) else reach[index + 1]
    widths = [0] * len(items)
    opened: list[tuple[int, int | None]] = []  # the group, its latest break
    for index, item in enumerate(items):
        if isinstance(item, OpenGroup):
            opened.append((index, None))
        elif isinstance(item, Break) and opened:
            group, latest = opened.pop()
            if latest is not None:
                widths[latest] = before[index] - before[latest]
            opened.append((group, index))
        elif isinstance(item, Close):
            for start in opened.pop():
                if start is not None:
                    widths[start] = reach[index] - before[start]
    return widths


# Canonical text that keeps comments and paragraphs (`scenegen fmt`, editors).
#
# A formula is laid out from the tree; comments are found by scanning the text. What ties the two together: apart from
# grouping parentheses, the tokens of a text and of its canonical form are one to one, so a comment is known by the
# number of tokens before it.


_OPERATORS = frozenset(("&", "|", "!", "->", "<=", ">=", "+", "-", "*", "/"))


class _Comment(NamedTuple):
    """`behind`: on a line that something stands on before it."""

    text: str
    behind: bool
    blank: bool
    column: int


@dataclass(frozen=True, slots=True)
class _Text:
    """The tokens of a text, without grouping parentheses, and the comments before each of them and at the end."""

    tokens: list[Token]
    comments: list[list[_Comment]]


def format_source(source: Source) -> str:
    """The text of a spec in canonical form, with its comments and paragraphs. Formatting that again changes nothing.

    Raises SpecError for a text that does not parse.
    """
    module = parse(source)
    text = _read(source.text)
    formatted = "\n".join(_lines(module, text, source.text)) + "\n"
    if formatted != source.text:  # never hand out a text that means something else
        try:
            again = parse(Source(source.name, formatted))
        except SpecError as error:
            raise AssertionError("the formatted text of this spec does not parse") from error
        if not ast.same(again, module) or _remarks(_read(formatted)) != _remarks(text):
            raise AssertionError("formatting would change the meaning of this spec or lose a comment")
    return formatted


def _read(text: str) -> _Text:
    timed = has_time(text)
    scanned = list(scan(text, timed=timed))
    dropped = _grouping(scanned, KEYWORDS | TEMPORAL if timed else KEYWORDS)
    tokens: list[Token] = []
    comments: list[list[_Comment]] = [[]]
    blank, opens = False, -1
    for index, token in enumerate(scanned):
        blank |= token.blank
        if index in dropped:
            opens = token.start if opens < 0 and token.text == "(" else opens
            continue
        if token.kind == "comment":
            behind = not token.first and bool(tokens) and not comments[-1]
            here = column(text, token.start) if token.first else 0
            comments[-1].append(_Comment(token.text.rstrip(), behind, blank, here))
        else:
            # a formula in parentheses opens with them
            tokens.append(token._replace(start=token.start if opens < 0 else opens, blank=blank))
            comments.append([])
            opens = -1
        blank = False
    return _Text(tokens, comments)


def _grouping(tokens: Sequence[Token], keywords: AbstractSet[str]) -> set[int]:
    """The indices of parentheses that leave no trace in the tree: not those of a call, nor those of a point."""
    found: set[int] = set()
    opened: list[tuple[int, bool]] = []  # the bracket, whether it groups
    before: Token | None = None
    variables = False  # between `forall` and `in`
    for index, token in enumerate(tokens):
        if token.kind == "comment":
            continue
        variables = token.text != "in" and (variables or spelling(token) in ("forall", "exists"))
        if token.text in ("(", "["):
            call = before is not None and before.kind == "name" and before.text not in keywords
            opened.append((index, token.text == "(" and not call))
        elif token.text == "," and opened and not variables:
            opened[-1] = (opened[-1][0], False)
        elif token.text in (")", "]"):
            start, groups = opened.pop()
            if groups:
                found |= {start, index}
        before = token
    return found


def _remarks(text: _Text) -> list[str]:
    return sorted(comment.text for gap in text.comments for comment in gap)


def _lines(module: ast.Module, text: _Text, raw: str) -> list[str]:
    """The lines of the file: statements, the comments between them, single empty lines where there were any."""
    lines: list[str] = []
    start = 0
    for items in _statements(module):
        words = [item for item in items if isinstance(item, str)]
        tokens = text.tokens[start : start + len(words)]
        if [spelling(token) for token in tokens] != words:
            raise AssertionError("the canonical text of a statement does not have the tokens of its source")
        opening = column(raw, tokens[0].start)
        lines += _own_lines(text.comments[start], opening, follows=start > 0, first=not lines)
        if tokens[0].blank and lines:
            lines.append("")
        above, inside, below = _place(items, words, text.comments[start + 1 : start + len(words)])
        start += len(words)
        below += [comment.text for comment in text.comments[start][:1] if comment.behind]
        statement = break_lines(items, inside)
        if below:
            statement[-1] += f"  {below[0]}"
        lines += [*above, *statement, *(" " * INDENT + comment for comment in below[1:])]
    return lines + _own_lines(text.comments[start], opening, follows=True, first=False)


def _statements(module: ast.Module) -> Iterator[list[Item]]:
    if module.bare is not None:
        joins = isinstance(module.bare, ast.And | ast.Or)
        yield [*expand([OPEN, ExpressionPart(module.bare, 0, indent=0, joins=joins), CLOSE])]
    for statement in module.statements:
        yield [*expand(statement_pieces(statement))]


def _own_lines(comments: Sequence[_Comment], opening: int, *, follows: bool, first: bool) -> list[str]:
    """Comments on lines of their own between statements, or at the end of the file.

    Those right below a statement that stand further to the right than the next one opens are taken for part of it.
    """
    lines: list[str] = []
    hanging = follows
    for comment in comments:
        if follows and comment.behind:
            continue  # written with the statement before
        hanging = hanging and not comment.blank and comment.column > opening
        if comment.blank and (lines or not first):
            lines.append("")
        lines.append(" " * INDENT * hanging + comment.text)
    return lines


def _place(
    items: Sequence[Item], words: Sequence[str], gaps: Sequence[Sequence[_Comment]]
) -> tuple[list[str], dict[int, list[tuple[str, bool]]], list[str]]:
    """Where the comments inside a statement go: above it, to one of its breaks, or below it.

    `gaps` are those after the first token, the second and so on. Where the canonical text has no break, a comment
    behind a line moves on to the next one, a comment on its own line back to the one before; what stands behind an
    operator at the end of a line is about what is before the operator.
    """
    breaks: dict[int, int] = {}  # how many tokens stand before a free break -> its index
    passed = 0
    for index, item in enumerate(items):
        if isinstance(item, str):
            passed += 1
        elif isinstance(item, Break) and item.free:
            breaks[passed] = index
    places = sorted(breaks)
    above: list[str] = []
    inside: dict[int, list[tuple[str, bool]]] = {}
    below: list[str] = []
    for gap, comments in enumerate(gaps, 1):
        after = bisect_left(places, gap)  # the first break here or later
        for comment in comments:
            chosen: int | None
            if gap in breaks:
                chosen = gap
            elif words[gap] == "," if not comment.behind else words[gap - 1] not in _OPERATORS:
                chosen = places[after] if after < len(places) else None
            else:
                chosen = places[after - 1] if after else 0
            if chosen is None:
                below.append(comment.text)
            elif chosen == 0:
                above.append(comment.text)
            else:
                inside.setdefault(breaks[chosen], []).append((comment.text, comment.behind))
    return above, inside, below
