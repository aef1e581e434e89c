"""Lines of scenes that differ in how many things there are: each as of a file with its objects alone, and `counts`."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from scenegen.formats.blocks import Block, counts_in
from scenegen.formats.lines import SceneLines
from scenegen.pose import row_count, rows_of
from scenegen.scene.data import SceneFile
from scenegen.scene.numbers import member_of

Index = tuple[int, ...]


Each = Callable[[Callable[[Block], bytes], Iterable[Block]], Iterable[bytes]]
"""`map`, or the same by several processes."""


@dataclass(frozen=True, slots=True)
class Text:
    """The job of writing a block's lines: with something before each, and something between two."""

    lines: SceneLines | NumberedLines
    before: str
    between: str

    def __call__(self, block: Block) -> bytes:
        return self.between.join(f"{self.before}{line}" for line in self.lines.of(block)).encode()


def lines_of(header: SceneFile, labels: Sequence[str]) -> SceneLines | NumberedLines:
    """The text of scenes of a file."""
    return NumberedLines(header, labels) if header.counts else SceneLines(header, labels)


class NumberedLines:
    """The text of scenes of a file in which numbers of things are drawn."""

    def __init__(self, header: SceneFile, labels: Sequence[str]) -> None:
        self._header, self._labels = header, labels
        self._members: dict[Index, tuple[SceneLines, list[int]]] = {}
        self._heads: dict[str, tuple[SceneLines, list[int]]] = {}
        numbers = ", ".join(
            f"{re.escape(json.dumps(one.name, ensure_ascii=False))}: ([0-9]{{1,5}})" for one in header.counts
        )
        self._pattern = re.compile(rf'\{{"counts": \{{{numbers}\}}')

    def of(self, block: Block) -> list[str]:
        """A line for each scene of a block; floats are written so that they read back bit for bit."""
        found = counts_in(self._header, block.rows)
        lines = [""] * block.count
        for numbers in np.unique(found, axis=1).T:
            mine = np.flatnonzero((found == numbers[:, None]).all(axis=0))
            text, rows = self._member(tuple(numbers.tolist()))
            some = Block(block.rows[np.array(rows)[:, None], mine], block.phi[:, mine])
            for place, line in zip(mine, text.of(some), strict=True):
                lines[place] = line
        return lines

    def numbers(self, line: str) -> list[float] | None:
        """The numbers of a scene, in the order of a block, in a line as `of` writes it; None for any other text."""
        head = line[: line.find("}") + 1]
        known = self._heads.get(head) or self._read_head(head)
        if known is None:
            return None
        text, rows = known
        found = text.numbers(line)
        if found is None:
            return None
        whole = [math.nan] * self._header.coordinates
        for row, value in zip(rows, found, strict=False):  # phi comes after the coordinates
            whole[row] = value
        return whole + found[len(rows) :]

    def _read_head(self, head: str) -> tuple[SceneLines, list[int]] | None:
        """The member that the beginning of a line names, kept for later lines."""
        match = self._pattern.fullmatch(head)
        counts = () if match is None else tuple(map(int, match.groups()))
        drawn = self._header.counts
        if match is None or any(not one.least <= many <= one.most for one, many in zip(drawn, counts, strict=True)):
            return None
        self._heads[head] = self._member(counts)
        return self._heads[head]

    def _member(self, counts: Index) -> tuple[SceneLines, list[int]]:
        """The text of scenes with these numbers of things, and the rows of their objects among those of all."""
        if counts not in self._members:
            header = self._header
            numbers = dict(zip((one.name for one in header.counts), counts, strict=True))
            member = member_of(header, numbers)
            here = {one.name for one in member.objects}
            rows = [row for which, one in enumerate(header.objects) if one.name in here for row in rows_of(which)]
            first = row_count(len(header.objects))
            rows += [first + which for which, one in enumerate(header.choosers) if one.name in here]
            self._members[counts] = SceneLines(member, self._labels, numbers), rows
        return self._members[counts]
