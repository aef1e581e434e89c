"""Scenes drawn in advance, evenly over phi from the hardest that occur to satisfied, and indexed by phi.

One library serves all environments of the same target and source, whatever their seeds; a `LibraryStream` takes scenes
from it, for one of them.
"""

from __future__ import annotations

import contextlib
import hashlib
import math
import os
from bisect import bisect, bisect_left, bisect_right
from collections import Counter, OrderedDict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import accumulate, pairwise
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from scenegen.api.feasibility import doubts
from scenegen.api.reading import read_scenes
from scenegen.api.sample import draw_scenes
from scenegen.api.scene_arrays import SpecScenes, parts_of
from scenegen.api.scenes import SceneSet
from scenegen.api.spec import Spec
from scenegen.arrays import Array
from scenegen.errors import DataError, RequestError
from scenegen.errors.learning import DRAW_TOO_SLOW, MODEL_OF_ANOTHER_SPEC, NO_START_IN_FILE, NO_UNMET_GOAL
from scenegen.errors.requests import NO_SCENES, OUT_OF_TIME, WRONG_VALUE
from scenegen.lang.spec import CheckedSpec, rows_among
from scenegen.learn.model import Model, is_family, load_model
from scenegen.play.environments.goal import Goal, Scorer, refused
from scenegen.play.environments.request import PhiRanges, everything
from scenegen.play.tasks import PhiBox
from scenegen.pose import row_count
from scenegen.sampling.request import Range, SampleRequest
from scenegen.scenes.arrange import check_scenes
from scenegen.validation import as_path

# --------------------------------------------------------------------------------------------------------------------
# Where scenes come from: the exact sampler, a trained model, or a scene file. All of them are verified.


SECONDS = 20.0  # after this time a request counts as unreachable; scenes that are found earlier do not depend on it
SHORTLY = 2.0  # the same, if the nearest scenes may be used instead


@dataclass(frozen=True, eq=False)
class Scenes:
    """`poses` (n, 3N) in metres and radians, and `phi` (n, D) of a goal's labels."""

    poses: Array
    phi: Array

    def __len__(self) -> int:
        return len(self.poses)

    @cached_property
    def columns(self) -> list[list[float]]:
        """phi by label as lists, which Python reads fastest; computed once for many streams."""
        found: list[list[float]] = self.phi.T.tolist()
        return found


class Sampler:
    """Draws from a spec, exactly, or from a model trained on it."""

    def __init__(self, target: Goal, model: Model | None = None) -> None:
        self._from: Spec | Model = target.spec if model is None else model.with_spec(target.spec)

    def draw(
        self, phi: Mapping[str, Range], n: int, seed: int, spread: str = "flat", patience: float = SECONDS
    ) -> Scenes:
        """Up to n scenes with phi in the ranges, at least one: as many as are found in `patience` seconds. Raises
        RequestError."""
        request = SampleRequest(
            phi, n, seed=seed, spread=spread, timeout=patience, keep_partial=True, workers=1, strict=True
        )
        try:
            found = draw_scenes(self._from, request)
        except RequestError as problem:
            first = problem.diagnostics[0]
            if first.kind not in OUT_OF_TIME:
                raise
            slow = DRAW_TOO_SLOW(first.span, problem=first.title, note=first.note, seconds=patience)
            raise RequestError(slow) from problem
        spec = (self._from.spec if isinstance(self._from, Model) else self._from).require_scenes()
        rows = _stored(spec, found)[0] if spec.choices else found.poses.reshape(len(found), -1).T
        return Scenes(rows.T, np.stack(list(found.phi.values()), axis=1))


def stock(target: Goal, scenes: SceneSet) -> Scenes:
    """The scenes of a file, scored by the spec. Raises DataError for scenes that are not of it."""
    if not len(scenes):
        raise DataError(NO_SCENES())
    rows, parts = _stored(target.spec.require_scenes(), scenes)
    for part in parts:
        check_scenes(part.spec, part.rows)
    return Scenes(np.ascontiguousarray(rows.T), Scorer(target)(rows)[: len(target.names)].T.copy())


def _stored(spec: CheckedSpec, scenes: SceneSet) -> tuple[Array, list[SpecScenes]]:
    """Scenes as the core of the spec has them, (3N, n), NaN for objects that are not there; and by the ordinary specs
    that they are of. Raises DataError for other objects."""
    rows = np.full((row_count(len(spec.core.objects)), len(scenes)), np.nan)
    parts = list(parts_of(spec, scenes))
    for part in parts:
        rows[rows_among(spec, part.spec)[:, None], part.which] = part.rows
    return rows, parts


def check_source(source: object) -> None:
    """Raises gymnasium.error.Error for an invalid source."""
    if source is not None and not isinstance(source, str | Path | SceneSet | Model):
        wanted = "a model, scenes, or the path of either"
        raise refused(WRONG_VALUE(argument="source", value=f"of type {type(source).__name__}", wanted=wanted))


def open_source(target: Goal, spec: Spec, source: Any) -> Sampler | Scenes:
    """`source` as users give it: None for the exact sampler, a Model or a SceneSet, or the path of a model file
    (.safetensors), of a folder of models, or of a scene file. Raises DataError, RequestError, gymnasium.error.Error."""
    if source is None:
        return Sampler(target)
    if isinstance(source, str | Path):
        path = as_path("source", source)
        source = (
            load_model(path, spec) if path.suffix.lower() == ".safetensors" or is_family(path) else read_scenes(path)
        )
    if isinstance(source, SceneSet):
        return stock(target, source)
    if isinstance(source, Model):
        if source.spec.require_scenes().sha256 != spec.require_scenes().sha256:
            raise refused(MODEL_OF_ANOTHER_SPEC(model=source.name))
        return Sampler(target, source)
    raise AssertionError(source)  # see check_source


# --------------------------------------------------------------------------------------------------------------------
# Scenes in addition to those that a library starts with, drawn once for all environments.
#
# Many tables follow one curriculum, so they need the same bands at about the same time, and planning a draw costs
# more than hundreds of its scenes. The result of a draw depends only on the request, not on which environment is
# first.


MOST_KEPT = 1 << 18  # maximum number of cached scenes: 50 MB of seven objects

_Key = tuple[tuple[tuple[str, tuple[float | None, float | None]], ...], int, int]


class Draws:
    """`draw(phi, n, number, patience)`: draw `number` (0, 1, ...) of up to n scenes with phi in the ranges, as many
    as are found in so many seconds."""

    def __init__(self, sampler: Sampler) -> None:
        self._sampler = sampler
        self._kept: OrderedDict[_Key, Scenes] = OrderedDict()
        self._count = 0

    def draw(self, phi: Mapping[str, Range], n: int, number: int, patience: float) -> Scenes:
        """Do not write to the arrays: others get the same ones. Raises RequestError if there are no scenes."""
        key = (tuple((label, (one.low, one.high)) for label, one in phi.items()), n, number)
        if key in self._kept:
            self._kept.move_to_end(key)
            return self._kept[key]
        seed = int.from_bytes(hashlib.blake2b(repr(key).encode(), digest_size=8).digest()) >> 1
        self._kept[key] = scenes = self._sampler.draw(phi, n, seed, patience=patience)
        self._count += len(scenes)
        while self._count > MOST_KEPT and len(self._kept) > 1:
            self._count -= len(self._kept.popitem(last=False)[1])
        return scenes


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
class PhiIndex:
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
    _indices: dict[tuple[int, ...], PhiIndex] = field(default_factory=dict)

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

    def index(self, dims: tuple[int, ...]) -> PhiIndex:
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

    def _make(self, dims: tuple[int, ...]) -> PhiIndex:
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
        return PhiIndex(dims, low, np.where(cells == count - 1, self.high[at], low + width), members)


def make_library(target: Goal, source: Sampler | Scenes) -> Library:
    """Raises gymnasium.error.Error if there is nothing to learn, because every scene satisfies the goal or none does,
    and RequestError if no scenes are found."""
    goal = target.goal
    least, most = target.spec.bounds()[target.names[goal]]
    reach = {"label": target.names[goal], "lowest": least, "highest": most}
    if most < 0.0:
        raise refused(NO_UNMET_GOAL(**reach))
    if isinstance(source, Scenes):
        phi = source.phi
        return Library(target, source, phi.min(axis=0), phi.max(axis=0), float(phi[:, goal].min()), None)
    if least >= 0.0:
        raise refused(NO_UNMET_GOAL(**reach, always=True))
    name = target.names[goal]
    if any(one.proved and one.label == name for one in doubts(target.spec.require_scenes())):
        raise refused(NO_UNMET_GOAL(label=name))
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
    checked = spec.require_scenes()
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


# --------------------------------------------------------------------------------------------------------------------
# A stream of scenes from a library: one at a time, each once, at a few microseconds each.
#
# The scenes are determined by the seed and the requests so far. All streams of a library use the same scenes, each
# in its own order. One of the library's cells that overlap with the request is chosen, with its overlapping share
# as its weight; a cell has its scenes in random order. When they are used up, more are drawn, twice as many each
# time, because planning a draw costs more than hundreds of its scenes: for all cells while requests vary, for the
# overlapping cells if a request is repeated. Requests outside of the library get their own draws. So do repeated
# requests that overlap with cells only in part, because the other parts of these cells would remain unused.


StartScene = tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]
"""A scene (3N,) and its phi (D,)."""

FIRST, LARGEST = 4096, 32_768  # scenes of the first draw for cells, and the maximum for later draws
ALONE = 1024  # scenes of the first draw for one band
LEFT = 2048  # unused scenes of a bucket that are kept when a later draw is added
WORTH = 2.0  # if a draw for whole cells gives fewer scenes in the requested part of a cell, draw that part alone
OFTEN = 8  # a band that is requested more often counts as repeated
DRAWS = 2  # maximum number of draws for one scene
BANDS, BUCKETS = 256, 1024  # cached, the most recent ones; an index of three labels may have 512 cells


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
        """Unused scenes, at most LEFT, and their numbers."""
        kept = self._left[-LEFT:]
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
        self._plans: OrderedDict[PhiRanges, _Service | None] = OrderedDict()
        self._buckets: OrderedDict[tuple[object, int], Bucket] = OrderedDict()
        self._out_of_reach: set[PhiRanges] = set()
        self._fills: dict[tuple[int, ...], int] = {}

    def take(self, ranges: PhiRanges, *, nearest: bool = False, patience: float = SECONDS) -> StartScene:
        """A scene and its phi, after draws of at most `patience` seconds. With `nearest`, a scene of the nearest cell
        is used if the request cannot be satisfied quickly. Raises RequestError, but not with `nearest`."""
        patience = SHORTLY if nearest else patience
        plan = self._plan(ranges)
        if plan is not None:
            plan.requests += 1
            plan.alone = plan.alone or (
                plan.requests > OFTEN and self.library.more is not None and min(plan.shares) < 1.0
            )
        if plan is not None and not plan.alone:
            first = min(bisect(plan.weights, self._rng.random() * plan.weights[-1]), len(plan.cells) - 1)
            # a file may have no scenes in the requested part of a cell, but some in the next cell
            rough = nearest and len(ranges.dims) > 1
            for step in range(1 if self.library.more is not None else len(plan.cells)):
                try:
                    found = self._of_cell(
                        plan, (first + step) % len(plan.cells), ranges, 0 if rough else DRAWS, patience
                    )
                except RequestError:
                    if not nearest:
                        raise
                    break
                if found is not None:
                    return found
            if rough:  # with several labels, part of a cell may be empty, and it takes long to find out
                return self._of_whole(plan.index, plan.cells[first], ranges)
        if not nearest:
            return self._of_its_own(ranges, patience)
        within = self._within(ranges)
        if within != ranges:
            return self.take(within, nearest=True)
        if plan is not None and ranges not in self._out_of_reach:
            try:
                return self._of_its_own(ranges, patience)
            except RequestError:
                self._out_of_reach.add(ranges)
        index = self.library.index(ranges.dims)
        return self._of_whole(index, index.nearest(ranges), ranges)

    def _of_whole(self, index: PhiIndex, cell: int, ranges: PhiRanges) -> StartScene:
        """A scene of a cell, as a substitute for the request: one of the library's is used again if no others are
        found."""
        low, high = list(ranges.low), list(ranges.high)
        for k, dim in enumerate(ranges.dims):
            low[dim], high[dim] = float(index.low[cell, k]), float(index.high[cell, k])
        whole = PhiRanges(tuple(low), tuple(high))
        if whole not in self._out_of_reach:
            try:
                return self.take(whole, patience=SHORTLY)
            except RequestError:
                self._out_of_reach.add(whole)
        members = index.members[cell]
        place = members[int(self._rng.random() * len(members))]
        return self.library.scenes.poses[place], self.library.scenes.phi[place]

    def _plan(self, ranges: PhiRanges) -> _Service | None:
        if ranges in self._plans:
            self._plans.move_to_end(ranges)
            return self._plans[ranges]
        plan = None
        # a file has no other scenes: use all of its scenes in the requested range
        if self.library.more is None or self.library.covers(ranges):
            index = self.library.index(ranges.dims)
            cells, shares = index.overlap(ranges)
            if cells:
                plan = _Service(index, cells, list(accumulate(shares)), shares)
        self._plans[ranges] = plan
        if len(self._plans) > BANDS:
            self._plans.popitem(last=False)
        return plan

    def _of_cell(self, plan: _Service, at: int, ranges: PhiRanges, draws: int, patience: float) -> StartScene | None:
        """A scene in the requested range from one of the plan's cells, after at most so many draws; None if a separate
        draw is better."""
        bucket = self._cell(plan.index, plan.cells[at])
        for attempt in range(1 + draws):
            found = bucket.take(ranges, self._used)
            if found is not None:
                return found
            if attempt == draws:
                break
            if self.library.more is None:  # use all again, in another order
                members = plan.index.members[plan.cells[at]]
                bucket = self._put((plan.index.dims, plan.cells[at]), self._filled(members))
                continue
            often = plan.requests > OFTEN
            cells = plan.cells if often else range(len(plan.index.members))
            count = min(FIRST << (bucket.draws if often else self._fills.get(plan.index.dims, 0)), LARGEST)
            if plan.shares[at] * count / len(cells) < WORTH:
                break
            self._fill(plan.index, cells, count, patience)
            bucket = self._cell(plan.index, plan.cells[at])
        return None

    def _cell(self, index: PhiIndex, cell: int) -> Bucket:
        """The bucket of a cell, with the library's scenes to begin with."""
        key, members = (index.dims, cell), index.members[cell]
        bucket = self._buckets.get(key)
        if bucket is None:
            return self._put(key, self._filled(members, members.tolist()))
        self._buckets.move_to_end(key)
        return bucket

    def _filled(self, members: npt.NDArray[np.intp], ids: Sequence[int] | None = None) -> Bucket:
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
        met = scenes.phi[:, None, dims]
        within = np.asarray(((met >= low) & (met <= high)).all(axis=2))
        owner = np.where(within.any(axis=1), within.argmax(axis=1), -1)
        for number, cell in enumerate(cells):
            mine = np.flatnonzero(owner == number)
            if len(mine):
                self._stack((index.dims, cell), self._cell(index, cell), Scenes(scenes.poses[mine], scenes.phi[mine]))

    def _of_its_own(self, ranges: PhiRanges, patience: float) -> StartScene:
        """A scene from a draw for exactly this request."""
        key, names = (ranges, 0), self.library.target.names
        bucket = self._buckets.get(key)
        if bucket is not None:
            self._buckets.move_to_end(key)
            found = bucket.take(ranges, self._used)
            if found is not None:
                return found
        if self.library.more is None:
            raise RequestError(NO_START_IN_FILE(wanted=ranges.describe(names)))
        scenes = self._draw(ranges.phi(names), min(ALONE << 2 * (bucket.draws if bucket else 0), LARGEST), patience)
        found = self._stack(key, bucket, scenes).take(ranges, self._used)
        assert found is not None
        return found

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
        made = Bucket(scenes, numbers, self._rng)
        made.draws = draws
        return self._put(key, made)

    def _put(self, key: tuple[object, int], bucket: Bucket) -> Bucket:
        self._buckets[key] = bucket
        if len(self._buckets) > BUCKETS:
            self._buckets.popitem(last=False)
        return bucket

    def _within(self, ranges: PhiRanges) -> PhiRanges:
        """The part of the request within the box of the library's scenes; the whole request if it is outside."""
        low, high = list(ranges.low), list(ranges.high)
        for k in ranges.dims:
            low[k], high[k] = max(low[k], float(self.library.low[k])), min(high[k], float(self.library.high[k]))
            if low[k] >= high[k]:
                return ranges
        return PhiRanges(tuple(low), tuple(high))
