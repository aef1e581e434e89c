"""Mistakes that people bring from other languages, from mathematics and from word processors.

Each is recognised by the text around the place where the parser stopped, and answered with what to write instead. The
general explanations are in scenegen.lang.syntax_errors.
"""

from __future__ import annotations

import re

from scenegen.errors import Diagnostic, Source, Span
from scenegen.lang.tokens import ending
from scenegen.primitives import PRIMITIVES
from scenegen.scene.workspace import AXES

_UNITS = ("m", "cm", "mm", "rad", "deg", "turn")

# characters of word processors and of other alphabets -> what to type instead
_LOOKALIKES = {
    "°": ("degrees are written out", "write 90 deg"),
    "“": ("these are typographic quotes", "write names without quotes; file names in straight ones"),
    "”": ("these are typographic quotes", "write names without quotes; file names in straight ones"),
    "‘": ("these are typographic quotes", "write names without quotes"),
    "’": ("these are typographic quotes", "write names without quotes"),
    "，": ("this is a wide comma", "write `,`"),
    "：": ("this is a wide colon", "write `:`"),
    "（": ("this is a wide parenthesis", "write `(`"),
    "）": ("this is a wide parenthesis", "write `)`"),
    "−": ("this is a typographic minus", "write `-`"),
    "–": ("this is a dash", "write `-`"),
    "×": ("this is not a letter", "write `*` for a product, `x` in `workspace [0, 1] x [0, 1]`"),
    "·": ("this is not an operator here", "write `*` for a product"),
    "′": ("this is not a unit", "units are m, cm, mm, rad, deg and turn"),
}


def explain_habit(source: Source, start: int, end: int, depth: int, accepts: set[str]) -> Diagnostic | None:
    """The diagnostic for a known habit at characters start..end, `depth` brackets deep; None for anything else."""
    text, word = source.text, source.text[start:end]
    here = Span(source, start, end)
    line = text[text.rfind("\n", 0, start) + 1 : start]
    if text[start] in _LOOKALIKES:
        title, help_ = _LOOKALIKES[text[start]]
        return Diagnostic(title, Span(source, start, start + 1), "", help_)
    if text[max(0, start - 2) : start + 1] == "<->":
        help_ = "write (a -> b) & (b -> a)"
        return Diagnostic("`<->` is not an operator here", Span(source, start - 2, start + 1), "", help_)
    if word == "," and not depth and accepts & {"_AND", "$END"}:
        help_ = "join formulas with `&` (and), `|` (or) or `->` (implies)"
        return Diagnostic("`,` cannot join formulas", here, "", help_)
    if word == "|" and "NAME" in accepts and re.match(r"[^|\n]*\|", text[end:]):
        return Diagnostic("`|` has nothing on its left", here, "", "for an absolute value write abs(...)")
    if word == "=" and text[end : end + 1] not in ("=", "<", ">"):
        head = re.fullmatch(r"\s*((\w+)\s*\([\w\s,]*\))\s*", line)
        if head is not None and head[2] not in PRIMITIVES and head[2] not in AXES:
            return Diagnostic("a definition opens with `def`", here, "", f"write `def {head[1]} = ...`")
    if word == "[" and ending(r"\bobject\s[^\n:=]*\]\s*$", text[:start]):
        help_ = "declare several arrays: object block[2], cup[3]"
        return Diagnostic("an array has one number of elements", here, "", help_)
    if word == ":":
        return _colon(source, here, line, depth, accepts)
    if word.isidentifier() and "NAME" not in accepts and "COLON" not in accepts:
        return _word(source, here, line, depth)
    return None


def _colon(source: Source, here: Span, line: str, depth: int, accepts: set[str]) -> Diagnostic | None:
    before = ending(r"(\w+)\s*$", line)
    name = before[1] if before else ""
    if name == "workspace":
        return Diagnostic("`workspace` takes no `:`", here, "", "write workspace [0, 1] x [0, 1]")
    if depth and ending(r"[(,]\s*\w+\s*$", line):
        return Diagnostic("an argument is named with `=`", here, "", f"write {name} = ...")
    if ending(r"\bobject\s+\w+\s*$", source.text[: here.start]):
        return Diagnostic("`object` needs names", here, "a statement opens here", "write object mug, plate")
    comma = source.text[: here.start].rstrip().removesuffix(name).rstrip()
    if comma.endswith(",") and not depth and "\n" in source.text[len(comma) : here.start]:
        return Diagnostic(
            "this `,` has nothing on its right", Span(source, len(comma) - 1, len(comma)), "", "remove it"
        )
    if "EQUAL" in accepts:
        return Diagnostic(
            "expected `=` here", here, "", "constants and definitions are written with `=`, labels with `:`"
        )
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
        return Diagnostic(
            "there is no `if` here",
            Span(source, here.start - len(before[0]), here.end),
            "",
            "write condition -> consequence",
        )
    if word == "then":
        return Diagnostic("there is no `then` here", here, "", "write condition -> consequence")
    if word in _UNITS and previous not in ("object", "const", "region"):
        help_ = f"a unit follows a written number: {previous} * 1 {word}"
        return Diagnostic(f"`{previous}` cannot have a unit", here, "", help_)
    if after is not None and after[1] not in ("and", "or", "implies", "in", "at") and not depth:
        # relations are written in camel case, objects hardly ever
        words = [previous, word, after[1]]
        name = words.pop(next((place for place, one in enumerate(words) if re.search(r"[A-Z]", one[1:])), 1))
        first, second = words
        help_ = f"write {name}({first}, {second})"
        return Diagnostic("a relation is written in front of its arguments", here, "", help_)
    if re.fullmatch(r"\s*", line[: before.start()]) and re.match(r"\s*\(", text[here.end :]) and not depth:
        return Diagnostic("a formula is named with `:`", here, "", f"write `{previous}: {word}(...)`")
    return None
