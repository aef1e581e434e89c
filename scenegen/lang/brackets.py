"""Brackets that are open, close nothing, or have nothing inside."""

from __future__ import annotations

import re

from scenegen.errors import Diagnostic, Source, Span
from scenegen.errors.syntax import CLOSES_NOTHING, NOTHING_INSIDE, UNCLOSED_BRACKET, WRONG_BRACKET

BINARY = ("&", "|", "->", "<=", ">=", "!=", "<", ">", "+", "*", "/", "∧", "∨", "→", "≤", "≥", "≠")
_CLOSED = {"(": ")", "[": "]"}
_CLOSING = {closing: opening for opening, closing in _CLOSED.items()}
_TOKEN = re.compile(r'#[^\n]*|"[^"\n]*"|\s+|.', re.DOTALL)


def open_brackets(text: str, end: int) -> tuple[list[int], int | None]:
    """Offsets of the brackets open at `end`, and the offset of the first one that closes nothing."""
    stack: list[int] = []
    for match in _TOKEN.finditer(text, 0, end):
        char = match[0]
        if char in "([":
            stack.append(match.start())
        elif char in _CLOSING:
            if not stack or text[stack[-1]] != _CLOSING[char]:
                return stack, match.start()
            stack.pop()
    return stack, None


def bracket(source: Source, start: int) -> Diagnostic | None:
    """What is wrong with a closing bracket at `start`; None for other characters."""
    text = source.text
    if text[start] not in _CLOSING:
        return None
    stack, _ = open_brackets(text, start)
    closing = text[start]
    if not stack:
        return CLOSES_NOTHING(Span(source, start, start + 1), closing=closing)
    if text[stack[-1]] != _CLOSING[closing]:
        opened = text[stack[-1]]
        line, column = source.position(stack[-1])
        want = _CLOSED[opened]
        return WRONG_BRACKET(
            Span(source, start, start + 1), closing=closing, opening=opened, wanted=want, line=line, column=column
        )
    before = text[:start].rstrip()
    if before.endswith((",", "(", "[", "!", "-", *BINARY)):
        last = before[-2:] if before[-2:] in ("->", "<=", ">=", "!=") else before[-1]
        where = "an argument" if last == "," else "something inside" if last in "([" else f"something after `{last}`"
        return NOTHING_INSIDE(Span(source, start, start + 1), what=where, closing=closing)
    return None


def unclosed(source: Source, stack: list[int]) -> Diagnostic:
    """The innermost of the brackets that are open."""
    opened = source.text[stack[-1]]
    closing = _CLOSED[opened]
    more = len(stack) if len(stack) > 1 else None
    return UNCLOSED_BRACKET(Span(source, stack[-1], stack[-1] + 1), opening=opened, closing=closing, open_brackets=more)
