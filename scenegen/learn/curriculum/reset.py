"""The start of an episode: the options of `reset` turned into a scene."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import error

from scenegen.api.spec import Spec
from scenegen.errors import RequestError
from scenegen.errors.learning import GOAL_ALWAYS_MET
from scenegen.learn.curriculum.goal import as_gymnasium, refused
from scenegen.learn.curriculum.library import Library, check_source, open_library
from scenegen.learn.curriculum.request import PhiRanges, check_options, everything, read_phi, read_scene
from scenegen.learn.curriculum.rules import Rules, Tables
from scenegen.learn.curriculum.scene_stream import LibraryStream, StartScene

Array = npt.NDArray[np.float64]

TINY = 1e-300  # "not satisfied" ends at a tiny negative number, which is shown as 0


@dataclass(frozen=True, slots=True, eq=False)
class StartRequest:
    """Checked options: the given scene, or the requested phi; both None if the options have neither."""

    scene: Tables | None = None
    ranges: PhiRanges | None = None
    nearest: bool = False


class Resets:
    """Provides the scenes at which episodes start. `phi` is the default request. The library is made when it is first
    needed: an environment that always gets its scenes from the caller never draws any."""

    def __init__(self, spec: Spec, rules: Rules, source: Any, phi: object) -> None:
        self._spec, self._target, self._source = spec, rules.target, source
        self._score = rules.score
        self._usual = None if phi is None else read_phi(rules.target, phi)
        self._library: Library | None = None
        check_source(source)

    @property
    def library(self) -> Library:
        """Raises gymnasium.error.Error if the source is invalid, or if every scene satisfies the goal."""
        if self._library is None:
            with as_gymnasium():
                self._library = open_library(self._target, self._spec, self._source)
        return self._library

    def stream(self, rng: np.random.Generator) -> LibraryStream:
        """Scenes from the seed of a generator."""
        return LibraryStream(self.library, int(rng.integers(2**63)))

    def read(self, options: Mapping[str, Any] | None) -> StartRequest:
        """Check options. Raises gymnasium.error.Error, and InvalidBound for invalid ranges."""
        if options is None:  # most often
            return StartRequest()
        options = check_options(options)
        if options.get("scene") is not None:
            return StartRequest(scene=self._given(read_scene(self._spec, options["scene"])[:, None]))
        nearest, phi = bool(options.get("nearest", False)), options.get("phi")
        return StartRequest(
            ranges=None if phi is None else read_phi(self._target, phi, points=nearest), nearest=nearest
        )

    def task(self, request: StartRequest) -> Array:
        """(D, 2): the lowest and highest requested phi."""
        ranges = everything(self._target) if request.scene is not None else self._ranges(request)
        task = np.array([ranges.low, ranges.high]).T
        task[np.abs(task) < TINY] = 0.0
        return task

    def _given(self, rows: Array) -> Tables:
        """A scene (3N, 1) that was verified when it was read."""
        phi, slack = self._score(rows), np.zeros(1)
        if self._score.requires:
            phi, slack = phi[:-1], np.minimum(phi[-1], 0.0)
        return Tables(rows, phi, slack)

    def draw(self, stream: LibraryStream, request: StartRequest) -> StartScene:
        """A scene in the requested range, and its phi. Raises gymnasium.error.InvalidBound if the range is out of
        reach."""
        ranges = self._ranges(request)
        try:
            return stream.take(ranges, nearest=request.nearest)
        except RequestError as problem:
            raise refused(problem.diagnostics[0], error.InvalidBound, self._nearest(ranges)) from problem

    def _ranges(self, request: StartRequest) -> PhiRanges:
        if request.ranges is not None:
            return request.ranges
        if self._usual is not None:
            return self._usual
        if self.library.hard >= 0.0:
            raise refused(GOAL_ALWAYS_MET())
        return self.library.unsatisfied

    def _nearest(self, ranges: PhiRanges) -> str:
        """The reachable phi nearest to a range that is out of reach."""
        found, names = self.library.met(ranges), self._target.names
        parts = [f"phi of `{names[k]}` {found[k]:.4g}" for k in ranges.dims]
        return f"the nearest scene that was met has {' and '.join(parts)}"
