"""Scenes drawn in advance, evenly over phi from the hardest that occur to satisfied, and indexed by phi.

One library serves all environments of the same target and source, whatever their seeds; `scene_stream` takes scenes
from it.
"""

from __future__ import annotations

import contextlib
import math
import os
from bisect import bisect_left, bisect_right
from collections import OrderedDict
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from scenegen.api.feasibility import doubts
from scenegen.api.spec import Spec
from scenegen.curriculum.draws import Draws
from scenegen.curriculum.errors import refused
from scenegen.curriculum.goal import Goal
from scenegen.curriculum.request import PhiRanges, everything
from scenegen.curriculum.sources import Sampler, Scenes, open_source
from scenegen.curriculum.tasks import PhiBox
from scenegen.errors import RequestError
from scenegen.errors.learning import GOAL_ALWAYS_MET, GOAL_OUT_OF_REACH
from scenegen.sampling.request import Range
from scenegen.validation import as_path

Array = npt.NDArray[np.float64]

PILOT, SCENES = 4096, 4096  # drawn to find out which phi is hard, and also used as scenes
HARDEST = 1e-3  # share of unsatisfied scenes that are harder than the library's hardest
CELLS = {1: 32, 2: 16}  # along each label of an index, 8 for more
LEAST = 1e-9  # smaller overlaps with a cell are ignored: they are due to rounding
BELOW = math.nextafter(0.0, -1.0)  # the highest phi that is not satisfied
KEPT = 8  # number of cached libraries

_KEPT: OrderedDict[tuple[Any, ...], Library] = OrderedDict()


def _share(low: float, high: float, least: float, most: float) -> float:
    """The share of the range from `least` to `most` that lies between `low` and `high`; the ranges overlap."""
    return (min(high, most) - max(low, least)) / (most - least) if most > least else 1.0


@dataclass(frozen=True, eq=False)
class Index:
    """Scenes by cells of phi of some labels, `dims`: the ends of the G cells that have scenes, (G, K) each, and the
    numbers of their scenes."""

    dims: tuple[int, ...]
    low: Array
    high: Array
    members: tuple[npt.NDArray[np.intp], ...]

    def overlap(self, ranges: PhiRanges) -> tuple[list[int], list[float]]:
        """The cells that overlap with the requested box, and the share of each that does."""
        if len(self.dims) == 1:  # the usual case, for which numpy would be slow
            lows, highs = self._line
            low, high = ranges.low[self.dims[0]], ranges.high[self.dims[0]]
            cells = range(bisect_left(highs, low), bisect_right(lows, high))
            parts = ((cell, _share(low, high, lows[cell], highs[cell])) for cell in cells)
            found = [(cell, share) for cell, share in parts if share > LEAST]
            return [cell for cell, _ in found], [share for _, share in found]
        at = list(self.dims)
        lower = np.maximum(np.array(ranges.low)[at], self.low)
        upper = np.minimum(np.array(ranges.high)[at], self.high)
        width = self.high - self.low
        # phi that is the same everywhere has cells without width
        share = np.where(width > 0.0, (upper - lower) / np.where(width > 0.0, width, 1.0), upper >= lower)
        whole = np.clip(share, 0.0, 1.0).prod(axis=1)
        numbers = np.flatnonzero(whole > LEAST)
        return numbers.tolist(), whole[numbers].tolist()

    @cached_property
    def _line(self) -> tuple[list[float], list[float]]:
        return self.low[:, 0].tolist(), self.high[:, 0].tolist()

    def nearest(self, ranges: PhiRanges) -> int:
        """The cell whose phi is nearest to the requested box, in widths of cells."""
        at = list(self.dims)
        low, high = np.array(ranges.low)[at], np.array(ranges.high)[at]
        away = np.maximum(np.maximum(low - self.high, self.low - high), 0.0)
        return int((away / np.maximum(self.high - self.low, 1e-12)).sum(axis=1).argmin())


@dataclass(eq=False)
class Library:
    """`low` and `high` (D,) are the box over which the scenes are spread; `hard` is the lowest phi of the goal among
    them. `more` draws others; it is None if there are no others."""

    target: Goal
    scenes: Scenes
    low: Array
    high: Array
    hard: float
    more: Draws | None
    _indices: dict[tuple[int, ...], Index] = field(default_factory=dict)

    @property
    def unsatisfied(self) -> PhiRanges:
        """The default request: everything that does not satisfy the goal yet."""
        free = everything(self.target)
        low, high = list(free.low), list(free.high)
        low[self.target.goal], high[self.target.goal] = self.hard, BELOW
        return PhiRanges(tuple(low), tuple(high))

    @property
    def space(self) -> PhiBox:
        """The range of phi for a curriculum: from the hardest to satisfied for labels that have to be satisfied, all
        that occurs for the others."""
        high = self.high[: self.target.labels]
        low, names = self.low[: self.target.labels], self.target.names
        # a label that is hardly ever violated has nothing to learn below 0, and no clear lowest phi
        capped = [name in self.target.wanted and least < 0.0 for name, least in zip(names, low, strict=False)]
        ends = [min(value, 0.0) if cap else value for value, cap in zip(high, capped, strict=True)]
        return PhiBox(tuple(map(float, low)), tuple(map(float, ends)))

    def covers(self, ranges: PhiRanges) -> bool:
        """Whether the requested box lies within the box over which the scenes are spread."""
        least, most = self._ends
        return all(ranges.low[k] >= least[k] and ranges.high[k] <= most[k] for k in ranges.dims)

    @cached_property
    def _ends(self) -> tuple[list[float], list[float]]:
        """`low` and `high` as tuples, which Python reads fastest."""
        return self.low.tolist(), self.high.tolist()

    def index(self, dims: tuple[int, ...]) -> Index:
        """The scenes by phi of some labels."""
        if dims not in self._indices:
            self._indices[dims] = self._make(dims)
        return self._indices[dims]

    def met(self, ranges: PhiRanges) -> Array:
        """phi (D,) of the scene nearest to the requested box, among the library and as many scenes of the base
        distribution."""
        phi = self.scenes.phi
        if self.more is not None:
            with contextlib.suppress(RequestError):  # time may be up for these, too
                phi = np.concatenate([phi, Sampler(self.target).draw({}, PILOT, 0, "base").phi])
        away = np.maximum(np.maximum(np.array(ranges.low) - phi, phi - np.array(ranges.high)), 0.0)
        return np.asarray(phi[away.sum(axis=1).argmin()])

    def _make(self, dims: tuple[int, ...]) -> Index:
        at = list(dims)
        count = CELLS.get(len(dims), 8)
        width = (self.high[at] - self.low[at]) / count
        phi = self.scenes.phi[:, at]
        inside = np.flatnonzero(((phi >= self.low[at]) & (phi <= self.high[at])).all(axis=1))
        cells = np.floor((phi[inside] - self.low[at]) / np.where(width > 0.0, width, 1.0)).astype(np.intp)
        cells, which = np.unique(np.minimum(cells, count - 1), axis=0, return_inverse=True)
        order = np.argsort(which.ravel(), kind="stable")
        borders = np.searchsorted(which.ravel()[order], np.arange(len(cells) + 1))
        members = tuple(inside[order[a:b]] for a, b in pairwise(borders))
        low = self.low[at] + cells * width
        return Index(dims, low, np.where(cells == count - 1, self.high[at], low + width), members)


def make_library(target: Goal, source: Sampler | Scenes) -> Library:
    """Raises gymnasium.error.Error if there is nothing to learn, because every scene satisfies the goal or none does,
    and RequestError if no scenes are found."""
    goal = target.goal
    least, most = target.spec.bounds()[target.names[goal]]
    reach = {"label": target.names[goal], "lowest": least, "highest": most}
    if most < 0.0:
        raise refused(GOAL_OUT_OF_REACH(**reach))
    if isinstance(source, Scenes):
        phi = source.phi
        return Library(target, source, phi.min(axis=0), phi.max(axis=0), float(phi[:, goal].min()), None)
    if least >= 0.0:
        raise refused(GOAL_ALWAYS_MET(**reach))
    name = target.names[goal]
    if any(one.proved and one.label == name for one in doubts(target.spec.drawn)):
        raise refused(GOAL_OUT_OF_REACH(label=name))
    # which phi is hard depends on the spec, not on the source of the scenes
    pilot = Sampler(target).draw({name: Range(None, BELOW)}, PILOT, 0, "base")
    hard = float(np.quantile(pilot.phi[:, goal], HARDEST))
    scenes = source.draw({name: Range(hard, 0.0)}, SCENES, 0)
    low, high = (np.quantile(pilot.phi, share, axis=0) for share in (HARDEST, 1.0 - HARDEST))
    aimed = [target.names.index(label) for label in target.wanted]
    high[aimed] = np.maximum(high[aimed], 0.0)  # near the goal, scenes are easier than most
    low[goal], high[goal] = hard, 0.0
    return Library(target, scenes, low, high, hard, Draws(source))


def open_library(target: Goal, spec: Spec, source: Any) -> Library:
    """The library of a source. The last few are cached, because often many environments are made alike. Raises
    DataError, RequestError, gymnasium.error.Error."""
    stamp = None
    if isinstance(source, str | Path):
        source = Path(os.path.realpath(as_path("source", source)))
        with contextlib.suppress(OSError):
            stamp = source.stat().st_mtime_ns
    checked = spec.drawn
    key = (checked.sha256, checked.shapes, target.wanted, source, stamp)
    if key in _KEPT:
        _KEPT.move_to_end(key)
        return _KEPT[key]
    _KEPT[key] = made = make_library(target, open_source(target, spec, source))
    if len(_KEPT) > KEPT:
        _KEPT.popitem(last=False)
    return made


def forget() -> None:
    """Clear the cache of libraries: the next ones are drawn again, as in a new process."""
    _KEPT.clear()
