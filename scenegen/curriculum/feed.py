"""Scenes handed out one at a time, each once, at a few microseconds each.

What comes out is fixed by the seed and by what was asked for since. All feeds of a library deal the same scenes, each
feed in an order of its own. Of the cells of the library that overlap with what is wanted, one is drawn by how much of
it does; the cell has its scenes in random order. When they are used up, more are drawn, twice as many each time, for
planning a draw costs more than hundreds of its scenes: for all cells while requests vary, for those that overlap where
one comes again and again. What the library does not reach gets draws of its own, and so does a band that comes again
and again and takes parts of cells: they would be left with their other parts.
"""

from __future__ import annotations

from bisect import bisect
from collections import Counter, OrderedDict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import accumulate

import numpy as np
import numpy.typing as npt

from scenegen.curriculum.library import Index, Library
from scenegen.curriculum.request import Wanted
from scenegen.curriculum.sources import SECONDS, SHORTLY, Ends, Scenes
from scenegen.errors import Diagnostic, RequestError

Dealt = tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]
"""A scene (3N,) and its phi (D,)."""

FIRST, MOST = 4096, 32_768  # scenes of the first draw of cells and of later ones at most
ALONE = 1024  # scenes of the first draw for one band
KEPT = 2048  # scenes of a shelf that later draws leave there
WORTH = 2.0  # scenes that a draw for whole cells should give of a part of one: else that part is drawn itself
OFTEN = 8  # a band asked for more often comes again and again
DRAWS = 2  # for one scene, at most
BANDS, SHELVES = 256, 1024  # that are remembered, the last ones; an index of three labels may have 512 cells


class Shelf:
    """Scenes in random order. `ids` are their numbers in the library, -1 for others."""

    def __init__(self, scenes: Scenes, ids: Sequence[int], rng: np.random.Generator) -> None:
        self.scenes, self._ids, self.draws = scenes, list(ids), 0
        self._left: list[int] = rng.permutation(len(scenes)).tolist()

    def take(self, wanted: Wanted, used: set[int]) -> Dealt | None:
        """A scene that is wanted and was not taken before; None where there is none left."""
        columns = self.scenes.columns
        ends = [(columns[k], wanted.low[k], wanted.high[k]) for k in wanted.dims]
        left = self._left
        at = len(left)
        while at:
            at -= 1
            place = left[at]
            number = self._ids[place]
            if number >= 0 and number in used:
                del left[at]
                continue
            for phi, low, high in ends:
                if not low <= phi[place] <= high:
                    break
            else:
                del left[at]
                if number >= 0:
                    used.add(number)
                return self.scenes.poses[place], self.scenes.phi[place]
        return None

    def leftover(self) -> tuple[Scenes, list[int]]:
        """The last that were not taken, and their numbers."""
        kept = self._left[-KEPT:]
        return Scenes(self.scenes.poses[kept], self.scenes.phi[kept]), [self._ids[place] for place in kept]


@dataclass(slots=True, eq=False)
class _Plan:
    """How a request is served: by which cells of an index, the running sum of their weights, the share of each that is
    wanted, how often it was asked for, and whether it has draws of its own."""

    index: Index
    cells: list[int]
    weights: list[float]
    shares: list[float]
    asked: int = field(default=0)
    alone: bool = field(default=False)


class Feed:
    """Hands out the scenes of a library. `entropy` is the seed."""

    def __init__(self, library: Library, entropy: int) -> None:
        self.library = library
        self._rng = np.random.default_rng(entropy)
        self._draws: Counter[frozenset[tuple[str, Ends]]] = Counter()
        self._used: set[int] = set()
        self._plans: OrderedDict[Wanted, _Plan | None] = OrderedDict()
        self._shelves: OrderedDict[tuple[object, int], Shelf] = OrderedDict()
        self._hopeless: set[Wanted] = set()
        self._fills: dict[tuple[int, ...], int] = {}

    def take(self, wanted: Wanted, *, nearest: bool = False, patience: float = SECONDS) -> Dealt:
        """A scene and its phi, after draws of `patience` seconds at most. With `nearest` it is of the cell nearest to
        what is wanted where that cannot be had shortly. Raises RequestError, but not with `nearest`."""
        patience = SHORTLY if nearest else patience
        plan = self._plan(wanted)
        if plan is not None:
            plan.asked += 1
            plan.alone = plan.alone or (plan.asked > OFTEN and self.library.more is not None and min(plan.shares) < 1.0)
        if plan is not None and not plan.alone:
            first = min(bisect(plan.weights, self._rng.random() * plan.weights[-1]), len(plan.cells) - 1)
            # a file may have scenes in a part of a cell that is not wanted, and others in the next cell
            rough = nearest and len(wanted.dims) > 1
            for step in range(1 if self.library.more is not None else len(plan.cells)):
                try:
                    found = self._of_cell(
                        plan, (first + step) % len(plan.cells), wanted, 0 if rough else DRAWS, patience
                    )
                except RequestError:
                    if not nearest:
                        raise
                    break
                if found is not None:
                    return found
            if rough:  # a part of a cell in several labels may well be empty, and finding that out takes long
                return self._of_whole(plan.index, plan.cells[first], wanted)
        if not nearest:
            return self._of_its_own(wanted, patience)
        within = self._within(wanted)
        if within != wanted:
            return self.take(within, nearest=True)
        if plan is not None and wanted not in self._hopeless:
            try:
                return self._of_its_own(wanted, patience)
            except RequestError:
                self._hopeless.add(wanted)
        index = self.library.index(wanted.dims)
        return self._of_whole(index, index.nearest(wanted), wanted)

    def _of_whole(self, index: Index, cell: int, wanted: Wanted) -> Dealt:
        """A scene of a cell, in place of what is wanted: one of the library's again where no others are found."""
        low, high = list(wanted.low), list(wanted.high)
        for k, dim in enumerate(wanted.dims):
            low[dim], high[dim] = float(index.low[cell, k]), float(index.high[cell, k])
        whole = Wanted(tuple(low), tuple(high))
        if whole not in self._hopeless:
            try:
                return self.take(whole, patience=SHORTLY)
            except RequestError:
                self._hopeless.add(whole)
        members = index.members[cell]
        place = members[int(self._rng.random() * len(members))]
        return self.library.scenes.poses[place], self.library.scenes.phi[place]

    def _plan(self, wanted: Wanted) -> _Plan | None:
        if wanted in self._plans:
            self._plans.move_to_end(wanted)
            return self._plans[wanted]
        plan = None
        # a file has no more than it has: what of it is wanted is all there is
        if self.library.more is None or self.library.covers(wanted):
            index = self.library.index(wanted.dims)
            cells, shares = index.overlap(wanted)
            if cells:
                plan = _Plan(index, cells, list(accumulate(shares)), shares)
        self._plans[wanted] = plan
        if len(self._plans) > BANDS:
            self._plans.popitem(last=False)
        return plan

    def _of_cell(self, plan: _Plan, at: int, wanted: Wanted, draws: int, patience: float) -> Dealt | None:
        """A scene that is wanted of one of the plan's cells, after so many draws at most; None where it is better drawn
        by itself."""
        shelf = self._cell(plan.index, plan.cells[at])
        for attempt in range(1 + draws):
            found = shelf.take(wanted, self._used)
            if found is not None:
                return found
            if attempt == draws:
                break
            if self.library.more is None:  # once more, in another order
                members = plan.index.members[plan.cells[at]]
                shelf = self._put((plan.index.dims, plan.cells[at]), self._filled(members))
                continue
            often = plan.asked > OFTEN
            cells = plan.cells if often else range(len(plan.index.members))
            count = min(FIRST << (shelf.draws if often else self._fills.get(plan.index.dims, 0)), MOST)
            if plan.shares[at] * count / len(cells) < WORTH:
                break
            self._fill(plan.index, cells, count, patience)
            shelf = self._cell(plan.index, plan.cells[at])
        return None

    def _cell(self, index: Index, cell: int) -> Shelf:
        """The shelf of a cell, with the library's scenes to begin with."""
        key, members = (index.dims, cell), index.members[cell]
        shelf = self._shelves.get(key)
        if shelf is None:
            return self._put(key, self._filled(members, members.tolist()))
        self._shelves.move_to_end(key)
        return shelf

    def _filled(self, members: npt.NDArray[np.intp], ids: Sequence[int] | None = None) -> Shelf:
        """Scenes of the library; without `ids`, such as may be handed out again."""
        scenes = Scenes(self.library.scenes.poses[members], self.library.scenes.phi[members])
        return Shelf(scenes, [-1] * len(members) if ids is None else ids, self._rng)

    def _fill(self, index: Index, numbers: Sequence[int], count: int, patience: float) -> None:
        """More scenes for some cells."""
        cells, dims = list(numbers), list(index.dims)
        self._fills[index.dims] = self._fills.get(index.dims, 0) + 1
        low, high = index.low[cells], index.high[cells]
        ends = zip(dims, low.min(axis=0).tolist(), high.max(axis=0).tolist(), strict=True)
        scenes = self._draw({self.library.aim.names[k]: (least, most) for k, least, most in ends}, count, patience)
        phi = scenes.phi[:, None, dims]
        within = np.asarray(((phi >= low) & (phi <= high)).all(axis=2))
        owner = np.where(within.any(axis=1), within.argmax(axis=1), -1)
        for number, cell in enumerate(cells):
            mine = np.flatnonzero(owner == number)
            if len(mine):
                self._stack((index.dims, cell), self._cell(index, cell), Scenes(scenes.poses[mine], scenes.phi[mine]))

    def _of_its_own(self, wanted: Wanted, patience: float) -> Dealt:
        """A scene of a draw for just what is wanted."""
        key, names = (wanted, 0), self.library.aim.names
        shelf = self._shelves.get(key)
        if shelf is not None:
            self._shelves.move_to_end(key)
            found = shelf.take(wanted, self._used)
            if found is not None:
                return found
        if self.library.more is None:
            raise RequestError(Diagnostic(f"the file has no scene with {wanted.describe(names)}"))
        scenes = self._draw(wanted.ranges(names), min(ALONE << 2 * (shelf.draws if shelf else 0), MOST), patience)
        found = self._stack(key, shelf, scenes).take(wanted, self._used)
        assert found is not None
        return found

    def _draw(self, ranges: Mapping[str, Ends], count: int, patience: float) -> Scenes:
        assert self.library.more is not None
        what = frozenset(ranges.items())
        self._draws[what] += 1
        return self.library.more.asked(ranges, count, self._draws[what] - 1, patience)

    def _stack(self, key: tuple[object, int], shelf: Shelf | None, scenes: Scenes) -> Shelf:
        """A shelf with more scenes."""
        draws, numbers = 1, [-1] * len(scenes)
        if shelf is not None:
            (old, ids), draws = shelf.leftover(), shelf.draws + 1
            numbers = ids + numbers
            scenes = Scenes(np.concatenate([old.poses, scenes.poses]), np.concatenate([old.phi, scenes.phi]))
        made = Shelf(scenes, numbers, self._rng)
        made.draws = draws
        return self._put(key, made)

    def _put(self, key: tuple[object, int], shelf: Shelf) -> Shelf:
        self._shelves[key] = shelf
        if len(self._shelves) > SHELVES:
            self._shelves.popitem(last=False)
        return shelf

    def _within(self, wanted: Wanted) -> Wanted:
        """The part of what is wanted that lies where the scenes are spread; all of it where no part does."""
        low, high = list(wanted.low), list(wanted.high)
        for k in wanted.dims:
            low[k], high[k] = max(low[k], float(self.library.low[k])), min(high[k], float(self.library.high[k]))
            if low[k] >= high[k]:
                return wanted
        return Wanted(tuple(low), tuple(high))
