"""Syntax errors about time: its words in a spec that has no `time` statement, or in the wrong place of one that has."""

from __future__ import annotations

import re
from collections.abc import Sequence

from scenegen.errors import Diagnostic, Source, Span, nearest
from scenegen.errors.syntax import KEYWORD_AS_NAME, UNEXPECTED
from scenegen.errors.temporal import (
    HORIZON_OUT_OF_RANGE,
    MOVES_WITHOUT_TIME,
    NO_WINDOW_HERE,
    TIME_MISSING,
    TIME_UNFINISHED,
)
from scenegen.lang.expected import expected
from scenegen.lang.horizon import MAX_STEPS
from scenegen.lang.tokens import KEYWORDS, OVER_TIME, TEMPORAL, ending

# a part of help lines
UNITS_OF_TIME = "times in s, ms or min; speeds in m/s or cm/s; turn rates in deg/s or rad/s"

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


def _meant(word: str, known: Sequence[str]) -> str | None:
    """The word of time that another was meant for."""
    if word in known:
        return None
    elsewhere = _ELSEWHERE.get(word)
    return elsewhere if elsewhere in known else nearest(word.lower(), known) if len(word) > 2 else None


def explain_time(source: Source, start: int, end: int, accepts: set[str], timed: bool) -> Diagnostic | None:
    """The diagnostic for a mistake at characters start..end that has to do with time; None for any other."""
    return _in_time(source, start, end, accepts) if timed else _without(source, start, end)


def _without(source: Source, start: int, end: int) -> Diagnostic | None:
    """Words of time where they can only be meant as such, for two names never stand beside each other."""
    text, word = source.text, source.text[start:end]
    before = text[:start]
    if word in ("until", "until_with"):
        return TIME_MISSING(Span(source, start, end), word=word)
    found = ending(r"\btime\s+(-\s*\d[\d.]*)\s+$", before)
    if found is not None and word == "steps":
        steps = float(found[1].replace(" ", "").rstrip("."))
        return HORIZON_OUT_OF_RANGE(Span(source, found.start(1), end), steps=steps, limit=MAX_STEPS)
    found = ending(r"\bmoves\s+$", before)
    if found is not None and word.isidentifier():
        return MOVES_WITHOUT_TIME(Span(source, found.start(), end))
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
    known = None if found is None or found[1] in KEYWORDS else _meant(found[1], (*OVER_TIME, "moves", "until"))
    if found is not None and known is not None and (word in (",", ":") if "[" in found[2] else _OPERAND.match(word)):
        return UNEXPECTED(Span(source, found.start(1), found.end(1)), found=f"`{found[1]}`", nearest=known)
    known = _meant(word, ("until", "until_with", "moves"))
    if known is not None and "NAME" not in accepts and word not in KEYWORDS:
        return UNEXPECTED(Span(source, start, end), found=f"`{word}`", nearest=known)
    if ending(r"\btime\s*\[[^][]*\]\s*$", before) or (ending(r"\btime\s+[\w. ]+\s$", before) and "NAME" in accepts):
        return TIME_UNFINISHED(Span(source, start, end))
    found = ending(r"\b(next|initially|finally)\s*\[[^][]*\]\s*$", before)
    if found is not None:
        return NO_WINDOW_HERE(Span(source, found.start(), found.end()), operator=found[1])
    match = re.compile(rf"({'|'.join(sorted(TEMPORAL, reverse=True))})(?!\w)").match(text, start)
    if match is not None and "NAME" in accepts and "OVER_TIME" not in accepts:
        return KEYWORD_AS_NAME(Span(source, start, match.end()), word=match[1], expected=expected(accepts))
    return None
