"""Tokens and marks as lines of limited width, comments (which do not count) where they were put.

After Oppen, Prettyprinting (TOPLAS 2(4), 1980): the widths of all groups are summed up first, then one pass decides
group by group, from the outermost inwards, whether its line breaks are taken. Linear in the number of items, without
recursion.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from scenegen.lang.pieces import WIDTH, Break, Close, Indent, Item, Open

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
            case Open(fill):
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
        if isinstance(item, Open):
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
