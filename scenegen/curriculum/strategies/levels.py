"""The reach of phi cut into parts that are counted: levels of difficulty, or cells over all labels.

An outcome belongs to the part whose box was asked for, else to the part that its first scene's phi lies in: so a part
that no scene can reach, and for which a source hands out its nearest, is heard of too; and outcomes of tasks that
somebody else chose count like our own.
"""

from __future__ import annotations

import itertools
from typing import Protocol

import numpy as np

from scenegen.curriculum.strategies.axis import Axis, pick
from scenegen.curriculum.tasks import Outcome, PhiBox
from scenegen.errors import Diagnostic, RequestError

CELLS = (16, 6, 4, 3)  # per label, of one, two, three and four labels; of more, two
MOST = 4096


class Parts(Protocol):
    """What levels and cells have in common: `count` of them."""

    count: int

    def box(self, part: int, rng: np.random.Generator) -> PhiBox:
        """A box of this part."""
        ...

    def of(self, outcome: Outcome) -> int | None:
        """The part that an outcome belongs to, None if it lies outside of the space."""
        ...


class Levels:
    """`count` levels of equal difference in difficulty, 0 the easiest; of several labels, shells."""

    def __init__(self, axis: Axis, count: int) -> None:
        self.axis, self.count = axis, count
        self._boxes = [axis.shell(level / count, (level + 1) / count) for level in range(count)]
        self._named = {box: level for level, boxes in enumerate(self._boxes) for _, box in boxes}

    def box(self, part: int, rng: np.random.Generator) -> PhiBox:
        return pick(self._boxes[part], rng)

    def of(self, outcome: Outcome) -> int | None:
        named = self._named.get(outcome.task)
        if named is not None:
            return named
        difficulty = self.axis.difficulty(outcome.phi)
        return None if difficulty is None else min(int(difficulty * self.count), self.count - 1)


class Cells:
    """A grid over all labels of the axis, `per` cells along each; the first label's index changes slowest.

    Raises RequestError where that makes more than MOST cells.
    """

    def __init__(self, axis: Axis, per: int | None = None) -> None:
        per = per or (CELLS[axis.count - 1] if 0 < axis.count <= len(CELLS) else 2)
        self.axis, self.per, self.count = axis, per, per**axis.count
        if self.count > MOST:
            title = f"{axis.count} labels with {per} cells each make {self.count} cells, more than {MOST}"
            raise RequestError(Diagnostic(title, help="name the labels that matter: labels=[0, 1]"))
        edges = [(k / per, (k + 1) / per) for k in range(per)]
        corners = [zip(*cell, strict=True) for cell in itertools.product(edges, repeat=axis.count)]
        self._boxes = [axis.box(*corner) if axis.count else axis.space for corner in corners]
        self._named = {box: cell for cell, box in enumerate(self._boxes)}

    def box(self, part: int, rng: np.random.Generator) -> PhiBox:
        return self._boxes[part]

    def of(self, outcome: Outcome) -> int | None:
        named = self._named.get(outcome.task)
        if named is not None:
            return named
        shares = self.axis.shares(outcome.phi)
        if shares is None:
            return None
        cell = 0
        for share in shares:
            cell = cell * self.per + min(int(share * self.per), self.per - 1)
        return cell
