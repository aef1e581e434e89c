"""A stream of scenes from a library: one at a time, each once, at a few microseconds each.

The scenes are determined by the seed and the requests so far. All streams of a library use the same scenes, each in its
own order. One of the library's cells that overlap with the request is chosen, with its overlapping share as its weight;
a cell has its scenes in random order. When they are used up, more are drawn, twice as many each time, because planning
a draw costs more than hundreds of its scenes: for all cells while requests vary, for the overlapping cells if a request
is repeated. Requests outside of the library get their own draws. So do repeated requests that overlap with cells only
in part, because the other parts of these cells would remain unused.
"""

from __future__ import annotations

from bisect import bisect
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import accumulate

import numpy as np
import numpy.typing as npt

from scenegen.errors import RequestError
from scenegen.errors.learning import NO_START_IN_FILE
from scenegen.play.environments.library import DRAW_PATIENCE, Library, PhiIndex, Scenes
from scenegen.play.environments.request import PhiRanges
from scenegen.play.recent import Recent
from scenegen.sampling.request import Range

StartScene = tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]
"""A scene (3N,) and its phi (D,)."""

SHORT_PATIENCE = 2.0  # seconds, as DRAW_PATIENCE, if the nearest scenes may be used instead
FIRST_DRAW, MAX_DRAW = 4096, 32_768  # scenes of the first draw for cells, and the maximum for later draws
FIRST_OWN_DRAW = 1024  # scenes of the first draw for one band
MAX_LEFTOVER = 2048  # unused scenes of a bucket that are kept when a later draw is added
MIN_YIELD = 2.0  # if a draw for whole cells gives fewer scenes in the requested part of a cell, draw that part alone
REPEATED = 8  # a band that is requested more often counts as repeated
MAX_TRIES = 2  # draws for one scene
MAX_BANDS, MAX_BUCKETS = 256, 1024  # cached; an index of three labels may have 512 cells


class Bucket:
    """Scenes in random order. `ids` are their numbers in the library, -1 for others."""

    def __init__(self, scenes: Scenes, ids: Sequence[int], rng: np.random.Generator) -> None:
        self.scenes, self._ids, self.draws = scenes, list(ids), 0
        self._left: list[int] = rng.permutation(len(scenes)).tolist()

    def take(self, ranges: PhiRanges, used: set[int]) -> StartScene | None:
        """A scene in the requested range that was not taken before; None if there are no more."""
        columns = self.scenes.columns
        ends = [(columns[k], ranges.low[k], ranges.high[k]) for k in ranges.dims]
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
        """Unused scenes, at most MAX_LEFTOVER, and their numbers."""
        kept = self._left[-MAX_LEFTOVER:]
        return Scenes(self.scenes.poses[kept], self.scenes.phi[kept]), [self._ids[place] for place in kept]


@dataclass(slots=True, eq=False)
class _Service:
    """How a request is served: the cells of an index, the cumulative sum of their weights, the requested share of each,
    the number of requests, and whether it has its own draws."""

    index: PhiIndex
    cells: list[int]
    weights: list[float]
    shares: list[float]
    requests: int = field(default=0)
    alone: bool = field(default=False)


class LibraryStream:
    """Takes scenes from a library. `entropy` is the seed."""

    def __init__(self, library: Library, entropy: int) -> None:
        self.library = library
        self._rng = np.random.default_rng(entropy)
        self._draws: Counter[frozenset[tuple[str, Range]]] = Counter()
        self._used: set[int] = set()
        self._plans: Recent[PhiRanges, _Service | None] = Recent(MAX_BANDS)
        self._buckets: Recent[tuple[object, int], Bucket] = Recent(MAX_BUCKETS)
        self._out_of_reach: set[PhiRanges] = set()
        self._fills: dict[tuple[int, ...], int] = {}

    def take(self, ranges: PhiRanges, *, nearest: bool = False, patience: float = DRAW_PATIENCE) -> StartScene:
        """A scene and its phi, after draws of at most `patience` seconds. With `nearest`, a scene of the nearest cell
        is used if the request cannot be satisfied quickly. Raises RequestError, but not with `nearest`."""
        patience = SHORT_PATIENCE if nearest else patience
        plan = self._plans.get_or_make(ranges, lambda: self._make_plan(ranges))
        if plan is not None:
            plan.requests += 1
            plan.alone = plan.alone or (
                plan.requests > REPEATED and self.library.more is not None and min(plan.shares) < 1.0
            )
        if plan is not None and not plan.alone:
            first = min(bisect(plan.weights, self._rng.random() * plan.weights[-1]), len(plan.cells) - 1)
            # a file may have no scenes in the requested part of a cell, but some in the next cell
            rough = nearest and len(ranges.dims) > 1
            for step in range(1 if self.library.more is not None else len(plan.cells)):
                try:
                    cell = (first + step) % len(plan.cells)
                    scene = self._take_from_cell(plan, cell, ranges, 0 if rough else MAX_TRIES, patience)
                except RequestError:
                    if not nearest:
                        raise
                    break
                if scene is not None:
                    return scene
            if rough:  # with several labels, part of a cell may be empty, and it takes long to find out
                return self._take_substitute(plan.index, plan.cells[first], ranges)
        if not nearest:
            return self._take_from_own_draw(ranges, patience)
        within = self._clip_to_library(ranges)
        if within != ranges:
            return self.take(within, nearest=True)
        if plan is not None and ranges not in self._out_of_reach:
            try:
                return self._take_from_own_draw(ranges, patience)
            except RequestError:
                self._out_of_reach.add(ranges)
        index = self.library.index(ranges.dims)
        return self._take_substitute(index, index.nearest(ranges), ranges)

    def _take_substitute(self, index: PhiIndex, cell: int, ranges: PhiRanges) -> StartScene:
        """A scene of a cell, as a substitute for the request: one of the library's is used again if no others are
        found."""
        low, high = list(ranges.low), list(ranges.high)
        for k, dim in enumerate(ranges.dims):
            low[dim], high[dim] = float(index.low[cell, k]), float(index.high[cell, k])
        whole = PhiRanges(tuple(low), tuple(high))
        if whole not in self._out_of_reach:
            try:
                return self.take(whole, patience=SHORT_PATIENCE)
            except RequestError:
                self._out_of_reach.add(whole)
        members = index.members[cell]
        place = members[int(self._rng.random() * len(members))]
        return self.library.scenes.poses[place], self.library.scenes.phi[place]

    def _make_plan(self, ranges: PhiRanges) -> _Service | None:
        # a file has no other scenes: use all of its scenes in the requested range
        if self.library.more is None or self.library.covers(ranges):
            index = self.library.index(ranges.dims)
            cells, shares = index.overlap(ranges)
            if cells:
                return _Service(index, cells, list(accumulate(shares)), shares)
        return None

    def _take_from_cell(
        self, plan: _Service, at: int, ranges: PhiRanges, draws: int, patience: float
    ) -> StartScene | None:
        """A scene in the requested range from one of the plan's cells, after at most so many draws; None if a separate
        draw is better."""
        bucket = self._cell(plan.index, plan.cells[at])
        for attempt in range(1 + draws):
            scene = bucket.take(ranges, self._used)
            if scene is not None:
                return scene
            if attempt == draws:
                break
            if self.library.more is None:  # use all again, in another order
                members = plan.index.members[plan.cells[at]]
                bucket = self._buckets.put((plan.index.dims, plan.cells[at]), self._bucket_of(members))
                continue
            repeated = plan.requests > REPEATED
            cells = plan.cells if repeated else range(len(plan.index.members))
            count = min(FIRST_DRAW << (bucket.draws if repeated else self._fills.get(plan.index.dims, 0)), MAX_DRAW)
            if plan.shares[at] * count / len(cells) < MIN_YIELD:
                break
            self._fill(plan.index, cells, count, patience)
            bucket = self._cell(plan.index, plan.cells[at])
        return None

    def _cell(self, index: PhiIndex, cell: int) -> Bucket:
        """The bucket of a cell, with the library's scenes to begin with."""
        key, members = (index.dims, cell), index.members[cell]
        bucket = self._buckets.get(key)
        if bucket is None:
            return self._buckets.put(key, self._bucket_of(members, members.tolist()))
        return bucket

    def _bucket_of(self, members: npt.NDArray[np.intp], ids: Sequence[int] | None = None) -> Bucket:
        """Scenes of the library; without `ids`, scenes that may be used again."""
        scenes = Scenes(self.library.scenes.poses[members], self.library.scenes.phi[members])
        return Bucket(scenes, [-1] * len(members) if ids is None else ids, self._rng)

    def _fill(self, index: PhiIndex, numbers: Sequence[int], count: int, patience: float) -> None:
        """More scenes for some cells."""
        cells, dims = list(numbers), list(index.dims)
        self._fills[index.dims] = self._fills.get(index.dims, 0) + 1
        low, high = index.low[cells], index.high[cells]
        ends = zip(dims, low.min(axis=0).tolist(), high.max(axis=0).tolist(), strict=True)
        scenes = self._draw(
            {self.library.target.names[k]: Range(least, most) for k, least, most in ends}, count, patience
        )
        phi = scenes.phi[:, None, dims]
        within = np.asarray(((phi >= low) & (phi <= high)).all(axis=2))
        owner = np.where(within.any(axis=1), within.argmax(axis=1), -1)
        for number, cell in enumerate(cells):
            mine = np.flatnonzero(owner == number)
            if len(mine):
                self._stack((index.dims, cell), self._cell(index, cell), Scenes(scenes.poses[mine], scenes.phi[mine]))

    def _take_from_own_draw(self, ranges: PhiRanges, patience: float) -> StartScene:
        """A scene from a draw for exactly this request."""
        key, names = (ranges, 0), self.library.target.names
        bucket = self._buckets.get(key)
        if bucket is not None:
            scene = bucket.take(ranges, self._used)
            if scene is not None:
                return scene
        if self.library.more is None:
            raise RequestError(NO_START_IN_FILE(wanted=ranges.describe(names)))
        count = min(FIRST_OWN_DRAW << 2 * (bucket.draws if bucket else 0), MAX_DRAW)
        scenes = self._draw(ranges.phi(names), count, patience)
        scene = self._stack(key, bucket, scenes).take(ranges, self._used)
        assert scene is not None
        return scene

    def _draw(self, phi: Mapping[str, Range], count: int, patience: float) -> Scenes:
        assert self.library.more is not None
        what = frozenset(phi.items())
        self._draws[what] += 1
        return self.library.more.draw(phi, count, self._draws[what] - 1, patience)

    def _stack(self, key: tuple[object, int], bucket: Bucket | None, scenes: Scenes) -> Bucket:
        """A bucket with more scenes."""
        draws, numbers = 1, [-1] * len(scenes)
        if bucket is not None:
            (old, ids), draws = bucket.leftover(), bucket.draws + 1
            numbers = ids + numbers
            scenes = Scenes(np.concatenate([old.poses, scenes.poses]), np.concatenate([old.phi, scenes.phi]))
        stacked = Bucket(scenes, numbers, self._rng)
        stacked.draws = draws
        return self._buckets.put(key, stacked)

    def _clip_to_library(self, ranges: PhiRanges) -> PhiRanges:
        """The part of the request within the box of the library's scenes; the whole request if it is outside."""
        low, high = list(ranges.low), list(ranges.high)
        for k in ranges.dims:
            low[k], high[k] = max(low[k], float(self.library.low[k])), min(high[k], float(self.library.high[k]))
            if low[k] >= high[k]:
                return ranges
        return PhiRanges(tuple(low), tuple(high))
