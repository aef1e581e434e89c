"""The tokens of a text without the parser: for texts that do not parse, and for comments, which the parser drops.

The shapes of names, numbers and texts are those of grammar/spec.lark; every other character is a token of its own, so
any text at all can be scanned. What a token means (a label, a name) is the parser's to say.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import NamedTuple

STATEMENTS = ("workspace", "object", "region", "const", "def", "require", "import")
KEYWORDS = frozenset((*STATEMENTS, *"forall exists in at and or not implies true false".split()))

NEAR = 400  # characters before a mistake that can tell something about it

_TOKEN = re.compile(
    r"(?P<space>\s+)"
    r"|(?P<comment>#[^\n]*)"
    r'|(?P<text>"[^"\n]*")'
    r"|(?P<number>\d+(?:\.\d+)?(?:[eE][+-]?\d+)?(?:[ \t]*(?:mm|cm|m|rad|deg|turn)(?!\w))?)"
    r"|(?P<name>[A-Za-z_][A-Za-z0-9_]*)"
    r"|(?P<sign>->|<=|>=|\.\.|.)",
    re.DOTALL,
)
_NUMBER = re.compile(r"([\d.]+(?:[eE][+-]?\d+)?)[ \t]*([a-z]*)")

# every spelling of an operator or a word -> the canonical one
_SPELLINGS = {
    "and": "&",
    "∧": "&",
    "or": "|",
    "∨": "|",
    "not": "!",
    "¬": "!",
    "implies": "->",
    "→": "->",
    "∀": "forall",
    "∃": "exists",
    "⊤": "true",
    "⊥": "false",
    "≤": "<=",
    "<": "<=",
    "≥": ">=",
    ">": ">=",
}


class Token(NamedTuple):
    """`kind` is comment, text, number, name or sign; `first`: on its line; `blank`: an empty line stands before it."""

    kind: str
    text: str
    start: int
    end: int
    first: bool
    blank: bool


def scan(text: str, start: int = 0) -> Iterator[Token]:
    """The tokens and comments of a text from character `start` on."""
    breaks = 1 if start == 0 or text[start - 1 : start] == "\n" else 0
    for match in _TOKEN.finditer(text, start):
        kind = match.lastgroup or ""
        if kind == "space":
            breaks += match[0].count("\n")
            continue
        yield Token(kind, match[0], match.start(), match.end(), breaks > 0, breaks > 1)
        breaks = 0


def spelling(token: Token) -> str:
    """The one spelling that canonical text has for a token."""
    if token.kind == "number":
        found = _NUMBER.fullmatch(token.text)
        if found is not None and found[2]:
            return f"{found[1]} {found[2]}"
    return _SPELLINGS.get(token.text, token.text)


def ending(pattern: str, text: str) -> re.Match[str] | None:
    """The match of a pattern that closes with `$`, in the last NEAR characters of a text. In all of the text the search
    would take time quadratic in the length of its names and blanks."""
    return re.compile(pattern).search(text, max(0, len(text) - NEAR))


def column(text: str, offset: int) -> int:
    """How many characters stand before an offset on its line."""
    return offset - (text.rfind("\n", 0, offset) + 1)
