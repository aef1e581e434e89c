"""Target values of phi for proposers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.sampling.problem import LARGEST_PIECE, PILOT, Problem
from scenegen.sampling.request import Cells

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.intp]

FEWEST = 16  # scenes of a range that tell how phi is distributed there
INSIDE = 1e-4  # of what is required, where its margin is not known: a tenth of a millimetre


@dataclass(frozen=True, slots=True, eq=False)
class Targets:
    """Combinations of target values of phi that occur in scenes.

    Drawn from `phi` (L, P) of scenes as they occur in the range, or else of a pilot sample of the base distribution, so
    that labels which are free, or depend on each other, get compatible values; if none of them is in a cell, uniform in
    the cell. `members` are these scenes in order of their cells, which begin at `borders`.
    """

    cells: Cells
    phi: Array
    members: Index
    borders: Index

    def draw(self, cells: Index, rng: np.random.Generator) -> Array:
        """A target phi for each of B cells, (B,) -> (L, B)."""
        out = np.empty((self.phi.shape[0], len(cells)))
        for cell in map(int, np.unique(cells)):
            mine = np.flatnonzero(cells == cell)
            members = self.members[self.borders[cell] : self.borders[cell + 1]]
            if len(members):
                out[:, mine] = self.phi[:, rng.choice(members, len(mine))]
            else:
                out[:, mine] = self._guess(cell, len(mine), rng)
        return out

    def _guess(self, cell: int, count: int, rng: np.random.Generator) -> Array:
        """Uniform within a cell; labels with an open end take a value of the pilot, clipped to the cell."""
        low, high = self.cells.limits(cell)
        guess: Array = self.phi[:, rng.integers(self.phi.shape[1], size=count)]
        closed = np.isfinite(low) & np.isfinite(high)
        guess = np.clip(guess, low[:, None], high[:, None])
        width = np.where(closed, high - low, 0.0)[:, None]
        return np.where(closed[:, None], low[:, None] + width * rng.random(guess.shape), guess)


def make_targets(problem: Problem, regions: Sequence[Array] = ()) -> Targets:
    """The targets of a problem. `regions` are what is known of how phi is distributed, see `occurring`."""
    cells, labels = problem.cells, len(problem.spec.labels)
    best = occurring(regions, cells.low[:labels], cells.high[:labels])
    if best.shape[1] >= FEWEST:
        required = np.full((len(cells.labels) - labels, best.shape[1]), INSIDE)
        return _sorted(cells, np.concatenate([best, required]))
    rng = np.random.default_rng(np.random.SeedSequence([problem.request.seed, PILOT]))
    lowest, highest = problem.lowest[:, None], problem.highest[:, None]
    count = min(problem.piece_size, max(1024, LARGEST_PIECE // len(problem.core.labels)))
    with np.errstate(all="ignore"):  # phi may overflow or be undefined somewhere: such scenes are no targets
        phi = problem.phi(lowest + (highest - lowest) * rng.random((len(lowest), count)))
    return _sorted(cells, phi)


def occurring(regions: Sequence[Array], low: Array, high: Array) -> Array:
    """phi (L, m) of scenes as they occur with phi from `low` to `high`, (L,) each. Each of the regions is (L, 2 + m),
    the lowest and the highest phi of a part of all scenes, and the phi of m scenes as they occur there. Of those that
    hold the whole range, the one with most scenes in it is taken; m is 0 where none does."""
    best = np.empty((len(low), 0))
    for one in regions if all(len(each) == len(low) for each in regions) else ():
        if (one[:, 0] <= low).all() and (one[:, 1] >= high).all():
            phi = one[:, 2:]
            inside = phi[:, ((phi >= low[:, None]) & (phi <= high[:, None])).all(axis=0)]
            best = inside if inside.shape[1] > best.shape[1] else best
    return best


def _sorted(cells: Cells, phi: Array) -> Targets:
    found = cells.find(phi)
    order = np.argsort(found, kind="stable")
    borders = np.searchsorted(found[order], np.arange(cells.count + 1))
    return Targets(cells, phi, order, borders)
