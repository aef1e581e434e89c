"""Places in a text: character offsets, and the lines and characters that editors count in.

An editor's `character` counts UTF-16 code units unless client and server agreed on UTF-8 bytes or on UTF-32. Lines end
at `\\n`; `\\r\\n` and `\\r` count as one break too, so a text keeps its positions when its breaks are made plain.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Mapping
from itertools import accumulate

# encoding -> how many units one character takes
_UNITS: Mapping[str, Callable[[str], int]] = {
    "utf-8": lambda char: len(char.encode("utf-8", "surrogatepass")),
    "utf-16": lambda char: 1 + (char > "\uffff"),
    "utf-32": lambda char: 1,
}


class Lines:
    """The lines of a text with plain line breaks, in one of the encodings that language servers know."""

    def __init__(self, text: str, encoding: str = "utf-16") -> None:
        self.text, self.encoding = text, encoding
        self._units = _UNITS[encoding]
        self._starts = [0, *accumulate(len(line) + 1 for line in text.split("\n")[:-1])]

    def position(self, offset: int) -> tuple[int, int]:
        """0-based line and character of an offset; beyond the text it is the text's end."""
        offset = min(max(offset, 0), len(self.text))
        line = bisect_right(self._starts, offset) - 1
        before = self.text[self._starts[line] : offset]
        return line, len(before) if before.isascii() else sum(map(self._units, before))

    def offset(self, line: int, character: int) -> int:
        """The offset of a position. Beyond a line's end it is that end, inside a character that character's start."""
        if line >= len(self._starts):
            return len(self.text)
        start = self._starts[max(line, 0)]
        end = self.text.find("\n", start)
        words = self.text[start : len(self.text) if end < 0 else end]
        if words.isascii():
            return start + min(max(character, 0), len(words))
        for place, char in enumerate(words):
            character -= self._units(char)
            if character < 0:
                return start + place
        return start + len(words)
