"""Text -> s-expressions with places. One loop, no recursion, and limits that hostile text meets early."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from scenegen.errors import DataError, Source, Span
from scenegen.errors.planning import PDDL_BRACKETS, PDDL_CHARACTER, PDDL_TOO_DEEP
from scenegen.formats.files import read_bytes
from scenegen.lang.parse import plain_breaks

MAX_BYTES = 4_000_000
MAX_DEPTH = 200  # what reads the tree may recurse

_TOKEN = re.compile(r"[ \t\n\f]+|;[^\n]*|[()]|[^\s();\x00-\x1f\x7f]+")


@dataclass(frozen=True, slots=True)
class Atom:
    """A word, as written."""

    text: str
    span: Span


@dataclass(frozen=True, slots=True)
class Group:
    """What stands between two parentheses."""

    items: tuple[Node, ...]
    span: Span

    @property
    def head(self) -> str:
        """The first word, in lower case; empty if there is none."""
        first = self.items[0] if self.items else None
        return first.text.lower() if isinstance(first, Atom) else ""

    @property
    def rest(self) -> tuple[Node, ...]:
        return self.items[1:]


Node = Atom | Group


def read(path: Path, what: str) -> tuple[Source, tuple[Node, ...]]:
    """A file and its expressions. Raises DataError for files too large, binary or unbalanced."""
    data = read_bytes(path, what, limit=MAX_BYTES)
    text = plain_breaks(data.decode("utf-8-sig", errors="replace"))
    source = Source(str(path), text)
    return source, expressions(source)


def expressions(source: Source) -> tuple[Node, ...]:
    """All expressions of a text. Raises DataError."""
    open_: list[tuple[int, list[Node]]] = [(-1, [])]
    for word, start, end in _words(source):
        if word == "(":
            if len(open_) > MAX_DEPTH:
                raise DataError(PDDL_TOO_DEEP(Span(source, start, end), limit=MAX_DEPTH))
            open_.append((start, []))
        elif word == ")":
            if len(open_) == 1:
                raise DataError(PDDL_BRACKETS(Span(source, start, end)))
            begin, items = open_.pop()
            open_[-1][1].append(Group(tuple(items), Span(source, begin, end)))
        else:
            open_[-1][1].append(Atom(word, Span(source, start, end)))
    if len(open_) > 1:
        begin = open_[-1][0]
        raise DataError(PDDL_BRACKETS(Span(source, begin, begin + 1), opened=True))
    return tuple(open_[0][1])


def _words(source: Source) -> Iterator[tuple[str, int, int]]:
    place, text = 0, source.text
    while place < len(text):
        found = _TOKEN.match(text, place)
        if found is None or "\ufffd" in found[0]:
            if found is not None:
                place += found[0].index("\ufffd")
            here = Span(source, place, place + 1)
            said = f"character U+{ord(text[place]):04X}"
            raise DataError(PDDL_CHARACTER(here, file=source.name, character=said))
        if found[0][0] not in " \t\n\f;":
            yield found[0], place, found.end()
        place = found.end()
