"""What the parser did not expect, in the words of the person who wrote it.

No name of a token or rule gets out of here. Each special case is a mistake that people make; whatever is left over says
what was found and what could have stood there.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from lark.exceptions import UnexpectedCharacters, UnexpectedToken

from scenegen.errors import Diagnostic, Source, Span, nearest
from scenegen.errors.declarations import WRONG_CHOICE
from scenegen.errors.language import (
    BARE_POINT,
    CANNOT_BE_SAID,
    EQUALITY,
    FOREIGN_SIGN,
    HORIZON_OUT_OF_RANGE,
    KEYWORD_AS_NAME,
    MISSING_OPERATOR,
    MISSING_SIGN,
    NOTHING_BESIDE,
    TIME_MISSING,
    TIME_UNFINISHED,
    UNCLOSED,
    UNEXPECTED,
    UNFINISHED_STATEMENT,
    UNKNOWN_STATEMENT,
    UNKNOWN_UNIT,
    UNNAMED_FORMULA,
    WRONG_WINDOW,
)
from scenegen.lang.formula.timed import MAX_TIME_STEPS
from scenegen.lang.syntax.foreign import PRIOR, RELATIONS, UNIT_WORDS, explain_foreign_syntax, one_list, plain
from scenegen.lang.syntax.tokens import (
    BINARY,
    KEYWORDS,
    OVER_TIME,
    SOFT_STATEMENTS,
    STATEMENTS,
    TEMPORAL,
    UNITS_OF_TIME,
    bracket,
    character_text,
    column,
    ending,
    expected_tokens,
    has_time,
    open_brackets,
    unclosed_bracket,
)
from scenegen.things.library import has_picture

# what other languages call the operators
_ELSEWHERE = {
    "G": "always",
    "F": "eventually",
    "X": "next",
    "U": "until",
    "globally": "always",
    "historically": "always",
}
_OPERAND = re.compile(r"[A-Za-z_0-9(!¬∀∃⊤⊥]")


def _nearest_time_word(word: str, known: Sequence[str]) -> str | None:
    """The word of time that another was meant for."""
    if word in known:
        return None
    elsewhere = _ELSEWHERE.get(word)
    return elsewhere if elsewhere in known else nearest(word.lower(), known) if len(word) > 2 else None


def explain_time(source: Source, start: int, end: int, accepts: set[str], timed: bool) -> Diagnostic | None:
    """The diagnostic for a mistake at characters start..end that has to do with time; None for any other."""
    return _in_time(source, start, end, accepts) if timed else _misplaced_time_word(source, start, end)


def _misplaced_time_word(source: Source, start: int, end: int) -> Diagnostic | None:
    """Words of time where they can only be meant as such, for two names never stand beside each other."""
    text, word = source.text, source.text[start:end]
    before = text[:start]
    if word in ("until", "until_with"):
        return TIME_MISSING(Span(source, start, end), word=word)
    found = ending(r"\btime\s+(-\s*\d[\d.]*)\s+$", before)
    if found is not None and word == "steps":
        steps = float(found[1].replace(" ", "").rstrip("."))
        return HORIZON_OUT_OF_RANGE(Span(source, found.start(1), end), steps=steps, limit=MAX_TIME_STEPS)
    found = ending(r"\bmoves\s+$", before)
    if found is not None and word.isidentifier():
        return TIME_MISSING(Span(source, found.start(), end))
    found = ending(rf"\b({'|'.join(OVER_TIME)})\s+$", before)
    if found is not None and _OPERAND.match(word):
        return TIME_MISSING(Span(source, found.start(1), found.end(1)), word=found[1])
    found = ending(rf"\b(always|eventually|{'|'.join(_ELSEWHERE)})\s*\[[^][]*(\]\s*)?$", before)
    if found is not None and (word in (",", ":") if found[2] is None else _OPERAND.match(word)):
        return TIME_MISSING(Span(source, found.start(1), found.end(1)), word=found[1])
    return None


def _in_time(source: Source, start: int, end: int, accepts: set[str]) -> Diagnostic | None:
    text, word = source.text, source.text[start:end]
    before = text[:start]
    if word in TEMPORAL and text[end:].lstrip().startswith(":"):
        return KEYWORD_AS_NAME(Span(source, start, end), word=word)
    found = ending(r"\b([A-Za-z_]\w*)(\s*\[[^][]*|\s+)$", before)
    known = (
        None if found is None or found[1] in KEYWORDS else _nearest_time_word(found[1], (*OVER_TIME, "moves", "until"))
    )
    if found is not None and known is not None and (word in (",", ":") if "[" in found[2] else _OPERAND.match(word)):
        return UNEXPECTED(Span(source, found.start(1), found.end(1)), found=f"`{found[1]}`", nearest=known)
    known = _nearest_time_word(word, ("until", "until_with", "moves"))
    if known is not None and "NAME" not in accepts and word not in KEYWORDS:
        return UNEXPECTED(Span(source, start, end), found=f"`{word}`", nearest=known)
    if ending(r"\btime\s*\[[^][]*\]\s*$", before) or (ending(r"\btime\s+[\w. ]+\s$", before) and "NAME" in accepts):
        return TIME_UNFINISHED(Span(source, start, end))
    found = ending(r"\b(next|initially|finally)\s*\[[^][]*\]\s*$", before)
    if found is not None:
        return WRONG_WINDOW(Span(source, found.start(), found.end()), operator=found[1], none=True)
    match = re.compile(rf"({'|'.join(sorted(TEMPORAL, reverse=True))})(?!\w)").match(text, start)
    if match is not None and "NAME" in accepts and "OVER_TIME" not in accepts:
        return KEYWORD_AS_NAME(Span(source, start, match.end()), word=match[1], expected=expected_tokens(accepts))
    return None


# operators of other languages -> which mistake it is, and what to write instead
_FOREIGN = {
    "&&": ("", "`&` (or `and`)"),
    "||": ("", "`|` (or `or`)"),
    "=>": ("", "`->` for `implies`, or `>=` for `at least`"),
    "=<": ("", "`<=`"),
    "**": ("", "a product: a * a"),
    "^": ("", "`&` for `and`; for a power write a product: a * a"),
    "~": ("", "`!` (or `not`)"),
    ";": ("semicolon", ""),
    "%": ("", "wrap(a) to bring an angle to one turn"),
    "'": ("quotes", ""),
    "{": ("braces", ""),
    "}": ("braces", ""),
    "//": ("comment", ""),
    "/*": ("comment", ""),
    "==": ("equality", ""),
    "=": ("equality", ""),
}
NO_COMMA = "leave out the `,`: any of [...] by area"
BY_AREA = "write `any of [...] by area`; without `by area` all are equally likely"
_SOFT_OPENING = re.compile(rf"({'|'.join(SOFT_STATEMENTS)})\s+[A-Za-z_]")
PICTURE_SIDES = "after the angle stand the sides of the picture, width:height: fov 60 deg, 4:3"
_KNOWN = frozenset("()[],.:<>+-*/&|!≤≥≠∧∨¬→∀∃⊤⊥")  # characters that mean something, if not here


def explain(source: Source, error: UnexpectedToken | UnexpectedCharacters, timed: bool = False) -> Diagnostic:
    """The diagnostic for what Lark could not accept; `timed`: in a spec with time."""
    text = source.text
    if isinstance(error, UnexpectedToken) and error.token.type != "$END":
        start, end = int(error.token.start_pos or 0), int(error.token.end_pos or 0)
        accepts = set(error.accepts or error.expected or ())
    elif isinstance(error, UnexpectedCharacters):
        start, end = int(error.pos_in_stream or 0), int(error.pos_in_stream or 0) + 1
        accepts = set(error.allowed or ())
    else:
        return _at_end(source, set(error.accepts or error.expected or ()))
    if "RSQB" in accepts:  # a weight is seldom what was meant
        accepts.discard("COLON")
    return (
        explain_time(source, start, end, accepts, timed)
        or _missing_sides(source, start, end, accepts)
        or _unfinished_statement(source, start, end, accepts)
        or explain_foreign_syntax(source, start, end, len(open_brackets(text, start)[0]), accepts)
        or _foreign(source, start)
        or bracket(source, start)
        or _statement(source, start, end, accepts)
        or _two_operands(source, start, end, accepts)
        or _keyword(source, start, end, accepts)
        or _number(source, start, accepts)
        or UNEXPECTED(
            Span(source, start, end),
            found=character_text(text[start:end]),
            expected=expected_tokens(accepts),
            instead=_character_help(text[start:end], accepts),
        )
    )


def stop(text: str, error: UnexpectedToken | UnexpectedCharacters) -> int:
    """The character at which Lark stopped; the end of the text where it is there that something is missing."""
    if isinstance(error, UnexpectedCharacters):
        return int(error.pos_in_stream or 0)
    return len(text) if error.token.type == "$END" else int(error.token.start_pos or 0)


def _character_help(text: str, accepts: set[str]) -> str:
    if len(text) == 1 and ord(text) > 127 and text.isalpha():
        return "names are made of the letters a-z and A-Z, digits and `_`"
    if len(text) != 1 or text in _KNOWN or text.isalnum():
        return ""
    return "put `&` (and), `|` (or) or `->` (implies) in its place" if "_AND" in accepts else "remove it"


def _foreign(source: Source, start: int) -> Diagnostic | None:
    text = source.text
    if text[start] == '"' and '"' not in source.line(start)[source.position(start)[1] :]:
        return UNCLOSED(Span(source, start, start + 1))
    line = text[text.rfind("\n", 0, start) + 1 : start].strip()
    if text[start] == "=" and re.fullmatch(r"def\s+\w+", line):
        return MISSING_SIGN(Span(source, start, start + 1), head=line, parameters=True)
    if text[start] == "=" and line.removesuffix(":").rstrip().isidentifier() and line.endswith(":"):
        return FOREIGN_SIGN(Span(source, text.rfind(":", 0, start), start + 1), operator=":=", instead="`:`")
    if text[start] == "=" and text[start + 1 : start + 2] != "=" and line.isidentifier():
        return MISSING_SIGN(Span(source, start, start + 1), name=line, formula="...")
    if text[start : start + 2] == "!=" or text[start - 1 : start + 1] == "!=":
        start -= text[start] == "="
        return NOTHING_BESIDE(Span(source, start, start + 2), word="!=")
    # `&&` is noticed at its second character: look one back as well.
    for at, length in ((start - 1, 2), (start, 2), (start, 1)):
        found = text[at : at + length] if at >= 0 else ""
        if (
            len(found) == length
            and found in _FOREIGN
            and not (length == 2 and at < start and found not in ("&&", "||", "==", "**", "//"))
        ):
            which, instead = _FOREIGN[found]
            here = Span(source, at, at + length)
            operand = re.search(r"(\w+|[)\]])$", line)
            if found == "~" and operand is not None and operand[1] not in KEYWORDS:
                return CANNOT_BE_SAID(here, word="~", instead=PRIOR)  # a name and its distribution
            if which == "equality":
                return _equal(here, line)
            return FOREIGN_SIGN(here, operator=found, instead=instead, **({which: True} if which else {}))
    return None


def _equal(here: Span, line: str) -> Diagnostic:
    """`=` or `==` in a formula, after the rest of its line."""
    text = here.source.text
    after = re.match(r"[ \t]*(-?[\w.]+(?:\[\w+\])?)(\s*\([^()\n]*\))?[ \t]*([a-z]*)", text[here.end :])
    before = ending(r"([A-Za-z_][\w.]*(?:\[\w+\])?|\w+\([^()]*\))$", line)
    if after is not None and RELATIONS.get(plain(after[1])) == PRIOR:
        start = here.end + after.start(1)
        return CANNOT_BE_SAID(Span(here.source, start, start + len(after[1])), word=after[1], instead=PRIOR)
    instead = None
    if before is not None and after is not None:
        a, b = before[1], after[1] + (after[2] or "")
        if "(" not in a + b and not re.search(r"\d\.|\.\d", b):  # two things, or a number of a round
            instead = f"write !({a} != {b})"
        elif "(" in a:
            small = "0.1" if a.startswith(("theta", "bearing")) else "1 cm"
            unit = after[3] if after[3] in UNIT_WORDS else ""
            instead = f"allow a tolerance: abs({a} - {f'{b} {unit}'.strip()}) <= {small}"
    return EQUALITY(here, single=here.text == "=" or None, instead=instead)


def _two_operands(source: Source, start: int, end: int, accepts: set[str]) -> Diagnostic | None:
    """Something that opens an operand where only an operator or a new statement can stand."""
    text, word = source.text, source.text[start:end]
    if not re.match(r"[A-Za-z_0-9(!¬\"]", word) or "NAME" in accepts:
        return None
    before = text[:start].rstrip()
    found = ending(r"[A-Za-z_0-9.]+$", before)
    previous = found[0] if found else ""
    here = Span(source, start, end)
    if _opens_with_equal(source, start, end):
        number = re.match(r"[ \t]*=[ \t]*(-?\d[^\n#]*)", text[end:])
        if number is not None:
            instead = f"write const {word} = {number[1].strip()}"
            return UNEXPECTED(here, found=f"`{word}`", expected=expected_tokens(accepts), instead=instead)
        return MISSING_SIGN(here, name=word, formula="...")
    if word.lower() in KEYWORDS and word != word.lower():
        return KEYWORD_AS_NAME(here, word=word, keyword=word.lower())
    if "COLON" in accepts:
        return MISSING_SIGN(here)
    if previous == "workspace":
        instead = "write workspace [0, 1] x [0, 1]"
        return UNEXPECTED(here, found=character_text(word), expected="an interval such as [0, 1]", instead=instead)
    stack, _ = open_brackets(text, start)
    opening = nearest(previous, STATEMENTS) if previous not in KEYWORDS else None
    if opening is not None and before[: len(before) - len(previous)].rstrip()[-1:] in ("", "\n", ")", "]"):
        place = Span(source, len(before) - len(previous), len(before))
        return UNKNOWN_STATEMENT(place, name=previous, nearest=opening)
    known = [one for one in ("and", "or", "implies") if f"_{one.upper()}" in accepts]
    if text[end : end + 1] != "(":
        known += [one for one in STATEMENTS if one.upper() in accepts]
    close = nearest(word, known) if word.isidentifier() else None
    if close is not None and len(word) > 2 and word not in KEYWORDS:
        return UNEXPECTED(here, found=f"`{word}`", nearest=close)
    if not accepts & {"_AND", "_OR", "PLUS"}:
        return _unnamed_formula(here, accepts)
    between = text[len(before) : start]
    if previous[:1].isdigit() and word.isidentifier() and word not in KEYWORDS and "\n" not in between:
        return UNKNOWN_UNIT(here, name=word, times=UNITS_OF_TIME if has_time(text) else None)
    if stack and previous == "any" and word == "of":
        return WRONG_CHOICE(here, surfaces=one_list(text[stack[-1] :]), nested=True)
    if stack and "COMMA" in accepts:
        return MISSING_OPERATOR(here, before=character_text(word), comma="`,`")
    names = previous.isidentifier() and previous not in KEYWORDS and word.isidentifier() and "\n" not in between
    return MISSING_OPERATOR(
        here,
        before=character_text(word),
        call=f"{previous}({word}, ...)" if names else None,
        labels="`task: ...` and `safe: ...`" if not names and not stack and "\n" in between else None,
        only="a name" if not names and word == "(" and (stack or "\n" not in between) else None,
    )


def _opens_with_equal(source: Source, start: int, end: int) -> bool:
    """Whether `name = ...` stands on a line of its own, where `name: ...` is meant."""
    line = source.text[source.text.rfind("\n", 0, start) + 1 : start]
    return not line.strip() and re.match(r"[ \t]*=(?!=)", source.text[end:]) is not None


def _unnamed_formula(here: Span, accepts: set[str]) -> Diagnostic:
    """A name where a list of names or a statement has ended."""
    word = here.text
    before = here.source.text[: here.start].rstrip()
    measure = re.search(r"\]\s*(,?)\s*by$", before if word != "by" else f"{before} by")
    if measure:
        instead = NO_COMMA if measure[1] and word == "area" else BY_AREA
        return UNEXPECTED(here, found=f"`{word}`", expected="another object", instead=instead)
    if "LABEL" in accepts and word.isidentifier():
        rest = here.source.text[here.end :].lstrip()
        if drawn := re.match(r"(?:\([^()\n]*\)|\[[^][\n]*\])?\s*(~)", rest):
            place = len(here.source.text) - len(rest) + drawn.start(1)
            return CANNOT_BE_SAID(Span(here.source, place, place + 1), word="~", instead=PRIOR)
        if rest.startswith("("):
            return UNNAMED_FORMULA(here, formula=f"{word}(...)")
        if re.match(r"[A-Za-z_]\w*\s*\(", rest):
            return MISSING_SIGN(here, name=word, formula="...")
        wanted = "`,` or a statement" if "COMMA" in accepts else expected_tokens(accepts)
        instead = "separate names in a list with `,`"
        first = re.search(r"\b(?:object|region|,)\s*([A-Za-z_]\w*)[ \t]*$", before)
        if first is not None and not has_picture(first[1]):
            instead = f"a name is one word: write {first[1]}_{word}; {instead}"
        return UNEXPECTED(here, found=f"`{word}`", expected=wanted, instead=instead)
    return UNEXPECTED(here, found=character_text(word), expected=expected_tokens(accepts))


def _keyword(source: Source, start: int, end: int, accepts: set[str]) -> Diagnostic | None:
    if source.text[start - 1 : end] == "->":  # where a number may stand, `-` is taken for its sign
        start -= 1
    word = source.text[start:end]
    if word in (*BINARY, "and", "or", "implies") and "NAME" in accepts:
        return NOTHING_BESIDE(Span(source, start, end), word=word)
    if word == ":" and "COLON" not in accepts:
        return _colon(source, start)
    word = next((key for key in KEYWORDS if re.match(rf"{key}(?!\w)", source.text[start:])), "")
    if not word or "NAME" not in accepts:
        return None
    end = start + len(word)
    return KEYWORD_AS_NAME(Span(source, start, end), word=word, expected=expected_tokens(accepts))


def _statement(source: Source, start: int, end: int, accepts: set[str]) -> Diagnostic | None:
    """A statement that opens where a bracket is open, or after a formula without a name."""
    text, word = source.text, source.text[start:end]
    named = word.isidentifier() and re.match(r"\s*:", text[end:]) is not None
    if not (named or word in STATEMENTS) or accepts & {"NAME", "IN", "COLON"}:
        return None
    stack, _ = open_brackets(text, start)
    if stack:
        return unclosed_bracket(source, stack)
    if "$END" not in accepts or "LABEL" in accepts or ending(r"\bworkspace\s*$", text[:start]):
        return None
    return UNNAMED_FORMULA(Span(source, start, end), word=word)


def _unfinished_statement(source: Source, start: int, end: int, accepts: set[str]) -> Diagnostic | None:
    """A statement that opens a line while the one before it still waits for something."""
    text, word = source.text, source.text[start:end]
    begin, opened = text.rfind("\n", 0, start) + 1, start
    head = text[begin:start].rstrip()
    if word == ":" and "COLON" not in accepts:
        opened = begin if head.isidentifier() else start
    elif head in SOFT_STATEMENTS and word.isidentifier():  # read as a name of the statement before
        opened, end, accepts = begin, begin + len(head), {"NAME"}
    elif accepts & {"$END", "LABEL"} or not (word in STATEMENTS or _SOFT_OPENING.match(text, start)):
        return None
    if column(text, opened) or (opened == start and word == ":") or not text[:opened].strip():
        return None
    stack, _ = open_brackets(text, opened)
    if stack:
        return unclosed_bracket(source, stack)
    if word == ":":
        return None
    return UNFINISHED_STATEMENT(Span(source, opened, end), expected=expected_tokens(accepts))


def _missing_sides(source: Source, start: int, end: int, accepts: set[str]) -> Diagnostic | None:
    """What stands where a camera's angle should be followed by the sides of its picture."""
    before, word = _without_comments(source.text[:start]), source.text[start:end]
    found = ending(r"\bcamera\s[^\n]*\bfov\s[^\n]*(\n\s*)?$", before)
    if found is None or not (accepts & {"COLON", "COMMA"}) or open_brackets(source.text, start)[0]:
        return None
    if "COLON" not in accepts and not (found[1] or re.match(r"[\d;]|$", word)):
        return None
    expected = "`:`" if "COLON" in accepts else "`,`"
    shown = {"found": character_text(word)} if word else {"last": before.split()[-1], "end": True}
    return UNEXPECTED(Span(source, start, end), expected=expected, instead=PICTURE_SIDES, **shown)


def _colon(source: Source, start: int) -> Diagnostic:
    found = ending(r"\w+$", source.text[:start].rstrip())
    if found is not None and found[0] in KEYWORDS:
        return KEYWORD_AS_NAME(Span(source, found.start(), found.end()), word=found[0])
    opens = found.start() if found is not None else start
    return UNFINISHED_STATEMENT(Span(source, opens, start + 1), named=True)


def _number(source: Source, start: int, accepts: set[str]) -> Diagnostic | None:
    text = source.text
    if ending(r"\d\.$", text[:start]) and "NAME" in accepts:
        return _dot(source, start)
    if text[start] != ".":
        return None
    if re.match(r"\.\d", text[start:]) and "NAME" in accepts:
        number = re.match(r"\.\d+", text[start:])
        shown = number[0] if number else "."
        return BARE_POINT(Span(source, start, start + len(shown)), mended=f"0{shown}")
    return None


def _dot(source: Source, end: int) -> Diagnostic:
    """A number such as `5.` that ends just before `end`."""
    found = ending(r"\d+\.$", source.text[:end])
    assert found is not None
    return BARE_POINT(Span(source, found.start(), end), mended=f"{found[0]}0")


def _at_end(source: Source, accepts: set[str]) -> Diagnostic:
    text = source.text
    stop = len(text.rstrip())
    stack, _ = open_brackets(text, len(text))
    if stack and accepts & {"RPAR", "RSQB"}:
        return unclosed_bracket(source, stack)
    if ending(r"\d\.$", text[:stop]):
        return _dot(source, stop)
    if (problem := _missing_sides(source, stop, stop, accepts)) is not None:
        return problem
    word = ending(r"(?:[A-Za-z_]\w*|->|<=|>=|!=|[^\w\s])$", _without_comments(text).rstrip())
    return UNEXPECTED(
        Span(source, stop, stop), last=word[0] if word else None, expected=expected_tokens(accepts), end=True
    )


def _without_comments(text: str) -> str:
    return re.sub(r"#[^\n]*", "", text)
