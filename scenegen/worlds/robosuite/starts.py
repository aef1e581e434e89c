"""Scenes to start from, one at a time, drawn ahead: at a range of phi, or at the next task of a strategy."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias, TypeGuard

import numpy as np
import numpy.typing as npt

from scenegen.api.request import Phi, read_phi
from scenegen.api.sample import draw_scenes
from scenegen.api.scene_arrays import make_header, poses7, stored_rows
from scenegen.api.spec import Spec
from scenegen.errors import RequestError
from scenegen.errors.learning import NOT_A_TASK
from scenegen.learn.curriculum.tasks import PhiBox, Strategy
from scenegen.needs import need
from scenegen.pose import as_poses, row_count
from scenegen.sampling.request import Range, SampleRequest
from scenegen.scenes.data import RequestData

if TYPE_CHECKING:
    from scenegen.learn.curriculum.library import Library, LibraryStream

Array = npt.NDArray[np.float64]
Wanted: TypeAlias = Phi | PhiBox | Strategy | Callable[[], Phi | PhiBox | None] | None
"""A range of phi (see `scenegen.sample`), a strategy, or a function that gives a range for each start."""

FIRST, MOST = 1024, 16_384  # scenes of the first draw at a range, and of later ones at most
RANGES = 64  # ranges whose scenes are kept, the most recent ones
STREAM = 12  # the stream of random numbers of starts; api/batches.py and others have streams of their own


@dataclass(frozen=True, slots=True, eq=False)
class Start:
    """A verified scene: `poses` (N, 7), see `SceneSet.poses7`, `phi` by label, `on` (M,) of objects on one of several
    surfaces, and the strategy's task."""

    poses: Array
    phi: Mapping[str, float]
    on: Array | None
    task: PhiBox | None = None


class StartSource(Protocol):
    def take(self) -> Start:
        """The next scene. Raises RequestError."""
        ...


class RangeStarts:
    """Scenes with phi in a range that `wanted` gives for each. Draws grow from FIRST to MOST scenes; a range that is
    asked for again goes on with its own scenes."""

    def __init__(self, spec: Spec, wanted: Callable[[], Phi | PhiBox | None], seed: int, timeout: float) -> None:
        self._spec, self._wanted, self._seed, self._timeout = spec, wanted, seed, timeout
        self._draws = 0
        self._streams: OrderedDict[tuple[tuple[str, Range], ...], Iterator[Start]] = OrderedDict()

    def take(self) -> Start:
        wanted = self._wanted()
        if isinstance(wanted, PhiBox):
            if not len(wanted.low) == len(wanted.high) == len(self._spec.labels):
                raise RequestError(NOT_A_TASK(count=len(wanted.low), labels=self._spec.labels))
            ends = zip(self._spec.labels, wanted.low, wanted.high, strict=True)
            wanted = {label: (low, high) for label, low, high in ends}
        ranges = read_phi(self._spec, wanted)
        key = tuple(sorted(ranges.items(), key=lambda item: item[0]))
        if key not in self._streams:
            self._streams[key] = self._stream(ranges)
            if len(self._streams) > RANGES:
                self._streams.popitem(last=False)
        self._streams.move_to_end(key)
        try:
            return next(self._streams[key])
        except RequestError:
            del self._streams[key]  # a generator that raised has ended
            raise

    def _stream(self, ranges: Mapping[str, Range]) -> Iterator[Start]:
        count = FIRST
        while True:
            source = np.random.SeedSequence([self._seed, STREAM, self._draws])
            self._draws += 1
            seed = int(source.generate_state(1)[0])
            request = SampleRequest(
                ranges, count, seed=seed, timeout=self._timeout, keep_partial=True, workers=1, strict=True
            )  # in this process: simulators do not like to be forked
            scenes = draw_scenes(self._spec, request)
            places = scenes.poses7()
            for index in np.random.default_rng(source).permutation(len(scenes)).tolist():
                phi = {label: float(values[index]) for label, values in scenes.phi.items()}
                yield Start(places[index], phi, None if scenes.on is None else scenes.on[index])
            count = min(4 * count, MOST)


class StrategyStarts:
    """Scenes at the next task of a strategy, or at the nearest phi there is."""

    def __init__(self, spec: Spec, goal: str | None, strategy: Strategy, seed: int) -> None:
        self._spec, self._goal, self._strategy, self._seed = spec, goal, strategy, seed
        self._header = make_header(spec.checked, {}, RequestData(phi={}, n=1, spread="flat"))
        self._stream: LibraryStream | None = None  # made at the first start: it draws thousands of scenes

    def take(self) -> Start:
        with as_request_errors():
            return self._take()

    def _take(self) -> Start:
        from scenegen.learn.curriculum.library import LibraryStream
        from scenegen.learn.curriculum.request import read_phi as read_task

        if self._stream is None:
            self._stream = LibraryStream(_library(self._spec, self._goal), self._seed)
        task = self._strategy.next_task()
        if not isinstance(task, PhiBox):
            raise RequestError(NOT_A_TASK(value=repr(task)))
        target = self._stream.library.target
        row, phi = self._stream.take(read_task(target, task, points=True), nearest=True)
        rows = np.asarray(row)[:, None]
        count = row_count(len(self._spec.objects))
        on = stored_rows(self._spec.checked, rows)[count:].T if self._spec.checked.choices else None
        places = poses7(self._header, as_poses(rows[:count]), on, tensor=False, dtype="float64")
        found = dict(zip(self._spec.labels, map(float, phi), strict=False))
        return Start(places[0], found, None if on is None else on[0], task)


def make_starts(spec: Spec, wanted: Wanted, goal: str | None, seed: int, timeout: float) -> StartSource:
    """Raises RequestError for an invalid range."""
    if is_strategy(wanted):
        need("gymnasium", "for starts chosen by a strategy")
        return StrategyStarts(spec, goal, wanted, seed)
    if callable(wanted):
        return RangeStarts(spec, wanted, seed, timeout)
    fixed: Any = wanted
    if not isinstance(fixed, PhiBox):
        read_phi(spec, fixed)
    return RangeStarts(spec, lambda: fixed, seed, timeout)


def is_strategy(wanted: object) -> TypeGuard[Strategy]:
    return all(callable(getattr(wanted, call, None)) for call in ("next_task", "report"))


def phi_space(spec: Spec, goal: str | None = None) -> PhiBox:
    """The range of phi to train on, for a strategy: from the hardest thousandth of scenes to satisfied. `goal` is the
    label to satisfy, by default all. Raises RequestError where there is nothing to learn."""
    need("gymnasium", "for starts chosen by a strategy")
    with as_request_errors():
        return _library(spec, goal).space


def _library(spec: Spec, goal: str | None) -> Library:
    from scenegen.learn.curriculum.goal import make_goal
    from scenegen.learn.curriculum.library import open_library

    return open_library(make_goal(spec, goal), spec, None)


@contextmanager
def as_request_errors() -> Iterator[None]:
    """Turns the errors of environments, which are gymnasium's, into RequestError."""
    from gymnasium import error

    try:
        yield
    except error.Error as problem:
        diagnostic = getattr(problem, "diagnostic", None)
        if diagnostic is None:
            raise
        raise RequestError(diagnostic) from problem
