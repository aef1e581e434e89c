"""What the parser did not expect, in the words of the person who wrote it.

No name of a token or rule gets out of here. Each special case is a mistake that people make; whatever is left over says
what was found and what could have stood there.
"""

from __future__ import annotations

import re

from lark.exceptions import UnexpectedCharacters, UnexpectedToken

from scenegen.errors import Diagnostic, Source, Span, nearest
from scenegen.lang.habits import explain_habit
from scenegen.lang.tokens import KEYWORDS, STATEMENTS, column, ending

# operators of other languages -> what to write here
_FOREIGN = {
    "&&": ("`&&` is not an operator here", "write `&` (or `and`)"),
    "||": ("`||` is not an operator here", "write `|` (or `or`)"),
    "==": ("two numbers are never exactly equal in a random scene", "allow a tolerance: abs(a - b) <= 0.01"),
    "!=": ("`!=` is not an operator here", "for a distance from a value, write abs(a - b) >= 0.01"),
    "=>": ("`=>` is not an operator here", "write `->` for `implies`, or `>=` for `at least`"),
    "=<": ("`=<` is not an operator here", "write `<=`"),
    "=": ("`=` only stands in `const`, `def`, `object` and `region`", "to compare numbers write `<=` or `>=`"),
    "**": ("there is no power operator", "write a product: a * a"),
    "^": ("`^` is not an operator here", "write `&` for `and`; for a power write a product: a * a"),
    "~": ("`~` is not an operator here", "write `!` (or `not`)"),
    ";": ("statements are not parted by `;`", "start the next statement on a new line"),
    "%": ("`%` is not an operator here", "to bring an angle to one turn write wrap(a)"),
    "'": ("names stand without quotes", 'write leftOf(mug, plate); file names stand in "double quotes"'),
    "{": ("braces mean nothing here", "group with ( ), list with [ ]"),
    "}": ("braces mean nothing here", "group with ( ), list with [ ]"),
    "//": ("`//` opens no comment here", "comments start with `#`"),
    "/*": ("`/*` opens no comment here", "comments start with `#`"),
}
_BINARY = ("&", "|", "->", "<=", ">=", "<", ">", "+", "*", "/", "∧", "∨", "→", "≤", "≥")
_KNOWN = frozenset("()[],.:<>+-*/&|!≤≥∧∨¬→∀∃⊤⊥")  # characters that mean something, if not here
_CLOSING = {")": "(", "]": "["}
_TOKEN = re.compile(r'#[^\n]*|"[^"\n]*"|\s+|.', re.DOTALL)

# what can stand at a place, by the tokens that would have been accepted there; the first that fits is said
_EXPECTED = (
    ({"NAME", "QUANTITY", "LPAR"}, "a formula, a name or a number"),
    ({"_AND", "_OR", "COMPARE"}, "an operator such as `&`, `|`, `->` or `<=`, or the end of the formula"),
    ({"RSQB", "COMMA"}, "`,` or `]`"),
    ({"RPAR", "COMMA"}, "`,` or `)`"),
    ({"LABEL", "OBJECT", "CONST"}, "a statement such as `object`, `const`, `def` or `task: ...`"),
    ({"COMMA", "IN"}, "`in` and what to range over"),
    ({"X"}, "`x` and the second interval: workspace [0, 1] x [0, 1]"),
    ({"LSQB"}, "an interval such as [0, 1]"),
    ({"LPAR"}, "`(`"),
    ({"EQUAL"}, "`=`"),
    ({"COLON"}, "`:`"),
    ({"STRING"}, 'a text in double quotes, such as "table.spec"'),
    ({"NAME"}, "a name"),
    ({"COMMA"}, "`,`"),
    ({"RPAR"}, "`)`"),
    ({"RSQB"}, "`]`"),
)


def explain(source: Source, error: UnexpectedToken | UnexpectedCharacters) -> Diagnostic:
    """The diagnostic for what Lark could not accept."""
    text = source.text
    if isinstance(error, UnexpectedToken) and error.token.type != "$END":
        start, end = int(error.token.start_pos or 0), int(error.token.end_pos or 0)
        accepts = set(error.accepts or error.expected or ())
    elif isinstance(error, UnexpectedCharacters):
        start, end = int(error.pos_in_stream or 0), int(error.pos_in_stream or 0) + 1
        accepts = set(error.allowed or ())
    else:
        return _at_end(source, set(error.accepts or error.expected or ()))
    return (
        _unfinished(source, start, end, accepts)
        or explain_habit(source, start, end, len(_open_brackets(text, start)[0]), accepts)
        or _foreign(source, start)
        or _bracket(source, start)
        or _statement(source, start, end, accepts)
        or _two_operands(source, start, end, accepts)
        or _keyword(source, start, end, accepts)
        or _number(source, start, accepts)
        or Diagnostic(
            f"unexpected {_shown(text[start:end])}",
            Span(source, start, end),
            f"expected {_expected(accepts)}",
            _character_help(text[start:end], accepts),
        )
    )


def stop(text: str, error: UnexpectedToken | UnexpectedCharacters) -> int:
    """The character at which Lark stopped; the end of the text where it is there that something is missing."""
    if isinstance(error, UnexpectedCharacters):
        return int(error.pos_in_stream or 0)
    return len(text) if error.token.type == "$END" else int(error.token.start_pos or 0)


def _shown(text: str) -> str:
    return f"`{text}`" if text.isprintable() else f"character U+{ord(text[0]):04X}"


def _expected(accepts: set[str]) -> str:
    return next((words for needed, words in _EXPECTED if needed <= accepts), "something else")


def _character_help(text: str, accepts: set[str]) -> str:
    if len(text) == 1 and ord(text) > 127 and text.isalpha():
        return "names are made of the letters a-z and A-Z, digits and `_`"
    if len(text) != 1 or text in _KNOWN or text.isalnum():
        return ""
    return "put `&` (and), `|` (or) or `->` (implies) in its place" if "_AND" in accepts else "remove it"


def _open_brackets(text: str, end: int) -> tuple[list[int], int | None]:
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


def _foreign(source: Source, start: int) -> Diagnostic | None:
    text = source.text
    if text[start] == '"' and '"' not in source.line(start)[source.position(start)[1] :]:
        return Diagnostic("this text is never closed", Span(source, start, start + 1), "", 'add `"` where it ends')
    line = text[text.rfind("\n", 0, start) + 1 : start].strip()
    if text[start] == "=" and re.fullmatch(r"def\s+\w+", line):
        help_ = f"write {line}(a, b) = ..., or {line}() = ... if it has none; for a number write const"
        return Diagnostic("a definition needs its parameters", Span(source, start, start + 1), "expected `(`", help_)
    if text[start] == "=" and text[start + 1 : start + 2] != "=" and line.isidentifier():
        return Diagnostic("a formula is named with `:`", Span(source, start, start + 1), "", f"write `{line}: ...`")
    # `&&` is noticed at its second character: look one back as well.
    for at, length in ((start - 1, 2), (start, 2), (start, 1)):
        found = text[at : at + length] if at >= 0 else ""
        if (
            len(found) == length
            and found in _FOREIGN
            and not (length == 2 and at < start and found not in ("&&", "||", "==", "**", "//"))
        ):
            title, help_ = _FOREIGN[found]
            return Diagnostic(title, Span(source, at, at + length), "", help_)
    return None


def _bracket(source: Source, start: int) -> Diagnostic | None:
    text = source.text
    if text[start] not in _CLOSING:
        return None
    stack, _ = _open_brackets(text, start)
    closing = text[start]
    if not stack:
        return Diagnostic(
            f"this `{closing}` closes nothing", Span(source, start, start + 1), "", "remove it, or open it before"
        )
    if text[stack[-1]] != _CLOSING[closing]:
        opened = text[stack[-1]]
        line, column = source.position(stack[-1])
        want = {"(": ")", "[": "]"}[opened]
        return Diagnostic(
            f"`{closing}` cannot close `{opened}`",
            Span(source, start, start + 1),
            f"expected `{want}`",
            note=f"`{opened}` was opened in line {line}, column {column}",
        )
    before = text[:start].rstrip()
    if before.endswith((",", "(", "[", "!", "-", *_BINARY)):
        last = before[-2:] if before[-2:] in ("->", "<=", ">=") else before[-1]
        where = "an argument" if last == "," else "something inside" if last in "([" else f"something after `{last}`"
        return Diagnostic(f"expected {where} before `{closing}`", Span(source, start, start + 1), "nothing stands here")
    return None


def _two_operands(source: Source, start: int, end: int, accepts: set[str]) -> Diagnostic | None:
    """Something that opens an operand where only an operator or a new statement can stand."""
    text, word = source.text, source.text[start:end]
    if not re.match(r"[A-Za-z_0-9(!¬\"]", word) or "NAME" in accepts:
        return None
    before = text[:start].rstrip()
    found = ending(r"[A-Za-z_0-9.]+$", before)
    previous = found[0] if found else ""
    here = Span(source, start, end)
    if word.lower() in KEYWORDS and word != word.lower():
        return Diagnostic(f"unknown word `{word}`", here, "", f"keywords are lower case: `{word.lower()}`")
    if "COLON" in accepts:
        return Diagnostic("missing `:`", here, "expected `:` before the formula", "write forall i in 1..6: formula")
    if previous == "workspace":
        help_ = "write workspace [0, 1] x [0, 1]"
        return Diagnostic(f"unexpected {_shown(word)}", here, "expected an interval such as [0, 1]", help_)
    stack, _ = _open_brackets(text, start)
    opening = nearest(previous, STATEMENTS) if previous not in KEYWORDS else None
    if opening is not None and before[: len(before) - len(previous)].rstrip()[-1:] in ("", "\n", ")", "]"):
        place = Span(source, len(before) - len(previous), len(before))
        return Diagnostic(f"unknown statement `{previous}`", place, "", f"did you mean `{opening}`?")
    known = [one for one in ("and", "or", "implies") if f"_{one.upper()}" in accepts]
    if text[end : end + 1] != "(":
        known += [one for one in STATEMENTS if one.upper() in accepts]
    close = nearest(word, known) if word.isidentifier() else None
    if close is not None and len(word) > 2 and word not in KEYWORDS:
        return Diagnostic(f"unexpected `{word}`", here, "", f"did you mean `{close}`?")
    if not accepts & {"_AND", "_OR", "PLUS"}:
        return _unnamed_formula(here, accepts)
    between = text[len(before) : start]
    if previous[:1].isdigit() and word.isidentifier() and word not in KEYWORDS and "\n" not in between:
        return Diagnostic(f"unknown unit `{word}`", here, "", "units are m, cm, mm, rad, deg and turn")
    join = "join the two parts with `&` (and), `|` (or) or `->` (implies)"
    label = f"expected an operator before {_shown(word)}"
    if stack and "COMMA" in accepts:
        help_ = "part arguments by `,`; join formulas with `&` (and), `|` (or) or `->` (implies)"
        return Diagnostic("missing `,` or operator", here, label.replace("an operator", "`,` or an operator"), help_)
    if previous.isidentifier() and previous not in KEYWORDS and word.isidentifier() and "\n" not in between:
        join = f"arguments stand in parentheses: {previous}({word}, ...)"
    elif not stack and "\n" in between:
        join += ",\nor give every formula a name: `task: ...` and `safe: ...`"
    elif word == "(":
        join += "; only a name can be called"
    return Diagnostic("missing operator", here, label, join)


def _unnamed_formula(here: Span, accepts: set[str]) -> Diagnostic:
    """A name where a list of names or a statement has ended."""
    word = here.text
    if "LABEL" in accepts and word.isidentifier():
        rest = here.source.text[here.end :].lstrip()
        if rest.startswith("("):
            help_ = f"a formula among statements needs a name: `task: {word}(...)`"
            return Diagnostic("a formula without a name", here, "expected a statement", help_)
        if re.match(r"[A-Za-z_]\w*\s*\(", rest):
            return Diagnostic("a formula is named with `:`", here, "", f"write `{word}: ...`")
        label = "expected `,` or a statement" if "COMMA" in accepts else f"expected {_expected(accepts)}"
        return Diagnostic(f"unexpected `{word}`", here, label, "names in a list are parted by `,`")
    return Diagnostic(f"unexpected {_shown(word)}", here, f"expected {_expected(accepts)}")


def _keyword(source: Source, start: int, end: int, accepts: set[str]) -> Diagnostic | None:
    if source.text[start - 1 : end] == "->":  # where a number may stand, `-` is taken for its sign
        start -= 1
    word = source.text[start:end]
    if word in (*_BINARY, "and", "or", "implies") and "NAME" in accepts:
        return Diagnostic(
            f"`{word}` has nothing on its left", Span(source, start, end), "expected a formula or a number before it"
        )
    if word == ":" and "COLON" not in accepts:
        return _colon(source, start)
    word = next((key for key in KEYWORDS if re.match(rf"{key}(?!\w)", source.text[start:])), "")
    if not word or "NAME" not in accepts:
        return None
    end = start + len(word)
    return Diagnostic(
        f"`{word}` is a keyword", Span(source, start, end), f"expected {_expected(accepts)}", "choose another name"
    )


def _statement(source: Source, start: int, end: int, accepts: set[str]) -> Diagnostic | None:
    """A statement that opens where a bracket is open, or after a formula without a name."""
    text, word = source.text, source.text[start:end]
    named = word.isidentifier() and re.match(r"\s*:", text[end:]) is not None
    if not (named or word in STATEMENTS) or accepts & {"NAME", "IN", "COLON"}:
        return None
    stack, _ = _open_brackets(text, start)
    if stack:
        return _unclosed(source, stack)
    if "$END" not in accepts or "LABEL" in accepts or ending(r"\bworkspace\s*$", text[:start]):
        return None
    help_ = "give the formula before it a name: `task: ...`"
    return Diagnostic(f"unexpected `{word}`", Span(source, start, end), "an unnamed formula stands alone", help_)


def _unfinished(source: Source, start: int, end: int, accepts: set[str]) -> Diagnostic | None:
    """A statement that opens a line while the one before it still waits for something."""
    text, word = source.text, source.text[start:end]
    opened = start
    if word == ":" and "COLON" not in accepts:
        before = text[text.rfind("\n", 0, start) + 1 : start].rstrip()
        opened = start - column(text, start) if before.isidentifier() else start
    elif word not in STATEMENTS or accepts & {"$END", "LABEL"}:
        return None
    if column(text, opened) or (opened == start and word == ":") or not text[:opened].strip():
        return None
    stack, _ = _open_brackets(text, opened)
    if stack:
        return _unclosed(source, stack)
    if word == ":":
        return None
    label = f"expected {_expected(accepts)} before it"
    return Diagnostic("a statement opens here", Span(source, start, end), label, "finish the statement before it")


def _colon(source: Source, start: int) -> Diagnostic:
    found = ending(r"\w+$", source.text[:start].rstrip())
    if found is not None and found[0] in KEYWORDS:
        return Diagnostic(
            f"`{found[0]}` is a keyword",
            Span(source, found.start(), found.end()),
            "it cannot name a formula",
            "choose another name",
        )
    opens = found.start() if found is not None else start
    return Diagnostic(
        "a name with `:` opens a statement",
        Span(source, opens, start + 1),
        "it cannot stand inside a formula",
        "finish the formula before it",
    )


def _number(source: Source, start: int, accepts: set[str]) -> Diagnostic | None:
    text = source.text
    if ending(r"\d\.$", text[:start]) and "NAME" in accepts:
        return _dot(source, start)
    if text[start] != ".":
        return None
    if re.match(r"\.\d", text[start:]) and "NAME" in accepts:
        number = re.match(r"\.\d+", text[start:])
        shown = number[0] if number else "."
        return Diagnostic(
            "a number starts with a digit", Span(source, start, start + len(shown)), "", f"write 0{shown}"
        )
    return None


def _dot(source: Source, end: int) -> Diagnostic:
    """A number such as `5.` that ends just before `end`."""
    found = ending(r"\d+\.$", source.text[:end])
    assert found is not None
    return Diagnostic("a number ends with a digit", Span(source, found.start(), end), "", f"write {found[0]}0")


def _unclosed(source: Source, stack: list[int]) -> Diagnostic:
    opened = source.text[stack[-1]]
    closing = {"(": ")", "[": "]"}[opened]
    return Diagnostic(
        f"this `{opened}` is never closed",
        Span(source, stack[-1], stack[-1] + 1),
        f"`{closing}` is missing" + (f" ({len(stack)} brackets are open)" if len(stack) > 1 else ""),
        f"add `{closing}` where it ends",
    )


def _at_end(source: Source, accepts: set[str]) -> Diagnostic:
    text = source.text
    stop = len(text.rstrip())
    stack, _ = _open_brackets(text, len(text))
    if stack and accepts & {"RPAR", "RSQB"}:
        return _unclosed(source, stack)
    if ending(r"\d\.$", text[:stop]):
        return _dot(source, stop)
    word = ending(r"(?:[A-Za-z_]\w*|->|<=|>=|[^\w\s])$", _without_comments(text).rstrip())
    after = f" after `{word[0]}`" if word else ""
    return Diagnostic(
        f"the text ends{after}", Span(source, stop, stop), f"expected {_expected(accepts)}", "finish the formula"
    )


def _without_comments(text: str) -> str:
    return re.sub(r"#[^\n]*", "", text)
