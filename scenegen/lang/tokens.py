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

# the words of time, which are keywords in a spec that has a `time` statement and names in any other
OVER_TIME = ("always", "eventually", "next", "initially", "finally")
TEMPORAL = frozenset((*OVER_TIME, "until", "until_with"))

NEAR = 400  # characters before a mistake that can tell something about it

_UNITS = "(?:mm|cm|m|rad|deg|turn)"


def _tokens(units: str) -> re.Pattern[str]:
    return re.compile(
        r"(?P<space>\s+)"
        r"|(?P<comment>#[^\n]*)"
        r'|(?P<text>"[^"\n]*")'
        rf"|(?P<number>\d+(?:\.\d+)?(?:[eE][+-]?\d+)?(?:[ \t]*{units}(?!\w))?)"
        r"|(?P<name>[A-Za-z_][A-Za-z0-9_]*)"
        r"|(?P<sign>->|<=|>=|!=|\.\.|.)",
        re.DOTALL,
    )


_TOKEN = {False: _tokens(_UNITS), True: _tokens(f"(?:{_UNITS}(?:/s)?|s|ms|min)")}
_NUMBER = re.compile(r"([\d.]+(?:[eE][+-]?\d+)?)[ \t]*([a-z]*(?:/s)?)")
_TIME = re.compile(r"\btime\b")

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
    "≠": "!=",
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


def has_time(text: str) -> bool:
    """Whether a spec's text has a `time` statement: the word, then a number, `NAME steps` or an interval. Elsewhere
    `time` is a name; no spec without time has it before one of these."""
    if not _TIME.search(text):
        return False
    tokens = [token for token in scan(text, timed=True) if token.kind != "comment"]
    for place, token in enumerate(tokens[:-1]):
        if token.text != "time" or token.kind != "name":
            continue
        following = tokens[place + 1]
        after = tokens[place + 2].text if place + 2 < len(tokens) else ""
        if following.kind == "number" or (following.kind == "name" and after == "steps"):
            return True
        if following.text == "[" and _comma(tokens, place + 1):
            return True
    return False


def _comma(tokens: list[Token], place: int) -> bool:
    """Whether a comma stands in the bracket that opens at a place, in no other bracket inside."""
    depth = 0
    for token in tokens[place:]:
        if token.kind != "sign":
            continue
        depth += (token.text in ("[", "(")) - (token.text in ("]", ")"))
        if not depth or (token.text == "," and depth == 1):
            return bool(depth)
    return False


def scan(text: str, start: int = 0, timed: bool = False) -> Iterator[Token]:
    """The tokens and comments of a text from character `start` on; `timed`: of a spec with time, whose numbers have
    more units."""
    breaks = 1 if start == 0 or text[start - 1 : start] == "\n" else 0
    for match in _TOKEN[timed].finditer(text, start):
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
