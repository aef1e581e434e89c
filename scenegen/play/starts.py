"""Where episodes of other environments start: verified scenes, drawn ahead, at a range of phi or at the next task of a
strategy."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias, runtime_checkable

import numpy as np

from scenegen.api.request import Phi, read_phi
from scenegen.api.sample import draw_scenes
from scenegen.api.scene_arrays import make_header, poses7, stored_rows
from scenegen.api.scenes import SceneSet
from scenegen.api.spec import Spec
from scenegen.arrays import Array
from scenegen.errors import RequestError
from scenegen.errors.files import HELD_ELSEWHERE
from scenegen.errors.learning import NO_EPISODE, NOT_A_TASK
from scenegen.geometry import NUMPY
from scenegen.geometry.workspace import wrap_headings
from scenegen.lang.formula.interpret import phi as score
from scenegen.needs import need
from scenegen.play.recent import Recent
from scenegen.play.tasks import Outcome, PhiBox, Strategy, is_strategy
from scenegen.pose import as_poses, as_rows, row_count
from scenegen.sampling.request import Range, SampleRequest, Spread
from scenegen.sampling.streams import STARTS_STREAM
from scenegen.scenes.arrange import fixed_pose_facts, held_elsewhere, with_switches
from scenegen.scenes.data import RequestData

if TYPE_CHECKING:
    from scenegen.play.environments.library import Library
    from scenegen.play.environments.stream import LibraryStream


Wanted: TypeAlias = "Phi | PhiBox | Strategy | StartSource | Callable[[], Phi | PhiBox | None] | None"
"""A range of phi (see `scenegen.sample`), a strategy, a source of starts, or a function that gives a range for each."""

FIRST_STARTS, MAX_STARTS = 1024, 16_384  # scenes of the first draw at a range, and of later ones at most
STARTS_AHEAD = 4096  # scenes of a range that a generator chooses among
MAX_RANGES = 64  # whose scenes are kept
START_TOLERANCES = 1e-3, 0.01  # metres and radians by which a held object may be off in a simulation


SortedRanges: TypeAlias = tuple[tuple[str, Range], ...]


@dataclass(frozen=True, slots=True, eq=False)
class Start:
    """A verified scene: `poses` (N, 7), see `SceneSet.poses7`, `phi` by label, `on` (M,) of objects on one of several
    surfaces, and the strategy's task."""

    poses: Array
    phi: Mapping[str, float]
    on: Array | None
    task: PhiBox | None = None


@runtime_checkable
class StartSource(Protocol):
    def take(self) -> Start:
        """The next scene. Raises RequestError."""
        ...


def draw_shuffled(
    spec: Spec,
    ranges: Mapping[str, Range],
    count: int,
    source: np.random.SeedSequence,
    *,
    timeout: float,
    keep_partial: bool,
    method: str = "auto",
    workers: int | None = 1,
    spread: Spread = "flat",
) -> SceneSet:
    """Scenes with phi in the ranges in an order of `source`: samplers give them sorted by cells of phi. With one worker
    they are drawn in this process: simulators do not like to be forked. Raises RequestError."""
    seed = int(source.generate_state(1)[0])
    request = SampleRequest(
        ranges,
        count,
        seed=seed,
        method=method,
        spread=spread,
        timeout=timeout,
        workers=workers,
        keep_partial=keep_partial,
        strict=True,
    )
    scenes = draw_scenes(spec, request)
    return scenes[np.random.default_rng(source).permutation(len(scenes))]


class RangeStarts:
    """Scenes with phi in a range that `wanted` gives for each. Draws grow from `first` to MAX_STARTS scenes; a range
    that is asked for again goes on with its own scenes. `spread` is that of `scenegen.sample`."""

    def __init__(
        self,
        spec: Spec,
        wanted: Callable[[], Phi | PhiBox | None],
        seed: int,
        timeout: float,
        ahead: int = STARTS_AHEAD,
        first: int = FIRST_STARTS,
        spread: Spread = "flat",
    ) -> None:
        self._spec, self._wanted, self._seed, self._timeout, self._ahead = spec, wanted, seed, timeout, ahead
        self._first, self._spread = first, spread
        self._draws = 0
        self._streams: Recent[SortedRanges, Iterator[Start]] = Recent(MAX_RANGES)
        self._pools: Recent[SortedRanges, list[Start]] = Recent(MAX_RANGES)

    def take(self) -> Start:
        ranges = self._ranges()
        stream = self._streams.get_or_make(ranges, lambda: self._stream(dict(ranges)))
        try:
            return next(stream)
        except RequestError:
            self._streams.drop(ranges)  # a generator that raised has ended
            raise

    def choose(self, generator: np.random.Generator) -> Start:
        """One of `ahead` scenes of the range, which are the same whatever was taken before. Raises RequestError, also
        where there is no time to draw them all."""
        ranges, source = self._ranges(), np.random.SeedSequence([self._seed, STARTS_STREAM])
        pool = self._pools.get_or_make(
            ranges, lambda: list(self._draw(dict(ranges), self._ahead, source, keep_partial=False))
        )
        return pool[int(generator.integers(len(pool)))]

    def _ranges(self) -> SortedRanges:
        wanted = self._wanted()
        if isinstance(wanted, PhiBox):
            if not len(wanted.low) == len(wanted.high) == len(self._spec.labels):
                raise RequestError(NOT_A_TASK(count=len(wanted.low), labels=self._spec.labels))
            ends = zip(self._spec.labels, wanted.low, wanted.high, strict=True)
            wanted = {label: (low, high) for label, low, high in ends}
        return tuple(sorted(read_phi(self._spec, wanted).items(), key=lambda item: item[0]))

    def _stream(self, ranges: Mapping[str, Range]) -> Iterator[Start]:
        count = self._first
        while True:
            source = np.random.SeedSequence([self._seed, STARTS_STREAM, self._draws])
            self._draws += 1
            yield from self._draw(ranges, count, source, keep_partial=True)
            count = min(4 * count, MAX_STARTS)

    def _draw(
        self, ranges: Mapping[str, Range], count: int, source: np.random.SeedSequence, keep_partial: bool
    ) -> Iterator[Start]:
        scenes = draw_shuffled(
            self._spec,
            ranges,
            count,
            source,
            timeout=self._timeout,
            keep_partial=keep_partial,
            spread=self._spread,
        )
        poses, on = scenes.poses7(), scenes.on
        phi = {label: values.tolist() for label, values in scenes.phi.items()}
        for index in range(len(scenes)):
            phi_here = {label: values[index] for label, values in phi.items()}
            yield Start(poses[index], phi_here, None if on is None else on[index])


class StrategyStarts:
    """Scenes at the next task of a strategy, or at the nearest phi there is."""

    def __init__(self, spec: Spec, goal: str | None, strategy: Strategy, seed: int) -> None:
        self._spec, self._goal, self._strategy, self._seed = spec, goal, strategy, seed
        self._header = make_header(spec.checked, {}, RequestData(phi={}, n=1, spread="flat"))
        self._stream: LibraryStream | None = None  # made at the first start: it draws thousands of scenes

    def take(self) -> Start:
        with as_request_errors():
            if self._stream is None:
                self._stream = self._begin(self._seed)
            return self._next(self._stream)

    def choose(self, generator: np.random.Generator) -> Start:
        """A scene at the next task, which task and generator choose: what was taken before has no part in it."""
        with as_request_errors():
            return self._next(self._begin(int(generator.integers(2**63))))

    def _begin(self, seed: int) -> LibraryStream:
        from scenegen.play.environments.stream import LibraryStream

        return LibraryStream(_library(self._spec, self._goal), seed)

    def _next(self, stream: LibraryStream) -> Start:
        from scenegen.play.environments.request import read_phi as read_task

        task = self._strategy.next_task()
        if not isinstance(task, PhiBox):
            raise RequestError(NOT_A_TASK(value=repr(task)))
        target = stream.library.target
        row, phi = stream.take(read_task(target, task, points=True), nearest=True)
        rows = np.asarray(row)[:, None]
        count = row_count(len(self._spec.objects))
        on = stored_rows(self._spec.checked, rows)[count:].T if self._spec.checked.choices else None
        poses = poses7(self._header, as_poses(rows[:count]), on, tensor=False, dtype="float64")
        by_label = dict(zip(self._spec.labels, map(float, phi), strict=False))
        return Start(poses[0], by_label, None if on is None else on[0], task)


def make_starts(
    spec: Spec, wanted: Wanted, goal: str | None, seed: int, timeout: float, ahead: int = STARTS_AHEAD
) -> StartSource:
    """Raises RequestError for an invalid range."""
    if isinstance(wanted, StartSource) and not hasattr(wanted, "shape"):  # arrays have a `take` of their own
        return wanted
    if is_strategy(wanted):
        need("gymnasium", "for starts chosen by a strategy")
        return StrategyStarts(spec, goal, wanted, seed)
    if callable(wanted):
        return RangeStarts(spec, wanted, seed, timeout, ahead)
    fixed: Any = wanted
    if not isinstance(fixed, PhiBox):
        read_phi(spec, fixed)
    return RangeStarts(spec, lambda: fixed, seed, timeout, ahead)


def require_start(start: Start | None) -> Start:
    """Raises RequestError before the first start."""
    if start is None:
        raise RequestError(NO_EPISODE(state="no scene was placed yet", remedy="reset the environment first"))
    return start


def report_outcome(strategy: Strategy | None, start: Start, success: bool, total: float, steps: int) -> Outcome | None:
    """Tell a strategy how the episode ended that began with a start; nothing where the start was not its own."""
    if strategy is None or start.task is None:
        return None
    outcome = Outcome(start.task, tuple(start.phi.values()), success, total, steps)
    strategy.report(outcome)
    return outcome


def phi_space(spec: Spec, goal: str | None = None) -> PhiBox:
    """The range of phi to train on, for a strategy: from the hardest thousandth of scenes to satisfied. `goal` is the
    label to satisfy, by default all. Raises RequestError where there is nothing to learn."""
    need("gymnasium", "for starts chosen by a strategy")
    with as_request_errors():
        return _library(spec, goal).space


def _library(spec: Spec, goal: str | None) -> Library:
    from scenegen.play.environments.goal import make_goal
    from scenegen.play.environments.library import open_library

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


def phi_at(spec: Spec, start: Start, poses: Array) -> dict[str, float]:
    """phi of each label with the objects at `poses` (N, 3), in the spec's frame, on the surfaces of the start. Raises
    RequestError where an object that the spec holds is elsewhere."""
    checked = spec.checked
    rows = wrap_headings(as_rows(poses[None]))
    moved = held_elsewhere(checked, rows, *START_TOLERANCES)
    if moved is not None:
        raise RequestError(HELD_ELSEWHERE(**fixed_pose_facts(checked, moved[0]), place="in the simulation"))
    if checked.choices:
        header = make_header(checked, {}, RequestData(phi={}, n=1, spread="flat"))
        rows = with_switches(checked, header, rows, None if start.on is None else start.on[None])
    return {label: float(value[0]) for label, value in score(checked.core, list(rows), NUMPY).items()}
