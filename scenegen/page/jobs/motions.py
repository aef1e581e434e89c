"""Motions for the page: what they are worth at every moment, and why; their formulas as trees."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from scenegen.api.monitor import score_trajectory
from scenegen.api.motions import MotionSet
from scenegen.api.outline import FormulaTree, Outline, OutlinePart
from scenegen.api.scene_arrays import motion_header
from scenegen.api.spec import Spec
from scenegen.arrays import Array
from scenegen.errors import DataError, Diagnostic, RequestError
from scenegen.errors.program import NO_MESSAGE, PAGE_LIMIT
from scenegen.lang.formula.core import REQUIRE, BoundedUntil, Everywhere, Junction, Moment, Window
from scenegen.lang.formula.timed import Numpy, Signal, Timed, TimedValues, over_time
from scenegen.page.jobs.source import MAX_LINE_NODES, Json, decider_json, line_of, numbers_of, stage_of_spec, tree_of
from scenegen.page.limits import MAX_MOMENTS, MAX_MOTION, MAX_PAGE_SCENES
from scenegen.sampling.motions.scores import TraceScores
from scenegen.sampling.request import SampleRequest
from scenegen.scenes.formats.motions import facts_of
from scenegen.scenes.motions import MotionRequestData, TimeData
from scenegen.search import node_bounds
from scenegen.things.surfaces import base_heights, overlapping

MAX_TREE_VALUES = 40_000  # lines times moments whose values are all sent; of longer motions those that count


def motions_of(spec: Spec, poses: object) -> Array:
    """Motions as they come from a page, (n, T + 1, N, 3). Raises DataError for what are no motions of the spec's
    objects and moments, RequestError for too many."""
    shape = timed_of(spec).horizon.moments, len(spec.objects), 3
    array = numbers_of(poses)
    if array.ndim != 4 or array.shape[1:] != shape or not np.isfinite(array).all():
        raise DataError(NO_MESSAGE(reason=f"no motions of {shape[1]} objects at {shape[0]} moments"))
    check_size(spec, len(array))
    return array


def phi_json(spec: Spec, motions: Array) -> dict[str, Any]:
    """What the page shows of motions (n, T + 1, N, 3): phi of each label and the margin of what is required, (n,) each,
    and how high above the table each object stands at every moment, in metres; None where all stand on it."""
    scores = TraceScores(timed_of(spec))(np.ascontiguousarray(motions.transpose(2, 3, 1, 0)))
    required = None if timed_of(spec).requirement is None else scores[-1].tolist()
    heights = bases_of(spec, motions)
    return {
        "phi": {name: row.tolist() for name, row in zip(spec.labels, scores[:-1], strict=True)},
        "require": required,
        "bases": heights.tolist() if heights.any() else None,
        "on": None,
    }


def motions_json(spec: Spec, motions: Array, sampler: Mapping[str, Any], *notes: str) -> dict[str, Any]:
    """Motions that are there already, as the job `sample` sends those that it draws."""
    made = {"motions": motions.tolist(), "sampler": sampler}
    return {**phi_json(spec, motions), **made, "warnings": [], "notes": list(notes), "took": 0.0}


def bases_of(spec: Spec, motions: Array) -> Array:
    """How high above the table each object stands, in metres: (n, T + 1, N)."""
    stage = stage_of_spec(spec)
    flat = motions.reshape(-1, *motions.shape[2:])
    heights = base_heights([thing.shape for thing in stage.things], flat, declared=stage.declared)
    return np.broadcast_to(heights, flat.shape[:2]).reshape(motions.shape[:3])


def reasons(spec: Spec, motion: Array, *, everything: bool = True) -> dict[str, Any]:
    """Of one motion (T + 1, N, 3): phi from every moment on, the value of every line of the trees where it counts and
    (`everything`, unless there are too many) at every moment, what decides each label, and what overlaps at the last
    moment."""
    trees, scored = trees_of(spec), score_trajectory(spec, motion)
    values = trees.values(scored)
    at = trees.moments(scored, values)
    labels = [*spec.labels, *([REQUIRE] if timed_of(spec).requirement is not None else [])]
    signals = {**scored.signals, **({} if scored.requirement is None else {REQUIRE: scored.requirement})}
    shapes = [thing.shape for thing in stage_of_spec(spec).things]
    return {
        "signals": {name: row.tolist() for name, row in signals.items()},
        "values": values[np.arange(len(values)), at].tolist(),
        "at": at,
        "over": [*map(six_digits, values.tolist())] if everything and values.size <= MAX_TREE_VALUES else None,
        "decides": {label: _decides(spec, label, scored, motion, at) for label in labels},
        "overlaps": [[spec.objects[a], spec.objects[b]] for a, b in overlapping(shapes, motion[-1:], None)[0]],
    }


def six_digits(values: list[float]) -> list[float]:
    """Numbers as short as they may be where they colour a tree."""
    return [float(f"{one:.6g}") for one in values]


def _decides(spec: Spec, label: str, scored: TimedValues, motion: Array, at: list[int]) -> dict[str, Any] | None:
    timed, trees = timed_of(spec), trees_of(spec)
    try:
        atom, moment = scored.decides(None if label == REQUIRE else label)
    except (ValueError, StopIteration):  # infinite in this motion
        return None
    core = timed.state
    index = next(number for number, node in enumerate(core.nodes) if node is atom)
    now, before = motion[moment], motion[max(moment - 1, 0)]
    rows = np.concatenate([now, before]) if timed.steps else now
    values = scored.states[index]
    mine = [number for number, one in enumerate(trees.places) if index in one.states]
    lines = [number for number in mine if at[number] == moment] or mine
    found = decider_json(core, index, label, float(values[moment]), lines, rows.reshape(-1).tolist())
    return {**found, "moment": moment, "signal": values.tolist()}


def motion_set(spec: Spec, motions: Array, sampler: Mapping[str, Any], request: SampleRequest) -> MotionSet:
    """Motions from a page as a set with its header; phi is computed again."""
    horizon = timed_of(spec).horizon
    ranges = {name: (one.low, one.high) for name, one in request.phi.items()}
    asked = MotionRequestData(phi=ranges, n=request.n)
    header = motion_header(spec.definition, sampler, asked, TimeData(steps=horizon.steps, dt=horizon.dt))
    phi = {name: np.array(values) for name, values in phi_json(spec, motions)["phi"].items()}
    return MotionSet(motions, phi, facts_of(motions), header)


# The formulas of a spec over time as trees for the page: what time makes of formulas, and below that the formulas of
# a single moment, folded as those of scenes are.
#
# A line of such a tree has a value at every moment. For the whole motion it counts at one of them: below `always`
# where its formula is least, below `eventually` where it is largest, and so on down from moment 0, so that the value
# of a line comes from that of a line below it.


class _States(Outline):
    """The outline of the formulas of a single moment, over the box (3N,) of poses."""

    def __init__(self, timed: Timed, lowest: Array, highest: Array) -> None:
        if timed.steps:  # every object as it stands now, and as it stood before
            lowest, highest = np.tile(lowest, 2), np.tile(highest, 2)
        self._core = timed.state
        self._bounds = node_bounds(timed.state, lowest, highest)
        self._choices = {}  # what moves stands on one surface
        self.labels = tuple(timed.state.labels)


@dataclass(frozen=True, slots=True)
class LineNodes:
    """What a line stands for: a node over time, or nodes of the state core of which the least or the largest counts."""

    node: int | None
    states: tuple[int, ...] = ()
    least: bool = True


class TimedTrees:
    """`trees` maps each label, and `require`, to its tree; the lines are numbered through all of them."""

    def __init__(self, timed: Timed, lowest: Array, highest: Array) -> None:
        self.timed = timed
        self._states = _States(timed, lowest, highest)
        self._folded = FormulaTree(self._states)
        self._low, self._high = self._bounds()
        self.places: list[LineNodes] = []
        self.lines: list[Json] = []  # by their numbers
        self.roots: dict[str, int] = {}
        self.trees: dict[str, Json] = {}
        labels = {**timed.labels, **({} if timed.requirement is None else {REQUIRE: timed.requirement})}
        for label, node in labels.items():
            self.roots[label] = len(self.places)
            root: int | OutlinePart = node
            self.trees[label] = tree_of(root, self._line)

    def _bounds(self) -> tuple[list[Array], list[Array]]:
        """What every node over time can be at least and at most, at every moment."""
        found = self._states._bounds
        ends = [[float(getattr(found[node], end)) for node in self.timed.state.labels.values()] for end in ("lo", "hi")]

        def everywhere(value: float) -> Array:
            return np.full(self.timed.horizon.moments, value)

        low, high = (over_time(Numpy(), self.timed, [everywhere(x) for x in end], everywhere) for end in ends)
        return low, high

    def _line(self, part: int | OutlinePart, least: bool) -> tuple[Json, list[int | OutlinePart]]:
        """The line of a node over time, or of a part of a moment's formula; and what lies below it."""
        place = part
        while isinstance(part, int):
            node = self.timed.nodes[part]
            match node:
                case Moment("steps", arg):  # nothing but the moments at which there is a step
                    part = arg
                    continue
                case Signal(number):
                    part = self._folded.root(str(number))
                case Junction(kind, args):
                    return self._over_time(part, "all" if kind == "min" else "one", node.text), list(args)
                case BoundedUntil(_, left, right):
                    return self._over_time(part, "time", node.text), [left, right]
                case Window(_, arg) | Moment(_, arg):
                    return self._over_time(part, "time", node.text), [arg]
                case Everywhere(holds):
                    return self._over_time(part, "atom", "true" if holds else "false"), []
        number = self._number(LineNodes(place if isinstance(place, int) else None, part.nodes[:MAX_LINE_NODES], least))
        found = line_of(self.timed.state, part, number)
        self.lines.append(found)
        return found, list(self._folded.children(part))

    def _over_time(self, node: int, kind: str, text: str) -> Json:
        number = self._number(LineNodes(node))
        words = {"all": "all of", "one": "one of"}.get(kind, text)
        if kind in ("all", "one") and text and text != REQUIRE:
            words = f"{words}: {text}"
        ends = [float(self._low[node][0]), float(self._high[node][0])]
        line: Json = {
            "line": number, "kind": kind, "text": words, "margin": "", "unit": "", "count": "", "bounds": ends,
            "spans": [], "parts": [],
        }  # fmt: skip
        self.lines.append(line)
        return line

    def _number(self, place: LineNodes) -> int:
        self.places.append(place)
        return len(self.places) - 1

    def values(self, scored: TimedValues) -> Array:
        """The value of every line at every moment, (lines, T + 1); infinite where there is none."""
        found = np.empty((len(self.places), self.timed.horizon.moments))
        for number, place in enumerate(self.places):
            if place.node is not None:
                found[number] = scored.values[place.node]
            else:
                some = np.stack([scored.states[node] for node in place.states])
                found[number] = some.min(axis=0) if place.least else some.max(axis=0)
        return found

    def moments(self, scored: TimedValues, values: Array) -> list[int]:
        """The moment at which every line counts for the whole motion."""
        found = [0] * len(self.places)
        for label, root in self.roots.items():
            found[root] = int(np.argmin(values[root])) if label == REQUIRE else 0
            waiting = [root]
            while waiting:
                number = waiting.pop()
                below = self._below(number)
                for one, moment in zip(below, self._moments(number, found[number], scored), strict=False):
                    found[one] = moment
                waiting += below
        return found

    def _below(self, number: int) -> list[int]:
        return [line["line"] for line in self.lines[number]["parts"]]

    def _moments(self, number: int, t: int, scored: TimedValues) -> list[int]:
        """Of a line that counts at moment t: the moments at which the lines below it do."""
        place, last = self.places[number], self.timed.horizon.steps
        node = None if place.node is None or place.states else self.timed.nodes[place.node]
        match node:
            case Window(kind, arg, lowest, highest):
                some = scored.values[arg][t + lowest : t + highest + 1]
                if not some.size:
                    return [min(t + lowest, last)]
                return [t + lowest + int(some.argmin() if kind == "min" else some.argmax())]
            case Moment("first", _):
                return [0]
            case Moment("last", _):
                return [last]
            case BoundedUntil():
                return self._until(node, t, scored)
            case _:
                return [t] * len(self._below(number))

    def _until(self, node: BoundedUntil, t: int, scored: TimedValues) -> list[int]:
        sign = 1.0 if node.kind == "max" else -1.0
        left, right = (sign * scored.values[part][t : t + node.highest + 1] for part in (node.left, node.right))
        held = np.minimum.accumulate(left)
        if not node.closed:
            held = np.concatenate([[np.inf], held[:-1]])
        both = np.minimum(held, right)[node.lowest :]
        if not both.size:
            return [t, min(t + node.lowest, self.timed.horizon.steps)]
        end = node.lowest + int(both.argmax())
        before = left[: end + 1] if node.closed else left[:end]
        return [t + (int(before.argmin()) if before.size else 0), t + end]


def timed_of(spec: Spec) -> Timed:
    """What a spec over time means."""
    assert spec.over_time is not None
    return spec.over_time


def most_of(spec: Spec) -> int:
    """How many motions of a spec the page shows; 0 where a single one is too long."""
    size = timed_of(spec).horizon.moments * max(1, len(spec.objects))
    return 0 if size > MAX_MOTION else min(MAX_PAGE_SCENES, MAX_MOMENTS // size)


def too_long(spec: Spec) -> Diagnostic:
    """What is said of motions that the page does not show."""
    return PAGE_LIMIT(poses=timed_of(spec).horizon.moments * len(spec.objects), most=MAX_MOTION)


def check_size(spec: Spec, count: int) -> None:
    """Raises RequestError for more motions than the page shows."""
    most = most_of(spec)
    if most == 0:
        raise RequestError(too_long(spec))
    if not 1 <= count <= most:
        raise RequestError(PAGE_LIMIT(most=most, count=count, what="motions"))


@lru_cache(maxsize=2)
def trees_of(spec: Spec) -> TimedTrees:
    """The formulas of a spec over time."""
    return TimedTrees(timed_of(spec), *spec.definition.box())
