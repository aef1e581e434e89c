"""The text as `scenegen fmt` writes it, as one change to the lines that differ."""

from __future__ import annotations

from dataclasses import dataclass

from scenegen.errors import SpecError
from scenegen.lang.layout import format_source
from scenegen.lsp.document import Document


@dataclass(frozen=True, slots=True)
class Change:
    """`text` takes the place of characters `start` to `end`."""

    start: int
    end: int
    text: str


def formatted(document: Document) -> Change | None:
    """The change that turns the document into its canonical layout; None if it has that already, or does not parse."""
    try:
        wanted = format_source(document.source)
    except SpecError:
        return None
    if wanted == document.text:
        return None
    old, new = document.text.splitlines(keepends=True), wanted.splitlines(keepends=True)
    head = 0
    while head < min(len(old), len(new)) and old[head] == new[head]:
        head += 1
    tail = 0
    while tail < min(len(old), len(new)) - head and old[-1 - tail] == new[-1 - tail]:
        tail += 1
    start = sum(map(len, old[:head]))
    end = len(document.text) - sum(map(len, old[len(old) - tail :]))
    return Change(start, end, "".join(new[head : len(new) - tail]))
