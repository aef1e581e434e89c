"""phi over motions in numpy, from a spec over time."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from scenegen.arrays import Array
from scenegen.errors import RequestError
from scenegen.errors.requests import NO_BOUND_ON_STEPS, NO_TIME_TO_CHECK
from scenegen.geometry import NUMPY, PRIMITIVES
from scenegen.geometry.namespace import turning
from scenegen.lang.formula.core import (
    BoundedUntil,
    Const,
    Coord,
    Core,
    Everywhere,
    Junction,
    Moment,
    Node,
    Window,
    part_of,
    restrict,
)
from scenegen.lang.formula.interpret import (
    GapMinima,
    NearestPairs,
    Numbers,
    PrunedNumbers,
    bare_rows,
    find_groups,
    fold,
    minimum,
)
from scenegen.lang.formula.interpret import phi as evaluate
from scenegen.lang.formula.timed import Numpy, Signal, Timed, TimeNode, over_time
from scenegen.lang.spec import CheckedSpec
from scenegen.pose import PLACE, THETA, row_of, rows_along, rows_of
from scenegen.sampling.motions.bounds import phi_bounds, step_bounds, without_step_bounds
from scenegen.sampling.motions.problem import MAX_STATES_AT_ONCE, MotionProblem, cost, within_a_turn
from scenegen.sampling.prior import pull_back
from scenegen.sampling.problem import doubts_of_fixed, hold_fixed, refuse_turned_priors
from scenegen.sampling.request import SampleRequest, within_reach
from scenegen.search.effort import NEVER, Stop, StoppedError, effort_until_stopped

MAX_NUMBERS_ALIVE = 1 << 25  # numbers alive meanwhile; large formulas get fewer states


@dataclass(frozen=True, slots=True)
class TraceScores:
    """Poses (N, 3, T + 1, B) -> (L + 1, B): phi of every label at moment 0, then the least margin of the requirement
    over time, infinity where nothing is required."""

    timed: Timed

    def __call__(self, poses: Array) -> Array:
        count = poses.shape[-1]
        nodes = len(self.timed.state.nodes) + 2 * len(self.timed.nodes)
        some = max(1, min(MAX_STATES_AT_ONCE, MAX_NUMBERS_ALIVE // nodes) // poses.shape[2])
        if count <= some:
            return self._score_batch(poses)
        parts = [poses[..., start : start + some] for start in range(0, count, some)]
        return np.concatenate([self._score_batch(part) for part in parts], axis=1)

    def signals(self, poses: Array) -> Array:
        """phi of every label at every moment: (N, 3, T + 1, B) -> (L, T + 1, B)."""
        return np.array([value.T for value in self._values(poses, list(self.timed.labels.values()))])

    def _score_batch(self, poses: Array) -> Array:
        timed, count = self.timed, poses.shape[-1]
        required = [] if timed.requirement is None else [timed.requirement]
        labels = self._values(poses, [*timed.labels.values(), *required])
        out = np.empty((len(timed.labels) + 1, count))
        for row, value in zip(out, labels, strict=False):
            row[:] = value[:, 0]
        out[-1] = labels[-1].min(axis=1) if required else np.inf
        return out

    def _values(self, poses: Array, nodes: list[int]) -> list[Array]:
        """The values of nodes at every moment, (B, T + 1) each."""
        timed, (things, axes, moments, count) = self.timed, poses.shape
        if bare_rows(timed.state):
            poses = within_a_turn(poses.copy())
        rows = list(poses.reshape(things * axes, moments * count))
        if timed.steps:
            before = np.concatenate([poses[:, :, :1], poses[:, :, :-1]], axis=2)
            rows += list(before.reshape(things * axes, moments * count))
        signals = evaluate(timed.state, rows, NUMPY).values()

        def everywhere(value: float) -> Array:
            return np.full((moments, count), value).T  # time is the last axis of formulas, and the first in memory

        shape = (moments, count)
        arrays = [np.broadcast_to(one, moments * count).reshape(shape).T for one in signals]
        values = over_time(Numpy(), timed, arrays, everywhere)
        return [values[node] for node in nodes]


Mask = npt.NDArray[np.bool_]


def moments_needed(timed: Timed, *, labels: bool, requirement: bool) -> list[Mask]:
    """Of every signal, the moments (T + 1,) at which its value can matter to the labels' phi at moment 0, or to the
    requirement at any moment."""
    moments, nodes = timed.horizon.moments, timed.nodes
    needed = [np.zeros(moments, dtype=bool) for _ in nodes]
    for root in timed.labels.values() if labels else ():
        needed[root][0] = True
    if requirement and timed.requirement is not None:
        needed[timed.requirement][:] = True
    signals = [np.zeros(moments, dtype=bool) for _ in timed.state.labels]
    for index in range(len(nodes) - 1, -1, -1):  # parents before children
        node, mask = nodes[index], needed[index]
        if not mask.any():
            continue
        match node:
            case Signal(place):
                signals[place] |= mask
            case Junction(_, args):
                for arg in args:
                    needed[arg] |= mask
            case Window(_, arg, lowest, highest):
                needed[arg] |= _later_moments(mask, lowest, highest)
            case BoundedUntil(_, left, right, lowest, highest, _):
                needed[left] |= _later_moments(mask, 0, highest)
                needed[right] |= _later_moments(mask, lowest, highest)
            case Moment("first", arg):
                needed[arg][0] = True
            case Moment("last", arg):
                needed[arg][-1] = True
            case Moment(_, arg):
                needed[arg][1:] |= mask[1:]
            case Everywhere():
                pass
    return signals


def _later_moments(mask: Mask, lowest: int, highest: int) -> Mask:
    """The moments from `lowest` to `highest` after any that is marked."""
    count = len(mask)
    starts = np.concatenate([[0], np.cumsum(mask)])
    moment = np.arange(count)
    first, last = np.clip(moment - highest, 0, count), np.clip(moment - lowest + 1, 0, count)
    return np.asarray(starts[np.maximum(first, last)] > starts[first])


Moments = npt.NDArray[np.intp]

SIGN_GAPS, SIGN_GAPS_EACH = 2, 1  # gaps of a minimum, and for each pair of shapes: few can be negative


class _Signs(PrunedNumbers):
    """Minima of gaps have their values where they are negative; else they are merely not."""

    def least(self, pairs: NearestPairs) -> Any:
        least = minimum(pairs, self.values.__getitem__, partial(PRIMITIVES["gap"].evaluate, NUMPY), below=0.0)
        assert least is not None
        return least


@dataclass(frozen=True, slots=True)
class _StateFormulas:
    """Some formulas of a state, `signals`, that are needed at the same `moments`. `steps`: they look at the moments
    before, too. `groups` are minima of gaps whose values are asked for, `signs` those of which only signs are."""

    core: Core
    signals: tuple[int, ...]
    moments: Moments
    steps: bool
    groups: GapMinima
    signs: GapMinima

    def values(self, poses: Array, signs: bool) -> list[Array]:
        """The values of the signals, (moments, B) each, of poses (N, 3, T + 1, B)."""
        moments, count = poses.shape[2:]
        some = poses if len(self.moments) == moments else poses[:, :, self.moments]
        if self.steps:
            before = poses[:, :, np.maximum(self.moments - 1, 0)]
            some = np.concatenate([some, before])
        table = some.reshape(-1, len(self.moments) * count)
        rows, values = list(table), list[Any]()
        namespace = turning(NUMPY, rows[rows_along(THETA)])
        groups = self.signs if signs else self.groups
        algebra: Numbers = Numbers(namespace, rows)
        if signs:
            algebra = _Signs(namespace, rows, groups, values)
        elif groups.skipped:
            algebra = PrunedNumbers(namespace, rows, groups, values)
        fold(self.core.nodes, algebra, values=values)
        found = [values[self.core.labels[str(signal)]] for signal in self.signals]
        return [np.broadcast_to(one, table.shape[1]).reshape(-1, count) for one in found]


@dataclass(frozen=True, slots=True)
class _TimedFormulas:
    """Formulas over time of which some `nodes` are asked for, and the formulas of a state that these need."""

    timed: Timed
    nodes: tuple[int, ...]
    parts: tuple[_StateFormulas, ...]

    def values(self, poses: Array, signs: bool = False) -> list[Array]:
        """The values of the nodes at every moment, (B, T + 1) each; right where they are needed."""
        moments, count = poses.shape[2:]

        def everywhere(value: float) -> Array:
            return np.full((moments, count), value).T  # time is the last axis of formulas, and the first in memory

        signals = [everywhere(0.0)] * len(self.timed.state.labels)
        for part_ in self.parts:
            for signal, value in zip(part_.signals, part_.values(poses, signs), strict=True):
                if len(part_.moments) < moments:
                    whole = np.zeros((moments, count))
                    whole[part_.moments] = value
                    value = whole
                signals[signal] = value.T
        found = over_time(Numpy(), self.timed, signals, everywhere)
        return [found[node] for node in self.nodes]


@dataclass(frozen=True, slots=True)
class StagedScores:
    """Scores of a spec over time for chains, which ask whether a motion stays in a region, and its phi if it does.

    Chains are cheaper to score than motions that are returned:

    * bounds of steps hold by construction, so the requirement is scored without them;
    * formulas of a state are computed at the moments that phi looks at: `finally f` needs f at one;
    * what leaves the region by its limits or labels needs no requirement, and of a requirement that holds already,
      only gaps that can be negative are computed.

    Labels have the values of `TraceScores`, to the bit, where a motion stays in the region. The requirement has at
    least the sign. Motions are scored in full before they are returned.
    """

    labels: _TimedFormulas
    requirement: _TimedFormulas | None
    bare: bool  # whether a formula takes headings as numbers

    def of_labels(self, poses: Array) -> Array:
        """phi of every label, (N, 3, T + 1, B) -> (L, B)."""
        values = self.labels.values(self._ready(poses))
        return np.array([value[:, 0] for value in values]).reshape(len(values), poses.shape[-1])

    def of_requirement(self, poses: Array, signs: bool) -> Array:
        """The least margin of what is required, (N, 3, T + 1, B) -> (B,): where it is positive, some positive number;
        where only `signs` are asked for, where it is negative, some negative one."""
        if self.requirement is None:
            return np.full(poses.shape[-1], np.inf)
        least: Array = self.requirement.values(self._ready(poses), signs)[0].min(axis=1)
        return least

    def _ready(self, poses: Array) -> Array:
        return within_a_turn(poses.copy()) if self.bare else poses


def make_lean_scores(timed: Timed) -> StagedScores:
    """The lean scores of a spec over time."""
    roots = tuple(timed.labels.values())
    labels = _stage(timed, roots, moments_needed(timed, labels=True, requirement=False))
    required: _TimedFormulas | None = None
    if timed.requirement is not None:
        less = without_step_bounds(timed)
        assert less.requirement is not None
        needed = moments_needed(less, labels=False, requirement=True)
        stage = _stage(less, (less.requirement,), needed)
        if any(one.core.nodes != (Const(math.inf),) for one in stage.parts):
            required = stage
    return StagedScores(labels, required, bool(bare_rows(timed.state)))


def _stage(timed: Timed, nodes: tuple[int, ...], needed: Sequence[Mask]) -> _TimedFormulas:
    by_moments: dict[bytes, list[int]] = {}
    for signal, mask in enumerate(needed):
        if mask.any():
            by_moments.setdefault(mask.tobytes(), []).append(signal)
    parts, count = [], len(timed.objects)
    for signals in by_moments.values():
        core = part_of(timed.state, tuple(map(str, signals)))
        roots = tuple(core.labels.values())
        steps = any(isinstance(node, Coord) and node.object >= count for node in core.nodes)
        usual, signs = find_groups(core, roots), find_groups(core, roots, SIGN_GAPS, SIGN_GAPS_EACH)
        parts.append(_StateFormulas(core, tuple(signals), np.flatnonzero(needed[signals[0]]), steps, usual, signs))
    kept, place = restrict(cast("Sequence[Node]", timed.nodes), nodes)  # a signal is a leaf, like a coordinate
    bare = replace(timed, nodes=cast("tuple[TimeNode, ...]", kept), labels={}, requirement=None)
    return _TimedFormulas(bare, tuple(place[node] for node in nodes), tuple(parts))


def make_motion_problem(spec: CheckedSpec, request: SampleRequest, stop: Stop = NEVER) -> MotionProblem:
    """Raises RequestError for a request that is wrong or out of the bounds of phi, for an object of which nothing says
    how far it moves in a step, and where time is up."""
    timed = spec.timed
    assert timed is not None
    effort = effort_until_stopped(stop)
    lowest, highest, fixed = hold_fixed(spec, request.fix)
    refuse_turned_priors(spec, lowest == highest)
    try:
        bounds = phi_bounds(timed, lowest, highest, effort)
    except StoppedError:
        raise RequestError(NO_TIME_TO_CHECK()) from None
    checked, warnings = within_reach(dataclasses.replace(request, fix=fixed), bounds)
    warnings = (*warnings, *doubts_of_fixed(spec, request.fix))
    radius, turn = _steps(timed, lowest, highest)
    for name in unbounded_objects(timed, lowest, highest):
        raise RequestError(NO_BOUND_ON_STEPS(name=name))
    turn[np.isinf(turn)] = 0.0  # without a bound a heading is kept
    shape = (len(timed.objects), len(rows_of(0)))
    _, base = pull_back(replace(spec, core=Core((), {}, timed.objects)), lowest, highest)
    return MotionProblem(
        names=timed.objects, labels=tuple(timed.labels), steps=timed.horizon.steps, lowest=lowest.reshape(shape),
        highest=highest.reshape(shape), radius=radius, turn=turn, score=TraceScores(timed), request=checked,
        moves=timed.moves, dt=timed.horizon.dt, cost=cost(spec),
        lean=make_lean_scores(timed), log_excess=spec.log_excess(lowest, highest),
        spec=spec, base=base, warnings=warnings,
    )  # fmt: skip


def unbounded_objects(timed: Timed, lowest: Array, highest: Array) -> list[str]:
    """The objects of which nothing says how far they move in a step, in the box (3N,) of their poses."""
    radius, _ = _steps(timed, lowest, highest)
    return [name for name, far in zip(timed.objects, radius, strict=True) if np.isinf(far)]


def _steps(timed: Timed, lowest: Array, highest: Array) -> tuple[Array, Array]:
    """The largest displacement and turn of each object in a step, (N,) each: none of one that is held in place."""
    radius, turn = step_bounds(timed)
    for thing in range(len(timed.objects)):
        place = [row_of(thing, axis) for axis in PLACE]
        if (lowest[place] == highest[place]).all():
            radius[thing] = 0.0
            if lowest[row_of(thing, THETA)] == highest[row_of(thing, THETA)]:
                turn[thing] = 0.0
    return radius, turn
