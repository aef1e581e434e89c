"""Scenes drawn in advance, evenly over phi from the hardest that occur to satisfied, and indexed by phi.

One library serves all environments of the same target and source, whatever their seeds; a `LibraryStream` (stream.py)
takes scenes from it, for one of them. Scenes come from the exact sampler, a trained model, or a scene file, and all are
verified.
"""

from __future__ import annotations

import contextlib
import hashlib
import math
import os
from bisect import bisect_left, bisect_right
from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
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
from scenegen.errors.learning import DRAW_TOO_SLOW, MODEL_OF_ANOTHER_SPEC, NO_UNMET_GOAL
from scenegen.errors.requests import NO_SCENES, OUT_OF_TIME, WRONG_VALUE
from scenegen.lang.spec import CheckedSpec, rows_among
from scenegen.learn.model import Model, is_family, load_model
from scenegen.play.environments.goal import Goal, Scorer
from scenegen.play.environments.gym_errors import gym_error
from scenegen.play.environments.request import PhiRanges, everything
from scenegen.play.recent import Recent
from scenegen.play.tasks import PhiBox
from scenegen.pose import row_count
from scenegen.sampling.request import Range, SampleRequest
from scenegen.scenes.arrange import check_scenes
from scenegen.validation import as_path

DRAW_PATIENCE = 20.0  # seconds after which a request counts as unreachable; scenes found earlier do not depend on it
MAX_CACHED_SCENES = 1 << 18  # 50 MB of seven objects
MAX_LIBRARIES = 8  # that are cached
PILOT_SCENES, LIBRARY_SCENES = 4096, 4096  # drawn to find out which phi is hard, and also used as scenes
HARDEST_SHARE = 1e-3  # of unsatisfied scenes, which are harder than the library's hardest
INDEX_CELLS = {1: 32, 2: 16}  # along each label of an index, 8 for more
MIN_OVERLAP = 1e-9  # smaller overlaps with a cell are ignored: they are due to rounding
UNSATISFIED = math.nextafter(0.0, -1.0)  # the highest phi that is not satisfied


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
        columns: list[list[float]] = self.phi.T.tolist()
        return columns


class Sampler:
    """Draws from a spec, exactly, or from a model trained on it."""

    def __init__(self, target: Goal, model: Model | None = None) -> None:
        self._from: Spec | Model = target.spec if model is None else model.with_spec(target.spec)

    def draw(
        self, phi: Mapping[str, Range], n: int, seed: int, spread: str = "flat", patience: float = DRAW_PATIENCE
    ) -> Scenes:
        """Up to n scenes with phi in the ranges, at least one: as many as are found in `patience` seconds. Raises
        RequestError."""
        request = SampleRequest(
            phi, n, seed=seed, spread=spread, timeout=patience, keep_partial=True, workers=1, strict=True
        )
        try:
            scenes = draw_scenes(self._from, request)
        except RequestError as problem:
            first = problem.diagnostics[0]
            if first.kind not in OUT_OF_TIME:
                raise
            slow = DRAW_TOO_SLOW(first.span, problem=first.title, note=first.note, seconds=patience)
            raise RequestError(slow) from problem
        spec = (self._from.spec if isinstance(self._from, Model) else self._from).require_scenes()
        rows = _core_rows(spec, scenes)[0] if spec.choices else scenes.poses.reshape(len(scenes), -1).T
        return Scenes(rows.T, np.stack(list(scenes.phi.values()), axis=1))


def score_file(target: Goal, scenes: SceneSet) -> Scenes:
    """The scenes of a file, scored by the spec. Raises DataError for scenes that are not of it."""
    if not len(scenes):
        raise DataError(NO_SCENES())
    rows, parts = _core_rows(target.spec.require_scenes(), scenes)
    for part in parts:
        check_scenes(part.spec, part.rows)
    return Scenes(np.ascontiguousarray(rows.T), Scorer(target)(rows)[: len(target.names)].T.copy())


def _core_rows(spec: CheckedSpec, scenes: SceneSet) -> tuple[Array, list[SpecScenes]]:
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
        raise gym_error(WRONG_VALUE(argument="source", value=f"of type {type(source).__name__}", wanted=wanted))


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
        return score_file(target, source)
    if isinstance(source, Model):
        if source.spec.require_scenes().sha256 != spec.require_scenes().sha256:
            raise gym_error(MODEL_OF_ANOTHER_SPEC(model=source.name))
        return Sampler(target, source)
    raise AssertionError(source)  # see check_source


_Key = tuple[tuple[tuple[str, tuple[float | None, float | None]], ...], int, int]


class Draws:
    """Scenes in addition to those that a library starts with, drawn once for all environments: `draw(phi, n, number,
    patience)` is draw `number` (0, 1, ...) of up to n scenes with phi in the ranges, as many as are found in so many
    seconds.

    Many tables follow one curriculum, so they need the same bands at about the same time, and planning a draw costs
    more than hundreds of its scenes. The result of a draw depends only on the request, not on which environment is
    first."""

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
        while self._count > MAX_CACHED_SCENES and len(self._kept) > 1:
            self._count -= len(self._kept.popitem(last=False)[1])
        return scenes


_LIBRARIES: Recent[tuple[Any, ...], Library] = Recent(MAX_LIBRARIES)


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
            found = [(cell, share) for cell, share in parts if share > MIN_OVERLAP]
            return [cell for cell, _ in found], [share for _, share in found]
        at = list(self.dims)
        lower = np.maximum(np.array(ranges.low)[at], self.low)
        upper = np.minimum(np.array(ranges.high)[at], self.high)
        width = self.high - self.low
        # phi that is the same everywhere has cells without width
        share = np.where(width > 0.0, (upper - lower) / np.where(width > 0.0, width, 1.0), upper >= lower)
        whole = np.clip(share, 0.0, 1.0).prod(axis=1)
        numbers = np.flatnonzero(whole > MIN_OVERLAP)
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
    def unsatisfied_ranges(self) -> PhiRanges:
        """The default request: everything that does not satisfy the goal yet."""
        free = everything(self.target)
        low, high = list(free.low), list(free.high)
        low[self.target.goal], high[self.target.goal] = self.hard, UNSATISFIED
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
            self._indices[dims] = self._make_index(dims)
        return self._indices[dims]

    def nearest_phi(self, ranges: PhiRanges) -> Array:
        """phi (D,) of the scene nearest to the requested box, among the library and as many scenes of the base
        distribution."""
        phi = self.scenes.phi
        if self.more is not None:
            with contextlib.suppress(RequestError):  # time may be up for these, too
                phi = np.concatenate([phi, Sampler(self.target).draw({}, PILOT_SCENES, 0, "base").phi])
        away = np.maximum(np.maximum(np.array(ranges.low) - phi, phi - np.array(ranges.high)), 0.0)
        return np.asarray(phi[away.sum(axis=1).argmin()])

    def _make_index(self, dims: tuple[int, ...]) -> PhiIndex:
        at = list(dims)
        count = INDEX_CELLS.get(len(dims), 8)
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
        raise gym_error(NO_UNMET_GOAL(**reach))
    if isinstance(source, Scenes):
        phi = source.phi
        return Library(target, source, phi.min(axis=0), phi.max(axis=0), float(phi[:, goal].min()), None)
    if least >= 0.0:
        raise gym_error(NO_UNMET_GOAL(**reach, always=True))
    name = target.names[goal]
    if any(one.proved and one.label == name for one in doubts(target.spec.require_scenes())):
        raise gym_error(NO_UNMET_GOAL(label=name))
    # which phi is hard depends on the spec, not on the source of the scenes
    pilot = Sampler(target).draw({name: Range(None, UNSATISFIED)}, PILOT_SCENES, 0, "base")
    hard = float(np.quantile(pilot.phi[:, goal], HARDEST_SHARE))
    scenes = source.draw({name: Range(hard, 0.0)}, LIBRARY_SCENES, 0)
    low, high = (np.quantile(pilot.phi, share, axis=0) for share in (HARDEST_SHARE, 1.0 - HARDEST_SHARE))
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
    return _LIBRARIES.get_or_make(key, lambda: make_library(target, open_source(target, spec, source)))


def forget() -> None:
    """Clear the cache of libraries: the next ones are drawn again, as in a new process."""
    _LIBRARIES.clear()
