"""Mistakes that people bring from other languages, from mathematics and from word processors.

Each is recognised by the text around the place where the parser stopped, and answered with what to write instead. The
general explanations are in scenegen.lang.syntax_errors.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from scenegen.assets.palette import NAMED
from scenegen.errors import Diagnostic, Source, Span
from scenegen.errors.language import UNKNOWN_RELATION
from scenegen.errors.syntax import (
    CANNOT_BE_SAID,
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
    UNEXPECTED,
    UNIT_AFTER_NAME,
    UNKNOWN_UNIT,
)
from scenegen.lang.other_words import COLOR, COUNTING, FILLERS, INFIX, RELATIONS, between, known, plain
from scenegen.lang.tokens import ending
from scenegen.pose import NAMES
from scenegen.primitives import PRIMITIVES

NAME = r"[A-Za-z_][\w.]*(?:\[[^\[\]\n]*\])?"  # of a thing, an element or a surface
UNITS = ("m", "cm", "mm", "rad", "deg", "turn")

# characters of word processors and of other alphabets -> what to type instead
INCHES = {"in": 2.54, "inch": 2.54, "inches": 2.54, "ft": 30.48, "foot": 30.48, "feet": 30.48}  # in cm

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
    if word == "(" and (named := ending(r"\b(?:object|,)\s*([A-Za-z_]\w*)[ \t]*$", line)) and "EQUAL" in accepts:
        if re.match(r"\s*colou?r\b", text[end:]):
            return CANNOT_BE_SAID(here, word="color", instead=COLOR)
        return UNEXPECTED(here, found="`(`", expected="`=` and a shape", instead=f"write object {named[1]} = box(...)")
    if word == "," and depth and (problem := _range(source, here)) is not None:
        return problem
    if re.match(r"\w", word) and "NAME" not in accepts and "COLON" not in accepts:
        problem = _not_here(source, here, line, accepts)
        return problem or (_word(source, here, line, depth) if word.isidentifier() else None)
    if word == "in" and re.match(r"\s*\(", text[end:]):
        instead = "write inside(a, b), or insideOf(a, b) of what stands in a vessel"
        return UNKNOWN_RELATION(here, name="in", instead=instead)
    return None


def _range(source: Source, here: Span) -> Diagnostic | None:
    """Two numbers with `,` or `:` between them where a range or a window stands with something else."""
    found = ending(r"\b(object\s[^\n]*?)?(\w+)\s*\[\s*([\w.]+)\s*$", source.text[: here.start])
    after = re.match(r"\s*([\w.]+)\s*\]", source.text[here.end :])
    if found is None or after is None:
        return None
    name, first, last = found[2], found[3], after[1]
    instead = f"two elements are a list: [{name}[{first}], {name}[{last}]]"
    if found[1]:
        instead = f"for {first} to {last} of them write {name}[{first}..{last}]"
    elif here.text == ":" and name in ("always", "eventually", "until", "until_with"):
        instead = f"write {name} [{first}, {last}]"
    expected = "`,`" if instead.startswith("write") else "`]`"
    return UNEXPECTED(here, found=f"`{here.text}`", expected=expected, instead=instead)


def _not_here(source: Source, here: Span, line: str, accepts: set[str]) -> Diagnostic | None:
    """A property or a statement that other languages have, and this one has not."""
    text, word = source.text, here.text
    before = ending(r"(\w+|\)|\])[ \t]*$", line)
    if word in INCHES and (number := ending(r"(?<![\w.])(\d+(?:\.\d+)?)[ \t]*$", line)) is not None:
        instead = f"{float(number[1]) * INCHES[word]:.4g} cm"
        return UNKNOWN_UNIT(here, name=word, instead=instead)
    if word in UNITS and before is not None and before[1] in (")", "]"):
        instead = f"a unit follows each number: [0 {word}, 40 {word}]"
        return UNEXPECTED(here, found=f"`{word}`", expected="no unit", instead=instead)
    if word in ("iff", "xor", "XOR") and "_AND" in accepts:
        instead = "(a -> b) & (b -> a)" if word == "iff" else "(a | b) & !(a & b)"
        return FOREIGN_OPERATOR(here, operator=word, instead=instead)
    if word == "in" and ending(r"\b(count|number|sum|len)\s*\(\s*\w+\s*$", line):
        return CANNOT_BE_SAID(here, word="count", instead=COUNTING)
    if word == "in" and before is not None and before[1] == ")":
        instead = "for a number write 0.2 <= x(mug) <= 0.4, for a place inside(mug, region)"
        return UNEXPECTED(here, found="`in`", expected="a comparison", instead=instead)
    after = re.match(r"[ \t]+(\w+)", text[here.end :])
    words = [(here.start, here.end)]
    if before is not None and ending(r"\b(?:object|,)\s*\w+[ \t]*$", line) and before[1].lower() in NAMED:
        start = here.start - len(before[0])
        return CANNOT_BE_SAID(Span(source, start, start + len(before[1])), word=before[1], instead=COLOR)
    if word in ("with", "has", "having", "at", "of") and after is not None:
        words = [(here.end + after.start(1), here.end + after.end(1))]
    if before is not None and re.fullmatch(r"\s*\w+[ \t]*", line) and before[1] not in ("object", "region"):
        words.append((here.start - len(before[0]), here.start - len(before[0]) + len(before[1])))
    for start, end in words if before is None or before[1] != "by" else ():
        instead = RELATIONS.get(plain(text[start:end]), "write")
        if not instead.startswith(("write", "if ", "allow")):
            return CANNOT_BE_SAID(Span(source, start, end), word=text[start:end], instead=instead)
    return None


def _colon(source: Source, here: Span, line: str, depth: int, accepts: set[str]) -> Diagnostic | None:
    before = ending(r"(\w+)\s*$", line)
    name = before[1] if before else ""
    if depth and (problem := _range(source, here)) is not None:
        return problem
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


def _sides(words: Sequence[str]) -> tuple[str, Sequence[str], str]:
    """The two things of a sentence such as `mug is left of plate`, and what it says of them."""
    # relations are written in camel case, objects hardly ever
    camel = next((place for place, one in enumerate(words[:3]) if re.search(r"[A-Z]", one[1:])), None)
    if camel is None and plain(words[0]) in RELATIONS and plain(words[1]) not in RELATIONS | INFIX:
        camel = 0
    if camel is not None:
        first, second = (one for place, one in enumerate(words[:3]) if place != camel)
        return first, [words[camel]], second
    for end in range(len(words) - 1, 1, -1):  # the longest that is known
        if known(words[1:end]) is not None:
            return words[0], words[1:end], words[end]
    said = [one for one in words[1:] if one.lower() not in FILLERS]
    return (words[0], said[:1], said[1]) if len(said) > 1 else (words[0], [words[1]], words[2])


def _word(source: Source, here: Span, line: str, depth: int) -> Diagnostic | None:
    """Two words beside each other."""
    text, word = source.text, here.text
    before = ending(rf"({NAME})[ \t]*$", line)
    if before is None:
        return None
    previous = before[1]
    after = re.match(r"[ \t]+([A-Za-z_]\w*)", text[here.end :])
    declared = re.match(r"\s*object\b", line) is not None
    if previous == "import":
        return None
    if word == "of" and after is not None and declared and (on := ending(r"(\S+)\s+on\s+top\s*$", line)) is not None:
        instead = f"write `{on[1]} on {after[1]}`"
        return INFIX_RELATION(here, name="on", first=on[1], second=after[1], instead=instead)
    same = re.match(rf"is[ \t]+(not[ \t]+)?({NAME})(?![ \t]*(?!and\b|or\b|implies\b)[\w.(\[])", text[here.start :])
    if same is not None and not declared and plain(same[2]) not in RELATIONS | INFIX:
        unlike = f"{previous} != {same[2]}"
        instead = f"write {unlike}" if same[1] else f"write !({unlike})"
        return INFIX_RELATION(here, name="is", first=previous, second=same[2], instead=instead)
    if previous == "if":
        return NO_IF(Span(source, here.start - len(before[0]), here.end), word="if")
    if word == "then":
        return NO_IF(here, word="then")
    if word in UNITS and previous not in ("object", "const", "region"):
        return UNIT_AFTER_NAME(here, name=previous, unit=word)
    if after is not None and after[1] not in ("and", "or", "implies", "in", "at") and not depth:
        phrase = re.match(r"[A-Za-z_]\w*([ \t]+[A-Za-z_]\w*)*", text[here.start :])
        words = [previous, *(phrase[0].split() if phrase else ())]
        if phrase is not None and (more := re.match(r"(?:\.\w+|\[[^\[\]\n]*\])+", text[here.start + phrase.end() :])):
            words[-1] += more[0]  # cabinet.drawer[1]
        first, said, second = _sides(words)
        name = said[0] + "".join(one[:1].upper() + one[1:] for one in said[1:])
        told = between(first, said, second, declared=declared)
        if word == "or" and re.search(rf"\bon[ \t]+{previous}[ \t]*$", line):
            told = f"write on any of [{first}, {second}]"
        return INFIX_RELATION(here, name=name, first=first, second=second, instead=told)
    if re.fullmatch(r"\s*", line[: before.start()]) and re.match(r"\s*\(", text[here.end :]) and not depth:
        return MISSING_LABEL_COLON(here, name=previous, formula=f"{word}(...)")
    return None
