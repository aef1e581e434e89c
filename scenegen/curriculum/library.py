"""Scenes drawn ahead: evenly over phi from the hardest that occur to satisfied, and found by phi.

One library serves every environment of the same aim and source, whatever its seed; `feed` hands its scenes out.
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
from gymnasium import error

from scenegen import given
from scenegen.api.spec import Spec
from scenegen.bounds import spec_bounds
from scenegen.curriculum.aim import Aim
from scenegen.curriculum.draws import Draws
from scenegen.curriculum.request import Wanted, everything
from scenegen.curriculum.sources import Sampler, Scenes, open_source
from scenegen.curriculum.tasks import PhiBox
from scenegen.errors import RequestError

Array = npt.NDArray[np.float64]

PILOT, SCENES = 4096, 4096  # drawn to see what is hard, and to have
HARDEST = 1e-3  # share of unsatisfied scenes that are harder than what the library goes to
CELLS = {1: 32, 2: 16}  # along each label of an index, 8 for more
LEAST = 1e-9  # share of a cell that is worth a look; rounding makes neighbours overlap by less
BELOW = math.nextafter(0.0, -1.0)  # the highest phi that is not satisfied
KEPT = 8  # libraries that are kept

_KEPT: OrderedDict[tuple[Any, ...], Library] = OrderedDict()


def _share(low: float, high: float, least: float, most: float) -> float:
    """Which share of the range from `least` to `most` lies from `low` to `high`; these two overlap."""
    return (min(high, most) - max(low, least)) / (most - least) if most > least else 1.0


@dataclass(frozen=True, eq=False)
class Index:
    """Scenes by cells of phi of some labels, `dims`: the ends of the G cells that have scenes, (G, K) each, and the
    numbers of their scenes."""

    dims: tuple[int, ...]
    low: Array
    high: Array
    members: tuple[npt.NDArray[np.intp], ...]

    def overlap(self, wanted: Wanted) -> tuple[list[int], list[float]]:
        """The cells that have a part of what is wanted, and which share of each is."""
        if len(self.dims) == 1:  # the usual case, for which numpy would be slow
            lows, highs = self._line
            low, high = wanted.low[self.dims[0]], wanted.high[self.dims[0]]
            cells = range(bisect_left(highs, low), bisect_right(lows, high))
            parts = ((cell, _share(low, high, lows[cell], highs[cell])) for cell in cells)
            found = [(cell, share) for cell, share in parts if share > LEAST]
            return [cell for cell, _ in found], [share for _, share in found]
        at = list(self.dims)
        lower = np.maximum(np.array(wanted.low)[at], self.low)
        upper = np.minimum(np.array(wanted.high)[at], self.high)
        width = self.high - self.low
        # phi that is the same everywhere has cells without width
        share = np.where(width > 0.0, (upper - lower) / np.where(width > 0.0, width, 1.0), upper >= lower)
        whole = np.clip(share, 0.0, 1.0).prod(axis=1)
        numbers = np.flatnonzero(whole > LEAST)
        return numbers.tolist(), whole[numbers].tolist()

    @cached_property
    def _line(self) -> tuple[list[float], list[float]]:
        return self.low[:, 0].tolist(), self.high[:, 0].tolist()

    def nearest(self, wanted: Wanted) -> int:
        """The cell whose phi is nearest to what is wanted, in widths of cells."""
        at = list(self.dims)
        low, high = np.array(wanted.low)[at], np.array(wanted.high)[at]
        away = np.maximum(np.maximum(low - self.high, self.low - high), 0.0)
        return int((away / np.maximum(self.high - self.low, 1e-12)).sum(axis=1).argmin())


@dataclass(eq=False)
class Library:
    """`low` and `high` (D,) is where the scenes are spread; `hard` is the lowest phi of the goal among them. `more`
    draws others, None where the scenes are all there are."""

    aim: Aim
    scenes: Scenes
    low: Array
    high: Array
    hard: float
    more: Draws | None
    _indices: dict[tuple[int, ...], Index] = field(default_factory=dict)

    @property
    def unsatisfied(self) -> Wanted:
        """What is asked for where nothing is: everything that does not satisfy the goal yet."""
        free = everything(self.aim)
        low, high = list(free.low), list(free.high)
        low[self.aim.goal], high[self.aim.goal] = self.hard, BELOW
        return Wanted(tuple(low), tuple(high))

    @property
    def space(self) -> PhiBox:
        """What a curriculum goes through: for labels that have to be satisfied from the hardest to satisfied, for the
        others all that occurs."""
        high = self.high[: self.aim.labels]
        low, names = self.low[: self.aim.labels], self.aim.names
        # a label that is hardly ever violated has nothing to learn below 0, and no end of it there
        capped = [name in self.aim.wanted and least < 0.0 for name, least in zip(names, low, strict=False)]
        ends = [min(value, 0.0) if cap else value for value, cap in zip(high, capped, strict=True)]
        return PhiBox(tuple(map(float, low)), tuple(map(float, ends)))

    def covers(self, wanted: Wanted) -> bool:
        """Whether all that is wanted lies where the scenes are spread."""
        least, most = self._ends
        return all(wanted.low[k] >= least[k] and wanted.high[k] <= most[k] for k in wanted.dims)

    @cached_property
    def _ends(self) -> tuple[list[float], list[float]]:
        """`low` and `high` as Python reads them fastest."""
        return self.low.tolist(), self.high.tolist()

    def index(self, dims: tuple[int, ...]) -> Index:
        """The scenes by phi of some labels."""
        if dims not in self._indices:
            self._indices[dims] = self._make(dims)
        return self._indices[dims]

    def met(self, wanted: Wanted) -> Array:
        """phi (D,) of the scene nearest to what is wanted, of the library and of as many of the base distribution."""
        phi = self.scenes.phi
        if self.more is not None:
            with contextlib.suppress(RequestError):  # time may be up for these, too
                phi = np.concatenate([phi, Sampler(self.aim).draw({}, PILOT, 0, "base").phi])
        away = np.maximum(np.maximum(np.array(wanted.low) - phi, phi - np.array(wanted.high)), 0.0)
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


def make_library(aim: Aim, source: Sampler | Scenes) -> Library:
    """Raises gymnasium.error.Error where there is nothing to learn, for every scene satisfies the goal or none does,
    and RequestError where no scenes are found."""
    goal = aim.goal
    least, most = spec_bounds(aim.spec.checked)[aim.names[goal]]
    reach = f"phi of `{aim.names[goal]}` lies between {least:.4g} and {most:.4g} in this workspace"
    if most < 0.0:
        raise error.Error(f"no scene satisfies the goal, so there is nothing to learn: {reach}")
    if isinstance(source, Scenes):
        phi = source.phi
        return Library(aim, source, phi.min(axis=0), phi.max(axis=0), float(phi[:, goal].min()), None)
    if least >= 0.0:
        raise error.Error(f"every scene satisfies the goal already, so there is nothing to learn: {reach}")
    name = aim.names[goal]
    never = f"`{name}` can never be satisfied"
    if any(one.title == never for one in aim.spec.hopeless()):
        raise error.Error(f"{never}, so there is nothing to learn; `scenegen check` names the parts that clash")
    # what is hard is a matter of the spec, whatever draws the scenes
    pilot = Sampler(aim).draw({name: (None, BELOW)}, PILOT, 0, "base")
    hard = float(np.quantile(pilot.phi[:, goal], HARDEST))
    scenes = source.draw({name: (hard, 0.0)}, SCENES, 0)
    low, high = (np.quantile(pilot.phi, share, axis=0) for share in (HARDEST, 1.0 - HARDEST))
    aimed = [aim.names.index(label) for label in aim.wanted]
    high[aimed] = np.maximum(high[aimed], 0.0)  # near the goal scenes are easier than they mostly are
    low[goal], high[goal] = hard, 0.0
    return Library(aim, scenes, low, high, hard, Draws(source))


def open_library(aim: Aim, spec: Spec, source: Any) -> Library:
    """The library of a source; the last few are kept, for environments come in crowds. Raises DataError, RequestError,
    gymnasium.error.Error."""
    stamp = None
    if isinstance(source, str | Path):
        source = Path(os.path.realpath(given.path("source", source)))
        with contextlib.suppress(OSError):
            stamp = source.stat().st_mtime_ns
    checked = spec.checked
    key = (checked.sha256, checked.shapes, aim.wanted, source, stamp)
    if key in _KEPT:
        _KEPT.move_to_end(key)
        return _KEPT[key]
    _KEPT[key] = made = make_library(aim, open_source(aim, spec, source))
    if len(_KEPT) > KEPT:
        _KEPT.popitem(last=False)
    return made


def forget() -> None:
    """Let go of all libraries that are kept: the next ones are drawn anew, as in a new process."""
    _KEPT.clear()
