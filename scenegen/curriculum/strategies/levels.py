"""The range of phi cut into a finite number of parts: levels of difficulty, or cells over all labels.

A source may have no scene for a part, and return the nearest one. For levels this is acceptable: the outcome belongs to
the requested level. Many cells may be out of reach (two labels that no scene violates badly together), and all their
scenes would come from the border of the reachable region. So an outcome belongs to the cell of its first scene, and a
cell that never had a scene is closed after a few attempts.

Outcomes of tasks that the caller chose count by their phi.
"""

from __future__ import annotations

import itertools

import numpy as np

from scenegen.curriculum.strategies.axis import Axis, pick
from scenegen.curriculum.strategies.chances import Floats, Ints, drawn
from scenegen.curriculum.tasks import Outcome, PhiBox
from scenegen.errors import RequestError
from scenegen.errors.learning import TOO_MANY_CELLS

CELLS = (16, 6, 4, 3)  # per label, of one, two, three and four labels; of more, two
MOST = 4096
VAIN = 3  # attempts until a cell without scenes is closed


class Levels:
    """`count` levels of equal difference in difficulty, 0 the easiest; of several labels, shells."""

    def __init__(self, axis: Axis, count: int) -> None:
        self.axis, self.count = axis, count
        self._boxes = [axis.shell(level / count, (level + 1) / count) for level in range(count)]
        self._named = {box: level for level, boxes in enumerate(self._boxes) for _, box in boxes}

    def box(self, level: int, rng: np.random.Generator) -> PhiBox:
        """A box of the level's, by its volume."""
        return pick(self._boxes[level], rng)

    def of(self, outcome: Outcome) -> int | None:
        """The level that an outcome belongs to, None if it lies outside of the space."""
        named = self._named.get(outcome.task)
        if named is not None:
            return named
        difficulty = self.axis.difficulty(outcome.phi)
        return None if difficulty is None else min(int(difficulty * self.count), self.count - 1)


class Cells:
    """A grid over all labels of the axis, `per` cells along each; the first label's index changes slowest.

    `open` is 1 for cells that may have scenes, 0 for closed ones; `vain` counts the failed attempts for cells that
    never had a scene, and is -1 for the others. Raises RequestError for more than MOST cells.
    """

    memory = ("cells.open", "cells.vain")
    """The names for the `memory` of a strategy whose grid is its attribute `cells`."""
    open: Floats
    vain: Ints

    def __init__(self, axis: Axis, per: int | None = None) -> None:
        per = per or (CELLS[axis.count - 1] if 0 < axis.count <= len(CELLS) else 2)
        self.axis, self.per, self.count = axis, per, per**axis.count
        if self.count > MOST:
            raise RequestError(TOO_MANY_CELLS(labels=axis.count, per=per, count=self.count, limit=MOST))
        edges = [(k / per, (k + 1) / per) for k in range(per)]
        corners = [zip(*cell, strict=True) for cell in itertools.product(edges, repeat=axis.count)]
        self._boxes = [axis.box(*corner) if axis.count else axis.space for corner in corners]
        self._named = {box: cell for cell, box in enumerate(self._boxes)}
        self.open, self.vain = np.ones(self.count), np.zeros(self.count, dtype=np.int64)

    def box(self, cell: int) -> PhiBox:
        """The cell's box."""
        return self._boxes[cell]

    def any(self, rng: np.random.Generator) -> int:
        """A cell that is open."""
        return drawn(self.open, rng)

    def of(self, outcome: Outcome) -> int | None:
        """The cell that an outcome belongs to, None if it lies outside of the space. Records cells without scenes."""
        requested = self._named.get(outcome.task)
        if requested is not None and not outcome.task.holds(outcome.phi):
            self._missed(requested)
            requested = None
        cell = self._of(outcome.phi) if requested is None else requested
        if cell is not None and self.vain[cell] >= 0:
            self.vain[cell], self.open[cell] = -1, 1.0
        return cell

    def _missed(self, cell: int) -> None:
        if self.vain[cell] < 0:
            return
        self.vain[cell] += 1
        if self.vain[cell] >= VAIN and self.open.sum() > 1.0:
            self.open[cell] = 0.0

    def _of(self, phi: tuple[float, ...]) -> int | None:
        shares = self.axis.shares(phi)
        if shares is None:
            return None
        cell = 0
        for share in shares:
            cell = cell * self.per + min(int(share * self.per), self.per - 1)
        return cell
