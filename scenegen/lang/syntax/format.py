"""The formatter: canonical text that keeps comments and paragraphs (`scenegen fmt`, editors).

A formula is laid out from the tree, as in scenegen.lang.syntax.pieces, and broken over lines where it is long. Comments
are found by scanning the text. What ties the two together: apart from grouping parentheses, the tokens of a text and of
its canonical form are one to one, so a comment is known by the number of tokens before it.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

from scenegen.errors import Source, SpecError
from scenegen.lang.syntax import ast
from scenegen.lang.syntax.parse import parse
from scenegen.lang.syntax.pieces import (
    CLOSE,
    INDENT,
    OPEN,
    WIDTH,
    Break,
    Close,
    ExpressionPart,
    Indent,
    Item,
    OpenGroup,
    expand,
    statement_pieces,
)
from scenegen.lang.syntax.tokens import KEYWORDS, TEMPORAL, Token, column, has_time, scan, spelling

# --------------------------------------------------------------------------------------------------------------------
# Tokens and marks as lines of limited width, comments (which do not count) where they were put.
#
# After Oppen, Prettyprinting (TOPLAS 2(4), 1980): the widths of all groups are summed up first, then one pass decides
# group by group, from the outermost inwards, whether its line breaks are taken. Linear in the number of items,
# without recursion.


_NEVER = 1 << 40  # columns, more than any text has
DEEPEST = 60  # columns of indentation; what is nested deeper stands no further to the right


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
                groups.append((column + widths[index] > WIDTH, fill))
            case Close():
                groups.pop()
            case Indent(by):
                indent += by
            case Break(space):
                broken, fill = groups[-1] if groups else (False, False)
                if index in comments or (broken and not (fill and column + widths[index] <= WIDTH)):
                    margin = " " * min(indent, DEEPEST)
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
        if not _same(again, module) or _remarks(_read(formatted)) != _remarks(text):
            raise AssertionError("formatting would change the meaning of this spec or lose a comment")
    return formatted


# ---- reading -------------------------------------------------------------------------------------------------------


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


def _same(one: ast.Module, other: ast.Module) -> bool:
    """Whether two modules say the same; unlike `==` without recursion."""
    stack: list[tuple[Any, Any]] = [((one.statements, one.bare), (other.statements, other.bare))]
    while stack:
        first, second = stack.pop()
        if type(first) is not type(second):
            return False
        if isinstance(first, tuple):
            if len(first) != len(second):
                return False
            stack.extend(zip(first, second, strict=True))
        elif isinstance(first, ast.Node):
            names = (item.name for item in fields(first) if item.compare)
            stack.extend((getattr(first, name), getattr(second, name)) for name in names)
        elif first != second:
            return False
    return True


# ---- writing -------------------------------------------------------------------------------------------------------


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
        lines += _between(text.comments[start], opening, follows=start > 0, first=not lines)
        if tokens[0].blank and lines:
            lines.append("")
        above, inside, below = _place(items, words, text.comments[start + 1 : start + len(words)])
        start += len(words)
        below += [comment.text for comment in text.comments[start][:1] if comment.behind]
        statement = break_lines(items, inside)
        if below:
            statement[-1] += f"  {below[0]}"
        lines += [*above, *statement, *(" " * INDENT + comment for comment in below[1:])]
    return lines + _between(text.comments[start], opening, follows=True, first=False)


def _statements(module: ast.Module) -> Iterator[list[Item]]:
    if module.bare is not None:
        joins = isinstance(module.bare, ast.And | ast.Or)
        yield [*expand([OPEN, ExpressionPart(module.bare, 0, indent=0, joins=joins), CLOSE])]
    for statement in module.statements:
        yield [*expand(statement_pieces(statement))]


def _between(comments: Sequence[_Comment], opening: int, *, follows: bool, first: bool) -> list[str]:
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
