"""Mistakes that people bring from other languages, from mathematics and from word processors.

Each is recognised by the text around the place where the parser stopped, and answered with what to write instead. The
general explanations are in scenegen.lang.syntax_errors.
"""

from __future__ import annotations

import re

from scenegen.errors import Diagnostic, Source, Span
from scenegen.errors.syntax import (
    COLON_AFTER_WORKSPACE,
    COLON_IN_ARGUMENT,
    COMMA_BETWEEN_FORMULAS,
    FOREIGN_OPERATOR,
    INFIX_RELATION,
    LOOKALIKE,
    MISSING_DEF,
    MISSING_EQUAL,
    MISSING_LABEL_COLON,
    NESTED_ARRAY,
    NO_IF,
    NOTHING_ON_LEFT,
    NOTHING_ON_RIGHT,
    OBJECTS_WITHOUT_NAMES,
    UNIT_AFTER_NAME,
)
from scenegen.lang.height_words import between
from scenegen.lang.tokens import ending
from scenegen.pose import NAMES
from scenegen.primitives import PRIMITIVES

_UNITS = ("m", "cm", "mm", "rad", "deg", "turn")

# characters of word processors and of other alphabets -> what to type instead
_QUOTES = "write names without quotes; file names in straight ones"
_LOOKALIKES = {  # what they are, and what to write
    "°": ("not a unit", "write 90 deg"),
    "“": ("a typographic quote", _QUOTES),
    "”": ("a typographic quote", _QUOTES),
    "‘": ("a typographic quote", _QUOTES),
    "’": ("a typographic quote", _QUOTES),
    "，": ("a wide comma", "write `,`"),
    "：": ("a wide colon", "write `:`"),
    "（": ("a wide parenthesis", "write `(`"),
    "）": ("a wide parenthesis", "write `)`"),
    "−": ("a typographic minus", "write `-`"),
    "–": ("a dash", "write `-`"),
    "×": ("not a letter", "write `*` for a product, `x` in `workspace [0, 1] x [0, 1]`"),
    "·": ("not an operator here", "write `*` for a product"),
    "′": ("not a unit", "units are m, cm, mm, rad, deg and turn"),
}


def explain_foreign_syntax(source: Source, start: int, end: int, depth: int, accepts: set[str]) -> Diagnostic | None:
    """The diagnostic for a known habit at characters start..end, `depth` brackets deep; None for anything else."""
    text, word = source.text, source.text[start:end]
    here = Span(source, start, end)
    line = text[text.rfind("\n", 0, start) + 1 : start]
    if text[start] in _LOOKALIKES:
        what, instead = _LOOKALIKES[text[start]]
        return LOOKALIKE(Span(source, start, start + 1), character=text[start], what=what, instead=instead)
    if text[max(0, start - 2) : start + 1] == "<->":
        return FOREIGN_OPERATOR(Span(source, start - 2, start + 1), operator="<->", instead="(a -> b) & (b -> a)")
    if word == "," and not depth and accepts & {"_AND", "$END"}:
        return COMMA_BETWEEN_FORMULAS(here)
    if word == "|" and "NAME" in accepts and re.match(r"[^|\n]*\|", text[end:]):
        return NOTHING_ON_LEFT(here, word="|", instead="for an absolute value write abs(...)")
    if word == "=" and text[end : end + 1] not in ("=", "<", ">"):
        head = re.fullmatch(r"\s*((\w+)\s*\([\w\s,]*\))\s*", line)
        if head is not None and head[2] not in PRIMITIVES and head[2] not in NAMES:
            return MISSING_DEF(here, head=head[1])
    if word == "[" and ending(r"\bobject\s[^\n:=]*\]\s*$", text[:start]):
        return NESTED_ARRAY(here)
    if word == ":":
        return _colon(source, here, line, depth, accepts)
    if word.isidentifier() and "NAME" not in accepts and "COLON" not in accepts:
        return _word(source, here, line, depth)
    return None


def _colon(source: Source, here: Span, line: str, depth: int, accepts: set[str]) -> Diagnostic | None:
    before = ending(r"(\w+)\s*$", line)
    name = before[1] if before else ""
    if name == "workspace":
        return COLON_AFTER_WORKSPACE(here)
    if depth and ending(r"[(,]\s*\w+\s*$", line):
        return COLON_IN_ARGUMENT(here, name=name)
    if ending(r"\bobject\s+\w+\s*$", source.text[: here.start]):
        return OBJECTS_WITHOUT_NAMES(here)
    comma = source.text[: here.start].rstrip().removesuffix(name).rstrip()
    if comma.endswith(",") and not depth and "\n" in source.text[len(comma) : here.start]:
        return NOTHING_ON_RIGHT(Span(source, len(comma) - 1, len(comma)), word=",")
    if "EQUAL" in accepts:
        return MISSING_EQUAL(here)
    return None


def _word(source: Source, here: Span, line: str, depth: int) -> Diagnostic | None:
    """Two words beside each other."""
    text, word = source.text, here.text
    before = ending(r"([A-Za-z_]\w*)[ \t]*$", line)
    if before is None:
        return None
    previous = before[1]
    after = re.match(r"[ \t]+([A-Za-z_]\w*)", text[here.end :])
    if previous == "if":
        return NO_IF(Span(source, here.start - len(before[0]), here.end), word="if")
    if word == "then":
        return NO_IF(here, word="then")
    if word in _UNITS and previous not in ("object", "const", "region"):
        return UNIT_AFTER_NAME(here, name=previous, unit=word)
    if after is not None and after[1] not in ("and", "or", "implies", "in", "at") and not depth:
        # relations are written in camel case, objects hardly ever
        words = [previous, word, after[1]]
        name = words.pop(next((place for place, one in enumerate(words) if re.search(r"[A-Z]", one[1:])), 1))
        first, second = words
        instead = between(name, first, second, declared=re.match(r"\s*object\b", line) is not None)
        if word == "or" and re.search(rf"\bon[ \t]+{previous}[ \t]*$", line):
            instead = f"write on any of [{first}, {second}]"
        return INFIX_RELATION(here, name=name, first=first, second=second, instead=instead)
    if re.fullmatch(r"\s*", line[: before.start()]) and re.match(r"\s*\(", text[here.end :]) and not depth:
        return MISSING_LABEL_COLON(here, name=previous, formula=f"{word}(...)")
    return None
