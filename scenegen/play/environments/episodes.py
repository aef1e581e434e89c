"""Episodes on any number of tables side by side, and the scenes that they start from."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import error

from scenegen.api.spec import Spec
from scenegen.arrays import Array
from scenegen.errors import RequestError
from scenegen.errors.learning import NO_UNMET_GOAL
from scenegen.play.environments.gym_errors import as_gym_errors, gym_error
from scenegen.play.environments.library import Library, check_source, open_library
from scenegen.play.environments.request import (
    FirstScene,
    PhiRanges,
    StartRequest,
    check_options,
    everything,
    read_phi,
    read_scene,
)
from scenegen.play.environments.rules import Mask, Rules, StepOutcome, Tables
from scenegen.play.environments.stream import LibraryStream
from scenegen.play.tasks import PhiBox
from scenegen.pose import row_count

Observations = npt.NDArray[np.float32]

SHOWN_AS_ZERO = 1e-300  # "not satisfied" ends at a tiny negative number, which is shown as 0


class SceneStarts:
    """Provides the scenes at which episodes start. `phi` is the default request. The library is made when it is first
    needed: an environment that always gets its scenes from the caller never draws any."""

    def __init__(self, spec: Spec, rules: Rules, source: Any, phi: object) -> None:
        self.spec, self._target, self._source = spec, rules.target, source
        self._score = rules.score
        self._default = None if phi is None else read_phi(rules.target, phi)
        self._library: Library | None = None
        check_source(source)

    @property
    def library(self) -> Library:
        """Raises gymnasium.error.Error if the source is invalid, or if every scene satisfies the goal."""
        if self._library is None:
            with as_gym_errors():
                self._library = open_library(self._target, self.spec, self._source)
        return self._library

    @property
    def space(self) -> PhiBox:
        """From the hardest to where each label is satisfied."""
        return self.library.space

    def stream(self, rng: np.random.Generator) -> LibraryStream:
        """Scenes from the seed of a generator: one table's own."""
        return LibraryStream(self.library, int(rng.integers(2**63)))

    def read(self, options: object) -> StartRequest:
        """Check the options of `reset`. Raises gymnasium.error.Error, and InvalidBound for invalid ranges."""
        if options is None:  # most often
            return StartRequest()
        options = check_options(options)
        if options.get("scene") is not None:
            return StartRequest(scene=self._score_scene(read_scene(self.spec, options["scene"])[:, None]))
        nearest, phi = bool(options.get("nearest", False)), options.get("phi")
        return StartRequest(
            ranges=None if phi is None else read_phi(self._target, phi, points=nearest), nearest=nearest
        )

    def task(self, request: StartRequest) -> list[tuple[float, float]]:
        """The lowest and highest requested phi of each of the D labels."""
        ranges = everything(self._target) if request.scene is not None else self._ranges(request)
        return [
            (0.0 if abs(low) < SHOWN_AS_ZERO else low, 0.0 if abs(high) < SHOWN_AS_ZERO else high)
            for low, high in zip(ranges.low, ranges.high, strict=True)
        ]

    def _score_scene(self, rows: Array) -> FirstScene:
        """A scene (3N, 1) that was verified when it was read."""
        phi, slack = self._score(rows), np.zeros(1)
        if self._score.requires:
            phi, slack = phi[:-1], np.minimum(phi[-1], 0.0)
        return FirstScene(rows[:, 0], phi[:, 0], float(slack[0]))

    def draw(self, stream: LibraryStream, request: StartRequest) -> FirstScene:
        """A scene in the requested range, of a request without a scene. Raises gymnasium.error.InvalidBound if the
        range is out of reach."""
        ranges = self._ranges(request)
        try:
            return FirstScene(*stream.take(ranges, nearest=request.nearest))
        except RequestError as problem:
            raise gym_error(problem.diagnostics[0], error.InvalidBound, self._describe_nearest(ranges)) from problem

    def _ranges(self, request: StartRequest) -> PhiRanges:
        if request.ranges is not None:
            return request.ranges
        if self._default is not None:
            return self._default
        if self.library.hard >= 0.0:
            raise gym_error(NO_UNMET_GOAL())
        return self.library.unsatisfied_ranges

    def _describe_nearest(self, ranges: PhiRanges) -> str:
        """The reachable phi nearest to a range that is out of reach."""
        phi, names = self.library.nearest_phi(ranges), self._target.names
        parts = [f"phi of `{names[k]}` {phi[k]:.4g}" for k in ranges.dims]
        return f"the nearest scene that was met has {' and '.join(parts)}"


class Episodes:
    """Episodes on B tables side by side, which end when the goal is satisfied, or an object leaves its table. `names`
    are the D labels whose phi is recorded; `labels`, the first of these, are those of a curriculum's range."""

    def __init__(self, rules: Rules, starts: SceneStarts, tables: int = 1) -> None:
        self.rules, self.starts, self.tables = rules, starts, tables
        self.names, self.labels = rules.target.names, rules.target.names[: rules.target.labels]
        self.tasks = np.zeros((len(self.names), tables, 2))
        self.no_flags: Mapping[str, Mask] = {
            flag: np.zeros(tables, dtype=np.bool_) for flag in ("off_table", "blocked")
        }
        self._streams: list[LibraryStream | None] = [None] * tables
        shape = row_count(len(starts.spec.require_scenes().core.objects)), len(self.names)
        self._now = Tables(np.zeros((shape[0], tables)), np.zeros((shape[1], tables)), np.zeros(tables))

    def with_tables(self, tables: int) -> Episodes:
        """The same on another number of tables."""
        return Episodes(self.rules, self.starts, tables)

    @property
    def rows(self) -> Array:
        """The scenes as they are now, (3N, B)."""
        return self._now.rows

    def begin(self, requests: Mapping[int, StartRequest], rng: Callable[[int], np.random.Generator]) -> None:
        """Begin episodes on some tables, each with its generator. A request that fails leaves all tables unchanged."""
        scenes: dict[int, FirstScene] = {}
        tasks, starts = [], self.starts
        for table, request in requests.items():
            scene = request.scene
            if scene is None:
                stream = self._streams[table]
                if stream is None:
                    stream = self._streams[table] = starts.stream(rng(table))
                scene = starts.draw(stream, request)
            scenes[table] = scene
            tasks.append(starts.task(request))
        now = self._now
        for (table, scene), task in zip(scenes.items(), tasks, strict=True):
            for place, ends in enumerate(task):
                self.tasks[place, table] = ends
            now.rows[:, table], now.phi[:, table], now.slack[table] = scene

    def forget(self, table: int) -> None:
        """A table has got another generator of random numbers."""
        self._streams[table] = None

    def act(self, actions: npt.NDArray[Any]) -> StepOutcome:
        """Do checked actions."""
        self._now, outcome = self.rules.step(self._now, actions)
        return outcome

    def success(self) -> Mask:
        """Which scenes satisfy the goal, (B,)."""
        return self.rules.success(self._now)

    def observations(self) -> Observations:
        """(B, K)."""
        return self.rules.views(self._now.rows)

    def infos(self, success: Mask, flags: Mapping[str, Mask]) -> dict[str, npt.NDArray[Any]]:
        """What infos say of all tables: (B,), or of each label, (D, B) and (D, B, 2)."""
        return {"phi": self._now.phi, "is_success": success, **flags, "task": self.tasks}
