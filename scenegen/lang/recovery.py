"""Where to go on after a syntax error: at the next opening of a statement.

Every statement opens with a keyword or with `name:`. Newlines are white space to the parser, but people put statements
on lines of their own, and a broken text is read as people read it: what opens a line is trusted more than what stands
in the middle of one. A missed opening hides a mistake until the next run; a false one would report a mistake that is
none. So in doubt there is no opening.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

from scenegen.lang.tokens import KEYWORDS, STATEMENTS, Token, column, scan

_OPENS, _CLOSES = ("(", "[", "{"), (")", "]", "}")
_UNFINISHED = ("in", ".", "..")  # a name after one of these, then `:`, is the domain of a quantifier


def next_opening(text: str, begin: int, error: int) -> int | None:
    """The first statement opening after the one at `begin` that reaches beyond character `error`, where the parser
    stopped; None where no statement follows. Takes time linear in the distance."""
    for start, end in openings(text, scan(text, begin)):
        if start > begin and end > error:
            return start
    return None


def openings(text: str, scanned: Iterable[Token]) -> Iterator[tuple[int, int]]:
    """Statement openings among the tokens of a text, with the end of what makes them one; brackets that an earlier
    statement left open are forgotten at the next opening."""
    previous: Token | None = None
    depth = braces = quantifiers = 0
    tokens = (token for token in scanned if token.kind != "comment")
    token = next(tokens, None)
    while token is not None:
        following = next(tokens, None)
        label = following is not None and following.text == ":" and token.kind == "name" and token.text not in KEYWORDS
        if label:
            inside = braces > 0 or (not token.first and (depth > 0 or quantifiers > 0))
            opens = _opens_label(text, token, previous, inside)
        else:
            opens = token.text in STATEMENTS and _opens_keyword(text, token, previous, following)
        if opens:
            yield token.start, following.end if label and following is not None else token.end
            depth = braces = quantifiers = 0
        elif token.text in _OPENS:
            depth, braces = depth + 1, braces + (token.text == "{")
        elif token.text in _CLOSES:
            depth, braces = max(0, depth - 1), max(0, braces - (token.text == "}"))
        elif token.text in ("forall", "exists", "∀", "∃"):
            quantifiers += 1
        elif token.text == ":":
            quantifiers = max(0, quantifiers - 1)
        previous, token = token, following


def _opens_label(text: str, token: Token, previous: Token | None, inside: bool) -> bool:
    if token.first and column(text, token.start) == 0:
        return previous is None or previous.text not in _UNFINISHED
    return not inside and _can_end(previous)


def _opens_keyword(text: str, token: Token, previous: Token | None, following: Token | None) -> bool:
    after = following.text if following is not None else ""
    if token.text == "workspace":  # also a name in formulas: workspace.left
        return after == "[" or (token.first and (after in ("=", ":") or after[:1].isdigit()))
    if token.first and (column(text, token.start) == 0 or previous is None):
        return True
    return _can_end(previous) and (
        following is None or token.text == "require" or following.kind == ("text" if token.text == "import" else "name")
    )


def _can_end(previous: Token | None) -> bool:
    """Whether a statement may end with this token, mistakes such as a final `;` included."""
    if previous is None or previous.kind in ("number", "text"):
        return True
    if previous.kind == "name":
        return previous.text not in KEYWORDS or previous.text in ("true", "false", "workspace")
    return previous.text in (")", "]", "}", ";", "⊤", "⊥")


def blank(text: str, begin: int, end: int) -> str:
    """The text with characters begin..end made spaces, so that what follows keeps its place."""
    return text[:begin] + re.sub(r"[^\n]+", lambda found: " " * len(found[0]), text[begin:end]) + text[end:]
