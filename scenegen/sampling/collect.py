"""Keeping verified scenes cell by cell until every reachable cell has its share."""

from __future__ import annotations

from collections.abc import Mapping, Set
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from scenegen.errors import Diagnostic
from scenegen.sampling.cells import Cells, shares

Array = npt.NDArray[np.float64]

GOLDEN = (5.0**0.5 - 1.0) / 2.0


@dataclass(frozen=True, slots=True)
class Sampled:
    """Scenes handed out: rows (3N, n) and phi (L, n) in float64, how they were made, and what is to be said about it.

    `info` goes into the scene file's `sampler` (no timings: the same seed gives the same bytes). `shortfall` is set
    where fewer than the wanted n scenes were found.
    """

    rows: Array
    phi: Array
    info: Mapping[str, object]
    warnings: tuple[Diagnostic, ...] = ()
    shortfall: Diagnostic | None = None

    @property
    def count(self) -> int:
        return int(self.rows.shape[1])


@dataclass(slots=True)
class Collector:
    """Takes candidates in the order in which they are offered; the first that a cell needs are the ones it keeps."""

    cells: Cells
    n: int
    possible: Set[int]
    generator: np.random.Generator
    _rows: dict[int, list[Array]] = field(default_factory=dict)
    _phi: dict[int, list[Array]] = field(default_factory=dict)
    _count: dict[int, int] = field(default_factory=dict)
    _dead: set[int] = field(default_factory=set)
    _order: list[float] = field(init=False)

    def __post_init__(self) -> None:
        # Who gets one scene more, or the only one: multiples of the golden ratio leave even gaps, however many.
        shift = self.generator.random()
        self._order = [(cell * GOLDEN + shift) % 1.0 for cell in range(self.cells.count)]

    def offer(self, rows: Array, phi: Array) -> npt.NDArray[np.intp]:
        """Keep what is needed of B scenes, (3N, B) with phi (L, B); returns the cell of each, -1 for out of range."""
        found = self.cells.find(phi)
        present = np.unique(found[found >= 0])
        for cell in present:
            self._count.setdefault(int(cell), 0)
        most = -(-self.n // max(1, len(self._count)))
        for cell in map(int, present):
            room = most - self._count[cell]
            if room > 0:
                mine = np.flatnonzero(found == cell)[:room]
                whole = len(mine) == rows.shape[1]
                self._rows.setdefault(cell, []).append(rows if whole else rows.take(mine, axis=1))
                self._phi.setdefault(cell, []).append(phi if whole else phi.take(mine, axis=1))
                self._count[cell] += len(mine)
        return found

    def give_up(self, cell: int) -> None:
        """Declare a cell out of reach: its share goes to the others."""
        if not self._count.get(cell):
            self._dead.add(cell)

    @property
    def unreached(self) -> list[int]:
        """Cells in which no scene has been found so far, in order."""
        return [cell for cell in range(self.cells.count) if not self._count.get(cell)]

    @property
    def undecided(self) -> list[int]:
        """Cells that have neither been reached nor given up nor ruled out."""
        return [
            cell
            for cell in self.unreached
            if cell in self.possible and cell not in self._dead and cell not in self._count
        ]

    def quotas(self, *, hopeful: bool = False) -> Mapping[int, int]:
        """How many scenes each reached cell is to have; `hopeful` counts undecided cells as reachable."""
        reached = sorted(self._count)
        return shares(self.n, sorted([*reached, *self.undecided]) if hopeful else reached, self._order)

    def deficits(self, *, hopeful: bool = False) -> dict[int, int]:
        """How many scenes each cell still lacks; cells that lack none are left out."""
        missing = {cell: share - self._count.get(cell, 0) for cell, share in self.quotas(hopeful=hopeful).items()}
        return {cell: lack for cell, lack in missing.items() if lack > 0}

    @property
    def complete(self) -> bool:
        """Whether every cell reached so far has its share."""
        return bool(self._count) and not self.deficits()

    @property
    def found(self) -> int:
        """Scenes that would be handed out now."""
        return sum(min(share, self._count.get(cell, 0)) for cell, share in self.quotas().items())

    def scenes(self) -> tuple[Array, Array]:
        """The scenes of all cells in an order without pattern: rows (3N, n), phi (L, n). Scenes of a single cell stay
        in the order in which they were offered."""
        rows: list[Array] = []
        phi: list[Array] = []
        cells = 0
        for cell, share in self.quotas().items():
            have = min(share, self._count.get(cell, 0))
            cells += have > 0
            for block, values in zip(self._rows.get(cell, ()), self._phi.get(cell, ()), strict=True):
                if have > 0:
                    rows.append(block[:, :have])
                    phi.append(values[:, :have])
                have -= block.shape[1]
        together, values = np.concatenate(rows, axis=1), np.concatenate(phi, axis=1)
        if cells == 1:
            return together, values
        order = self.generator.permutation(together.shape[1])
        return together.take(order, axis=1), values.take(order, axis=1)
