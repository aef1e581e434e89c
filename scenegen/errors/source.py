"""Texts that diagnostics point into, and places in them."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Source:
    """A text that diagnostics can point into: a file, or an option as typed. `name` is then that of the `argument`,
    which is rendered as `--phi` or `phi`."""

    name: str
    text: str
    argument: bool = False

    def position(self, offset: int) -> tuple[int, int]:
        """1-based line and column (in characters) of a character offset."""
        offset = min(max(offset, 0), len(self.text))
        start = self.text.rfind("\n", 0, offset) + 1
        return self.text.count("\n", 0, offset) + 1, offset - start + 1

    def line(self, offset: int) -> str:
        """The line that holds a character offset, without its line break."""
        start = self.text.rfind("\n", 0, min(max(offset, 0), len(self.text))) + 1
        end = self.text.find("\n", start)
        return self.text[start : len(self.text) if end < 0 else end].rstrip("\r")

    def utf16(self, offset: int) -> tuple[int, int]:
        """0-based line and character of a character offset as language servers count: in UTF-16 code units, of which a
        character beyond U+FFFF takes two."""
        line, column = self.position(offset)
        before = self.line(offset)[: column - 1]
        return line - 1, column - 1 + sum(char > "\uffff" for char in before)


@dataclass(frozen=True, slots=True)
class Span:
    """Characters `start` (inclusive) to `end` (exclusive) of a source."""

    source: Source
    start: int
    end: int

    @property
    def place(self) -> str:
        """`file:line:column`."""
        line, column = self.source.position(self.start)
        return f"{self.source.name}:{line}:{column}"

    @property
    def text(self) -> str:
        return self.source.text[self.start : self.end]
