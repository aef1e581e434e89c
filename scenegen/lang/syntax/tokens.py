"""The tokens of a text without the parser: for texts that do not parse, and for comments, which the parser drops.

The shapes of names, numbers and texts are those of grammar/spec.lark; every other character is a token of its own, so
any text at all can be scanned. What a token means (a label, a name) is the parser's to say.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from typing import NamedTuple

from scenegen.errors import Diagnostic, Source, Span
from scenegen.errors.language import NOTHING_BESIDE, UNCLOSED, WRONG_BRACKET

STATEMENTS = ("workspace", "object", "region", "const", "def", "require", "import")
ROBOT = "robot"
SOFT_STATEMENTS = (ROBOT, "camera", "usually")  # which open a statement before a name, and are names elsewhere
KEYWORDS = frozenset((*STATEMENTS, *"forall exists in at and or not implies true false".split()))

# the words of time, which are keywords in a spec that has a `time` statement and names in any other
OVER_TIME = ("always", "eventually", "next", "initially", "finally")
TEMPORAL = frozenset((*OVER_TIME, "until", "until_with"))

# a part of help lines
UNITS_OF_TIME = "times in s, ms or min; speeds in m/s or cm/s; turn rates in deg/s or rad/s"

MAX_NEAR = 400  # characters before a mistake that can tell something about it

_UNIT_WORDS = "(?:mm|cm|m|rad|deg|turn)"


def _tokens(units: str) -> re.Pattern[str]:
    return re.compile(
        r"(?P<space>\s+)"
        r"|(?P<comment>#[^\n]*)"
        r'|(?P<text>"[^"\n]*")'
        rf"|(?P<number>\d+(?:\.\d+)?(?:[eE][+-]?\d+)?(?:[^\S\r\n]*(?:{units}(?!\w)|%))?)"
        r"|(?P<name>[A-Za-z_][A-Za-z0-9_]*)"
        r"|(?P<sign>->|<=|>=|!=|\.\.|.)",
        re.DOTALL,
    )


_TOKEN = {False: _tokens(_UNIT_WORDS), True: _tokens(f"(?:{_UNIT_WORDS}(?:/s)?|s|ms|min)")}
_NUMBER_TOKEN = re.compile(r"([\d.]+(?:[eE][+-]?\d+)?)\s*([a-z]*(?:/s)?|%)")
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
        found = _NUMBER_TOKEN.fullmatch(token.text)
        if found is not None and found[2]:
            return f"{found[1]} {found[2]}"
    return _SPELLINGS.get(token.text, token.text)


def ending(pattern: str, text: str) -> re.Match[str] | None:
    """The match of a pattern that closes with `$`, in the last MAX_NEAR characters of a text. In all of the text the
    search would take time quadratic in the length of its names and blanks."""
    return re.compile(pattern).search(text, max(0, len(text) - MAX_NEAR))


def column(text: str, offset: int) -> int:
    """How many characters stand before an offset on its line."""
    return offset - (text.rfind("\n", 0, offset) + 1)


BINARY = ("&", "|", "->", "<=", ">=", "!=", "<", ">", "+", "*", "/", "∧", "∨", "→", "≤", "≥", "≠")
_CLOSED = {"(": ")", "[": "]"}
_OPENING_OF = {closing: opening for opening, closing in _CLOSED.items()}
_BRACKETED = re.compile(r'#[^\n]*|"[^"\n]*"|\s+|.', re.DOTALL)


def open_brackets(text: str, end: int) -> tuple[list[int], int | None]:
    """Offsets of the brackets open at `end`, and the offset of the first one that closes nothing."""
    stack: list[int] = []
    for match in _BRACKETED.finditer(text, 0, end):
        char = match[0]
        if char in "([":
            stack.append(match.start())
        elif char in _OPENING_OF:
            if not stack or text[stack[-1]] != _OPENING_OF[char]:
                return stack, match.start()
            stack.pop()
    return stack, None


def bracket(source: Source, start: int) -> Diagnostic | None:
    """What is wrong with a closing bracket at `start`; None for other characters."""
    text = source.text
    if text[start] not in _OPENING_OF:
        return None
    stack, _ = open_brackets(text, start)
    closing = text[start]
    if not stack:
        return WRONG_BRACKET(Span(source, start, start + 1), closing=closing)
    if text[stack[-1]] != _OPENING_OF[closing]:
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
        return NOTHING_BESIDE(Span(source, start, start + 1), what=where, closing=closing)
    return None


def unclosed_bracket(source: Source, stack: list[int]) -> Diagnostic:
    """The innermost of the brackets that are open."""
    opened = source.text[stack[-1]]
    closing = _CLOSED[opened]
    more = len(stack) if len(stack) > 1 else None
    return UNCLOSED(Span(source, stack[-1], stack[-1] + 1), opening=opened, closing=closing, open_brackets=more)


# what can stand at a place, by the tokens that would have been accepted there; the first that fits is said
_EXPECTED = (
    ({"NAME", "QUANTITY", "LPAR"}, "a formula, a name or a number"),
    ({"_AND", "_OR", "COMPARE"}, "an operator such as `&`, `|`, `->` or `<=`, or the end of the formula"),
    ({"RSQB", "COMMA"}, "`,` or `]`"),
    ({"RPAR", "COMMA"}, "`,` or `)`"),
    ({"LABEL", "OBJECT", "CONST"}, "a statement such as `object`, `const`, `def` or `task: ...`"),
    ({"COMMA", "IN"}, "`in` and what to range over"),
    ({"X"}, "`x` and the second interval: workspace [0, 1] x [0, 1]"),
    ({"LOOKS_AT"}, "the point that the camera looks at: looks at (0.5, 0.4, 0)"),
    ({"FOV"}, "the angle of the picture's height: fov 60 deg, 4:3"),
    ({"LSQB", "EQUAL"}, "`=`"),
    ({"LSQB"}, "an interval such as [0, 1]"),
    ({"LPAR"}, "`(`"),
    ({"EQUAL"}, "`=`"),
    ({"COLON"}, "`:`"),
    ({"STRING"}, 'a text in double quotes, such as "table.spec"'),
    ({"NAME"}, "a name"),
    ({"TILDE"}, "`~` and where it usually is, such as normal((0.4, 0.3), 5 cm)"),
    ({"COMMA"}, "`,`"),
    ({"RPAR"}, "`)`"),
    ({"RSQB"}, "`]`"),
    ({"AT"}, "`at` and a place"),
)


def character_text(text: str) -> str:
    """What was found: the text, or the number of a character that cannot be printed."""
    return f"`{text}`" if text.isprintable() else f"character U+{ord(text[0]):04X}"


def expected_tokens(accepts: set[str]) -> str:
    """What could have stood there, from the tokens that would have been accepted."""
    return next((words for needed, words in _EXPECTED if needed <= accepts), "something else")


# Where to go on after a syntax error: at the next opening of a statement.
#
# Every statement opens with a keyword or with `name:`. Newlines are white space to the parser, but people put
# statements on lines of their own, and a broken text is read as people read it: what opens a line is trusted more
# than what stands in the middle of one. A missed opening hides a mistake until the next run; a false one would report
# a mistake where there is none. So in doubt there is no opening.


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
            named = following is not None and following.kind == "name"
            known = token.text in STATEMENTS or (named and token.text in SOFT_STATEMENTS)
            opens = known and _opens_keyword(text, token, previous, following)
            opens = opens or (named and token.text == ROBOT and token.first)
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
